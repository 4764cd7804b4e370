"""Curves of several runs on one abscissa, and their interquartile mean with its band."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan
from typing import Final

import numpy as np
from numpy.typing import NDArray

from comparisons.study.results.resampling import expanded_tail
from comparisons.study.results.statistics import aggregate
from worlds import Stream

_RESAMPLES: Final = 1000
_BAND: Final = 31  # names the stream of the resamples
_AT_ONCE: Final = 2_000_000  # numbers resampled at a time


def step_aligned(
    runs: Sequence[tuple[Sequence[float], Sequence[float]]], end: float | None = None, most: int = 200
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return runs' curves on one abscissa: at each place the last value that was known there.

    A run that ended keeps its last value; before its first, a run has nothing to show (-inf).

    Parameters
    ----------
    runs
        Abscissa, rising, and values of each run; at least one run.
    end
        The last place; the last one of any run by default.
    most
        Number of places at most, evenly spread from 0 to the last one if the runs have more.

    Returns
    -------
    tuple
        Places, shape (points,), and values, shape (runs, points).

    Examples
    --------
    >>> places, values = step_aligned([([0, 10], [0.0, 1.0]), ([5, 20], [0.5, 0.7])])
    >>> places.tolist()
    [0.0, 5.0, 10.0, 20.0]
    >>> values.tolist()
    [[0.0, 0.0, 1.0, 1.0], [-inf, 0.5, 0.5, 0.7]]
    """
    places = np.unique(np.concatenate([np.asarray(x, dtype=np.float64) for x, _ in runs]))
    if end is not None:
        places = np.unique([*places[places <= end], end])
    if len(places) > most:
        places = np.linspace(0.0, places[-1], most)
    values = np.full((len(runs), len(places)), -inf)
    for i, (x, y) in enumerate(runs):
        at = np.searchsorted(np.asarray(x, dtype=np.float64), places, side="right") - 1
        known = at >= 0
        values[i, known] = np.asarray(y, dtype=np.float64)[at[known]]
    return places, values


def iqm_bands(values: NDArray[np.float64], seed: int = 0) -> NDArray[np.float64]:
    """Return the interquartile mean over runs, and its 95 % bootstrap band, place by place.

    Whole runs are resampled, the same at every place, and the band is as wide as the interval of
    `comparisons.study.results.statistics.estimate`. Infinities are honest: where one lies among the middle
    half of the runs, the mean is infinite. A single run has no band.

    Parameters
    ----------
    values
        Shape (runs, points), without NaN.
    seed
        Of the resamples.

    Returns
    -------
    NDArray[np.float64]
        The mean, and the bounds of its interval, shape (3, points).

    Examples
    --------
    >>> iqm_bands(np.array([[1.0], [2.0], [4.0], [99.0]]))[0]
    array([3.])
    """
    runs, points = values.shape
    if runs < 2:
        return np.stack([values[0], *np.full((2, points), nan)])
    tail = expanded_tail(runs, 1)
    drawn = Stream(seed, _BAND).uniforms(_RESAMPLES * runs).reshape(_RESAMPLES, runs)
    which = (drawn * runs).astype(np.int64)
    found = np.empty((3, points))
    found[0] = _iqm(values)
    step = max(1, _AT_ONCE // (_RESAMPLES * runs))
    for first in range(0, points, step):
        means = _iqm(values[:, first : first + step][which].swapaxes(0, 1))
        # Bounds that occurred: between a number and an infinity there is nothing to interpolate.
        found[1:, first : first + step] = np.quantile(means, (tail, 1 - tail), axis=0, method="inverted_cdf")
    return found


def _iqm(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the interquartile mean along the first axis."""
    return aggregate(np.moveaxis(values, 0, -1), "iqm")
