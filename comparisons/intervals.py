"""Intervals of shares, of means and of differences, at 95 %."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Final

import numpy as np
from scipy.stats import binomtest

from worlds import Stream

_RESAMPLES: Final = 2000
_BOOTSTRAP: Final = 20  # names the stream of the resamples


def wilson(right: int, frames: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share; (0, 1) of nothing.

    Examples
    --------
    >>> [round(bound, 4) for bound in wilson(98, 100)], wilson(0, 0)
    ([0.93, 0.9945], (0.0, 1.0))
    """
    if not frames:
        return 0.0, 1.0
    bounds = binomtest(right, frames).proportion_ci(0.95, method="wilson")
    return float(bounds.low), float(bounds.high)


def bootstrapped(values: Sequence[float], seed: int) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval of a mean; (0, 0) of nothing.

    Examples
    --------
    >>> bootstrapped([2.0, 2.0, 2.0], seed=1)
    (2.0, 2.0)
    """
    if not values:
        return 0.0, 0.0
    drawn = Stream(seed, _BOOTSTRAP).uniforms(_RESAMPLES * len(values)).reshape(_RESAMPLES, len(values))
    means = np.asarray(values)[(drawn * len(values)).astype(np.int64)].mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return float(low), float(high)


def mean_interval(rights: Sequence[int], frames: int, seed: int) -> tuple[float, float]:
    """Return an interval of the mean share of several runs that were all measured on the same frames.

    Two things are uncertain: which frames they were, for which Wilson's interval of the mean stands, and how
    each run went, for which the bootstrap over runs stands. Whichever reaches farther counts, on either side.

    Parameters
    ----------
    rights
        Right ones of `frames`, by run; at least one run.
    frames
        Number of frames.
    seed
        Of the bootstrap.

    Examples
    --------
    >>> [round(bound, 3) for bound in mean_interval([96, 98, 97], 100, seed=1)]
    [0.915, 0.99]
    >>> [round(bound, 3) for bound in mean_interval([30, 60, 90], 100, seed=1)]
    [0.3, 0.9]
    """
    runs = bootstrapped([right / frames for right in rights], seed)
    sample = wilson(round(sum(rights) / len(rights)), frames)
    return min(runs[0], sample[0]), max(runs[1], sample[1])


def paired_difference(first: int, second: int, both: int, frames: int) -> tuple[float, float, float]:
    """Return the difference of two shares of the same frames, and its 95 % interval.

    Newcombe, "Improved confidence intervals for the difference between binomial proportions based on paired
    data", Statistics in Medicine 17 (1998), method 10: Wilson's intervals of the two, joined as far as the
    two go together.

    Parameters
    ----------
    first, second, both
        Frames that the first got right, the second, and both.
    frames
        Number of frames.

    Returns
    -------
    tuple
        Share of the first less that of the second, and the interval's bounds; (0, -1, 1) of no frames.

    Examples
    --------
    >>> [round(bound, 3) for bound in paired_difference(36, 43, 33, 50)]
    [-0.14, -0.281, 0.004]
    """
    if not frames:
        return 0.0, -1.0, 1.0
    one, other = first / frames, second / frames
    (low_one, high_one), (low_other, high_other) = wilson(first, frames), wilson(second, frames)
    neither = frames - first - second + both
    together = float(both * neither - (first - both) * (second - both))
    if together > 0:
        together = max(together - frames / 2, 0.0)
    spread = sqrt(first * (frames - first) * second * (frames - second))
    phi = together / spread if spread else 0.0
    difference = one - other
    below, above = one - low_one, high_other - other
    low = sqrt(max(below**2 - 2 * phi * below * above + above**2, 0.0))
    below, above = other - low_other, high_one - one
    high = sqrt(max(below**2 - 2 * phi * below * above + above**2, 0.0))
    return difference, max(difference - low, -1.0), min(difference + high, 1.0)
