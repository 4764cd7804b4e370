"""Confusion matrix and shares, against counts made by hand."""

from collections.abc import Iterable, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception import LABELS, NOTHING, Detection, Truth, View, confusion, measure
from perception.accuracy import score
from worlds import Size

CUBE1, CUBE2 = Detection("cube", 1.0, 1), Detection("cube", 0.8, 2)
BALL1, BALL2 = Detection("sphere", 1.0, 1), Detection("sphere", 0.6, 2)
TRUTH = [NOTHING, NOTHING, CUBE1, CUBE1, CUBE2, BALL1, BALL2, BALL2]
SEEN = [NOTHING, BALL1, CUBE1, CUBE2, NOTHING, BALL1, BALL2, CUBE2]
SIZES: list[Size | None] = [None, None, "small", "small", "large", "middle", "large", "large"]


class Recorded:
    """A backend that returns what it is given, and notes how many views it got at once."""

    name = "recorded"
    needs_frames = False

    def __init__(self, detections: Iterable[Detection]) -> None:
        self.left = list(detections)
        self.batches: list[int] = []

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Return the next detections."""
        self.batches.append(len(views))
        out, self.left = self.left[: len(views)], self.left[len(views) :]
        return out


def test_confusion_by_hand() -> None:
    """Rows are the truth, columns what was seen."""
    assert confusion(TRUTH, SEEN).tolist() == [[1, 0, 1], [1, 2, 0], [0, 1, 2]]


def test_score_by_hand() -> None:
    """Five of eight labels are right, and three of the four distances that go with them."""
    result = score([View(None, t, s) for t, s in zip(TRUTH, SIZES, strict=True)], SEEN)
    assert result.frames == 8
    assert result.accuracy == 5 / 8
    assert result.distance_accuracy == 3 / 4
    assert result.confusion["cube"] == {"none": 1, "cube": 2, "sphere": 0}
    assert result.groups == {
        "none": {"frames": 2, "right": 1},
        "cube small 1": {"frames": 2, "right": 2},
        "cube large 2": {"frames": 1, "right": 0},
        "sphere middle 1": {"frames": 1, "right": 1},
        "sphere large 2": {"frames": 2, "right": 1},
    }


def test_measure_streams_and_keeps_order() -> None:
    """A long stream is looked at in batches and scored as if at once."""
    backend = Recorded(SEEN * 30)
    result = measure(backend, (View(None, truth) for truth in TRUTH * 30))
    assert sum(backend.batches) == 240
    assert len(backend.batches) > 1
    assert result.accuracy == 5 / 8


def test_no_views_are_refused() -> None:
    """There is no accuracy of nothing."""
    with pytest.raises(ValueError, match="no views"):
        measure(Truth(), [])


def test_lengths_must_agree() -> None:
    """A backend that drops a view is caught."""
    with pytest.raises(ValueError, match="shorter"):
        confusion(TRUTH, SEEN[:-1])


detections = st.builds(
    lambda label, distance: Detection(label, 0.5, 0 if label == "none" else distance),
    st.sampled_from(LABELS),
    st.integers(1, 2),
)


@given(st.lists(st.tuples(detections, detections), min_size=1))
def test_counts_add_up(pairs: list[tuple[Detection, Detection]]) -> None:
    """Confusion and groups count every view once, and accuracy is the diagonal's share."""
    result = score([View(None, truth) for truth, _ in pairs], [seen for _, seen in pairs])
    assert sum(sum(row.values()) for row in result.confusion.values()) == len(pairs)
    assert sum(group["frames"] for group in result.groups.values()) == len(pairs)
    right = sum(truth.label == seen.label for truth, seen in pairs)
    assert result.accuracy == right / len(pairs)
    assert sum(group["right"] for group in result.groups.values()) == right
