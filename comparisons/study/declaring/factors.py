"""Factors of a study, their levels, and the combinations of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod
from typing import Final

from comparisons.study.declaring.schema import StudyText
from comparisons.study.declaring.written import Written, value_of
from comparisons.study.spec import Value
from hierarchy.text_nodes import Path

MOST_COMBINATIONS: Final = 1_000_000
"""How many combinations are looked through for those that are not left out."""


@dataclass(frozen=True)
class Level:
    """A level of a factor: its label, and the settings that it stands for."""

    label: str
    settings: Mapping[str, Value]


@dataclass(frozen=True)
class Factor:
    """What a study varies.

    Parameters
    ----------
    name
        Such as "gamma".
    levels
        In the file's order; their labels are distinct.
    bundled
        Whether the file gives labels with settings, rather than values of the setting of the factor's name.

    Examples
    --------
    >>> gamma = Factor("gamma", (Level("1", {"gamma": 1}), Level(".9", {"gamma": 0.9})))
    >>> gamma.labels, gamma.numbers
    (('1', '.9'), (1.0, 0.9))
    """

    name: str
    levels: tuple[Level, ...]
    bundled: bool = False

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """The levels' labels."""
        return tuple(level.label for level in self.levels)

    @cached_property
    def _places(self) -> Mapping[str, int]:
        return {label: place for place, label in enumerate(self.labels)}

    @property
    def numbers(self) -> tuple[float, ...] | None:
        """What the labels say as numbers; None unless each is one."""
        found = []
        for label in self.labels:
            try:
                value = value_of(label)
            except ValueError:
                return None
            if isinstance(value, bool) or not isinstance(value, int | float):
                return None
            found.append(float(value))
        return tuple(found)

    def place(self, level: Level, *setting: str) -> Path:
        """Return where in the file a level stands, or where it sets a setting."""
        if self.bundled:
            return ("vary", self.name, level.label, *setting)
        return ("vary", self.name, self._places[level.label])


Chosen = tuple[Level, ...]
"""One level of each factor, in the factors' order."""


def factors_of(text: StudyText) -> tuple[Factor, ...]:
    """Return the factors of a file."""
    factors = []
    for name, given in text.vary.items():
        if isinstance(given, dict):
            levels = tuple(Level(label, _values(bundle)) for label, bundle in given.items())
        else:
            levels = tuple(Level(each.text, {name: each.value}) for each in given)
        factors.append(Factor(name, levels, isinstance(given, dict)))
    return tuple(factors)


def _values(bundle: Mapping[str, Written]) -> dict[str, Value]:
    return {name: each.value for name, each in bundle.items()}


def combinations(
    factors: Sequence[Factor], leave_out: Sequence[Mapping[str, str]]
) -> tuple[Chosen, ...] | None:
    """Return every combination of levels that is not left out, the last factor's levels changing first.

    Parameters
    ----------
    factors
        The factors; without any, there is one combination, of nothing.
    leave_out
        Labels by factors' names. Combinations that have all the labels of one of these are left out.

    Returns
    -------
    tuple or None
        The combinations; None if there are more than can be looked through.

    Examples
    --------
    >>> two = Factor("a", (Level("1", {}), Level("2", {}))), Factor("b", (Level("x", {}), Level("y", {})))
    >>> for chosen in combinations(two, [{"a": "2", "b": "x"}]) or ():
    ...     print(*(level.label for level in chosen))
    1 x
    1 y
    2 y
    """
    if prod(len(factor.levels) for factor in factors) > MOST_COMBINATIONS:
        return None
    places = {factor.name: place for place, factor in enumerate(factors)}
    barred = [[(places[name], label) for name, label in labels.items()] for labels in leave_out]
    return tuple(
        chosen
        for chosen in product(*(factor.levels for factor in factors))
        if not any(all(chosen[place].label == label for place, label in labels) for labels in barred)
    )
