"""A maze's layout: cells, walls, doors, marks, and the obstacles that will appear."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, Literal, NamedTuple

ACTIONS: Final = ("North", "South", "West", "East")
"""The primitive actions, in the order that breaks ties (section 6.3 of the paper)."""
DELTAS: Final = ((-1, 0), (1, 0), (0, -1), (0, 1))
"""Row and column change of each action."""

Kind = Literal["cube", "sphere"]
Size = Literal["small", "middle", "large"]
KINDS: Final[tuple[Kind, ...]] = ("cube", "sphere")
SIZES: Final[tuple[Size, ...]] = ("small", "middle", "large")


class Cell(NamedTuple):
    """A grid of the maze: row from the top, column from the left, both from 0."""

    row: int
    col: int

    def __str__(self) -> str:
        return f"{self.row},{self.col}"


Edge = tuple[Cell, Cell]
"""Two adjacent cells, the smaller first."""


def edge(a: Cell, b: Cell) -> Edge:
    """Return the edge between two cells, whichever way round they come."""
    return (a, b) if a <= b else (b, a)


@dataclass(frozen=True)
class Appears:
    """When an obstacle appears: at the start, at a step, when the robot enters a cell, or as doors open.

    Examples
    --------
    >>> str(Appears("step", step=4)), str(Appears("robot", cell=Cell(3, 1)))
    ('at step 4', 'when robot 3,1')
    """

    event: Literal["start", "step", "robot", "doors"] = "start"
    step: int = 0
    cell: Cell | None = None

    def __str__(self) -> str:
        match self.event:
            case "start":
                return "at start"
            case "step":
                return f"at step {self.step}"
            case "robot":
                return f"when robot {self.cell}"
            case "doors":
                return "when doors open"


@dataclass(frozen=True)
class Obstacle:
    """A cube or sphere that appears at the centre of a cell.

    `colour` is ``#rrggbb``.
    """

    name: str
    kind: Kind
    cell: Cell
    size: Size = "middle"
    colour: str = "#d9332b"
    appears: Appears = field(default_factory=Appears)

    def __str__(self) -> str:
        return f"{self.name} {self.kind} {self.cell} {self.size} {self.colour} {self.appears}"


@dataclass(frozen=True)
class Layout:
    """A maze as data; `load_layout` reads one from its text.

    Parameters
    ----------
    name
        The layout's name.
    rows, cols
        Size in cells.
    solid
        Cells that are wall throughout.
    walls, doors
        Edges that are shut for ever, and edges that are shut until the trigger is reached.
    triggers, goals, thresholds
        Marked cells by name: T..., G... and D... (the grid behind a door).
    start, trigger, goal
        The example run: where the robot starts, and the names of its trigger and goal.
    obstacles
        What appears in the example run.
    chosen
        Names whose positions the source of the layout does not fix.
    """

    name: str
    rows: int
    cols: int
    solid: frozenset[Cell]
    walls: frozenset[Edge]
    doors: frozenset[Edge]
    triggers: Mapping[str, Cell]
    goals: Mapping[str, Cell]
    thresholds: Mapping[str, Cell]
    start: Cell
    trigger: str
    goal: str
    obstacles: tuple[Obstacle, ...] = ()
    chosen: frozenset[str] = frozenset()

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """Every cell, row by row, solid ones included: a cell's place here is its number."""
        return tuple(Cell(r, c) for r in range(self.rows) for c in range(self.cols))

    def number(self, cell: Cell) -> int:
        """Return the number of a cell."""
        return cell.row * self.cols + cell.col

    @cached_property
    def marks(self) -> dict[str, Cell]:
        """Every mark and its cell."""
        return {**self.triggers, **self.goals, **self.thresholds}

    @cached_property
    def neighbours(self) -> tuple[tuple[int, ...], ...]:
        """Number of the cell that each action leads to from each cell, doors taken as open; -1 at a wall."""
        return tuple(tuple(self._neighbour(cell, a) for a in range(len(ACTIONS))) for cell in self.cells)

    def _neighbour(self, cell: Cell, action: int) -> int:
        dr, dc = DELTAS[action]
        to = Cell(cell.row + dr, cell.col + dc)
        inside = 0 <= to.row < self.rows and 0 <= to.col < self.cols
        if not inside or cell in self.solid or to in self.solid or edge(cell, to) in self.walls:
            return -1
        return self.number(to)

    @cached_property
    def gates(self) -> tuple[tuple[bool, ...], ...]:
        """Whether each action from each cell leads through a door."""
        return tuple(
            tuple(to >= 0 and edge(cell, self.cells[to]) in self.doors for to in neighbours)
            for cell, neighbours in zip(self.cells, self.neighbours, strict=True)
        )

    def passage(self, cell: int, action: int, *, doors_open: bool) -> int:
        """Return the cell that `action` leads to past walls and doors alone, or -1 if they stop it."""
        to = self.neighbours[cell][action]
        return -1 if to >= 0 and self.gates[cell][action] and not doors_open else to

    def reach(self, start: Iterable[Cell], *, doors_open: bool) -> frozenset[Cell]:
        """Return the cells connected to `start`."""
        seen = {self.number(cell) for cell in start}
        queue = deque(seen)
        while queue:
            cell = queue.popleft()
            for action in range(len(ACTIONS)):
                to = self.passage(cell, action, doors_open=doors_open)
                if to >= 0 and to not in seen:
                    seen.add(to)
                    queue.append(to)
        return frozenset(self.cells[cell] for cell in seen)

    @cached_property
    def rooms(self) -> dict[str, frozenset[Cell]]:
        """The connected parts with every door shut, named A, B, ... in reading order."""
        rooms: list[frozenset[Cell]] = []
        seen: set[Cell] = set(self.solid)
        for cell in self.cells:
            if cell not in seen:
                rooms.append(self.reach([cell], doors_open=False))
                seen |= rooms[-1]
        return {_letters(i): room for i, room in enumerate(rooms)}

    def room(self, cell: Cell) -> frozenset[Cell]:
        """Return the room that a cell is in."""
        return self.reach([cell], doors_open=False)

    def describe(self, cell: Cell) -> str:
        """Return a cell's marks if it has any, its coordinates otherwise."""
        names = [name for name, marked in self.marks.items() if marked == cell]
        return "/".join(names) if names else str(cell)


def _letters(i: int) -> str:
    """Return the i-th name in A, B, ..., Z, AA, AB, ..."""
    out = ""
    i += 1
    while i:
        i, digit = divmod(i - 1, 26)
        out = chr(ord("A") + digit) + out
    return out
