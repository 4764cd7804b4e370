"""Percepts as arrays, the check of frames, and `detect` from `perceive`."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.percepts import LEAST_PIXELS, MOST_PIXELS, Percepts, Sees, checked_frames
from perception.protocol import LABELS, NOTHING, REACH, FrameBackend, Frames, View
from worlds import UserError


class Brightness(Sees):
    """Calls dark frames spheres and bright ones cubes, and says how many frames came at once."""

    name = "brightness"

    def __init__(self) -> None:
        self.batches: list[int] = []

    def perceive(self, frames: Frames) -> Percepts:
        """Go by the mean."""
        checked_frames(frames)
        self.batches.append(len(frames))
        bright = frames.mean(axis=(1, 2, 3)) / 255
        chances = np.column_stack([np.zeros(len(frames)), bright, 1 - bright])
        return Percepts(chances, np.full(len(frames), 2), np.zeros(len(frames), np.bool_))


@given(st.data(), st.integers(1, 5))
def test_detections_say_what_the_arrays_say(data: st.DataObject, count: int) -> None:
    """Label, confidence, distance, probabilities and abstention of each frame come out as they went in."""
    weights = data.draw(
        st.lists(st.tuples(*[st.integers(0, 50)] * 3).filter(any), min_size=count, max_size=count)
    )
    chances = np.array([[w / sum(row) for w in row] for row in weights])
    distances = data.draw(st.lists(st.integers(1, REACH), min_size=count, max_size=count))
    abstains = data.draw(st.lists(st.booleans(), min_size=count, max_size=count))
    percepts = Percepts(chances, np.array(distances), np.array(abstains))
    assert len(percepts) == count
    for i, found in enumerate(percepts.detections()):
        assert found.chances == tuple(chances[i])
        assert found.confidence == chances[i].max() == percepts.confidence[i]
        assert LABELS.index(found.label) == percepts.labels[i]
        assert found.distance == (0 if found.label == "none" else distances[i])
        assert found.abstains == abstains[i]


@pytest.mark.parametrize(
    ("chances", "distances", "abstains", "problem"),
    [
        ([[0.5, 0.5]], [1], [False], r"need shape \(frames, 3\)"),
        ([[0.5, 0.4, 0.2]], [1], [False], "frame 0 has probabilities"),
        ([[1.0, 0.0, 0.0], [1.5, -0.5, 0.0]], [1, 1], [False, False], "frame 1 has probabilities"),
        ([[np.nan, 0.5, 0.5]], [1], [False], "must sum to 1"),
        ([[1.0, 0.0, 0.0]], [0], [False], "distances are 1 to 2 cells, not 0 to 0"),
        ([[1.0, 0.0, 0.0]], [3], [False], "not 3 to 3"),
        ([[1.0, 0.0, 0.0]], [1, 1], [False], "as many distances"),
        ([[1.0, 0.0, 0.0]], [1], [], "as many distances"),
    ],
)
def test_percepts_that_contradict_themselves_are_refused(
    chances: Any, distances: Any, abstains: Any, problem: str
) -> None:
    """Shapes, sums and distances are held to what they mean."""
    with pytest.raises(ValueError, match=problem):
        Percepts(np.array(chances), np.array(distances), np.array(abstains, dtype=np.bool_))


def test_percepts_do_not_follow_the_arrays_they_were_made_of() -> None:
    """They hold copies that nobody can write to."""
    chances = np.array([[1.0, 0.0, 0.0]])
    percepts = Percepts(chances, np.array([1]), np.array([False]))
    chances[0] = 0.0, 1.0, 0.0
    assert percepts.labels.tolist() == [0]
    with pytest.raises(ValueError, match="read-only"):
        percepts.distances[0] = 2


@pytest.mark.parametrize(
    ("frames", "problem"),
    [
        (np.zeros((1, 96, 96, 3)), "not float64"),
        (np.zeros((1, 96, 96, 3), np.int64), "not int64"),
        (np.zeros((96, 96, 3), np.uint8), r"give one frame as frame\[None\]"),
        (np.zeros((1, 96, 96, 4), np.uint8), r"not uint8 \(1, 96, 96, 4\)"),
        (np.zeros((1, 96, 96), np.uint8), "red, green and blue last"),
        (np.zeros((1, 3, 96, 96), np.uint8), "red, green and blue last"),
        (np.zeros((0, 96, 96, 3), np.uint8), "at least one"),
        (np.zeros((1, LEAST_PIXELS - 1, 96, 3), np.uint8), "7 x 96; resize"),
        (np.zeros((1, 8, MOST_PIXELS + 1, 3), np.uint8), "8 x 4097; resize"),
        ([[1, 2]], "not list; make a numpy array"),
        (None, "not NoneType"),
    ],
)
def test_what_is_no_batch_of_frames_is_refused(frames: Any, problem: str) -> None:
    """The message says what came, what is wanted, and what to do."""
    with pytest.raises(UserError, match=problem):
        checked_frames(frames)


def test_a_camera_can_insist_on_its_size() -> None:
    """A backend that depends on the camera's geometry refuses frames of another size."""
    assert checked_frames(np.zeros((1, 32, 32, 3), np.uint8), pixels=32).shape == (1, 32, 32, 3)
    with pytest.raises(UserError, match="32 x 32 pixels, not 32 x 33"):
        checked_frames(np.zeros((1, 32, 33, 3), np.uint8), pixels=32)


def test_detect_comes_from_perceive_in_batches() -> None:
    """Views go through `perceive` together, in order, no more than 256 at once; of two sizes, one by one."""
    backend = Brightness()
    assert isinstance(backend, FrameBackend)
    views = [View(np.full((8, 8, 3), 255 * (i % 2), np.uint8), NOTHING) for i in range(300)]
    assert [found.label for found in backend.detect(views)] == ["sphere", "cube"] * 150
    assert backend.batches == [256, 44]
    mixed = [View(np.zeros((size, size, 3), np.uint8), NOTHING) for size in (8, 9)]
    assert [found.label for found in backend.detect(mixed)] == ["sphere", "sphere"]
    assert backend.batches == [256, 44, 1, 1]
    assert backend.detect([]) == []


def test_a_view_without_a_frame_is_refused() -> None:
    """A backend that sees says so where there is nothing to look at."""
    with pytest.raises(ValueError, match="the view has no frame"):
        Brightness().detect([View(None, NOTHING)])
