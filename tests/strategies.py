"""Hypothesis strategies that the tests share: random mazes, and what happens in them."""

from __future__ import annotations

from hypothesis import assume
from hypothesis import strategies as st

from worlds import KINDS, SIZES, Appears, Cell, Layout, Obstacle
from worlds.layout import Edge, edge

SMALL = """\
name small
grid
.   T1  |  .   .
.   .   :  D1  G1
start 1,0
trigger T1
goal G1
obstacles
S1  sphere  0,0  middle  #D9332B  at start
"""
"""The text of a maze of two rooms, right in all its parts."""

ACTION_NUMBERS = st.integers(0, 3)


@st.composite
def maze_layouts(draw: st.DrawFn, most: int = 5) -> Layout:
    """Draw a maze of up to `most` x `most` cells that can be played: no mark is out of reach.

    Walls and doors stand on any side of a cell. There are one or two triggers, and one or two goals.
    """
    rows, cols = draw(st.integers(2, most)), draw(st.integers(2, most))
    cells = [Cell(r, c) for r in range(rows) for c in range(cols)]
    solid = draw(st.frozensets(st.sampled_from(cells), max_size=len(cells) // 4))
    edges = [
        edge(cell, to)
        for cell in cells
        for to in (Cell(cell.row + 1, cell.col), Cell(cell.row, cell.col + 1))
        if to in cells and not solid & {cell, to}
    ]
    sorts = st.sampled_from(["open", "open", "open", "wall", "door"])
    sort = dict(zip(edges, draw(st.lists(sorts, min_size=len(edges), max_size=len(edges))), strict=True))
    doors = [e for e in edges if sort[e] == "door"]
    thresholds = {f"D{i + 1}": draw(st.sampled_from(door)) for i, door in enumerate(doors)}
    bare = _bare(rows, cols, solid, frozenset(e for e in edges if sort[e] == "wall"), frozenset(doors))
    free = [cell for cell in cells if cell not in solid]
    start = draw(st.sampled_from(free))
    near = sorted(bare.reach([start], doors_open=False) - {start})
    assume(near)
    triggers = draw(st.lists(st.sampled_from(near), min_size=1, max_size=2, unique=True))
    far = sorted(bare.reach([start], doors_open=True) - set(triggers))
    goals = draw(st.lists(st.sampled_from(far), min_size=1, max_size=2, unique=True))
    return Layout(
        name="random",
        rows=rows,
        cols=cols,
        solid=solid,
        walls=bare.walls,
        doors=bare.doors,
        triggers={f"T{i + 1}": cell for i, cell in enumerate(triggers)},
        goals={f"G{i + 1}": cell for i, cell in enumerate(goals)},
        thresholds=thresholds,
        start=start,
        trigger="T1",
        goal="G1",
    )


def _bare(
    rows: int, cols: int, solid: frozenset[Cell], walls: frozenset[Edge], doors: frozenset[Edge]
) -> Layout:
    """Return a maze without marks, to ask it what is within reach."""
    return Layout("bare", rows, cols, solid, walls, doors, {}, {}, {}, Cell(0, 0), "", "")


@st.composite
def obstacles_in(draw: st.DrawFn, layout: Layout, most: int = 6) -> tuple[Obstacle, ...]:
    """Draw obstacles of any kind that appear at any event, also two in one cell."""
    cells = st.sampled_from([cell for cell in layout.cells if cell not in layout.solid])
    appears = st.one_of(
        st.just(Appears("start")),
        st.builds(Appears, st.just("step"), st.integers(0, 12)),
        st.builds(Appears, st.just("robot"), cell=cells),
        st.just(Appears("doors")),
    )
    count = draw(st.integers(0, most))
    return tuple(
        Obstacle(
            f"O{i}",
            draw(st.sampled_from(KINDS)),
            draw(cells),
            draw(st.sampled_from(SIZES)),
            appears=draw(appears),
        )
        for i in range(count)
    )
