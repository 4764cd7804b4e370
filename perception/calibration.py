"""Whether probabilities mean what they say: temperature, reliability and expected calibration error.

Guo, Pleiss, Sun and Weinberger, "On calibration of modern neural networks", ICML 2017: one temperature,
fitted on frames that the network did not learn from, mends most of its overconfidence and changes no label.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_COLDEST: Final = 0.05
_HOTTEST: Final = 20.0
_HALVINGS: Final = 60  # of the range of temperatures: to the last bit


@dataclass(frozen=True, eq=False)
class Reliability:
    """How often a backend is right, by how sure it is.

    Parameters
    ----------
    edges
        The bins' limits, in confidence, shape (bins + 1,).
    counts
        Frames in each bin, shape (bins,).
    confidence, accuracy
        Mean confidence and share of right labels in each bin, shape (bins,); NaN in an empty bin.
    error
        The expected calibration error: the mean over frames of their bin's |accuracy - confidence|.
    """

    edges: Array
    counts: NDArray[np.int64]
    confidence: Array
    accuracy: Array
    error: float


def softmax(scores: NDArray[np.floating], temperature: float = 1.0) -> Array:
    """Return probabilities of scores, shape (frames, labels), each row summing to 1.

    Examples
    --------
    >>> softmax(np.array([[0.0, 0.0], [0.0, 1000.0]])).tolist()
    [[0.5, 0.5], [0.0, 1.0]]
    """
    scaled = np.asarray(scores, dtype=np.float64) / temperature
    powers = np.exp(scaled - scaled.max(axis=1, keepdims=True))
    share: Array = powers / powers.sum(axis=1, keepdims=True)
    return share


def fit_temperature(scores: NDArray[np.floating], labels: NDArray[np.integer]) -> float:
    """Return the temperature under which labels are likeliest.

    The log-likelihood is concave in 1 / temperature, so halving by the sign of its slope finds the top.

    Parameters
    ----------
    scores
        Of frames that the backend did not learn from, shape (frames, labels).
    labels
        What they should be, shape (frames,).

    Returns
    -------
    float
        From 0.05 to 20: perfect scores would want 0, and meaningless ones infinity.

    Raises
    ------
    ValueError
        If there are no frames, or not one label a frame.

    Examples
    --------
    >>> scores = np.log([[0.75, 0.25]] * 4)
    >>> round(fit_temperature(2 * scores, np.array([0, 0, 0, 1])), 6)  # right in 3 of 4, twice too sure
    2.0
    """
    found = np.asarray(scores, dtype=np.float64)
    if len(found) == 0 or len(found) != len(labels):
        raise ValueError(f"{len(found)} frames' scores and {len(labels)} labels: give one each, at least one")
    own = found[np.arange(len(found)), labels]
    low, high = 1 / _HOTTEST, 1 / _COLDEST
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        slope = float((own - (softmax(found, 1 / middle) * found).sum(axis=1)).mean())
        low, high = (middle, high) if slope > 0 else (low, middle)
    return 2 / (low + high)


def reliability(probabilities: Array, labels: NDArray[np.integer], bins: int = 15) -> Reliability:
    """Return how right a backend is in each of `bins` equal ranges of confidence.

    Parameters
    ----------
    probabilities
        Shape (frames, labels).
    labels
        The truth, shape (frames,).
    bins
        Number of ranges.

    Raises
    ------
    ValueError
        If there are no frames or bins, or not one label a frame.

    Examples
    --------
    >>> found = reliability(np.array([[0.75, 0.25], [0.75, 0.25]]), np.array([0, 1]), bins=2)
    >>> found.counts.tolist(), found.accuracy.tolist(), found.error
    ([0, 2], [nan, 0.5], 0.25)
    """
    if len(probabilities) == 0 or len(probabilities) != len(labels) or bins < 1:
        raise ValueError(
            f"{len(probabilities)} frames, {len(labels)} labels and {bins} bins: "
            "give a label a frame, and at least one frame and bin"
        )
    confidence = probabilities.max(axis=1)
    right = probabilities.argmax(axis=1) == labels
    place = np.minimum((confidence * bins).astype(np.int64), bins - 1)
    counts = np.bincount(place, minlength=bins)
    sure, true = (np.bincount(place, weights=what, minlength=bins) for what in (confidence, right))
    empty = np.full(bins, np.nan)
    return Reliability(
        edges=np.linspace(0, 1, bins + 1),
        counts=counts,
        confidence=np.divide(sure, counts, out=empty.copy(), where=counts > 0),
        accuracy=np.divide(true, counts, out=empty.copy(), where=counts > 0),
        error=float(np.abs(true - sure).sum() / len(labels)),
    )


def calibration_error(probabilities: Array, labels: NDArray[np.integer], bins: int = 15) -> float:
    """Return the expected calibration error, in [0, 1]; see `reliability`.

    Examples
    --------
    >>> calibration_error(np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([0, 1]))
    0.0
    """
    return reliability(probabilities, labels, bins).error
