from pathlib import Path

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import SMALL, maze_layouts

from worlds import (
    ACTIONS,
    DELTAS,
    Appears,
    Cell,
    Layout,
    Obstacle,
    layout_names,
    load_layout,
    parse_layout,
)
from worlds.layout import edge


def _graph(layout: Layout, *, doors_open: bool) -> nx.Graph:
    """Return the maze as networkx sees it, from walls and doors rather than from `neighbours`."""
    free = [cell for cell in layout.cells if cell not in layout.solid]
    shut = layout.walls if doors_open else layout.walls | layout.doors
    graph = nx.Graph()
    graph.add_nodes_from(free)
    graph.add_edges_from(
        (a, b)
        for a in free
        for b in free
        if abs(a.row - b.row) + abs(a.col - b.col) == 1 and edge(a, b) not in shut
    )
    return graph


def test_the_small_layout_reads_as_written() -> None:
    """Every part of the text is where it should be."""
    layout = parse_layout(SMALL)
    assert (layout.name, layout.rows, layout.cols) == ("small", 2, 4)
    assert layout.walls == {(Cell(0, 1), Cell(0, 2))}
    assert layout.doors == {(Cell(1, 1), Cell(1, 2))}
    assert layout.marks == {"T1": (0, 1), "G1": (1, 3), "D1": (1, 2)}
    assert (layout.start, layout.trigger, layout.goal) == ((1, 0), "T1", "G1")
    assert layout.solid == frozenset()
    assert layout.chosen == frozenset()
    assert layout.obstacles == (Obstacle("S1", "sphere", Cell(0, 0), "middle", "#d9332b", Appears("start")),)


@pytest.mark.parametrize(
    ("when", "appears"),
    [
        ("at start", Appears("start")),
        ("at step 12", Appears("step", step=12)),
        ("when robot 0,1", Appears("robot", cell=Cell(0, 1))),
        ("when robot T1", Appears("robot", cell=Cell(0, 1))),
        ("when doors open", Appears("doors")),
    ],
)
def test_an_obstacle_says_when_it_appears(when: str, appears: Appears) -> None:
    """Each event has its words."""
    layout = parse_layout(SMALL.replace("at start", when))
    assert layout.obstacles[0].appears == appears


def test_a_mark_names_a_cell_and_comments_are_skipped() -> None:
    """`start D1`-style cells work, and '#' begins a comment line."""
    text = SMALL.replace("start 1,0", "# a comment\n  # and another\nstart T2").replace(
        ".   .   :", "T2  .   :"
    )
    assert parse_layout(text).start == Cell(1, 0)


def test_solid_cells_are_no_part_of_any_room() -> None:
    """An X is closed to every action."""
    layout = parse_layout(SMALL.replace("|  .   .", "|  X   ."))
    assert layout.solid == {Cell(0, 2)}
    assert all(layout.solid.isdisjoint(room) for room in layout.rooms.values())
    number = layout.number(Cell(0, 3))
    assert layout.neighbours[number][ACTIONS.index("West")] == -1


def test_the_file_s_name_stands_in_for_a_missing_name() -> None:
    """A layout without a name line is called after its source."""
    assert parse_layout(SMALL.replace("name small\n", ""), source="mazes/tiny.maze").name == "tiny"


def test_a_file_is_read_by_its_path(tmp_path: Path) -> None:
    """A path in words or as a Path gives the same layout as its text."""
    path = tmp_path / "small.maze"
    path.write_text(SMALL, encoding="utf-8")
    assert load_layout(path) == load_layout(str(path)) == parse_layout(SMALL)


