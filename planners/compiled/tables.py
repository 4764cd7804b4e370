"""A ground graph as flat arrays: what a generated kernel reads, and where each task's part of it begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundGraph, GroundTask
from worlds import TransitionModel

CALLS: Final = 62
"""Calls whose availability one word holds."""
SHORT: Final = 62
"""The bit of a state's first word that says that the task has ended short of its goal."""
ENDED: Final = 63
"""The bit of a state's first word that says that the task has ended."""

T = TypeVar("T", bound=np.generic)
Positions = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Outcomes:
    """A transition model's outcomes that occur, those of an action in a state next to each other.

    Parameters
    ----------
    first
        Where those of each (state, action) begin, shape (states * actions + 1,).
    after, reward, up_to
        Next state, reward and cumulated probability of each.
    """

    first: Positions
    after: Positions
    reward: NDArray[np.float64]
    up_to: NDArray[np.float64]

    @property
    def certain(self) -> bool:
        """Whether every action has one outcome everywhere, so that `first` is not needed."""
        return self.after.size == self.first.size - 1


@dataclass(frozen=True)
class Group:
    """Calls of a task that are stored by the same state variables, row by row.

    Parameters
    ----------
    calls
        Places of the calls; a row has one value for each.
    base
        Where the table begins among the values.
    rows
        Where the positions of the states' rows begin.
    """

    calls: tuple[int, ...]
    base: int
    rows: int


@dataclass(frozen=True)
class Column:
    """The values of a primitive action: where they begin, how many, and where the states' positions begin."""

    base: int
    count: int
    rows: int


@dataclass(frozen=True, eq=False)
class Tables:
    """Where everything is.

    Parameters
    ----------
    words
        By task, state and word: a bit for each call that is available, `CALLS` a word.
    word, span
        Where each task's words begin, and how many a state has.
    rows
        Positions of values by state, for every group, and for every column if one has more than one value.
    columns
        Values of the primitive actions.
    groups
        Tables of each task.
    size
        Number of values.
    outcomes
        What the primitive actions do.
    """

    words: NDArray[np.uint64]
    word: tuple[int, ...]
    span: tuple[int, ...]
    rows: Positions
    columns: tuple[Column, ...]
    groups: tuple[tuple[Group, ...], ...]
    size: int
    outcomes: Outcomes

    @property
    def many(self) -> bool:
        """Whether some primitive action has several values, so that their positions stand in `rows`."""
        return any(column.count > 1 for column in self.columns)

    def place(self, task: int, call: int) -> tuple[Group, int]:
        """Return the group that a call belongs to, and its place in a row."""
        group = next(group for group in self.groups[task] if call in group.calls)
        return group, group.calls.index(call)

    def table(self, values: NDArray[np.float64], task: int, call: int, rows: int) -> NDArray[np.float64]:
        """Return the part of all values, shape (..., values), that belongs to a call: (..., rows), a view."""
        group, at = self.place(task, call)
        return values[..., group.base + at :: len(group.calls)][..., :rows]


def lay_out(grounded: GroundGraph, *, flat: bool) -> Tables:
    """Lay a ground graph out.

    Parameters
    ----------
    grounded
        The ground graph.
    flat
        Whether a task stores every call by its own relevant variables, and primitive actions store nothing,
        as flat Q-learning does; otherwise as MAXQ does.
    """
    index = grounded.model.index
    leaves = [node.leaf for node in grounded.nodes if node.leaf is not None]
    many = not flat and any(leaf.rows > 1 for leaf in leaves)
    rows: _Stack[np.int64] = _Stack()
    words: _Stack[np.uint64] = _Stack()
    values = 0
    columns: list[Column] = []
    word, span = [], []
    groups: list[tuple[Group, ...]] = []
    for node in grounded.nodes:
        if node.leaf is not None:
            count = 0 if flat else node.leaf.rows
            columns.append(Column(values, count, rows.size))
            if many:
                rows.add(values + node.leaf.projection)
            values += count
        span.append(-(-len(node.calls) // CALLS))
        word.append(words.size)
        if node.calls:
            words.add(_words(node, span[-1]))
        own = []
        for relevant, calls in _stored(grounded, node, flat=flat).items():
            own.append(Group(calls, values, rows.size))
            rows.add(values + len(calls) * index.project(relevant))
            values += len(calls) * int(np.prod([len(index.variable(name)) for name in relevant]))
        groups.append(tuple(own))
    return Tables(
        words.array(),
        tuple(word),
        tuple(span),
        rows.array().astype(np.int32),
        tuple(columns),
        tuple(groups),
        values,
        _outcomes(grounded.model),
    )


class _Stack(Generic[T]):
    """Arrays to be put one after the other."""

    def __init__(self) -> None:
        self.size = 0
        self._parts: list[NDArray[T]] = []

    def add(self, part: NDArray[T]) -> None:
        self._parts.append(part)
        self.size += part.size

    def array(self) -> NDArray[T]:
        return np.concatenate(self._parts)


def _stored(grounded: GroundGraph, node: GroundTask, *, flat: bool) -> dict[Sequence[str], tuple[int, ...]]:
    """Return the calls of a node by the variables that they are stored by."""
    found: dict[Sequence[str], tuple[int, ...]] = {}
    for k, call in enumerate(node.calls):
        relevant = grounded.graph.tasks[node.task].uses if flat else call.relevant
        found[relevant] = (*found.get(relevant, ()), k)
    return found


def _words(node: GroundTask, span: int) -> NDArray[np.uint64]:
    words = np.zeros((node.terminal.size, span), dtype=np.uint64)
    for k, call in enumerate(node.calls):
        words[:, k // CALLS] |= call.available.astype(np.uint64) << np.uint64(k % CALLS)
    words[:, 0] |= node.terminal.astype(np.uint64) << np.uint64(ENDED)
    words[:, 0] |= (node.terminal & ~node.goal).astype(np.uint64) << np.uint64(SHORT)
    return words.reshape(-1)


def _outcomes(model: TransitionModel) -> Outcomes:
    occurs = model.probabilities > 0
    up_to = np.zeros_like(model.probabilities)
    total = np.zeros(occurs.shape[:2])
    for at in range(occurs.shape[2]):  # in the order in which the reference adds, to the last bit
        total += model.probabilities[..., at]
        up_to[..., at] = total
    first = np.concatenate([[0], np.cumsum(occurs.sum(axis=2))])
    return Outcomes(
        first.astype(np.int32),
        model.outcomes[occurs].astype(np.int32),
        model.outcome_rewards[occurs].astype(np.float64),
        up_to[occurs],
    )
