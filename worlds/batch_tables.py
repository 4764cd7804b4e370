"""A maze as flat arrays: what batches of mazes look up instead of asking a `Layout`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from worlds.appearing import steps_to
from worlds.batch_reference import StreamedMazeEnv
from worlds.errors import UserError
from worlds.layout import ACTIONS, KINDS, Cell, Layout

Ints = NDArray[np.int32]
Bytes = NDArray[np.uint8]

CELL, KIND, EVENT, STEP, AT = range(5)
"""What a slot says of an obstacle: its cell, its kind, and when it appears (event, step, robot's cell)."""
SLOT: Final = 5
EVENTS: Final = ("start", "step", "robot", "doors")
"""The events of `worlds.Appears`; a slot holds an event's place here."""


@dataclass(frozen=True)
class MazeTables:
    """A layout and its obstacles in arrays.

    Attributes
    ----------
    rows, cols
        Size in cells.
    shut
        Shape (2, cells), uint8: bit a is set where a wall, or with row 0 also a door, stops action a.
    doorways
        Shape (cells,), uint8: 1 in the cells behind doors, where nothing appears while they are shut.
    triggers, goals
        Cells of the marks, in the layout's order.
    starts
        Cells that an episode may start in, triggers included, in ascending order.
    seats
        Place of each trigger's cell among `starts`.
    free
        Cells that are not solid, in ascending order.
    slots
        The layout's obstacles if they appear, shape (obstacles, `SLOT`).
    traps
        Shape (cells,), uint8: 1 where an obstacle appears when the robot is there.
    to_trigger, to_goal
        Next cell of a shortest way to each mark, doors shut and open, shape (marks, cells); a mark leads
        to itself. Empty unless obstacles are drawn.
    most
        Number of obstacles that an episode has room for.
    drawn
        Whether each episode draws its own obstacles.
    """

    rows: int
    cols: int
    shut: Bytes
    doorways: Bytes
    triggers: Ints
    goals: Ints
    starts: Ints
    seats: Ints
    free: Ints
    slots: Ints
    traps: Bytes
    to_trigger: Ints
    to_goal: Ints
    most: int
    drawn: bool

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.rows * self.cols

    @property
    def room(self) -> int:
        """Bytes that hold an environment's obstacles: a cell each, and a row before and after them."""
        return self.cells + 2 * self.cols


def tables_of(env: StreamedMazeEnv) -> MazeTables:
    """Lay out the arrays of a maze.

    Examples
    --------
    >>> tables = tables_of(StreamedMazeEnv("two_rooms", obstacles="layout"))
    >>> tables.shut[:, 19], tables.most  # cell 2,3 has a door to the East
    (array([8, 0], dtype=uint8), 6)
    """
    layout = env.layout
    drawn = env.obstacles == "random"
    slots = _slots(layout) if env.obstacles == "layout" else _ints([]).reshape(0, SLOT)
    triggers, goals = _numbers(layout, layout.triggers.values()), _numbers(layout, layout.goals.values())
    starts = _numbers(layout, env.starts)
    doorways, traps = (np.zeros(len(layout.cells), dtype=np.uint8) for _ in range(2))
    doorways[_numbers(layout, layout.thresholds.values())] = 1
    traps[slots[slots[:, EVENT] == EVENTS.index("robot"), AT]] = 1
    none = _ints([]).reshape(0, len(layout.cells))
    tables = MazeTables(
        rows=layout.rows,
        cols=layout.cols,
        shut=np.array([_shut(layout, doors_open=doors_open) for doors_open in (False, True)], dtype=np.uint8),
        doorways=doorways,
        triggers=triggers,
        goals=goals,
        starts=starts,
        seats=_ints(np.searchsorted(starts, triggers)),
        free=_numbers(layout, (cell for cell in layout.cells if cell not in layout.solid)),
        slots=slots,
        traps=traps,
        to_trigger=_nexts(layout, triggers, doors_open=False) if drawn else none,
        to_goal=_nexts(layout, goals, doors_open=True) if drawn else none,
        most=env.most_obstacles if drawn else len(slots),
        drawn=drawn,
    )
    if drawn:
        _hold_ways(layout, tables)
    return tables


def _ints(values: object) -> Ints:
    return np.asarray(values, dtype=np.int32)


def _numbers(layout: Layout, cells: object) -> Ints:
    return _ints([layout.number(cell) for cell in cells])  # type: ignore[attr-defined]


def _shut(layout: Layout, *, doors_open: bool) -> list[int]:
    """Return for each cell a bit for each action that a wall or shut door stops."""
    return [
        sum(
            (layout.passage(cell, action, doors_open=doors_open) < 0) << action
            for action in range(len(ACTIONS))
        )
        for cell in range(len(layout.cells))
    ]


def _slots(layout: Layout) -> Ints:
    rows = []
    for obstacle in layout.obstacles:
        appears = obstacle.appears
        at = -1 if appears.cell is None else layout.number(appears.cell)
        row = (layout.number(obstacle.cell), KINDS.index(obstacle.kind), EVENTS.index(appears.event))
        rows.append((*row, appears.step, at))
    return _ints(rows).reshape(len(rows), SLOT)


def _nexts(layout: Layout, marks: Ints, *, doors_open: bool) -> Ints:
    """Return the next cell of the way of `worlds.appearing.shortest_way` to each mark; -1 without a way."""
    return _ints([_next(layout, int(mark), doors_open=doors_open) for mark in marks])


def _next(layout: Layout, mark: int, *, doors_open: bool) -> list[int]:
    distance = steps_to(layout, mark, doors_open=doors_open)
    out = [-1] * len(layout.cells)
    out[mark] = mark
    for cell, steps in distance.items():
        # Ties fall to the first action: the others are written first, and over.
        for action in reversed(range(len(ACTIONS))):
            to = layout.passage(cell, action, doors_open=doors_open)
            if to >= 0 and distance[to] == steps - 1:
                out[cell] = to
    return out


def _hold_ways(layout: Layout, tables: MazeTables) -> None:
    """Refuse a maze in which an episode could not be won: random obstacles appear on a way."""
    for name, row in zip(layout.triggers, tables.to_trigger, strict=True):
        for start in tables.starts:
            if row[start] < 0:
                _refuse(layout, layout.cells[start], name)
    for trigger, cell in layout.triggers.items():
        for name, row in zip(layout.goals, tables.to_goal, strict=True):
            if row[layout.number(cell)] < 0:
                _refuse(layout, trigger, name)


def _refuse(layout: Layout, start: Cell | str, end: str) -> None:
    raise UserError(
        f"no way leads from {start} to {end} in layout {layout.name!r}, so no obstacle can appear on it;"
        " move the mark or open a way"
    )
