"""Tuning of the Hough recogniser: the softmax's constants, fitted to what it weighs in frames with labels.

Tune on a tuning set and measure on another. Frames of the set go in twice, as they are and corrupted, so
that the probabilities also hold where the picture is poor.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from perception.corruptions import CORRUPTIONS, HELD_OUT, corrupt
from perception.protocol import REACH, Frames
from perception.weighing import FEATURES, Weights
from worlds import Stream

TUNED_ON: Final = tuple(name for name in CORRUPTIONS if name not in HELD_OUT)
"""The corruptions that the tuning set is shown with."""
_PENALTY: Final = 1e-5  # on squared constants: without it, sets that can be told apart would drive them up
_OWN = {"cube": ("cube", "proposed cube"), "sphere": ("sphere", "proposed sphere")}


class TuningSet(NamedTuple):
    """Frames, shape (n, pixels, pixels, 3), the labels' places in `LABELS`, (n,), and distances, (n,)."""

    frames: Frames
    labels: NDArray[np.int64]
    distances: NDArray[np.int64]


def worsened(data: TuningSet, seed: int) -> TuningSet:
    """Return a set and, after it, the same with each frame corrupted: which way and how far is drawn.

    Examples
    --------
    >>> data = TuningSet(np.full((3, 16, 16, 3), 90, np.uint8), np.zeros(3, int), np.ones(3, int))
    >>> worsened(data, seed=1).frames.shape
    (6, 16, 16, 3)
    """
    worse = []
    for i in range(len(data.frames)):
        stream = Stream(seed, i)
        name, severity = stream.choose(TUNED_ON), 1 + stream.below(5)
        worse.append(corrupt(name, data.frames[i : i + 1], severity, stream.below(1 << 31)))
    return TuningSet(
        np.concatenate([data.frames, *worse]), np.tile(data.labels, 2), np.tile(data.distances, 2)
    )


def fit_weights(
    features: NDArray[np.float64], labels: NDArray[np.int64], distances: NDArray[np.int64]
) -> Weights:
    """Return the constants under which the labels, at their distances, are likeliest.

    Evidence for a kind never speaks against it, nor for its rival. In each cell they are the maximum of
    the likelihood of none, cube and sphere over the frames in which nothing nearer is in the way.

    Parameters
    ----------
    features
        `perception.weighing.FEATURES` of each frame, shape (frames, distances, features).
    labels, distances
        The truth, shape (frames,).

    Examples
    --------
    >>> from perception.weighing import weigh
    >>> rows = [(1, 0.1, 0, 0.2, 0, 0), (1, 0.9, 0.9, 0.3, 0, 0), (1, 0.2, 0, 0.9, 0.9, 0)]
    >>> features = np.array([[row, rows[0]] for row in rows])
    >>> weights = fit_weights(features, np.array([0, 1, 2]), np.array([1, 1, 1]))
    >>> weigh(features, weights)[0].argmax(axis=1).tolist()
    [0, 1, 2]
    """
    found = []
    for cell in range(REACH):
        there = (labels == 0) | (distances >= cell + 1)
        truth = np.where(distances[there] == cell + 1, labels[there], 0)
        best = minimize(
            _loss,
            np.zeros(2 * len(FEATURES)),
            args=(features[there, cell], truth),
            jac=True,
            method="L-BFGS-B",
            bounds=_bounds(),
            options={"maxiter": 20_000, "maxfun": 100_000, "ftol": 0.0, "gtol": 1e-8},
        )
        # The maximum is one, and found closely enough for two digits to be the same on any machine.
        cube, sphere = (best.x.round(2) + 0.0).reshape(2, -1).tolist()
        found.append((tuple(cube), tuple(sphere)))
    return tuple(found)


def _bounds() -> list[tuple[float | None, float | None]]:
    """Return the range of each constant: what keeps the confidence monotone in the evidence."""
    evidence = {name for names in _OWN.values() for name in names}
    return [
        (0.0, None) if name in own else (None, 0.0) if name in evidence else (None, None)
        for own in _OWN.values()
        for name in FEATURES
    ]


def _loss(
    flat: NDArray[np.float64], features: NDArray[np.float64], labels: NDArray[np.int64]
) -> tuple[float, NDArray[np.float64]]:
    """Return the mean negative log-likelihood in one cell, with its penalty, and its gradient."""
    weights = flat.reshape(2, -1)
    logits = np.column_stack([np.zeros(len(features)), features @ weights.T])
    logits -= logits.max(axis=1, keepdims=True)
    log_total = np.log(np.exp(logits).sum(axis=1))
    rows = np.arange(len(labels))
    loss = float((log_total - logits[rows, labels]).mean()) + _PENALTY * float(flat @ flat) / 2
    error = np.exp(logits - log_total[:, None])
    error[rows, labels] -= 1
    slope = error[:, 1:].T @ features / len(labels)
    return loss, slope.ravel() + _PENALTY * flat
