"""Fields of grids: the kernels equal the plain searches, and the certificate finds every wrong entry."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray
from strategies import maze_layouts

from planners.borders import bordered, row_width, unbordered
from planners.fields import UNREACHED
from planners.grid import (
    MOST_CELLS,
    actions_in,
    certify_grid,
    grid_field,
    grid_first_actions,
    layout_grid,
    mutual,
    plain_first_actions,
    plain_grid_field,
)
from worlds import Layout, UserError
from worlds.layout import ACTIONS, DELTAS

Grid = tuple[NDArray[np.bool_], list[tuple[int, int]], NDArray[np.uint8] | None]


@st.composite
def grids(draw: st.DrawFn) -> Grid:
    """Draw a grid of any shape, some goals (perhaps blocked, doubled or none), and perhaps walls."""
    shape = draw(st.tuples(st.integers(1, 8), st.integers(1, 8)))
    free = draw(arrays.arrays(np.bool_, shape, elements=st.sampled_from([True, True, False])))
    cell = st.tuples(st.integers(0, shape[0] - 1), st.integers(0, shape[1] - 1))
    goals = draw(st.lists(cell, max_size=3))
    ways = st.integers(0, 15) | st.just(15)
    passages = draw(st.none() | arrays.arrays(np.uint8, shape, elements=ways))
    return free, goals, passages


def _by_networkx(free: NDArray[np.bool_], goals: list[tuple[int, int]]) -> NDArray[np.int32]:
    graph = nx.grid_2d_graph(*free.shape)
    graph.remove_nodes_from([cell for cell in np.ndindex(free.shape) if not free[cell]])
    out = np.full(free.shape, UNREACHED, np.int32)
    starts = {goal for goal in goals if free[goal]}
    found = nx.multi_source_dijkstra_path_length(graph, starts) if starts else {}
    for cell, steps in found.items():
        out[cell] = steps
    return out


@settings(max_examples=200, deadline=None)
@given(grids())
def test_the_kernel_equals_the_plain_search(grid: Grid) -> None:
    """Distances and optimal first actions are the same to the last bit and of the same types."""
    free, goals, passages = grid
    distance, plain = grid_field(free, goals, passages), plain_grid_field(free, goals, passages)
    assert distance.dtype == plain.dtype == np.int32
    assert np.array_equal(distance, plain)
    assert np.array_equal(grid_first_actions(distance, passages), plain_first_actions(free, plain, passages))


@settings(max_examples=100, deadline=None)
@given(grids())
def test_distances_are_networkx_s_shortest_paths(grid: Grid) -> None:
    """Without walls the plain search finds networkx's distances."""
    free, goals, _ = grid
    assert np.array_equal(plain_grid_field(free, goals), _by_networkx(free, goals))


@settings(max_examples=60, deadline=None)
@given(maze_layouts(most=4), st.booleans(), st.data())
def test_a_layout_s_grid_has_its_passages(layout: Layout, doors_open: bool, data: st.DataObject) -> None:
    """A step is possible on the grid exactly where the layout lets it pass; the same cells are reached."""
    free, passages = layout_grid(layout, doors_open=doors_open)
    for number, cell in enumerate(layout.cells):
        for action, (down, right) in enumerate(DELTAS):
            expected = layout.passage(number, action, doors_open=doors_open) >= 0
            to = (cell.row + down, cell.col + right)
            assert bool(free[cell] and passages[cell] >> action & 1 and free[to]) == expected
    goal = data.draw(st.sampled_from(sorted(layout.marks.values())))
    distance = grid_field(free, [goal], passages)
    reached = {cell for cell in layout.cells if distance[cell] != UNREACHED}
    assert reached == layout.reach([goal], doors_open=doors_open)


@settings(max_examples=100, deadline=None)
@given(grids())
def test_a_right_field_has_no_fault(grid: Grid) -> None:
    """The certificate of every searched field is accepted."""
    free, goals, passages = grid
    assert certify_grid(free, goals, grid_field(free, goals, passages), passages) == ()


@settings(max_examples=300, deadline=None)
@given(grids(), st.data())
def test_any_wrong_distance_is_found(grid: Grid, data: st.DataObject) -> None:
    """One entry changed to any other value, UNREACHED included, is a fault."""
    free, goals, passages = grid
    wrong = np.array(grid_field(free, goals, passages))
    cell = data.draw(st.sampled_from(sorted(np.ndindex(free.shape))))
    value = data.draw(st.integers(-3, int(wrong.max()) + 3))
    assume(value != wrong[cell])
    wrong[cell] = value
    assert certify_grid(free, goals, wrong, passages)


