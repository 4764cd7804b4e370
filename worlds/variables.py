"""Discrete state variables, and the index that numbers every joint state."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Variable:
    """One discrete state variable.

    Parameters
    ----------
    name
        The variable's name, unique in its world.
    values
        Its domain, in order; values are hashable and distinct.
    labels
        A word for each value, used wherever a value is printed. Defaults to ``str(value)``.

    Raises
    ------
    ValueError
        If the domain is empty, holds a value twice, or the labels do not fit it.

    Examples
    --------
    >>> doors = Variable("doors", ("closed", "open"))
    >>> doors.position("open"), doors.label("open")
    (1, 'open')
    """

    name: str
    values: tuple[Hashable, ...]
    labels: tuple[str, ...] = ()
    _positions: Mapping[Hashable, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.values:
            raise ValueError(f"variable {self.name!r} has no values; give it at least one")
        positions = {value: i for i, value in enumerate(self.values)}
        if len(positions) != len(self.values):
            raise ValueError(f"variable {self.name!r} holds a value twice; make its values distinct")
        if not self.labels:
            object.__setattr__(self, "labels", tuple(str(value) for value in self.values))
        if len(self.labels) != len(self.values):
            raise ValueError(
                f"variable {self.name!r} has {len(self.values)} values but {len(self.labels)} labels"
            )
        object.__setattr__(self, "_positions", positions)

    def __len__(self) -> int:
        return len(self.values)

    def __contains__(self, value: Hashable) -> bool:
        return value in self._positions

    def position(self, value: Hashable) -> int:
        """Return where `value` stands in the domain; KeyError names the variable if it is not there."""
        try:
            return self._positions[value]
        except KeyError:
            raise KeyError(
                f"{value!r} is not a value of variable {self.name!r} ({', '.join(self.labels)})"
            ) from None

    def label(self, value: Hashable) -> str:
        """Return the word for `value`."""
        return self.labels[self.position(value)]


@dataclass(frozen=True)
class StateIndex:
    """Numbers the joint states of some variables, the last variable fastest (C order).

    Parameters
    ----------
    variables
        The state variables, in order; their names are distinct.

    Examples
    --------
    >>> index = StateIndex((Variable("x", (0, 1, 2)), Variable("door", ("shut", "open"))))
    >>> index.size, index.number((2, "open")), index.state(5)
    (6, 5, (2, 'open'))
    """

    variables: tuple[Variable, ...]

    def __post_init__(self) -> None:
        names = [variable.name for variable in self.variables]
        if len(set(names)) != len(names):
            raise ValueError(f"two state variables share a name: {', '.join(names)}")

    @cached_property
    def size(self) -> int:
        """Number of joint states."""
        return int(np.prod([len(variable) for variable in self.variables], dtype=np.int64))

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Domain sizes, one a variable."""
        return tuple(len(variable) for variable in self.variables)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Variable names, in order."""
        return tuple(variable.name for variable in self.variables)

    def variable(self, name: str) -> Variable:
        """Return the variable called `name`."""
        return self.variables[self.names.index(name)]

    def number(self, state: Sequence[Hashable]) -> int:
        """Return the number of a state given as values in variable order."""
        number = 0
        for variable, value in zip(self.variables, state, strict=True):
            number = number * len(variable) + variable.position(value)
        return number

    def state(self, number: int) -> tuple[Hashable, ...]:
        """Return the values of state `number`, in variable order."""
        positions = np.unravel_index(number, self.shape)
        return tuple(variable.values[int(i)] for variable, i in zip(self.variables, positions, strict=True))

    def words(self, number: int, names: Sequence[str] | None = None) -> str:
        """Return state `number` in words, or what the named variables say of it.

        Examples
        --------
        >>> index = StateIndex((Variable("x", (0, 1)), Variable("door", ("shut", "open"))))
        >>> index.words(3), index.words(3, ["door"])
        ('x = 1, door = open', 'door = open')
        """
        return ", ".join(
            f"{variable.name} = {variable.label(value)}"
            for variable, value in zip(self.variables, self.state(number), strict=True)
            if names is None or variable.name in names
        )

    def __iter__(self) -> Iterator[tuple[Hashable, ...]]:
        return (self.state(number) for number in range(self.size))

    @cached_property
    def positions(self) -> NDArray[np.int64]:
        """Domain positions of every state, shape (variables, states)."""
        return np.stack(np.unravel_index(np.arange(self.size), self.shape)).astype(np.int64)

    def column(self, name: str) -> NDArray[np.int64]:
        """Return the domain position of variable `name` in every state, shape (states,)."""
        column: NDArray[np.int64] = self.positions[self.names.index(name)]
        return column

    def project(self, names: Sequence[str]) -> NDArray[np.int64]:
        """Return the number of every state's projection onto `names`, shape (states,).

        Two states get the same number exactly if they agree on the named variables. With no names,
        every state gets 0.
        """
        number = np.zeros(self.size, dtype=np.int64)
        for name in names:
            number = number * len(self.variable(name)) + self.column(name)
        return number
