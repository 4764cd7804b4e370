"""How a maze with obstacles moves: one pure step, and an episode in which obstacles appear.

A cube blocks. A sphere that the robot pushes rolls on in that direction until a wall, a shut door or
another obstacle stops it; one that cannot move at all is wedged and blocks. The paper leaves the end
of a roll open (section 6.1); this is our definition of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

from worlds.layout import Cell, Layout, Obstacle


class Outcome(StrEnum):
    """The name of an episode's end."""

    REACHED = "reached"
    TRUNCATED = "truncated"
    NO_ROUTE = "no route left"
    WRONG_SHAPE = "wrong shape believed"


@dataclass(frozen=True, slots=True)
class MazeState:
    """Where everything in a maze is; cells are numbers (`Layout.number`).

    `trigger` and `goal` are this episode's cells. As the obstacles that a robot knows of, the same
    type serves as its belief.
    """

    robot: int
    trigger: int
    goal: int
    doors_open: bool = False
    cubes: frozenset[int] = frozenset()
    spheres: frozenset[int] = frozenset()


class Push(NamedTuple):
    """A sphere's roll: the cell it left and the cell that it came to rest in."""

    start: int
    end: int


def roll(layout: Layout, state: MazeState, sphere: int, action: int) -> int:
    """Return where a sphere comes to rest when pushed; its own cell if it is wedged.

    Examples
    --------
    >>> from worlds import ACTIONS, load_layout
    >>> maze = load_layout("two_rooms")
    >>> state = MazeState(robot=16, trigger=49, goal=31, cubes=frozenset({48}), spheres=frozenset({24}))
    >>> maze.cells[roll(maze, state, 24, ACTIONS.index("South"))]  # the cube at 6,0 stops it
    Cell(row=5, col=0)
    """
    cell = sphere
    while True:
        to = layout.passage(cell, action, doors_open=state.doors_open)
        if to < 0 or to in state.cubes or to in state.spheres or to == state.robot:
            return cell
        cell = to


def step(layout: Layout, state: MazeState, action: int) -> tuple[MazeState, Push | None]:
    """Return the state after one primitive action, and the roll that it caused.

    The robot stays where it is if a wall, a shut door, a cube or a wedged sphere stops it. Doors open
    as the robot reaches its trigger, and stay open.
    """
    to = layout.passage(state.robot, action, doors_open=state.doors_open)
    if to < 0 or to in state.cubes:
        return state, None
    push = None
    spheres = state.spheres
    if to in spheres:
        push = Push(to, roll(layout, state, to, action))
        if push.end == push.start:
            return state, None
        spheres = (spheres - {push.start}) | {push.end}
    doors_open = state.doors_open or to == state.trigger
    return replace(state, robot=to, doors_open=doors_open, spheres=spheres), push


def ahead(layout: Layout, state: MazeState, action: int, distance: int) -> int:
    """Return the cell `distance` cells ahead in the direction of `action`, or -1 past a wall or shut door."""
    cell = state.robot
    for _ in range(distance):
        cell = layout.passage(cell, action, doors_open=state.doors_open)
        if cell < 0:
            break
    return cell


@dataclass(frozen=True)
class Change:
    """What one step of an episode did."""

    action: int
    moved: bool
    push: Push | None
    opened: bool
    appeared: tuple[Obstacle, ...]


class Episode:
    """A maze in motion: its state, its obstacles by name, and those still to appear.

    An obstacle whose time has come but whose cell is taken (by the robot, another obstacle or a shut
    door) waits until the cell is free.

    Parameters
    ----------
    layout
        The maze.
    trigger, goal
        Names of this episode's marks.
    start
        The robot's first cell, in a room where the trigger can be reached.
    obstacles
        What appears, and when. Defaults to nothing.

    Raises
    ------
    ValueError
        If the start is solid or is the trigger, or an obstacle stands in a solid cell.

    Examples
    --------
    >>> from worlds import ACTIONS, load_layout
    >>> maze = load_layout("two_rooms")
    >>> episode = Episode(maze, "T4", "G2", maze.start, maze.obstacles)
    >>> _ = episode.step(ACTIONS.index("South"))
    >>> push = episode.step(ACTIONS.index("South")).push
    >>> maze.cells[push.end]  # S1 rolls from 3,0 to the wall
    Cell(row=7, col=0)
    """

    def __init__(
        self, layout: Layout, trigger: str, goal: str, start: Cell, obstacles: Iterable[Obstacle] = ()
    ) -> None:
        self.layout = layout
        cell = layout.triggers[trigger]
        if start in layout.solid or start == cell:
            raise ValueError(f"an episode cannot start at {start}: the cell is solid or the trigger itself")
        self.state = MazeState(layout.number(start), layout.number(cell), layout.number(layout.goals[goal]))
        self.placed: dict[str, int] = {}
        self.steps = 0
        self._due: list[Obstacle] = []
        self._pending = list(obstacles)
        for obstacle in self._pending:
            if obstacle.cell in layout.solid:
                raise ValueError(f"obstacle {obstacle.name} stands in the solid cell {obstacle.cell}")
        self.obstacles = {obstacle.name: obstacle for obstacle in self._pending}
        self.appeared = self._appear(moved=False, opened=False)

    @property
    def reached(self) -> bool:
        """Whether the robot is at its goal, doors open."""
        return self.state.doors_open and self.state.robot == self.state.goal

    def name_at(self, cell: int) -> str | None:
        """Return the name of the obstacle in a cell, or None."""
        return next((name for name, at in self.placed.items() if at == cell), None)

    def step(self, action: int) -> Change:
        """Carry out one primitive action (its place in `ACTIONS`); obstacles then appear."""
        before = self.state
        self.state, push = step(self.layout, before, action)
        self.steps += 1
        if push is not None:
            name = self.name_at(push.start)
            assert name is not None, "every sphere has a name"
            self.placed[name] = push.end
        moved = self.state.robot != before.robot
        opened = self.state.doors_open and not before.doors_open
        return Change(action, moved, push, opened, self._appear(moved=moved, opened=opened))

    def _appear(self, *, moved: bool, opened: bool) -> tuple[Obstacle, ...]:
        """Place every obstacle whose time has come and whose cell is free."""
        come = [o for o in self._pending if self._has_come(o, moved=moved, opened=opened)]
        self._pending = [o for o in self._pending if o not in come]
        self._due += come
        appeared = []
        for obstacle in list(self._due):
            cell = self.layout.number(obstacle.cell)
            if self._is_free(cell):
                self._due.remove(obstacle)
                self._place(obstacle, cell)
                appeared.append(obstacle)
        return tuple(appeared)

    def _has_come(self, obstacle: Obstacle, *, moved: bool, opened: bool) -> bool:
        appears = obstacle.appears
        match appears.event:
            case "start":
                return self.steps == 0
            case "step":
                return self.steps >= appears.step
            case "robot":
                here = self.layout.cells[self.state.robot]
                return appears.cell == here and (moved or self.steps == 0)
            case "doors":
                return opened

    def _is_free(self, cell: int) -> bool:
        state = self.state
        in_shut_door = not state.doors_open and self.layout.cells[cell] in self.layout.thresholds.values()
        return cell != state.robot and cell not in state.cubes | state.spheres and not in_shut_door

    def _place(self, obstacle: Obstacle, cell: int) -> None:
        self.placed[obstacle.name] = cell
        if obstacle.kind == "cube":
            self.state = replace(self.state, cubes=self.state.cubes | {cell})
        else:
            self.state = replace(self.state, spheres=self.state.spheres | {cell})
