"""The PyBullet twin of a maze: the grid decides what is legal, physics carries it out.

An `Episode` says what each step does; the twin then drags the robot, rolls the sphere it pushes and
sinks the doors, step by step of the physics engine. `disagreements` compares the two afterwards.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from worlds.bullet import Form
from worlds.camera import RADIUS, Camera
from worlds.geometry import cell_at, centre, heading
from worlds.layout import Cell, Layout, Obstacle
from worlds.maze import Change, Episode
from worlds.scene import ROBOT_RADIUS, TIME_STEP, Look, Scene

TOLERANCE: Final = 0.02
"""Metres that the robot or an obstacle may be off the centre of its cell."""
_SUBSTEPS = 12  # physics steps in which the robot crosses a cell
_SETTLE = 4  # physics steps after which it stands still
_LEAD = 1.5  # how many times faster than the robot a pushed sphere rolls
_NUDGE = 0.12  # metres that a stopped robot tries to go: short of the wall, cube or sphere ahead
_SUN = (-0.4, 0.5, 1.0)  # where the light stands for the picture from above, in the world


@dataclass(frozen=True)
class Whereabouts:
    """Where physics has the robot and the obstacles.

    Parameters
    ----------
    x, y
        The robot's centre, in metres.
    robot
        The cell it is in.
    obstacles
        The cell of each obstacle, by name, and how far it is off that cell's centre, in metres.
    """

    x: float
    y: float
    robot: Cell
    obstacles: Mapping[str, tuple[Cell, float]]


class Twin:
    """A maze in PyBullet, with a robot and its camera; a context manager.

    Parameters
    ----------
    layout
        The maze.
    camera
        The robot's camera.

    Examples
    --------
    >>> from worlds import ACTIONS, Episode, load_layout
    >>> maze = load_layout("two_rooms")
    >>> episode = Episode(maze, "T4", "G2", maze.start, maze.obstacles)
    >>> with Twin(maze, Camera(pixels=64)) as twin:
    ...     twin.begin(episode)
    ...     for _ in range(2):  # the second step pushes S1, which rolls to the wall
    ...         twin.carry_out(episode, episode.step(ACTIONS.index("South")))
    ...     twin.where().robot, twin.where().obstacles["S1"][0]
    ...     twin.frame().shape, twin.disagreements(episode)
    (Cell(row=3, col=0), Cell(row=7, col=0))
    ((64, 64, 3), ())
    """

    def __init__(self, layout: Layout, camera: Camera | None = None) -> None:
        self.layout = layout
        self.camera = Camera() if camera is None else camera
        self._folder = TemporaryDirectory(prefix="affordant-")
        self._scene = Scene(layout, Path(self._folder.name))
        self._bodies: dict[str, int] = {}
        self._heading = heading(0)
        self._cell: Cell | None = None  # where the robot is while physics runs an episode
        self._staged = False
        self.stage(layout.start, 0, ())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the physics engine and the texture's file back; the twin is of no use afterwards."""
        self._scene.client.disconnect()
        self._folder.cleanup()

    def begin(self, episode: Episode) -> None:
        """Take over the present state of an episode; the robot faces North.

        What follows does not depend on what the twin did before.
        """
        self._scene.rebuild()
        self._cell = self.layout.cells[episode.state.robot]
        self._scene.set_doors(doors_open=episode.state.doors_open)
        self._heading = heading(0)
        self._scene.put_robot(*centre(self._cell), self._heading)
        self._bodies = {
            name: self._scene.add(episode.obstacles[name], self.layout.cells[cell])
            for name, cell in episode.placed.items()
        }

    def face(self, action: int) -> None:
        """Turn the robot on the spot, at once, to face along an action."""
        self._heading = heading(action)
        self._scene.put_robot(*self._scene.position(self._scene.robot), self._heading)

    def carry_out(self, episode: Episode, change: Change) -> None:
        """Let physics do what `change = episode.step(action)` decided.

        Raises
        ------
        RuntimeError
            If no episode was begun since the twin was made or staged.
        """
        if self._cell is None:
            raise RuntimeError("the twin carries out no episode; call begin(episode) first")
        self.face(change.action)
        if not change.moved:
            self._nudge(self._cell)
        elif change.push is None:
            self._cross(self._cell)
        else:
            name = episode.name_at(change.push.end)
            assert name is not None, "a pushed sphere has a name"
            radius = RADIUS[episode.obstacles[name].size]
            self._push(self._cell, self._bodies[name], radius, self.layout.cells[change.push.end])
        self._cell = self.layout.cells[episode.state.robot]
        if change.opened:
            self._scene.set_doors(doors_open=True)
        for obstacle in change.appeared:
            self._bodies[obstacle.name] = self._scene.add(obstacle, obstacle.cell)

    def paint(self, look: Look) -> None:
        """Paint and light the maze anew; what stood in it is gone, so stage or begin afterwards.

        A twin that was painted shows nothing of what it went through before.
        """
        self._scene.paint(look)
        self._bodies = {}
        self._cell = None

    def stage(
        self,
        robot_cell: Cell,
        action: int,
        obstacles: Iterable[Obstacle],
        *,
        doors_open: bool = False,
        yaws: Mapping[str, float] | None = None,
        forms: Mapping[str, Form] | None = None,
    ) -> None:
        """Put the robot in a cell, facing along an action, among exactly these obstacles, at once.

        No physics runs: this is for rendering. An episode must be begun anew afterwards.

        Parameters
        ----------
        robot_cell, action
            Where the robot stands, and the action along which it faces.
        obstacles
            What stands in the maze.
        doors_open
            Whether the doors are open.
        yaws
            By obstacle's name, the degrees by which it is turned about the vertical; 0 if left out.
        forms
            By obstacle's name, the solid to show in place of its kind's.
        """
        yaws, forms = yaws or {}, forms or {}
        self._scene.clear()
        self._cell = None
        self._bodies = {
            obstacle.name: self._scene.add(
                obstacle, obstacle.cell, yaws.get(obstacle.name, 0.0), forms.get(obstacle.name)
            )
            for obstacle in obstacles
        }
        self._scene.set_doors(doors_open=doors_open)
        self._heading = heading(action)
        self._scene.put_robot(*centre(robot_cell), self._heading)

    def frame(self) -> NDArray[np.uint8]:
        """Return what the robot's camera sees, as RGB, shape (pixels, pixels, 3).

        The light is the robot's own lamp, so a scene looks the same whichever way the robot faces.
        """
        x, y = self._scene.position(self._scene.robot)
        view = self.camera.view(x, y, self._heading)
        east, north = self._heading
        ahead, left, up = self._scene.look.lamp
        light = (ahead * east - left * north, ahead * north + left * east, up)
        return self._scene.image(self.camera.pixels, view, self.camera.projection, light)

    def overview(self, pixels: int = 480) -> NDArray[np.uint8]:
        """Return the whole maze from above, North on top, as RGB, shape (pixels, pixels, 3)."""
        x, y = self.layout.cols / 2, -self.layout.rows / 2
        width = max(self.layout.cols, self.layout.rows) + 0.2
        height = 10 * width  # far away: next to no perspective
        above = Camera(
            pixels=pixels,
            fov=float(np.degrees(2 * np.arctan(width / 2 / (height - 1)))),
            height=height,
            forward=0.0,
            pitch=90.0,
            near=height / 2,
            far=2 * height,
        )
        return self._scene.image(pixels, above.view(x, y, heading(0)), above.projection, _SUN)

    def where(self) -> Whereabouts:
        """Return where physics has everything."""
        x, y = self._scene.position(self._scene.robot)
        obstacles = {}
        for name, body in self._bodies.items():
            at = self._scene.position(body)
            cell = cell_at(*at)
            obstacles[name] = cell, _distance(at, centre(cell))
        return Whereabouts(x, y, cell_at(x, y), obstacles)

    def disagreements(self, episode: Episode) -> tuple[str, ...]:
        """Return, in words, every way in which physics and the grid differ; empty if they agree."""
        where = self.where()
        cell = self.layout.cells[episode.state.robot]
        robot = (where.robot, _distance((where.x, where.y), centre(where.robot)))
        found = _differences("the robot", robot, cell)
        for name in sorted(episode.placed.keys() | where.obstacles.keys()):
            if name not in where.obstacles:
                found.append(f"{name} is missing from physics")
            elif name not in episode.placed:
                found.append(f"{name} has not appeared in the grid")
            else:
                found += _differences(name, where.obstacles[name], self.layout.cells[episode.placed[name]])
        if self.layout.doors and self._scene.doors_open() != episode.state.doors_open:
            found.append(f"the doors are {'open' if episode.state.doors_open else 'shut'} in the grid only")
        return tuple(found)

    def _cross(self, start: Cell) -> None:
        """Drag the robot from a cell's centre to the next one's."""
        for k in range(1, _SUBSTEPS + _SETTLE + 1):
            self._drag(start, min(k / _SUBSTEPS, 1.0))

    def _nudge(self, start: Cell) -> None:
        """Let the robot try to go, and come back."""
        for k in range(1, _SUBSTEPS + _SETTLE + 1):
            there = min(k, _SUBSTEPS - k) / (_SUBSTEPS / 2)
            self._drag(start, _NUDGE * max(there, 0.0))

    def _push(self, start: Cell, sphere: int, radius: float, end: Cell) -> None:
        """Drag the robot one cell while the sphere ahead of it rolls to `end`.

        The sphere is driven forward from the moment the robot touches it; what turns it is the
        friction of the floor.
        """
        goal = np.array(centre(end))
        origin = np.array(self._scene.position(sphere))
        length = float(np.linalg.norm(goal - origin))
        touch = (1 - radius - ROBOT_RADIUS) * _SUBSTEPS
        rolling = max(length * _SUBSTEPS / _LEAD, _SUBSTEPS - touch)
        for k in range(1, int(max(_SUBSTEPS, np.ceil(touch + rolling))) + _SETTLE + 1):
            share = min(max((k - touch) / rolling, 0.0), 1.0)
            if share > 0.0:
                self._drive(sphere, origin + share * (goal - origin), arrived=share == 1.0)
            self._drag(start, min(k / _SUBSTEPS, 1.0))
        self._scene.client.resetBaseVelocity(sphere, (0, 0, 0), (0, 0, 0))

    def _drive(self, body: int, target: NDArray[np.float64], *, arrived: bool) -> None:
        """Give a body the velocity that takes it to `target` in one physics step."""
        vx, vy = (target - np.array(self._scene.position(body))) / TIME_STEP
        # Whatever stops the sphere stops its turning too; left to spin, it would roll off again.
        still = {"angularVelocity": (0.0, 0.0, 0.0)} if arrived else {}
        self._scene.client.resetBaseVelocity(body, linearVelocity=(vx, vy, 0.0), **still)

    def _drag(self, start: Cell, share: float) -> None:
        """Run one physics step with the robot's grip `share` of a cell ahead of a cell's centre."""
        x, y = centre(start)
        self._scene.drag_robot(x + share * self._heading[0], y + share * self._heading[1], self._heading)
        self._scene.client.stepSimulation()


def _distance(a: tuple[float, float], b: tuple[float, float]) -> float:
    return float(np.hypot(a[0] - b[0], a[1] - b[1]))


def _differences(name: str, found: tuple[Cell, float], expected: Cell) -> list[str]:
    cell, offset = found
    if cell != expected:
        return [f"{name} is in {cell} in physics and in {expected} in the grid"]
    if offset > TOLERANCE:
        return [f"{name} is {offset:.3f} m off the centre of {cell}"]
    return []
