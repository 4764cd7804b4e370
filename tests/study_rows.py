"""Hand-made results of studies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from comparisons.study.kinds import Measure, Result
from comparisons.study.results.rows import Row
from comparisons.study.results.samples import Samples
from comparisons.study.spec import RunSpec

STEPS = Measure("steps_to_optimal", "environment steps until every start is optimal", "steps", "less")
OPTIMAL = Measure("optimal", "affordances that are proved optimal first actions", "", "more")
RETURN = Measure("mean_return", "mean return at the end", "reward", "more")
COST = Measure("cost_per_mistake", "steps that a mistake costs", "steps")
MOSTLY_NEVER: tuple[float | None, ...] = (*[None] * 12, *[3000.0] * 8)
"""Steps of 20 runs, of which 12 never got there."""


def wave(level: float, count: int = 20) -> list[float]:
    """Return numbers around a level, different for each seed."""
    return [level * (1 + 0.02 * ((7 * seed) % 11 - 5)) for seed in range(count)]


def samples(*tasks: Sequence[float], measure: Measure = STEPS) -> Samples:
    """Return numbers of a measure, each task's with seeds from 0."""
    return Samples(measure, {f"task {i}": dict(enumerate(map(float, each))) for i, each in enumerate(tasks)})


def rows(
    measure: Measure, by_level: Mapping[str, Sequence[float | None]], factor: str = "gamma", **fixed: str
) -> list[Row]:
    """Return rows of a factor's levels, a number for each seed from 0, at fixed levels of other factors."""
    return [
        Row({factor: level, **fixed}, seed, f"{level}-{seed}-{fixed}", Result({measure.name: value}))
        for level, values in by_level.items()
        for seed, value in enumerate(values)
    ]


@dataclass(frozen=True)
class Asked:
    """A question."""

    measure: str = STEPS.name
    compare: str = "gamma"
    against: str = "1"
    within: tuple[str, ...] = ()
    statistic: str = "iqm"
    normalise: str = "none"


@dataclass(frozen=True)
class Planned:
    """A run that is planned."""

    spec: RunSpec
    levels: Mapping[str, str]


@dataclass(frozen=True)
class Kept:
    """A run that is kept."""

    spec: RunSpec
    result: Result
    provenance: Mapping[str, Any] = field(default_factory=dict)


class Shelf:
    """A store in memory."""

    def __init__(self, *kept: Kept) -> None:
        self.kept = {each.spec.hash: each for each in kept}

    def hashes(self) -> Sequence[str]:
        """Return the names of all runs."""
        return tuple(self.kept)

    def read(self, run_hash: str) -> Kept:
        """Return a run."""
        return self.kept[run_hash]
