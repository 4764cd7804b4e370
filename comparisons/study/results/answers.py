"""The answer to a study's question: a sentence for each comparison, and what sums them up."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from comparisons.study.kinds import Measure
from comparisons.study.results.leads import summary
from comparisons.study.results.paired import Comparison, compare, correct
from comparisons.study.results.question import Asked, Place, Told
from comparisons.study.results.rows import L, Levelled, Levels, Row, by_levels, level_words
from comparisons.study.results.samples import Samples, samples_of
from comparisons.study.results.sentences import NO_PAIR, Sides, sentence
from comparisons.study.results.sizes import counted_in, counted_measure, sizes_of, warning
from comparisons.study.results.wording import plain


@dataclass(frozen=True)
class Answered:
    """The whole answer.

    Parameters
    ----------
    caution
        Sentences that say what to know before; often none.
    summary
        Sentences that sum many comparisons up; none where there are few.
    told
        The comparisons.
    measure
        What they compare: the measure, or multiples of a task's size of it.
    """

    caution: tuple[str, ...]
    summary: tuple[str, ...]
    told: tuple[Told, ...]
    measure: Measure


def answers(
    asked: Asked, measure: Measure, rows: Sequence[Row], missing: Iterable[Levelled] = ()
) -> Answered:
    """Return the answer: a comparison for each level but the one compared with, wherever it is made.

    Factors that are neither compared nor of ``within`` are the tasks. All p values are corrected together.

    Parameters
    ----------
    asked
        The question.
    measure
        The kind's measure of the name that is asked for: ``kind(study.kind).measure(asked.measure)``.
    rows
        Runs with their results, in the plan's order.
    missing
        Planned runs without a result.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from comparisons.study.kinds import Result
    >>> steps = Measure("steps_to_optimal", "steps until every start is optimal", "steps", "less")
    >>> rows = [
    ...     Row({"gamma": gamma}, seed, "", Result({steps.name: times * (1000.0 + seed)}))
    ...     for gamma, times in (("1", 1.0), ("0.9", 1.5))
    ...     for seed in range(20)
    ... ]
    >>> asked = SimpleNamespace(
    ...     measure=steps.name, compare="gamma", against="1", within=(), statistic="iqm", normalise="none"
    ... )
    >>> for part in answers(asked, steps, rows).told[0].sentence.split("; "):
    ...     print(part)
    gamma 0.9 needs 1.50 times (95 % 1.50 to 1.50) the steps of gamma 1 until every start is optimal
    IQMs of 20 seeds each, paired, p < 0.0001.
    """
    absent = list(missing)
    everything: list[Levelled] = [*rows, *absent]
    factors = list(everything[0].levels) if everything else []
    tasks = [name for name in factors if name != asked.compare and name not in asked.within]
    against = f"{asked.compare} {asked.against}"
    shown = counted_measure(measure, against) if asked.normalise == "against" else measure
    found: list[_Pair] = []
    places: list[Place] = []
    for place in by_levels(everything, asked.within):
        within = dict(zip(asked.within, place, strict=True))
        here = by_levels(_at(rows, within), [asked.compare])
        gone = by_levels(_at(absent, within), [asked.compare])
        samples = {level: samples_of(alike, measure, tasks) for (level,), alike in here.items()}
        reason = NO_PAIR
        if asked.normalise == "against":
            samples, reason = _normalised(samples, asked.against, against)
        places.append(Place(within, samples))
        nothing = Samples(shown, {})
        base = samples.get(asked.against, nothing)
        for (level,) in by_levels(_at(everything, within), [asked.compare]):
            if level == asked.against:
                continue
            other = samples.get(level, nothing)
            sides = Sides(
                level_words(within),
                f"{asked.compare} {level}",
                against,
                shown,
                sum(len(gone.get((side,), [])) for side in (level, asked.against)),
                other.untold + base.untold,
                reason,
            )
            found.append(_Pair(within, level, sides, compare(other, base, asked.statistic)))
    told = _told(asked, found)
    mixed = warning(max((each.comparison.apart for each in told if each.comparison), default=1.0), shown)
    return Answered((mixed,) if mixed else (), summary(asked, shown, told, places), told, shown)


class _Pair(NamedTuple):
    within: Levels
    level: str
    sides: Sides
    comparison: Comparison | None


def _normalised(samples: Mapping[str, Samples], level: str, words: str) -> tuple[dict[str, Samples], str]:
    """Return numbers in medians of a level by task; none, and why, if that cannot be."""
    if level not in samples:
        return {}, NO_PAIR
    sizes = sizes_of(samples[level])
    unfit = next((task for task, size in sizes.items() if not 0 < size < inf), None)
    if unfit is not None:
        told = f"never reached in {unfit}" if sizes[unfit] == inf else f"{plain(sizes[unfit])} in {unfit}"
        return {}, f"the median of {words} is {told.removesuffix(' in ')}, and nothing can be counted in it"
    return {name: counted_in(each, sizes, words) for name, each in samples.items()}, NO_PAIR


def _told(asked: Asked, found: Sequence[_Pair]) -> tuple[Told, ...]:
    """Return comparisons with their sentences; what rests on too few seeds is not ranked, and no test."""
    tested = {
        i: pair.comparison for i, pair in enumerate(found) if pair.comparison and not pair.comparison.few
    }
    corrected = dict(zip(tested, correct(list(tested.values())), strict=True))
    told = []
    for i, (within, level, sides, uncorrected) in enumerate(found):
        comparison = corrected.get(i, uncorrected)
        words = sentence(sides, comparison)
        told.append(Told(within, asked.compare, level, asked.against, comparison, sides.missing, words))
    return tuple(told)


def _at(rows: Iterable[L], within: Levels) -> list[L]:
    """Return the rows at some levels."""
    return [row for row in rows if all(row.levels[name] == label for name, label in within.items())]
