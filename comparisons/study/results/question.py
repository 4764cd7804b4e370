"""A study's question, and each comparison that answers it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from comparisons.study.results.paired import Comparison
from comparisons.study.results.rows import Levels
from comparisons.study.results.samples import Samples


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

    @property
    def normalise(self) -> str:
        """What numbers are divided by: "none", or "against", their task's median of that level."""


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


class Place(NamedTuple):
    """Where comparisons are made: one level's label by factor, and all numbers there, by level."""

    within: Levels
    samples: Mapping[str, Samples]
