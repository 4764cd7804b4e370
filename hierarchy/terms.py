"""Terms, which predicates compare, and the predicates that compare them.

A term is a state variable or a task's parameter. It makes predicates: that it equals another term or a
value, stands before or after it, or is one of a set of values.
"""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from hierarchy.predicates import AllOf, AnyOf, Predicate, Values
from worlds import StateIndex, Variable

Relation = Literal["<", "<=", ">", ">="]
_RELATIONS: Final = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


@dataclass(frozen=True)
class Constant:
    """A fixed value and the word for it."""

    value: Hashable
    label: str = field(default="", compare=False)

    def __str__(self) -> str:
        return self.label or str(self.value)


@dataclass(frozen=True)
class ValueSet:
    """A named set of values, such as the cells of a room."""

    name: str
    values: frozenset[Hashable]

    def __str__(self) -> str:
        return self.name


class Term(ABC):
    """Something with a name and a finite domain, that predicates compare."""

    @property
    @abstractmethod
    def domain(self) -> Variable:
        """The term's name, values and labels."""

    @property
    @abstractmethod
    def is_parameter(self) -> bool:
        """Whether this is a task's parameter, and not a state variable."""

    @property
    def name(self) -> str:
        """The term's name."""
        return self.domain.name

    def __str__(self) -> str:
        return self.name

    def eq(self, other: Term | Hashable) -> Predicate:
        """Return the predicate that this term equals another, or a value.

        Raises
        ------
        ValueError
            If the value is not in this term's domain.
        """
        return Equal(self, other if isinstance(other, Term) else self.constant(other))

    def ne(self, other: Term | Hashable) -> Predicate:
        """Return the predicate that this term differs from another, or from a value."""
        return ~self.eq(other)

    def lt(self, other: Term | Hashable) -> Predicate:
        """Return the predicate that this term stands before another, or before a value.

        The order is that of the values themselves; they must all be comparable.
        """
        return self._ordered("<", other)

    def le(self, other: Term | Hashable) -> Predicate:
        """Return the predicate that this term stands before or equals another, or a value."""
        return self._ordered("<=", other)

    def gt(self, other: Term | Hashable) -> Predicate:
        """Return the predicate that this term stands after another, or after a value."""
        return self._ordered(">", other)

    def ge(self, other: Term | Hashable) -> Predicate:
        """Return the predicate that this term stands after or equals another, or a value."""
        return self._ordered(">=", other)

    def _ordered(self, relation: Relation, other: Term | Hashable) -> Predicate:
        return Ordered(relation, self, other if isinstance(other, Term) else Constant(other))

    def isin(self, values: ValueSet | Iterable[Hashable]) -> Predicate:
        """Return the predicate that this term's value is one of `values`.

        Raises
        ------
        ValueError
            If one of them is not in this term's domain.
        """
        if not isinstance(values, ValueSet):
            chosen = frozenset(values)
            words = [self.domain.label(value) for value in self.domain.values if value in chosen]
            values = ValueSet("{" + ", ".join(words) + "}", chosen)
        for value in values.values:
            self.constant(value)
        return Member(self, values)

    def constant(self, value: Hashable) -> Constant:
        """Return a value of this term's domain with its label."""
        if value not in self.domain:
            raise ValueError(
                f"{value!r} is not a value of {self.name!r}; its values are {', '.join(self.domain.labels)}"
            )
        return Constant(value, self.domain.label(value))


@dataclass(frozen=True)
class Var(Term):
    """A state variable, as predicates and bindings name it."""

    variable: Variable

    @property
    def domain(self) -> Variable:
        """The state variable itself."""
        return self.variable

    @property
    def is_parameter(self) -> bool:
        """A state variable is no parameter."""
        return False

    __str__ = Term.__str__


@dataclass(frozen=True)
class Param(Term):
    """A parameter of a task.

    Examples
    --------
    >>> door = Param.over("door", {"D1": (2, 4), "D2": (5, 4)})
    >>> print(door, door.domain.labels)
    door ('D1', 'D2')
    """

    parameter: Variable

    @classmethod
    def over(cls, name: str, values: Mapping[str, Hashable]) -> Param:
        """Return a parameter that ranges over labelled values."""
        return cls(Variable(name, tuple(values.values()), tuple(values)))

    @property
    def domain(self) -> Variable:
        """The parameter's name, values and labels."""
        return self.parameter

    @property
    def is_parameter(self) -> bool:
        """A parameter is one."""
        return True

    __str__ = Term.__str__


