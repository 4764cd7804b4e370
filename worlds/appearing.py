"""Random obstacles that appear on the way of a robot."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Final

from worlds.layout import ACTIONS, KINDS, SIZES, Appears, Cell, Layout, Obstacle
from worlds.randomness import Stream

ON_THE_WAY: Final = 0.75
"""Probability that an obstacle appears on the way, where there is room for it."""
FARTHEST: Final = 3
"""How many cells before an obstacle on the way the robot is, at most, as it appears."""
_COLOURS: Final = 1 << 24


def shortest_way(layout: Layout, start: Cell, trigger: Cell, goal: Cell) -> tuple[Cell, ...]:
    """Return a shortest way from the start over the trigger to the goal, obstacles left out.

    Ties are broken in the order North, South, West, East.

    Returns
    -------
    tuple of Cell
        Where the robot is at each step, its start first.

    Raises
    ------
    ValueError
        If there is no such way.

    Examples
    --------
    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> way = shortest_way(maze, maze.start, maze.triggers["T4"], maze.goals["G2"])
    >>> len(way) - 1, [str(cell) for cell in way[:3]]
    (15, ['1,0', '2,0', '3,0'])
    """
    there = _leg(layout, start, trigger, doors_open=False)
    return there + _leg(layout, trigger, goal, doors_open=True)[1:]


def steps_to(layout: Layout, end: int, *, doors_open: bool) -> dict[int, int]:
    """Return the fewest steps to a cell from each that has a way there, by breadth-first search back from it.

    Examples
    --------
    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> ways = steps_to(maze, maze.number(maze.triggers["T4"]), doors_open=False)
    >>> ways[maze.number(maze.start)], len(ways)
    (6, 32)
    """
    distance = {end: 0}
    queue = deque([end])
    while queue:
        cell = queue.popleft()
        for action in range(len(ACTIONS)):
            to = layout.passage(cell, action, doors_open=doors_open)
            if to >= 0 and to not in distance:
                distance[to] = distance[cell] + 1
                queue.append(to)
    return distance


def _leg(layout: Layout, start: Cell, end: Cell, *, doors_open: bool) -> tuple[Cell, ...]:
    """Return a shortest way between two cells."""
    first, last = layout.number(start), layout.number(end)
    distance = steps_to(layout, last, doors_open=doors_open)
    if first not in distance:
        raise ValueError(f"no way leads from {start} to {end} in layout {layout.name!r}")
    way = [first]
    while way[-1] != last:
        nexts = (layout.passage(way[-1], a, doors_open=doors_open) for a in range(len(ACTIONS)))
        way.append(next(to for to in nexts if to >= 0 and distance[to] == distance[way[-1]] - 1))
    return tuple(layout.cells[cell] for cell in way)


def random_obstacles(
    layout: Layout,
    stream: Stream,
    count: int,
    way: Sequence[Cell],
    keep_free: frozenset[Cell] = frozenset(),
    *,
    spheres: float = 0.5,
    on_way: float = ON_THE_WAY,
) -> tuple[Obstacle, ...]:
    """Draw obstacles that appear while a robot follows a way, most of them on it.

    With probability `on_way` an obstacle appears in a cell of the way, at a step when a robot that
    follows the way is one to `FARTHEST` cells before it; otherwise (and once the way is full) in any
    free cell, at a step of 0 to ``len(way)``. No two share a cell.

    Parameters
    ----------
    layout
        The maze.
    stream
        Decides every draw: the same stream gives the same obstacles, and a larger `count` adds to them.
    count
        Number of obstacles.
    way
        The cells that the robot is expected in, step by step, its start first.
    keep_free
        Cells in which nothing may appear, such as the start, the trigger and the goal.
    spheres
        Probability that an obstacle is a sphere.
    on_way
        Probability that it appears on the way, where there is room for it.

    Returns
    -------
    tuple of Obstacle
        In the order drawn; cubes are named C1, C2, ... and spheres S1, S2, ...

    Raises
    ------
    ValueError
        If the maze has too few free cells.

    Examples
    --------
    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> way = shortest_way(maze, maze.start, maze.triggers["T4"], maze.goals["G2"])
    >>> for obstacle in random_obstacles(maze, Stream(7), 3, way):
    ...     print(obstacle)
    S1 sphere 6,1 middle #8ca3cb at step 3
    S2 sphere 3,6 large #dcf66e at step 12
    C1 cube 7,7 small #de887f at step 5
    """
    taken = set(keep_free)
    free = [cell for cell in layout.cells if cell not in layout.solid]
    obstacles: list[Obstacle] = []
    numbers = dict.fromkeys(KINDS, 0)
    for _ in range(count):
        kind = KINDS[stream.uniform() >= 1 - spheres]
        size = stream.choose(SIZES)
        colour = f"#{stream.below(_COLOURS):06x}"
        left = [cell for cell in free if cell not in taken]
        cell, step = _place_and_step(stream, way, left, taken, on_way)
        taken.add(cell)
        numbers[kind] += 1
        name = f"{kind[0].upper()}{numbers[kind]}"
        obstacles.append(Obstacle(name, kind, cell, size, colour, Appears("step", step=step)))
    return tuple(obstacles)


def _place_and_step(
    stream: Stream, way: Sequence[Cell], free: Sequence[Cell], taken: set[Cell], on_way: float
) -> tuple[Cell, int]:
    """Draw where an obstacle appears and at which step."""
    if not free:
        raise ValueError(f"no free cell is left for another obstacle ({len(taken)} are taken or kept free)")
    spots = [spot for spot in range(1, len(way)) if way[spot] not in taken]
    if stream.uniform() < on_way and spots:
        spot = stream.choose(spots)
        # A way may pass a cell twice: an obstacle never appears where the robot then stands.
        before = [step for step in range(max(0, spot - FARTHEST), spot) if way[step] != way[spot]]
        return way[spot], stream.choose(before)
    return stream.choose(free), stream.below(len(way) + 1)
