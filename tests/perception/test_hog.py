"""The HOG backend: its features, its linear classifier, and what it keeps on disk."""

from pathlib import Path

import numpy as np
import pytest

from perception.hog import FEATURES, SHAPES, Hog, features
from perception.labelled import Rows
from perception.models import load_model
from perception.pushed import PushedFrames, pushed_frames
from perception.variation import CLEAN
from worlds import UserError


@pytest.fixture(scope="module")
def pushed() -> PushedFrames:
    """Return clean frames of a test seed."""
    return pushed_frames(range(60), 298, CLEAN)


def stripes(count: int = 30) -> Rows:
    """Return frames without edges, with upright ones and with level ones; far ones fill half a frame."""
    labels, distances = np.arange(count) % 3, 1 + np.arange(count) // 3 % 2
    frames = np.full((count, 64, 64, 3), 90, np.uint8)
    for frame, label, distance in zip(frames, labels, distances, strict=True):
        part = frame[: 64 // distance, : 64 // distance]
        if label == 1:
            part[:, ::8] = 250
        elif label == 2:
            part[::8] = 250
    return Rows(frames, labels, distances)


def test_it_learns_directions_of_edges() -> None:
    """Upright, level and no edges are told apart, and so is how much of the frame they fill."""
    data = stripes()
    found = Hog().fit(data, 0).perceive(data.frames)
    assert np.array_equal(found.labels, data.labels)
    assert np.array_equal(found.distances[data.labels > 0], data.distances[data.labels > 0])


def test_features_do_not_go_by_brightness() -> None:
    """A frame at twice its brightness has nearly the same features."""
    frames = np.random.default_rng(0).integers(0, 128, (1, 64, 64, 3), np.uint8)
    assert features(frames).shape == (1, FEATURES)
    assert np.allclose(features(2 * frames), features(frames), atol=1e-4)


def test_ready_made_weights_beat_guessing(pushed: PushedFrames) -> None:
    """On clean frames never learnt from it is right far more often than one in three."""
    assert (Hog().perceive(pushed.frames).labels == pushed.truth).mean() > 0.8


def test_batches_and_singles_agree_to_the_bit(pushed: PushedFrames) -> None:
    """A frame's probabilities do not depend on the batch that it comes in."""
    hog = Hog()
    whole = hog.perceive(pushed.frames[:6]).probabilities
    assert np.array_equal(whole, [hog.perceive(frame[None]).probabilities[0] for frame in pushed.frames[:6]])


def test_it_keeps_arrays_only(tmp_path: Path, pushed: PushedFrames) -> None:
    """The file holds factors and constants, and what is loaded sees the same."""
    hog = Hog().fit(stripes(), 4, about="stripes")
    hog.save(tmp_path / "h.safetensors")
    tensors, card = load_model(tmp_path / "h.safetensors")
    assert {name: tensor.shape for name, tensor in tensors.items()} == SHAPES
    loaded = Hog.load(tmp_path / "h.safetensors")
    assert loaded.card == card == hog.card
    assert (card.seed, card.data) == (4, "stripes")
    assert np.array_equal(loaded.scores(pushed.frames[:3]), hog.scores(pushed.frames[:3]))


def test_labels_that_the_data_lack_are_never_reported() -> None:
    """From data without spheres it learns to tell cubes from nothing, and reports no sphere."""
    data = stripes(60)
    rows = np.flatnonzero(data.labels < 2)
    found = Hog().fit(Rows.of(data, rows), 0).perceive(data.frames)
    assert np.array_equal(found.labels[rows], data.labels[rows])
    assert not (found.labels == 2).any()
    empty = Rows.of(data, np.flatnonzero(data.labels == 0))
    assert (Hog().fit(empty, 0).perceive(data.frames).labels == 0).all()


def test_wrong_frames_are_refused() -> None:
    """Floats and an empty batch are refused."""
    for wrong in (np.zeros((1, 64, 64, 3)), np.zeros((0, 64, 64, 3), np.uint8)):
        with pytest.raises(UserError, match="frames need uint8"):
            Hog().perceive(wrong)
