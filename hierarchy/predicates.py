"""Predicates over state variables and parameters, as data: what they can do, and their connectives.

A predicate prints as it is meant, compares equal to another of the same meaning and form, knows what it
reads, and evaluates on one state or on all states at once. What compares terms is in `hierarchy.terms`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from worlds import StateIndex

if TYPE_CHECKING:  # terms make predicates, and predicates yield terms
    from hierarchy.terms import Constant, Term

Values = Mapping[str, Hashable]
"""A state, or a binding, by name."""


class Predicate(ABC):
    """A condition over state variables and parameters."""

    @abstractmethod
    def terms(self) -> Iterator[Term]:
        """Yield every variable and parameter that the predicate reads."""

    @abstractmethod
    def bind(self, binding: Mapping[str, Constant]) -> Predicate:
        """Return the predicate with parameters replaced by values."""

    @abstractmethod
    def mask(self, index: StateIndex) -> NDArray[np.bool_]:
        """Return where the predicate holds, shape (states,); every parameter must be bound."""

    @abstractmethod
    def holds(self, values: Values) -> bool:
        """Return whether the predicate holds for a state, and a binding, given by name."""

    def variables(self) -> frozenset[str]:
        """Return the names of the state variables that the predicate reads."""
        return frozenset(term.name for term in self.terms() if not term.is_parameter)

    def parameters(self) -> frozenset[str]:
        """Return the names of the parameters that the predicate reads."""
        return frozenset(term.name for term in self.terms() if term.is_parameter)

    def implies(self, other: Predicate) -> Predicate:
        """Return the predicate that the other holds wherever this one does."""
        return Implies(self, other)

    def __and__(self, other: Predicate) -> Predicate:
        return AllOf((*_parts(self, AllOf), *_parts(other, AllOf)))

    def __or__(self, other: Predicate) -> Predicate:
        return AnyOf((*_parts(self, AnyOf), *_parts(other, AnyOf)))

    def __invert__(self) -> Predicate:
        return self.inner if isinstance(self, Not) else Not(self)

    def __bool__(self) -> bool:
        raise TypeError("a predicate is data, not a truth value; combine predicates with &, | and ~")


@dataclass(frozen=True)
class Implies(Predicate):
    """Where one predicate holds, another does."""

    premise: Predicate
    conclusion: Predicate

    def __str__(self) -> str:
        return f"({self.premise}) implies ({self.conclusion})"

    def terms(self) -> Iterator[Term]:
        yield from self.premise.terms()
        yield from self.conclusion.terms()

    def bind(self, binding: Mapping[str, Constant]) -> Predicate:
        return Implies(self.premise.bind(binding), self.conclusion.bind(binding))

    def mask(self, index: StateIndex) -> NDArray[np.bool_]:
        return ~self.premise.mask(index) | self.conclusion.mask(index)

    def holds(self, values: Values) -> bool:
        return not self.premise.holds(values) or self.conclusion.holds(values)


@dataclass(frozen=True)
class Not(Predicate):
    """A predicate does not hold."""

    inner: Predicate

    def __str__(self) -> str:
        return f"not ({self.inner})"

    def terms(self) -> Iterator[Term]:
        yield from self.inner.terms()

    def bind(self, binding: Mapping[str, Constant]) -> Predicate:
        return Not(self.inner.bind(binding))

    def mask(self, index: StateIndex) -> NDArray[np.bool_]:
        return ~self.inner.mask(index)

    def holds(self, values: Values) -> bool:
        return not self.inner.holds(values)


@dataclass(frozen=True)
class _Joined(Predicate):
    """Several predicates under one connective."""

    parts: tuple[Predicate, ...]

    def terms(self) -> Iterator[Term]:
        for part in self.parts:
            yield from part.terms()

    def bind(self, binding: Mapping[str, Constant]) -> Predicate:
        return replace(self, parts=tuple(part.bind(binding) for part in self.parts))

    def _write(self, word: str, empty: str) -> str:
        texts = [f"({p})" if _is_compound(p) else str(p) for p in self.parts]
        return f" {word} ".join(texts) if texts else empty


@dataclass(frozen=True)
class AllOf(_Joined):
    """Every part holds; with no parts, always."""

    def __str__(self) -> str:
        return self._write("and", "always")

    def mask(self, index: StateIndex) -> NDArray[np.bool_]:
        mask = np.ones(index.size, dtype=np.bool_)
        for part in self.parts:
            mask &= part.mask(index)
        return mask

    def holds(self, values: Values) -> bool:
        return all(part.holds(values) for part in self.parts)


@dataclass(frozen=True)
class AnyOf(_Joined):
    """Some part holds; with no parts, never."""

    def __str__(self) -> str:
        return self._write("or", "never")

    def mask(self, index: StateIndex) -> NDArray[np.bool_]:
        mask = np.zeros(index.size, dtype=np.bool_)
        for part in self.parts:
            mask |= part.mask(index)
        return mask

    def holds(self, values: Values) -> bool:
        return any(part.holds(values) for part in self.parts)


ALWAYS: Predicate = AllOf(())
"""The predicate that holds everywhere."""


def _is_compound(predicate: Predicate) -> bool:
    """Return whether a predicate needs parentheses inside another."""
    return isinstance(predicate, Implies) or (isinstance(predicate, _Joined) and bool(predicate.parts))


def _parts(predicate: Predicate, kind: type[_Joined]) -> tuple[Predicate, ...]:
    return predicate.parts if isinstance(predicate, kind) else (predicate,)
