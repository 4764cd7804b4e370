"""The answer to a study's question: a sentence for each level that is compared, with its interval."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from comparisons.study.kinds import Measure
from comparisons.study.results.paired import Comparison, compare, correct
from comparisons.study.results.rows import L, Levelled, Levels, Row, by_levels, level_words
from comparisons.study.results.samples import Samples, samples_of
from comparisons.study.results.sentences import Sides, sentence


class Asked(Protocol):
    """What a study file says under ``answer``."""

    @property
    def measure(self) -> str:
        """Name of the measure."""

    @property
    def compare(self) -> str:
        """The factor whose levels are compared."""

    @property
    def against(self) -> str:
        """The level that the others are compared with."""

    @property
    def within(self) -> Sequence[str]:
        """Factors at each of whose levels the comparison is made by itself."""

    @property
    def statistic(self) -> str:
        """What sums up the runs: "iqm", "median" or "mean"."""


@dataclass(frozen=True)
class Told:
    """One comparison of the answer.

    Parameters
    ----------
    within
        Where it is made: one level's label by factor.
    factor, level, against
        What is compared: a level of the factor with another.
    comparison
        How they differ; None if no task and seed has a result of both.
    missing
        Number of runs of the two that were declared and have no result.
    sentence
        The same in words.
    """

    within: Levels
    factor: str
    level: str
    against: str
    comparison: Comparison | None
    missing: int
    sentence: str


def answers(
    asked: Asked, measure: Measure, rows: Sequence[Row], missing: Iterable[Levelled] = ()
) -> list[Told]:
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
    ...     measure=steps.name, compare="gamma", against="1", within=(), statistic="iqm"
    ... )
    >>> for part in answers(asked, steps, rows)[0].sentence.split("; "):
    ...     print(part)
    gamma 0.9 needs 1.50 times (95 % 1.50 to 1.50) the steps of gamma 1 until every start is optimal
    IQMs of 20 seeds each, paired, p < 0.0001.
    """
    absent = list(missing)
    everything: list[Levelled] = [*rows, *absent]
    factors = list(everything[0].levels) if everything else []
    tasks = [name for name in factors if name != asked.compare and name not in asked.within]
    found: list[_Pair] = []
    for place in by_levels(everything, asked.within):
        within = dict(zip(asked.within, place, strict=True))
        here = by_levels(_at(rows, within), [asked.compare])
        gone = by_levels(_at(absent, within), [asked.compare])
        samples = {level: samples_of(alike, measure, tasks) for (level,), alike in here.items()}
        base = samples.get(asked.against, Samples(measure, {}))
        for (level,) in by_levels(_at(everything, within), [asked.compare]):
            if level == asked.against:
                continue
            other = samples.get(level, Samples(measure, {}))
            sides = Sides(
                level_words(within),
                f"{asked.compare} {level}",
                f"{asked.compare} {asked.against}",
                measure,
                sum(len(gone.get((side,), [])) for side in (level, asked.against)),
                other.untold + base.untold,
            )
            found.append(_Pair(within, level, sides, compare(other, base, asked.statistic)))
    return _told(asked, found)


class _Pair(NamedTuple):
    within: Levels
    level: str
    sides: Sides
    comparison: Comparison | None


def _told(asked: Asked, found: Sequence[_Pair]) -> list[Told]:
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
    return told


def _at(rows: Iterable[L], within: Levels) -> list[L]:
    """Return the rows at some levels."""
    return [row for row in rows if all(row.levels[name] == label for name, label in within.items())]
