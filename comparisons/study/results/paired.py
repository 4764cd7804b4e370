"""Two levels compared run by run: those of the same task and seed are a pair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, sqrt
from typing import Final

import numpy as np
from scipy.stats import norm, rankdata

from comparisons.study.results.resampling import Array, inner, resampled
from comparisons.study.results.samples import Samples
from comparisons.study.results.statistics import (
    Estimate,
    Interval,
    aggregate,
    checked_statistic,
    estimate,
    improvement,
)

SIGNIFICANT: Final = 0.05
"""A difference is told as one where p is below this."""
_MOST_EXACT: Final = 200  # pairs; the exact distribution takes some 10 ms then
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
    p
        Of Wilcoxon's signed-rank test, both sides.
    corrected
        The same after Holm's correction for `tests` tests; as it is while nothing is corrected.
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
    p: float
    corrected: float
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
        return self.tests * 2.0 ** (1 - self.pairs) >= SIGNIFICANT


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
    # A reward's zero is anywhere: only what there can be none of, such as steps, has ratios.
    if one.measure.unit and one.measure.better != "more" and positive:
        ratio = _interval(_by(values), None if drawn is None else _by(drawn), one, least=0.0)
    gaps = paired_gaps(one, other)
    p = signed_rank(gaps)
    return Comparison(
        statistic,
        estimates[0],
        estimates[1],
        difference,
        ratio,
        None if one.measure.better is None else improvement(one, other),
        one.runs,
        one.seeds,
        len(one.arrays),
        unpaired,
        int(np.count_nonzero(gaps)),
        p,
        p,
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


def signed_rank(gaps: Sequence[float] | Array) -> float:
    """Return the p value of Wilcoxon's signed-rank test, both sides, of paired differences.

    Pairs that do not differ are left out, as Wilcoxon does (Biometrics Bulletin 1, 1945); equal ones share
    their middle rank, and infinite ones come last. Up to 200 pairs, the distribution is that of all ways to
    give these very ranks signs, so that ties do not make it less exact; beyond, it is the normal one of the
    same mean and variance.

    Examples
    --------
    >>> signed_rank([1.0, 2.0, 3.0, 4.0, 5.0, float("inf")]), signed_rank([1.0, 1.0, 1.0, -1.0])
    (0.03125, 0.625)
    >>> signed_rank([0.0, 0.0])
    1.0
    """
    given = np.asarray(gaps, dtype=np.float64)
    given = given[given != 0]
    if not len(given):
        return 1.0
    ranks = rankdata(np.abs(given))
    above = float(ranks[given > 0].sum())
    if len(given) > _MOST_EXACT:
        spread = sqrt(float((ranks**2).sum())) / 2
        return float(2 * norm.sf(abs(above - ranks.sum() / 2) / spread))
    # Middle ranks are multiples of a half: doubled, sums of them are places in an array.
    doubled = np.rint(2 * ranks).astype(np.int64)
    chances = np.zeros(int(doubled.sum()) + 1)
    chances[0] = 1.0
    for rank in doubled:
        shifted = np.concatenate([np.zeros(rank), chances[: len(chances) - rank]])
        chances = (chances + shifted) / 2
    place = round(2 * above)
    return float(min(2 * min(chances[: place + 1].sum(), chances[place:].sum()), 1.0))


def holm(values: Sequence[float]) -> list[float]:
    """Return p values corrected for there being many: Holm, Scandinavian Journal of Statistics 6 (1979).

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    order = sorted(range(len(values)), key=lambda i: values[i])
    corrected, least = [0.0] * len(values), 0.0
    for place, i in enumerate(order):
        least = max(least, min((len(values) - place) * values[i], 1.0))
        corrected[i] = least
    return corrected


def correct(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """Return comparisons of one question with their p values corrected for each other."""
    values = holm([comparison.p for comparison in comparisons])
    return [
        replace(comparison, corrected=value, tests=len(comparisons))
        for comparison, value in zip(comparisons, values, strict=True)
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
