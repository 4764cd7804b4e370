"""Fresh frames of the twin: scenes drawn at random, with the truth of what stands ahead.

Scene number i of a seed is a function of seed, i and the layout alone: the first hundred of a thousand
are the hundred.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from perception.protocol import LABELS, NOTHING, REACH, Detection, Label, View
from worlds import ACTIONS, KINDS, SIZES, Cell, Layout, Obstacle, Stream, UserError
from worlds.camera import Camera
from worlds.twin import Twin

MOST_OTHERS: Final = 2
"""At most so many obstacles stand elsewhere in the maze."""

Way = tuple[Cell, int, tuple[Cell, ...]]
"""A cell, an action, and the free cells ahead up to the first wall or shut door."""
Ways = Mapping[bool, tuple[Way, ...]]


@dataclass(frozen=True)
class FreshScene:
    """A robot somewhere in a maze, what stands around it, and what a backend should say.

    Parameters
    ----------
    robot, action
        The robot's cell, and the action along which it faces.
    doors_open
        Whether the doors are open.
    truth
        What stands in the way at most `REACH` cells ahead.
    obstacles
        Every obstacle; the one in the way comes first.
    """

    robot: Cell
    action: int
    doors_open: bool
    truth: Detection
    obstacles: tuple[Obstacle, ...]


def fresh_scene(layout: Layout, seed: int, number: int) -> FreshScene:
    """Draw one scene.

    Drawn, each evenly: the label, such that scenes 0 to 2, 3 to 5, ... hold one of each; doors open or
    shut; for an obstacle its distance (1 or 2 cells), size (of three) and colour; then the robot's cell
    and heading among those with no wall or shut door before that distance (for "none" among all, so
    that walls and doors close by and long corridors are views as well); and 0, 1 or 2 more obstacles
    of any kind, size and colour elsewhere, off the line of free cells ahead. Colours are uniform over
    red, green and blue, so some come close to those of floor, walls or doors.

    Parameters
    ----------
    layout
        The maze; its own obstacles are left out.
    seed, number
        Name the scene.

    Raises
    ------
    UserError
        If the maze has no two adjacent free cells.

    Examples
    --------
    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> sorted(fresh_scene(maze, seed=1, number=i).truth.label for i in range(3))
    ['cube', 'none', 'sphere']
    """
    return _draw(layout, ways_ahead(layout), seed, number)


def fresh_views(layout: Layout, n: int, seed: int, camera: Camera | None = None) -> Iterator[View]:
    """Render scenes 0 to n - 1 of a seed (`fresh_scene`), one at a time.

    Parameters
    ----------
    layout
        The maze.
    n
        Number of views: a third none, a third cubes, a third spheres.
    seed
        Names the views.
    camera
        The robot's camera. Defaults to ``Camera()``.

    Yields
    ------
    View
        A frame, its truth, and the size of the obstacle in the way.

    Examples
    --------
    >>> from worlds import load_layout
    >>> for view in fresh_views(load_layout("two_rooms"), 1, seed=1, camera=Camera(pixels=64)):
    ...     view.frame.shape
    (64, 64, 3)
    """
    ways = ways_ahead(layout)
    with Twin(layout, camera) as twin:
        for number in range(n):
            scene = _draw(layout, ways, seed, number)
            twin.stage(scene.robot, scene.action, scene.obstacles, doors_open=scene.doors_open)
            size = None if scene.truth.label == "none" else scene.obstacles[0].size
            yield View(twin.frame(), scene.truth, size)


def _draw(layout: Layout, ways: Ways, seed: int, number: int) -> FreshScene:
    stream = Stream(seed, 0, number)
    label: Label = Stream(seed, 1, number // len(LABELS)).shuffled(LABELS)[number % len(LABELS)]
    doors_open = stream.below(2) == 1
    here = ways[doors_open]
    if label == "none":
        robot, action, way = stream.choose(here)
        truth, obstacles = NOTHING, []
    else:
        longest = min(REACH, max(len(way) for *_, way in here))
        if longest == 0:
            raise UserError(f"layout {layout.name}: an obstacle needs two free cells in a row; open a wall")
        distance = 1 + stream.below(longest)
        robot, action, way = stream.choose([item for item in here if len(item[2]) >= distance])
        truth = Detection(label, 1.0, distance)
        obstacles = [_obstacle(stream, "ahead", way[distance - 1], label)]
    elsewhere = sorted({cell for cell, _, _ in here} - {robot, *way})
    for i, cell in enumerate(stream.shuffled(elsewhere)[: stream.below(MOST_OTHERS + 1)]):
        obstacles.append(_obstacle(stream, f"other{i + 1}", cell, stream.choose(KINDS)))
    return FreshScene(robot, action, doors_open, truth, tuple(obstacles))


def _obstacle(stream: Stream, name: str, cell: Cell, kind: Label) -> Obstacle:
    assert kind != "none", "only cubes and spheres are obstacles"
    return Obstacle(name, kind, cell, stream.choose(SIZES), f"#{stream.below(1 << 24):06x}")


def ways_ahead(layout: Layout) -> Ways:
    """Return the way ahead of every free cell along every action, doors shut and doors open."""
    return {
        doors_open: tuple(
            (cell, action, _way(layout, layout.number(cell), action, doors_open=doors_open))
            for cell in layout.cells
            if cell not in layout.solid
            for action in range(len(ACTIONS))
        )
        for doors_open in (False, True)
    }


def _way(layout: Layout, cell: int, action: int, *, doors_open: bool) -> tuple[Cell, ...]:
    way = []
    while (cell := layout.passage(cell, action, doors_open=doors_open)) >= 0:
        way.append(layout.cells[cell])
    return tuple(way)