@settings(max_examples=200, deadline=None)
@given(grids(), st.data())
def test_a_field_of_another_grid_is_found(grid: Grid, data: st.DataObject) -> None:
    """After a cell is blocked or freed the old field is accepted only where nothing changed."""
    free, goals, passages = grid
    old = grid_field(free, goals, passages)
    cell = data.draw(st.sampled_from(sorted(np.ndindex(free.shape))))
    changed = free.copy()
    changed[cell] ^= True
    same = np.array_equal(old, plain_grid_field(changed, goals, passages))
    assert (certify_grid(changed, goals, old, passages) == ()) == same


@pytest.mark.parametrize(
    ("distance", "fault"),
    [
        ([0, 1, 2, -1, 0], "distance 0 and the goals differ: cell 0,4"),
        ([0, 1, 3, -1, -1], "no step leads to distance - 1: cell 0,2"),
        ([0, 3, 2, -1, -1], "a step leads below distance - 1: cell 0,1"),
        ([0, 1, -1, -1, -1], "an unreached cell has a step to a reached one: cell 0,2"),
        ([0, 1, 2, 3, -1], "a blocked cell has a distance: cell 0,3"),
        ([0, 1, 2, -1, -2], "a distance is negative: cell 0,4"),
    ],
)
def test_faults_are_named(distance: list[int], fault: str) -> None:
    """Each way of being wrong, worked out by hand on a corridor with a blocked cell, has its words."""
    free, goals = [[True, True, True, False, True]], [(0, 0)]
    assert certify_grid(free, goals, [[0, 1, 2, -1, -1]]) == ()
    assert fault in certify_grid(free, goals, [distance])


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.3]), st.integers(250, 330))
def test_wide_grids(seed: int, blocked: float, cols: int) -> None:
    """Wide rows have a wider border, and the field of hundreds of goals is certified all the same."""
    rng = np.random.default_rng(seed)
    free = rng.random((60, cols)) >= blocked
    goals = [(0, int(col)) for col in range(cols)]
    distance = grid_field(free, goals)
    assert certify_grid(free, goals, distance) == ()
    assert np.array_equal(grid_first_actions(distance), plain_first_actions(free, distance))


def test_many_goals_outgrow_the_queue() -> None:
    """More goals than the queue has room for are all of distance 0."""
    free = np.ones((300, 300), np.bool_)
    assert not grid_field(free, list(np.ndindex(free.shape))).any()


def test_a_passage_needs_both_cells() -> None:
    """A step that only one of its two cells allows is no step, and none leads off the grid."""
    assert mutual(np.array([[15, 0, 15, 15]], np.uint8)).tolist() == [[0, 0, 8, 4]]
    assert grid_field(np.ones((1, 2)), [(0, 0)], np.array([[15, 0]])).tolist() == [[0, -1]]


def test_actions_are_named_in_order() -> None:
    """The sixteen sets have the names of their bits."""
    for bits in range(16):
        assert actions_in(bits) == tuple(name for a, name in enumerate(ACTIONS) if bits & 2**a)


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 5), st.integers(1, 300))
def test_a_border_comes_off_again(rows: int, cols: int) -> None:
    """A grid is found again inside its border, which is zero, and wide rows take an odd number of lines."""
    values = np.arange(1, rows * cols + 1).reshape(rows, cols)
    entries = bordered(values)
    assert np.array_equal(unbordered(entries, values.shape), values)
    assert np.count_nonzero(entries) == values.size
    assert row_width(cols) > cols
    assert cols < 256 or row_width(cols) % 32 == 16


def test_what_does_not_fit_is_refused() -> None:
    """Wrong shapes, goals off the grid and grids too large are told as the user's errors."""
    free = np.ones((2, 3), np.bool_)
    with pytest.raises(UserError, match=r"the cell 2,0 is not on the grid of 2 rows and 3 columns"):
        grid_field(free, [(2, 0)])
    with pytest.raises(UserError, match=r"the passages have shape \(3, 2\), the grid \(2, 3\)"):
        grid_field(free, [(0, 0)], np.full((3, 2), 15))
    with pytest.raises(UserError, match=r"the field has shape \(1, 3\), the grid \(2, 3\)"):
        certify_grid(free, [(0, 0)], np.zeros((1, 3)))
    with pytest.raises(UserError, match=r"rows and columns, not shape \(3,\)"):
        grid_field(free[0], [])


def test_a_grid_too_large_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """More cells than 32-bit distances can count are refused before any work."""
    assert MOST_CELLS < 2**30
    monkeypatch.setattr("planners.grid.MOST_CELLS", 5)
    with pytest.raises(UserError, match="the grid has 6 cells; fields go up to 5"):
        grid_field(np.ones((2, 3)), [])
