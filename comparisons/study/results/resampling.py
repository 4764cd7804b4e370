"""The bootstrap: what a statistic would be of runs like those that there are, task by task.

Its percentiles are those of Hesterberg's expanded percentile interval ("What teachers should know about the
bootstrap", The American Statistician 69, 2015): as far out as a t interval would reach, for plain percentiles
are too narrow where seeds are few.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import bootstrap, norm, t

from worlds import Stream

Array = NDArray[np.float64]
RESAMPLES: Final = 9999
"""Of every bootstrap."""
_STREAM: Final = 71  # names the streams of resamples
_MOST_NUMBERS: Final = 4_000_000  # that a batch of resamples may hold, for memory's sake
# Stands for an infinite number where arithmetic must not meet one; no measure comes near.
_HUGE: Final = 1e150


def resampled(arrays: Sequence[NDArray[Any]], of: Callable[..., Array]) -> Array | None:
    """Return a statistic of resamples, each array resampled by itself.

    Parameters
    ----------
    arrays
        Numbers of each task, or of each task and side.
    of
        Called with the arrays, resamples along the first axis, and the axis to work along; what it returns
        has its resamples along the last axis.

    Returns
    -------
    Array
        Shape (..., `RESAMPLES`); None if an array has fewer than two numbers, which show no spread. The same
        arrays always give the same.
    """
    if min(map(len, arrays)) < 2:
        return None

    def finite(*given: Array, axis: int) -> Array:
        return np.clip(of(*given, axis=axis), -_HUGE, _HUGE)

    stream = Stream(_STREAM, len(arrays), *map(len, arrays))
    drawn = bootstrap(
        tuple(arrays),
        finite,
        n_resamples=RESAMPLES,
        batch=max(_MOST_NUMBERS // sum(map(len, arrays)), 1),
        method="percentile",
        rng=np.random.Generator(np.random.Philox(key=stream.key)),
    ).bootstrap_distribution
    drawn = np.asarray(drawn, dtype=np.float64)
    return np.select([drawn >= _HUGE, drawn <= -_HUGE], [inf, -inf], drawn)


def inner(drawn: Array | None, runs: int, tasks: int) -> tuple[float, float]:
    """Return the bounds between which 95 % of resamples lie, widened as `expanded_tail` says.

    Parameters
    ----------
    drawn
        Numbers of resamples, infinite ones among them; None, for which the bounds are infinite, if none.
    runs, tasks
        Number of runs that were resampled, and of tasks.
    """
    if drawn is None:
        return -inf, inf
    tail = expanded_tail(runs, tasks)
    # No bound between two resamples: there is none between a finite number and an infinite one.
    low, high = np.quantile(drawn, (tail, 1 - tail), method="inverted_cdf")
    return float(low), float(high)


def expanded_tail(runs: int, tasks: int) -> float:
    """Return the share of resamples to leave out on either side, so that 95 % intervals are wide enough.

    Resamples of n numbers vary by a factor of (n - 1) / n too little, and normal tails are short where the
    spread is estimated from few: Hesterberg 2015, with n - 1 generalised to runs less tasks.

    >>> round(expanded_tail(5, 1), 5), round(expanded_tail(100, 1), 5)
    (0.00095, 0.02306)
    """
    freedom = runs - tasks
    return float(norm.cdf(t.ppf(0.025, freedom) * sqrt(runs / freedom)))
