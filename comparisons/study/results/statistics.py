"""Estimates over runs with 95 % intervals, stratified over tasks, in which a run may never have got there.

The methods are those of Agarwal, Schwarzer, Castro, Courville and Bellemare, "Deep reinforcement learning at
the edge of the statistical precipice", NeurIPS 2021 (below: the Precipice), with two changes for where seeds
are few or goals are missed: intervals are as wide as t intervals are, and numbers may be infinite.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Final, Literal, get_args

import numpy as np

from comparisons.intervals import wilson
from comparisons.study.results.resampling import Array, inner, resampled
from comparisons.study.results.samples import FEWEST_SEEDS, Samples
from worlds import UserError, suggest

Statistic = Literal["iqm", "median", "mean"]
STATISTICS: Final[tuple[Statistic, ...]] = get_args(Statistic)


@dataclass(frozen=True)
class Interval:
    """A number and the bounds of its 95 % interval.

    Parameters
    ----------
    value
        The number; infinite where what it tells of was not reached.
    low, high
        Bounds; infinite ones, on both sides, where there are too few runs to tell any.
    """

    value: float
    low: float
    high: float

    @property
    def bounded(self) -> bool:
        """Whether any bound could be told."""
        return not (self.low == -inf and self.high == inf)


@dataclass(frozen=True)
class Estimate(Interval):
    """A statistic of runs.

    Parameters
    ----------
    statistic
        Which.
    runs, seeds, tasks
        Number of runs, of seeds of the task that has fewest, and of tasks.
    reached
        Number of runs that got there.
    untold
        Number of runs that had nothing to tell, and are left out.
    """

    statistic: str
    runs: int
    seeds: int
    tasks: int
    reached: int
    untold: int = 0

    @property
    def few(self) -> bool:
        """Whether there are too few seeds for anything to be ranked by this."""
        return self.seeds < FEWEST_SEEDS


@dataclass(frozen=True)
class Profile:
    """A performance profile: the share of runs that are at least as good as each of some thresholds.

    Parameters
    ----------
    thresholds
        Numbers of the measure, ascending, shape (n,).
    shares, low, high
        Shares and the bounds of their 95 % intervals, pointwise, shape (n,).
    runs, seeds
        Number of runs, and of seeds of the task that has fewest.
    """

    thresholds: Array
    shares: Array
    low: Array
    high: Array
    runs: int
    seeds: int


def checked_statistic(name: str) -> Statistic:
    """Return a statistic's name.

    Raises
    ------
    UserError
        If there is none such.
    """
    for known in STATISTICS:
        if name == known:
            return known
    raise UserError(f"{name}: there is no such statistic; {suggest(name, STATISTICS)}")


def aggregate(values: Array, statistic: Statistic) -> Array:
    """Return a statistic over the last axis; values may be infinite, of one sign.

    The IQM (interquartile mean) is the mean of what is left when a quarter of the values, rounded down, is
    dropped at either end: the Precipice, section 4. It is infinite if what is left is.

    Examples
    --------
    >>> values = np.array([1.0, 2.0, 3.0, 6.0, np.inf])
    >>> [float(aggregate(values, statistic)) for statistic in STATISTICS]
    [3.6666666666666665, 3.0, inf]
    """
    if statistic == "mean":
        return np.asarray(values.mean(axis=-1))
    values = np.sort(values, axis=-1)
    count = values.shape[-1]
    cut = count // 4 if statistic == "iqm" else (count - 1) // 2
    return np.asarray(values[..., cut : count - cut].mean(axis=-1))


def estimate(samples: Samples, statistic: str = "iqm") -> Estimate | None:
    """Return a statistic over all runs with its interval; None if there are none.

    The bootstrap resamples runs within each task (`comparisons.study.results.resampling`).

    Parameters
    ----------
    samples
        Numbers of the runs.
    statistic
        "iqm", "median" or "mean".

    Examples
    --------
    >>> from comparisons.study.kinds import Measure
    >>> steps = Measure("steps", "steps to the goal", "steps", "less")
    >>> found = estimate(Samples(steps, {"": dict(enumerate([9, 9, 10, 11, 12, 12, 13, np.inf]))}))
    >>> found.value, found.high, found.reached, found.runs
    (11.25, inf, 7, 8)
    """
    named = checked_statistic(statistic)
    if not samples.runs:
        return None

    def of(*tasks: Array, axis: int) -> Array:
        return aggregate(np.concatenate(tasks, axis=axis), named)

    value = float(of(*samples.arrays, axis=-1))
    low, high = inner(resampled(samples.arrays, of), samples.runs, len(samples.arrays))
    return _of(samples, statistic, value, low, high)


def profile(samples: Samples, thresholds: Sequence[float] | None = None) -> Profile:
    """Return the share of runs at least as good as each threshold: the Precipice, section 4.

    Parameters
    ----------
    samples
        Numbers of the runs.
    thresholds
        Numbers of the measure; by default all finite ones that there are.

    Raises
    ------
    UserError
        If neither less nor more of the measure is better.

    Examples
    --------
    >>> from comparisons.study.kinds import Measure
    >>> steps = Measure("steps", "steps to the goal", "steps", "less")
    >>> found = profile(Samples(steps, {"": {0: 3.0, 1: np.inf, 2: 4.0, 3: 4.0}}))
    >>> found.thresholds.tolist(), found.shares.tolist()
    ([3.0, 4.0], [0.25, 0.75])
    """
    values, sign = samples.values, better_sign(samples)
    given = values[np.isfinite(values)] if thresholds is None else np.asarray(thresholds, dtype=np.float64)
    given = np.unique(given)
    right = (sign * values >= sign * given[:, None]).sum(axis=1)
    bounds = np.array([wilson(int(count), len(values)) for count in right]).reshape(-1, 2)
    shares = right / max(len(values), 1)
    return Profile(given, shares, bounds[:, 0], bounds[:, 1], samples.runs, samples.seeds)


def improvement(first: Samples, second: Samples) -> Estimate | None:
    """Return the chance that a run of the first is better than one of the second; None if no task is common.

    A tie counts as half, also one of two runs that never got there. Chances are averaged over the tasks: the
    Precipice, section 4. Where every run of one beats every run of the other, or all tie, resampling shows
    no spread; Wilson's interval of as many seeds stands in then.

    Raises
    ------
    UserError
        If neither less nor more of the measure is better.

    Examples
    --------
    >>> from comparisons.study.kinds import Measure
    >>> steps = Measure("steps", "steps to the goal", "steps", "less")
    >>> one, other = (Samples(steps, {"": dict(enumerate(n))}) for n in ([1, 2, 3], [2, 3, np.inf]))
    >>> round(improvement(one, other).value, 3)  # 7 of 9 pairs, of which two are ties that count half
    0.778
    """
    sign = better_sign(first)
    common = {task: tuple(first.tasks[task]) for task in first.tasks if second.tasks.get(task)}
    if not common:
        return None
    first, second = first.keep(common), second.keep({task: second.tasks[task] for task in common})

    wins = []
    for one, other in zip(first.arrays, second.arrays, strict=True):
        x, y = sign * one[:, None], sign * other
        wins.append(0.5 * (x > y) + 0.5 * (x >= y))
    value = float(np.mean([win.mean() for win in wins]))

    def of(*rows: Array, axis: int) -> Array:
        assert axis == -1, "scipy resamples along the last axis"
        # How often each run is drawn is all that counts: a product of matrices in place of all pairs anew.
        drawn = [_counts(each) for each in rows]
        sides = zip(drawn[: len(wins)], wins, drawn[len(wins) :], strict=True)
        return np.asarray(
            np.mean([((one @ win) * other).sum(axis=-1) / win.size for one, win, other in sides], axis=0)
        )

    seeds = min(first.seeds, second.seeds)
    drawn = resampled([np.arange(len(each)) for each in (*first.arrays, *second.arrays)], of)
    low, high = inner(drawn, min(first.runs, second.runs), len(common))
    if low == high:
        low, high = wilson(round(value * seeds), seeds)
    runs, reached = first.runs + second.runs, first.reached + second.reached
    return Estimate(value, low, high, "improvement", runs, seeds, len(common), reached)


def _counts(rows: Array) -> Array:
    """Return how often each of the places 0..n-1 stands in each row; rows have shape (..., n)."""
    count = rows.shape[-1]
    flat = rows.reshape(-1, count).astype(np.int64)
    apart = flat + count * np.arange(len(flat))[:, None]
    return np.bincount(apart.ravel(), minlength=flat.size).reshape(rows.shape).astype(np.float64)


def better_sign(samples: Samples) -> int:
    """Return 1 if more of the measure is better, -1 if less is; refuse a measure of neither kind."""
    if samples.measure.better is None:
        raise UserError(
            f"{samples.measure.name}: neither less nor more of it is better, so that nothing can be ranked "
            "by it; choose another measure"
        )
    return 1 if samples.measure.better == "more" else -1


def _of(samples: Samples, statistic: str, value: float, low: float, high: float) -> Estimate:
    runs, tasks = samples.runs, len(samples.arrays)
    return Estimate(value, low, high, statistic, runs, samples.seeds, tasks, samples.reached, samples.untold)
