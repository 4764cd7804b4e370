"""What the runs of a study found, as rows: one for each run that has a result."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from comparisons.study.kinds import Result
from comparisons.study.spec import RunSpec

Levels = Mapping[str, str]
"""One level's label by factor."""


class Levelled(Protocol):
    """Anything that stands at one level of each factor: a row, or a run that is planned."""

    @property
    def levels(self) -> Levels:
        """One level's label by factor."""


class Planned(Levelled, Protocol):
    """A run that a study declares."""

    @property
    def spec(self) -> RunSpec:
        """What it is to do."""


class Kept(Protocol):
    """A run as a store keeps it."""

    @property
    def spec(self) -> RunSpec:
        """What it did."""

    @property
    def result(self) -> Result:
        """What it found."""

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Where the result is from."""


class KeptRuns(Protocol):
    """A store, as far as its results are read."""

    def hashes(self) -> Iterable[str]:
        """Return the hashes of the runs whose results it has."""

    def read(self, run_hash: str, /) -> Kept:
        """Return a run by its hash."""


@dataclass(frozen=True)
class Row:
    """A run with its result.

    Parameters
    ----------
    levels
        One level's label by factor.
    seed
        Of the run.
    hash
        Of its spec.
    result
        What it found.
    """

    levels: Levels
    seed: int
    hash: str
    result: Result


L = TypeVar("L", bound=Levelled)


def by_levels(rows: Iterable[L], factors: Sequence[str]) -> dict[tuple[str, ...], list[L]]:
    """Return rows by their levels of some factors, in the order in which these first come.

    Examples
    --------
    >>> rows = [Row({"gamma": gamma}, seed, "", Result({})) for gamma in ("1", "0.9") for seed in (0, 1)]
    >>> {levels: [row.seed for row in found] for levels, found in by_levels(rows, ["gamma"]).items()}
    {('1',): [0, 1], ('0.9',): [0, 1]}
    """
    found: dict[tuple[str, ...], list[L]] = {}
    for row in rows:
        found.setdefault(tuple(row.levels[factor] for factor in factors), []).append(row)
    return found


def level_words(levels: Levels, factors: Iterable[str] | None = None) -> str:
    """Return levels as text, all of them unless factors are named.

    Examples
    --------
    >>> level_words({"learner": "maxq-0", "gamma": "0.9"})
    'learner maxq-0, gamma 0.9'
    """
    return ", ".join(f"{name} {levels[name]}" for name in (levels if factors is None else factors))
