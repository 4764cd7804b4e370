"""Two levels compared run by run: those of the same task and seed are a pair."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Final

import numpy as np

from comparisons.study.results.resampling import Array, inner, resampled
from comparisons.study.results.samples import Samples
from comparisons.study.results.significance import SIGNIFICANT, holm, leaning, least_p, signed_rank
from comparisons.study.results.sizes import apart, has_ratio
from comparisons.study.results.statistics import (
    Estimate,
    Interval,
    aggregate,
    checked_statistic,
    estimate,
    improvement,
)

_DIGITS: Final = 12  # of differences: sums of floats that should tie differ by less


@dataclass(frozen=True)
class Comparison:
    """How a level differs from another on the same tasks and seeds.

    Parameters
    ----------
    statistic
        What is compared: "iqm", "median" or "mean".
    first, second
        Estimates, over the paired runs alone.
    difference
        First less second; infinite where one of the two is. None where both are infinite.
    ratio
        First by second. None for shares, where more is better, where a number is negative or one of the
        second is zero, and where both are infinite.
    chance
        That a run of the first is better than one of the second; None if neither less nor more is better.
    pairs, seeds, tasks
        Number of pairs, of seeds of the task that has fewest, and of tasks.
    unpaired
        Number of runs that are left out since the other side has none of their task and seed.
    differing
        Number of pairs that differ at all.
    apart
        How many times the smallest task's size the largest task's is (`comparisons.study.results.sizes`).
    ahead
        Which side has more pair by pair, by the signed ranks: 1 if the first has, -1 if the second, 0 if
        neither. It need not be the side of the larger statistic.
    p
        Of Wilcoxon's signed-rank test, both sides.
    corrected
        The same after Holm's correction for `tests` tests; as it is while nothing is corrected.
    least
        What `corrected` would be if every pair differed, and all of them the same way.
    tests
        Number of tests that it is corrected for.
    """

    statistic: str
    first: Estimate
    second: Estimate
    difference: Interval | None
    ratio: Interval | None
    chance: Estimate | None
    pairs: int
    seeds: int
    tasks: int
    unpaired: int
    differing: int
    apart: float
    ahead: int
    p: float
    corrected: float
    least: float
    tests: int = 1

    @property
    def few(self) -> bool:
        """Whether there are too few seeds to rank."""
        return self.first.few

    @property
    def significant(self) -> bool:
        """Whether there is a difference that is not chance."""
        return self.corrected < SIGNIFICANT

    @property
    def powerless(self) -> bool:
        """Whether the test could not have shown a difference, even if every pair agreed."""
        return self.least >= SIGNIFICANT

    @property
    def clear(self) -> bool:
        """Whether the interval, of the ratio if there is one, leaves out that there is no difference."""
        interval, none = (self.difference, 0.0) if self.ratio is None else (self.ratio, 1.0)
        return interval is not None and not interval.low <= none <= interval.high

    @property
    def contrary(self) -> bool:
        """Whether the side that has more pair by pair has the smaller statistic."""
        return self.difference is not None and self.difference.value * self.ahead < 0


def compare(first: Samples, second: Samples, statistic: str = "iqm") -> Comparison | None:
    """Return how the first differs from the second; None if they have no pair.

    Parameters
    ----------
    first, second
        Numbers of the same measure.
    statistic
        "iqm", "median" or "mean".

    Notes
    -----
    The bootstrap resamples pairs within each task, and both statistics are taken of the same pairs. A
    resample in which both are infinite could be of any difference: it widens the interval on either side.

    Examples
    --------
    >>> from comparisons.study.kinds import Measure
    >>> steps = Measure("steps", "steps to the goal", "steps", "less")
    >>> slow = Samples(steps, {"": dict(enumerate([12.0, 14, 16, 18, 20, 22]))})
    >>> fast = Samples(steps, {"": dict(enumerate([6.0, 7, 8, 9, 10, 11]))})
    >>> found = compare(slow, fast)
    >>> found.difference.value, found.ratio, found.p
    (8.5, Interval(value=2.0, low=2.0, high=2.0), 0.03125)
    """
    named = checked_statistic(statistic)
    common = {task: set(first.tasks[task]) & set(second.tasks.get(task, ())) for task in first.tasks}
    common = {task: seeds for task, seeds in common.items() if seeds}
    one, other = first.keep(common), second.keep(common)
    unpaired = first.runs + second.runs - 2 * one.runs
    estimates = estimate(one, statistic), estimate(other, statistic)
    if estimates[0] is None or estimates[1] is None:
        return None

    def both(*rows: Array, axis: int) -> Array:
        assert axis == -1, "scipy resamples along the last axis"
        drawn = [row.astype(np.int64) for row in rows]
        sides = (one.arrays, other.arrays)
        taken = (np.concatenate([side[i][row] for i, row in enumerate(drawn)], axis=-1) for side in sides)
        return np.stack([aggregate(numbers, named) for numbers in taken])

    drawn = resampled([np.arange(len(numbers)) for numbers in one.arrays], both)
    values = np.array([[estimates[0].value], [estimates[1].value]])
    difference = _interval(_less(values), None if drawn is None else _less(drawn), one)
    ratio = None
    positive = one.values.min() >= 0 and other.values.min() > 0
    if has_ratio(one.measure) and positive:
        ratio = _interval(_by(values), None if drawn is None else _by(drawn), one, least=0.0)
    gaps = paired_gaps(one, other)
    p = signed_rank(gaps)
    return Comparison(
        statistic=statistic,
        first=estimates[0],
        second=estimates[1],
        difference=difference,
        ratio=ratio,
        chance=None if one.measure.better is None else improvement(one, other),
        pairs=one.runs,
        seeds=one.seeds,
        tasks=len(one.arrays),
        unpaired=unpaired,
        differing=int(np.count_nonzero(gaps)),
        apart=apart(other),
        ahead=leaning(gaps),
        p=p,
        corrected=p,
        least=least_p(one.runs),
    )


def paired_gaps(first: Samples, second: Samples) -> Array:
    """Return how much each run of the first has more than its twin, shape (pairs,).

    Two runs that never got there are as good as each other. Positive gaps are worse where less is better.
    """
    x, y = first.values, second.values
    finite = np.abs(np.concatenate([x, y]))
    scale = float(finite[np.isfinite(finite)].max(initial=0.0))
    with np.errstate(invalid="ignore"):
        gaps = np.where(x == y, 0.0, x - y)
    if scale:
        gaps = np.round(gaps / scale, _DIGITS) * scale
    return np.asarray(gaps)


def correct(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """Return comparisons of one question with their p values corrected for each other."""
    given = [comparison.p for comparison in comparisons]
    corrected, tests = holm(given), len(given)
    before, sofar = sorted(given), sorted(corrected)

    def best(p: float) -> float:
        """Return the correction of a p value that stands in for one at least as large."""
        place = bisect_left(before, p)
        return max(min((tests - place) * p, 1.0), sofar[place - 1] if place else 0.0)

    return [
        replace(comparison, corrected=value, least=best(least_p(comparison.pairs)), tests=tests)
        for comparison, value in zip(comparisons, corrected, strict=True)
    ]


def _interval(value: Array, drawn: Array | None, samples: Samples, least: float = -inf) -> Interval | None:
    """Return an interval of what may be unknown (not a number); None if the value itself is."""
    if np.isnan(value[0]):
        return None
    if drawn is None:
        return Interval(float(value[0]), -inf, inf)
    low, _ = inner(np.where(np.isnan(drawn), least, drawn), samples.runs, len(samples.arrays))
    _, high = inner(np.where(np.isnan(drawn), inf, drawn), samples.runs, len(samples.arrays))
    return Interval(float(value[0]), low, high)


def _less(sides: Array) -> Array:
    with np.errstate(invalid="ignore"):
        return np.asarray(sides[0] - sides[1])


def _by(sides: Array) -> Array:
    with np.errstate(invalid="ignore"):
        return np.asarray(sides[0] / sides[1])
