"""The ensemble of CNN and Hough, and the gate by which it abstains."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.calibration import softmax
from perception.cnn import Cnn
from perception.ensemble import Ensemble, agreement, pooled
from perception.labelled import Rows
from perception.percepts import Percepts
from perception.pushed import PushedFrames, pushed_frames
from perception.training import Training
from perception.variation import Variation
from worlds import UserError
from worlds.bullet import UNKNOWN_FORMS


@pytest.fixture(scope="module")
def pushed() -> PushedFrames:
    """Return varied frames of a test seed."""
    return pushed_frames(range(90), 297, Variation())


def percepts(seed: int, frames: int = 20) -> Percepts:
    """Return percepts at random."""
    random = np.random.default_rng(seed)
    return Percepts(
        softmax(random.normal(0, 2, (frames, 3))), random.integers(1, 3, frames), np.zeros(frames)
    )


@given(seed=st.integers(0, 200))
def test_pooling_favours_what_both_favour(seed: int) -> None:
    """Where two backends report the same label, so do they together, and more surely than the surer one."""
    one, other = percepts(seed), percepts(seed + 1)
    together = softmax(pooled(one, other))
    alike = one.labels == other.labels
    assert np.array_equal(together.argmax(axis=1)[alike], one.labels[alike])
    assert (together.max(axis=1) >= np.maximum(one.confidence, other.confidence) - 1e-9)[alike].all()


@given(seed=st.integers(0, 200))
def test_agreement_is_the_doubters(seed: int) -> None:
    """Agreement on a label is symmetric and never above what either backend gives it."""
    one, other, labels = percepts(seed), percepts(seed + 1), np.arange(20) % 3
    found = agreement(one, other, labels)
    assert np.array_equal(found, agreement(other, one, labels))
    assert (found <= one.probabilities[np.arange(20), labels]).all()
    assert (found <= other.probabilities[np.arange(20), labels]).all()


def test_gate_lets_the_share_pass(pushed: PushedFrames) -> None:
    """On the frames that set the gate, the share of spheres asked for passes, and a stricter gate less."""
    spheres = pushed.labels == 2
    passed = []
    for share in (0.9, 0.5):
        ensemble = Ensemble().gate(Cnn(), pushed, accepted=share)
        found = ensemble.perceive(pushed.frames[spheres])
        taken = (found.labels == 2) & ~found.abstains
        passed.append(taken.mean())
        assert taken.mean() == pytest.approx(share, abs=2 / spheres.sum())
    assert passed[0] > passed[1]


def test_it_abstains_on_solids_never_seen(pushed: PushedFrames) -> None:
    """Fewer solids of unknown families pass as spheres than by the network alone; most spheres pass."""
    unknown = pushed_frames(range(120), 296, Variation(families=UNKNOWN_FORMS))
    there = unknown.kinds != "none"
    found = Ensemble().perceive(unknown.frames[there])
    alone = Cnn().perceive(unknown.frames[there])
    false = ((found.labels == 2) & ~found.abstains).sum()
    assert false <= (alone.labels == 2).sum()
    assert false <= 0.15 * there.sum()
    spheres = Ensemble().perceive(pushed.frames[pushed.labels == 2])
    assert ((spheres.labels == 2) & ~spheres.abstains).mean() > 0.75


def test_batches_and_singles_agree(pushed: PushedFrames) -> None:
    """A frame's probabilities and abstention do not depend on the batch that it comes in."""
    ensemble = Ensemble()
    whole = ensemble.perceive(pushed.frames[:5])
    singles = [ensemble.perceive(frame[None]) for frame in pushed.frames[:5]]
    assert np.array_equal(whole.probabilities, np.concatenate([one.probabilities for one in singles]))
    assert np.array_equal(whole.abstains, np.concatenate([one.abstains for one in singles]))


def test_saved_and_loaded_is_the_same(tmp_path: Path, pushed: PushedFrames) -> None:
    """What was fitted, saved and loaded sees the same, by the same threshold."""
    data = Rows.of(pushed)
    ensemble = Ensemble().fit(data, 2, settings=Training(updates=10, batch=16), about="a few")
    ensemble.save(tmp_path / "e.safetensors")
    loaded = Ensemble.load(tmp_path / "e.safetensors")
    assert loaded.card == ensemble.card
    assert (loaded.card.backend, loaded.card.data, loaded.card.seed) == ("ensemble", "a few", 2)
    frames = pushed.frames[:4]
    assert np.array_equal(loaded.perceive(frames).probabilities, ensemble.perceive(frames).probabilities)


def test_frames_of_another_size_are_refused() -> None:
    """Hough knows its own camera only, so frames of another size are refused."""
    with pytest.raises(UserError, match="96 x 96"):
        Ensemble().perceive(np.zeros((1, 64, 64, 3), np.uint8))