def test_two_rooms_has_what_the_paper_fixes() -> None:
    """Figures 2, 3 and 13: an 8 x 8 maze in two rooms, T4, G2, D1 and D2, two doors in one wall."""
    layout = load_layout("two_rooms")
    assert (layout.rows, layout.cols) == (8, 8)
    assert layout.triggers["T4"] == (6, 1)
    assert layout.goals["G2"] == (3, 7)
    assert layout.thresholds == {"D1": (2, 4), "D2": (5, 4)}
    assert layout.doors == {(Cell(2, 3), Cell(2, 4)), (Cell(5, 3), Cell(5, 4))}
    assert layout.walls == {(Cell(r, 3), Cell(r, 4)) for r in (0, 1, 3, 4, 6, 7)}
    assert layout.rooms == {
        "A": {cell for cell in layout.cells if cell.col < 4},
        "B": {cell for cell in layout.cells if cell.col >= 4},
    }
    assert set(layout.triggers) == {"T1", "T2", "T3", "T4"}
    assert set(layout.goals) == {"G1", "G2", "G3", "G4"}
    assert set(layout.triggers.values()) <= layout.rooms["A"]
    assert set(layout.goals.values()) <= layout.rooms["B"]


def test_two_rooms_marks_the_rest_as_chosen() -> None:
    """Exactly what the paper does not fix is marked, and every name is the layout's."""
    layout = load_layout("two_rooms")
    names = {*layout.marks, *(obstacle.name for obstacle in layout.obstacles), "start"}
    assert layout.chosen == names - {"T4", "G2", "D1", "D2"}
    assert {obstacle.name for obstacle in layout.obstacles} == {"C1", "C2", "C3", "S1", "S2", "S3"}
    assert all((obstacle.kind == "cube") == (obstacle.name[0] == "C") for obstacle in layout.obstacles)


@pytest.mark.parametrize("name", layout_names())
def test_every_layout_of_the_package_loads(name: str) -> None:
    """A file in the package is called what it calls itself."""
    assert load_layout(name).name == name


@given(maze_layouts(), st.booleans())
def test_reach_and_rooms_are_networkx_components(layout: Layout, doors_open: bool) -> None:
    """What is connected is what networkx says, doors open or shut."""
    components = [frozenset(part) for part in nx.connected_components(_graph(layout, doors_open=doors_open))]
    for part in components:
        for cell in part:
            assert layout.reach([cell], doors_open=doors_open) == part
    if not doors_open:
        assert set(layout.rooms.values()) == set(components)
        assert list(layout.rooms) == [chr(ord("A") + i) for i in range(len(components))]
        assert all(layout.room(cell) == part for part in components for cell in part)


@given(maze_layouts(), st.data())
def test_reach_from_several_cells_is_the_union(layout: Layout, data: st.DataObject) -> None:
    """Each cell brings its own component."""
    graph = _graph(layout, doors_open=False)
    cells = data.draw(st.lists(st.sampled_from(sorted(graph)), max_size=3))
    expected = {to for cell in cells for to in nx.node_connected_component(graph, cell)}
    assert layout.reach(cells, doors_open=False) == expected


@given(maze_layouts(), st.booleans())
def test_passages_go_one_cell_and_both_ways(layout: Layout, doors_open: bool) -> None:
    """An action leads to the cell beside, if at all, and the opposite action leads back."""
    back = {0: 1, 1: 0, 2: 3, 3: 2}
    graph = _graph(layout, doors_open=doors_open)
    for cell in layout.cells:
        for action, (dr, dc) in enumerate(DELTAS):
            to = layout.passage(layout.number(cell), action, doors_open=doors_open)
            beside = Cell(cell.row + dr, cell.col + dc)
            assert (to >= 0) == graph.has_edge(cell, beside)
            if to >= 0:
                assert layout.cells[to] == beside
                assert layout.passage(to, back[action], doors_open=doors_open) == layout.number(cell)


def test_rooms_past_the_26th_have_two_letters() -> None:
    """A checkered maze of 3 x 19 cells has 29 rooms of one cell: A to Z, then AA, AB, AC."""
    solid = frozenset(Cell(r, c) for r in range(3) for c in range(19) if (r + c) % 2)
    none: frozenset[tuple[Cell, Cell]] = frozenset()
    layout = Layout("checkers", 3, 19, solid, none, none, {}, {}, {}, Cell(0, 0), "", "")
    assert list(layout.rooms)[25:] == ["Z", "AA", "AB", "AC"]


def test_a_cell_is_described_by_its_marks() -> None:
    """Marks come first, coordinates serve the rest."""
    layout = load_layout("two_rooms")
    assert [layout.describe(Cell(6, 1)), layout.describe(Cell(6, 2))] == ["T4", "6,2"]