@dataclass(frozen=True)
class Equal(Predicate):
    """A term equals another term or a value."""

    left: Term
    right: Term | Constant

    def __str__(self) -> str:
        return f"{self.left} = {self.right}"

    def terms(self) -> Iterator[Term]:
        yield self.left
        if isinstance(self.right, Term):
            yield self.right

    def bind(self, binding: Mapping[str, Constant]) -> Predicate:
        left, right = _bound(self.left, binding), _bound(self.right, binding)
        if isinstance(left, Constant):
            if isinstance(right, Constant):
                return AllOf(()) if left == right else AnyOf(())
            left, right = right, left
        return Equal(left, right)

    def mask(self, index: StateIndex) -> NDArray[np.bool_]:
        if isinstance(self.right, Constant):
            domain = index.variable(self.left.name)
            if self.right.value not in domain:
                return np.zeros(index.size, dtype=np.bool_)
            return np.equal(index.column(self.left.name), domain.position(self.right.value))
        codes: dict[Hashable, int] = {}
        left, right = (
            np.array([codes.setdefault(v, len(codes)) for v in term.domain.values])[index.column(term.name)]
            for term in (self.left, self.right)
        )
        same: NDArray[np.bool_] = left == right
        return same

    def holds(self, values: Values) -> bool:
        right = self.right.value if isinstance(self.right, Constant) else values[self.right.name]
        return bool(values[self.left.name] == right)


@dataclass(frozen=True)
class Ordered(Predicate):
    """A term stands before or after another term or a value, in the values' own order."""

    relation: Relation
    left: Term | Constant
    right: Term | Constant

    def __str__(self) -> str:
        return f"{self.left} {self.relation} {self.right}"

    def terms(self) -> Iterator[Term]:
        yield from (side for side in (self.left, self.right) if isinstance(side, Term))

    def bind(self, binding: Mapping[str, Constant]) -> Predicate:
        return replace(self, left=_bound(self.left, binding), right=_bound(self.right, binding))

    def mask(self, index: StateIndex) -> NDArray[np.bool_]:
        (left, rows), (right, cols) = _column(self.left, index), _column(self.right, index)
        table = np.array([[self._compare(a, b) for b in right] for a in left], dtype=np.bool_)
        mask: NDArray[np.bool_] = table[rows, cols]
        return mask

    def holds(self, values: Values) -> bool:
        sides = (s.value if isinstance(s, Constant) else values[s.name] for s in (self.left, self.right))
        return self._compare(*sides)

    def _compare(self, left: Any, right: Any) -> bool:
        return bool(_RELATIONS[self.relation](left, right))


@dataclass(frozen=True)
class Member(Predicate):
    """A term's value is in a set."""

    left: Term
    right: ValueSet

    def __str__(self) -> str:
        return f"{self.left} in {self.right}"

    def terms(self) -> Iterator[Term]:
        yield self.left

    def bind(self, binding: Mapping[str, Constant]) -> Predicate:
        left = _bound(self.left, binding)
        if isinstance(left, Constant):
            return AllOf(()) if left.value in self.right.values else AnyOf(())
        return replace(self, left=left)

    def mask(self, index: StateIndex) -> NDArray[np.bool_]:
        member = np.array([value in self.right.values for value in index.variable(self.left.name).values])
        mask: NDArray[np.bool_] = member[index.column(self.left.name)]
        return mask

    def holds(self, values: Values) -> bool:
        return values[self.left.name] in self.right.values


def _column(side: Term | Constant, index: StateIndex) -> tuple[tuple[Hashable, ...], NDArray[np.int64]]:
    """Return the values that a side may take, and the place of each state's among them."""
    if isinstance(side, Constant):
        return (side.value,), np.zeros(index.size, dtype=np.int64)
    return index.variable(side.name).values, index.column(side.name)


def _bound(term: Term | Constant, binding: Mapping[str, Constant]) -> Term | Constant:
    return binding.get(term.name, term) if isinstance(term, Param) else term
