"""Layouts of any size, drawn from a seed: rooms, passages, doors, triggers, goals and obstacles.

The maze is a grid of rooms. One wall from top to bottom parts it in two: the robot starts on its left with
the triggers, the goals lie on its right, and every way through it is a door. Within each part the rooms
are joined by passages, so that the paper's maze (two rooms, two doors) is the smallest case.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from worlds.appearing import random_obstacles, shortest_way
from worlds.errors import UserError
from worlds.layout import Cell, Edge, Layout, Obstacle, edge
from worlds.randomness import Stream

_PASSAGES, _DOORS, _MARKS, _OBSTACLES = range(4)  # each part draws from a stream of its own
_MORE_PASSAGES = 0.5  # probability of a passage that no room needs


def generate_layout(
    rows: int,
    cols: int,
    seed: int,
    *,
    rooms: tuple[int, int] = (1, 2),
    doors: int = 2,
    triggers: int = 4,
    goals: int = 4,
    obstacles: int = 6,
) -> Layout:
    r"""Draw a maze that can be played: triggers before the doors, goals behind them, all within reach.

    Each part is drawn from a stream of its own: with more goals or obstacles the walls stay where they are.

    Parameters
    ----------
    rows, cols
        Size in cells.
    seed
        Names the maze: the same arguments give the same layout.
    rooms
        Rows and columns of rooms; the wall with the doors stands in the middle of the columns.
    doors
        Number of doors that the trigger opens.
    triggers, goals
        Number of candidate cells in the first and the second part.
    obstacles
        Number of cubes and spheres that appear in the example run, most of them on its way.

    Raises
    ------
    UserError
        If the maze is too small for what it is to hold.

    Examples
    --------
    >>> from worlds.layout_writing import layout_text
    >>> maze = generate_layout(5, 8, seed=1, rooms=(2, 4), triggers=2, goals=1, obstacles=2)
    >>> print(*layout_text(maze).splitlines()[2:9], sep="\n")
    grid
    .  .   |  .  T2  :  D1  .  |  .   .
    .  .   |  .  .   :  D2  .  |  .   .
    +  -      +  -      -   +     -   +
    .  .      .  .   |  .   .     .   .
    .  T1  |  .  .   |  .   .  |  .   .
    .  .   |  .  .   |  .   .  |  G1  .
    """
    down, across = rooms
    if min(rows, cols, down, doors, triggers, goals, obstacles + 1) < 1 or across < 2:
        raise UserError(
            "a maze needs cells, doors, triggers and goals, at least one of each, and two columns of rooms"
        )
    _refuse_crowds(rows, cols, rooms, doors, obstacles)
    heights, widths = _bands(rows, down), _bands(cols, across)
    cut = widths[across // 2].start
    walls = frozenset(_walls(Stream(seed, _PASSAGES), heights, widths))
    door_rows = sorted(Stream(seed, _DOORS).shuffled(range(rows))[:doors])
    thresholds = [Cell(row, cut) for row in door_rows]
    shut = frozenset(edge(Cell(cell.row, cut - 1), cell) for cell in thresholds)
    marks = Stream(seed, _MARKS)
    near = _draw(
        marks, [Cell(r, c) for r in range(rows) for c in range(cut)], triggers + 1, "start and triggers"
    )
    beyond = {Cell(r, c) for r in range(rows) for c in range(cut, cols)} - set(thresholds)
    far = _draw(marks, sorted(beyond), goals, "goals")
    t, g = _named("T", near[1:]), _named("G", far)
    layout = Layout(
        name=f"maze_{rows}x{cols}_{seed}",
        rows=rows,
        cols=cols,
        solid=frozenset(),
        walls=walls - shut,
        doors=shut,
        triggers=t,
        goals=g,
        thresholds=_named("D", thresholds),
        start=near[0],
        trigger=min(t),
        goal=min(g),
    )
    return replace(layout, obstacles=_appearing(layout, Stream(seed, _OBSTACLES), obstacles))


def _refuse_crowds(rows: int, cols: int, rooms: tuple[int, int], doors: int, obstacles: int) -> None:
    """Refuse what does not fit whatever is drawn."""
    fits = {
        f"{rooms[0]} x {rooms[1]} rooms": rooms[0] <= rows and rooms[1] <= cols,
        f"{doors} doors": doors <= rows,
        f"{obstacles} obstacles": obstacles <= rows * cols - 3,  # start, trigger and goal stay free
    }
    for what, fit in fits.items():
        if not fit:
            raise UserError(f"{what} do not fit in a maze of {rows} x {cols} cells; ask for fewer")


def _bands(cells: int, count: int) -> list[range]:
    """Part a side of the maze into `count` bands of nearly equal width."""
    return [range(a, b) for a, b in pairwise(i * cells // count for i in range(count + 1))]


def _walls(stream: Stream, heights: Sequence[range], widths: Sequence[range]) -> Iterator[Edge]:
    """Yield the walls between rooms, less the passages.

    Passages join all the rooms of a part; other neighbours are joined at random, so that there are ways to
    choose between.
    """
    cut = len(widths) // 2
    between = [((i, j), (i + 1, j)) for i in range(len(heights) - 1) for j in range(len(widths))]
    between += [((i, j), (i, j + 1)) for i in range(len(heights)) for j in range(len(widths) - 1)]
    joined = {(i, j): (i, j) for i in range(len(heights)) for j in range(len(widths))}

    def part(room: tuple[int, int]) -> tuple[int, int]:
        """Return the room that stands for all those joined with this one."""
        while joined[room] != room:
            room = joined[room]
        return room

    for a, b in stream.shuffled(between):
        wall = list(_wall(heights, widths, a, b))
        passage, wanted = stream.choose(wall), stream.uniform() < _MORE_PASSAGES
        parts = a[1] < cut <= b[1]  # here only doors lead through
        opened = not parts and (wanted or part(a) != part(b))
        if opened:
            joined[part(a)] = part(b)
        yield from (between for between in wall if not opened or between != passage)


def _wall(
    heights: Sequence[range], widths: Sequence[range], a: tuple[int, int], b: tuple[int, int]
) -> Iterator[Edge]:
    """Yield the edges between two rooms, `b` below `a` or to its right."""
    if a[1] == b[1]:
        row = heights[b[0]].start
        return (edge(Cell(row - 1, col), Cell(row, col)) for col in widths[a[1]])
    col = widths[b[1]].start
    return (edge(Cell(row, col - 1), Cell(row, col)) for row in heights[a[0]])


def _draw(stream: Stream, cells: Sequence[Cell], count: int, what: str) -> list[Cell]:
    """Draw cells without repetition."""
    if count > len(cells):
        raise UserError(
            f"{what}: {count} cells are needed and {len(cells)} are left; ask for fewer, or more cells"
        )
    return stream.shuffled(cells)[:count]


def _named(letter: str, cells: Sequence[Cell]) -> dict[str, Cell]:
    """Name marks T1, T2, ... or, past nine, T01, T02, ...: a text's marks come in order of name."""
    digits = len(str(len(cells)))
    return {f"{letter}{i:0{digits}}": cell for i, cell in enumerate(cells, start=1)}


def _appearing(layout: Layout, stream: Stream, count: int) -> tuple[Obstacle, ...]:
    trigger, goal = layout.triggers[layout.trigger], layout.goals[layout.goal]
    way = shortest_way(layout, layout.start, trigger, goal)
    return random_obstacles(layout, stream, count, way, frozenset({layout.start, trigger, goal}))
