"""Shapes of tasks: what tasks must share to run the same machine code, and what each of them is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundGraph, GroundTask
from planners.compiled.tables import Tables

UNROLLED: Final = 16
"""Primitive actions up to which a task's loop over them is unrolled."""
FIELDS: Final = 3
"""Fields of a link before the child's own: its shape, where its rows begin, and its place in a row."""


@dataclass(frozen=True)
class Shape:
    """What tasks that share functions have in common.

    Parameters
    ----------
    number
        Its name; 0 stands for a primitive action.
    actions
        For a task whose loop is unrolled its primitive actions; otherwise none.
    places
        For an unrolled task, by call, its group and its place in the group's rows.
    children
        For any other task what `told` gives of its children, by their shapes' numbers.
    span
        Words of a state.
    boltzmann
        Whether it explores so; otherwise at random in a share of the cases.
    taught
        Its pseudo-reward where it ends short of its goal.
    """

    number: int
    actions: tuple[int, ...]
    places: tuple[tuple[int, int], ...]
    children: tuple[tuple[int, int], ...]
    span: int
    boltzmann: bool
    taught: float

    @property
    def unrolled(self) -> bool:
        """Whether its loop over primitive actions is unrolled."""
        return bool(self.actions)

    @property
    def groups(self) -> int:
        """Number of tables of an unrolled task."""
        return 1 + max(group for group, _ in self.places)

    @property
    def told(self) -> int:
        """How many numbers its functions are given of a task."""
        return 2 + self.groups if self.unrolled else 3


@dataclass(frozen=True, eq=False)
class Shapes:
    """The shapes of a ground graph.

    Parameters
    ----------
    shapes
        Every shape that occurs, children before callers.
    told
        By task, its shape's number and what the shape's functions are given of it: its place, where its
        words begin, and then where its tables' rows begin (unrolled) or its links (otherwise).
    links
        By call of the tasks that are not unrolled, what there is to know of it, shape (calls, fields).
    """

    shapes: tuple[Shape, ...]
    told: dict[int, tuple[int, ...]]
    links: NDArray[np.int64]


def find_shapes(
    grounded: GroundGraph, tables: Tables, boltzmann: Sequence[bool], *, pseudo_rewards: bool
) -> Shapes:
    """Sort the tasks of a ground graph by what they can share.

    Parameters
    ----------
    grounded, tables
        The ground graph, and how it is laid out.
    boltzmann
        By node, whether it explores so.
    pseudo_rewards
        Whether they are learnt.
    """
    actions = len(grounded.model.actions)
    found: dict[Shape, Shape] = {}
    told: dict[int, tuple[int, ...]] = {}
    links: list[tuple[int, ...]] = []
    for place in range(actions, len(grounded.nodes)):
        node, groups = grounded.nodes[place], tables.groups[place]
        calls = range(len(node.calls))
        taught = (node.pseudo_reward or 0.0) if pseudo_rewards else 0.0
        shape = Shape(0, (), (), (), tables.span[place], boltzmann[place], taught)
        if len(calls) <= UNROLLED and all(call.child < actions for call in node.calls):
            homes = [tables.place(place, k) for k in calls]
            shape = replace(
                shape,
                actions=tuple(call.child for call in node.calls),
                places=tuple((groups.index(group), at) for group, at in homes),
            )
            own = tuple(group.rows for group in groups)
        else:
            kinds = {told.get(call.child, (0,))[0] for call in node.calls}
            sizes = {0: 2, **{known.number: known.told for known in found.values()}}
            shape = replace(shape, children=tuple((kind, sizes[kind]) for kind in sorted(kinds)))
            own = (len(links),)
            links += [_link(tables, place, k, told, node) for k in calls]
        shape = found.setdefault(shape, replace(shape, number=len(found) + 1))
        told[place] = (shape.number, place, tables.word[place], *own)
    return Shapes(tuple(found.values()), told, _padded(links))


def _link(
    tables: Tables, task: int, k: int, told: dict[int, tuple[int, ...]], node: GroundTask
) -> tuple[int, ...]:
    """Return what there is to know of a call."""
    child = node.calls[k].child
    group, at = tables.place(task, k)
    if child in told:
        shape, *own = told[child]
        return (shape, group.rows, at, *own)
    column = tables.columns[child]
    return (0, group.rows, at, child, column.rows if tables.many else column.base)


def _padded(links: Sequence[tuple[int, ...]]) -> NDArray[np.int64]:
    width = max((len(link) for link in links), default=FIELDS)
    rows = [link + (0,) * (width - len(link)) for link in links]
    return np.array(rows or [(0,) * width], dtype=np.int64)
