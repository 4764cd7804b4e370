from itertools import pairwise

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import maze_layouts

from worlds import KINDS, SIZES, Cell, Episode, Layout, Stream, load_layout
from worlds.appearing import random_obstacles, shortest_way

TWO_ROOMS = load_layout("two_rooms")
WAY = shortest_way(TWO_ROOMS, Cell(1, 0), TWO_ROOMS.triggers["T4"], TWO_ROOMS.goals["G2"])
ENDS = frozenset({WAY[0], WAY[-1], TWO_ROOMS.triggers["T4"]})


@settings(max_examples=60, deadline=None)
@given(maze_layouts())
def test_a_way_is_as_short_as_networkx_s(layout: Layout) -> None:
    """Its length is that of the two shortest paths, and an episode can follow it to the goal."""
    trigger, goal = layout.triggers["T1"], layout.goals["G1"]
    way = shortest_way(layout, layout.start, trigger, goal)
    length = 0
    for ends, doors_open in (((layout.start, trigger), False), ((trigger, goal), True)):
        graph = nx.Graph(
            (cell, layout.cells[to])
            for cell in layout.reach([layout.start], doors_open=True)
            for action in range(4)
            if (to := layout.passage(layout.number(cell), action, doors_open=doors_open)) >= 0
        )
        length += nx.shortest_path_length(graph, *ends)
    assert len(way) - 1 == length
    episode = Episode(layout, "T1", "G1", layout.start)
    for cell, to in pairwise(way):
        assert not episode.reached
        number = layout.number(cell)
        action = next(
            a
            for a in range(4)
            if layout.passage(number, a, doors_open=episode.state.doors_open) == layout.number(to)
        )
        assert episode.step(action).moved
    assert episode.reached


def test_ties_go_north_south_west_east() -> None:
    """From 6,1 the way to D2 and on goes North before East."""
    after_trigger = WAY[WAY.index(Cell(6, 1)) :]
    assert after_trigger[:2] == (Cell(6, 1), Cell(5, 1))
    assert WAY[:6] == tuple(Cell(row, 0) for row in range(1, 7))


def test_no_way_is_an_error() -> None:
    """With doors shut, no way leads to a trigger in room B."""
    with pytest.raises(ValueError, match="no way leads from 1,0 to 3,7 in layout 'two_rooms'"):
        shortest_way(TWO_ROOMS, Cell(1, 0), TWO_ROOMS.goals["G2"], TWO_ROOMS.goals["G2"])


@given(st.integers(0, 2**32), st.integers(0, 12))
def test_drawn_obstacles_keep_the_rules(seed: int, count: int) -> None:
    """Cells are distinct, free and not among those kept free; names, kinds, sizes and colours fit."""
    obstacles = random_obstacles(TWO_ROOMS, Stream(seed), count, WAY, ENDS)
    cells = [obstacle.cell for obstacle in obstacles]
    assert len(set(cells)) == len(obstacles) == count
    assert ENDS.isdisjoint(cells)
    for kind in KINDS:
        names = [obstacle.name for obstacle in obstacles if obstacle.kind == kind]
        assert names == [f"{kind[0].upper()}{i + 1}" for i in range(len(names))]
    for obstacle in obstacles:
        assert obstacle.size in SIZES
        assert len(obstacle.colour) == 7
        assert 0 <= int(obstacle.colour.removeprefix("#"), 16) < 1 << 24
        assert obstacle.appears.event == "step"
        assert 0 <= obstacle.appears.step <= len(WAY)


@given(st.integers(0, 2**32), st.integers(0, 11))
def test_a_larger_count_adds_to_the_same_obstacles(seed: int, count: int) -> None:
    """The stream decides, and the first obstacles do not depend on how many follow."""
    fewer = random_obstacles(TWO_ROOMS, Stream(seed), count, WAY, ENDS)
    assert random_obstacles(TWO_ROOMS, Stream(seed), count + 1, WAY, ENDS)[:count] == fewer


def _before(way: tuple[Cell, ...], cell: Cell, step: int) -> list[int]:
    """Return how many cells before `cell` a robot on the way is at a step, for each passing that is near."""
    return [i - step for i, at in enumerate(way) if at == cell and 1 <= i - step <= 3 and way[step] != cell]


def test_most_obstacles_appear_shortly_before_the_robot() -> None:
    """Of 4,000 single draws about 3,000 (sigma 27), and a few by chance, appear 1 to 3 cells ahead."""
    ahead: list[int] = []
    for seed in range(4000):
        (obstacle,) = random_obstacles(TWO_ROOMS, Stream(seed), 1, WAY, ENDS)
        step = obstacle.appears.step
        if step < len(WAY):
            ahead += _before(WAY, obstacle.cell, step)[:1]
    # A draw off the way hits a cell shortly before the robot in about 4 % of cases.
    assert 3000 - 110 < len(ahead) < 3050 + 110
    assert all(ahead.count(n) > 800 for n in (1, 2, 3))


def test_obstacles_come_in_every_kind_and_size() -> None:
    """600 draws hold each of the six combinations about 100 times (sigma 9)."""
    drawn = [random_obstacles(TWO_ROOMS, Stream(seed), 1, WAY)[0] for seed in range(600)]
    for kind in KINDS:
        for size in SIZES:
            assert 55 < sum((o.kind, o.size) == (kind, size) for o in drawn) < 145


def test_a_way_there_and_back_never_puts_an_obstacle_on_the_robot() -> None:
    """On a way that turns round, the robot is elsewhere when an obstacle appears on it."""
    way = (Cell(0, 0), Cell(0, 1), Cell(0, 2), Cell(0, 1), Cell(0, 0))
    for seed in range(200):
        (obstacle,) = random_obstacles(TWO_ROOMS, Stream(seed), 1, way, on_way=1.0)
        assert _before(way, obstacle.cell, obstacle.appears.step)


def test_a_full_maze_is_an_error() -> None:
    """One obstacle more than there are free cells is refused; as many as there are is not."""
    room = 64 - len(ENDS)
    assert len(random_obstacles(TWO_ROOMS, Stream(1), room, WAY, ENDS)) == room
    with pytest.raises(ValueError, match="no free cell is left for another obstacle"):
        random_obstacles(TWO_ROOMS, Stream(1), room + 1, WAY, ENDS)
