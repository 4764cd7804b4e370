"""Temperatures, reliability and expected calibration error."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.calibration import calibration_error, fit_temperature, reliability, softmax


def drawn(seed: int, frames: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Return scores, and labels drawn from the probabilities that they mean."""
    random = np.random.default_rng(seed)
    scores = random.normal(0.0, spread, (frames, 3))
    labels = (softmax(scores).cumsum(axis=1) < random.random((frames, 1))).sum(axis=1).clip(0, 2)
    return scores, labels


@given(factor=st.floats(0.25, 4.0), seed=st.integers(0, 50))
def test_temperature_undoes_a_factor(factor: float, seed: int) -> None:
    """Scores that are a factor too large want a temperature that is as much higher."""
    scores, labels = drawn(seed, 300, 2.0)
    assert fit_temperature(factor * scores, labels) == pytest.approx(
        factor * fit_temperature(scores, labels), rel=1e-6
    )


def test_temperature_of_honest_scores_is_one() -> None:
    """Labels drawn from the scores' own probabilities leave the temperature near 1."""
    assert fit_temperature(*drawn(1, 20_000, 2.0)) == pytest.approx(1.0, abs=0.05)


def test_temperature_is_likeliest() -> None:
    """No temperature nearby makes the labels likelier."""
    scores, labels = drawn(2, 500, 3.0)
    best = fit_temperature(scores, labels)

    def likelihood(temperature: float) -> float:
        return float(np.log(softmax(scores, temperature)[np.arange(500), labels]).sum())

    assert likelihood(best) >= max(likelihood(best * 1.01), likelihood(best / 1.01))


def test_temperature_stays_in_its_range() -> None:
    """Perfect scores end at the coldest temperature and useless ones at the hottest."""
    sure = np.eye(3) * 0.5
    assert fit_temperature(sure, np.array([0, 1, 2])) == pytest.approx(0.05, rel=1e-6)
    assert fit_temperature(sure, np.array([1, 2, 0])) == pytest.approx(20.0, rel=1e-6)


@given(seed=st.integers(0, 50), bins=st.integers(1, 30))
def test_bins_hold_every_frame(seed: int, bins: int) -> None:
    """Every frame is in one bin, and the bins' mean gaps are the error."""
    scores, labels = drawn(seed, 200, 1.0)
    found = reliability(softmax(scores), labels, bins)
    full = found.counts > 0
    gaps = np.abs(found.accuracy - found.confidence)[full]
    assert found.counts.sum() == 200
    assert found.error == pytest.approx((gaps * found.counts[full]).sum() / 200)


def test_error_by_hand() -> None:
    """Two frames at 0.9 with one right, and two at 0.6 with both right: (2 * 0.4 + 2 * 0.4) / 4."""
    probabilities = np.array([[0.9, 0.1], [0.9, 0.1], [0.6, 0.4], [0.6, 0.4]])
    assert calibration_error(probabilities, np.array([0, 1, 0, 0]), bins=10) == pytest.approx(0.4)


def test_full_confidence_has_a_bin() -> None:
    """Confidence 1 falls in the last bin, not beyond it."""
    assert reliability(np.array([[1.0, 0.0]]), np.array([0]), bins=4).counts.tolist() == [0, 0, 0, 1]


def test_nothing_to_calibrate_is_refused() -> None:
    """Without frames, or with too few labels, there is neither temperature nor error."""
    none = np.zeros((0, 3))
    with pytest.raises(ValueError, match="at least one"):
        fit_temperature(none, np.zeros(0, np.int64))
    with pytest.raises(ValueError, match="label a frame"):
        reliability(np.full((2, 3), 1 / 3), np.zeros(1, np.int64))
