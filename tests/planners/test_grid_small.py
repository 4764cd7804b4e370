"""Fields of up to 64 cells, a word at a time, equal the plain search."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from planners.bitboards import action_sets, cells_in, passage_words, plain_small_fields, small_fields, words
from planners.grid import grid_field, grid_first_actions, layout_grid
from worlds import UserError, load_layout

SHAPES = [(rows, cols) for rows in range(1, 65) for cols in range(1, 64 // rows + 1)]
Batch = tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.uint8]]


@st.composite
def batches(draw: st.DrawFn) -> Batch:
    """Draw grids of one shape with goals, and walls that they share or each its own."""
    shape = (draw(st.integers(1, 3)), *draw(st.sampled_from(SHAPES) | st.just((8, 8))))
    free = draw(arrays.arrays(np.bool_, shape, elements=st.sampled_from([True, True, False])))
    goals = draw(arrays.arrays(np.bool_, shape, elements=st.sampled_from([True, *[False] * 12])))
    ways = st.integers(0, 15) | st.just(15)
    passages = draw(arrays.arrays(np.uint8, shape if draw(st.booleans()) else shape[1:], elements=ways))
    return free, goals, passages


@settings(max_examples=200, deadline=None)
@given(batches())
def test_words_equal_the_plain_search(batch: Batch) -> None:
    """The four words of every grid are those of its plain search."""
    free, goals, passages = batch
    fields = small_fields(words(free), words(goals), passage_words(passages), free.shape[2])
    assert fields.dtype == np.uint64
    assert np.array_equal(fields, plain_small_fields(free, goals, passages))


@settings(max_examples=100, deadline=None)
@given(batches())
def test_words_are_sets_of_cells(batch: Batch) -> None:
    """Cells come back from their word, cell by cell in reading order."""
    free, _, _ = batch
    packed = words(free)
    assert np.array_equal(cells_in(packed, free.shape[1:]), free)
    assert packed.tolist() == [sum(1 << int(i) for i in np.flatnonzero(grid)) for grid in free]


def test_the_paper_s_maze_in_one_batch() -> None:
    """One cube on each free cell in turn: all fields of the paper's maze at once, each as the grid's."""
    maze = load_layout("two_rooms")
    free, passages = layout_grid(maze, doors_open=True)
    goal = maze.goals["G2"]
    cubes = [cell for cell in maze.cells if cell != goal]
    grids = np.repeat(free[None], len(cubes), axis=0)
    goals = np.zeros_like(grids)
    goals[(slice(None), *goal)] = True
    for grid, cube in zip(grids, cubes, strict=True):
        grid[cube] = False
    sets = action_sets(small_fields(words(grids), words(goals), passage_words(passages), maze.cols), (8, 8))
    for grid, found in zip(grids, sets, strict=True):
        assert np.array_equal(found, grid_first_actions(grid_field(grid, [goal], passages), passages))


def test_what_does_not_fit_is_refused() -> None:
    """Too many cells, and shapes that do not go together, are told."""
    with pytest.raises(UserError, match="5 x 13 cells do not fit into 64 bits"):
        words(np.ones((5, 13)))
    with pytest.raises(UserError, match=r"shapes \(2,\) and \(3,\)"):
        small_fields(np.zeros(2), np.zeros(3), np.zeros(4), 8)
    with pytest.raises(
        UserError, match=r"the passages have shape \(3, 4\); give \(4,\), or \(N, 4\) for 2 grids"
    ):
        small_fields(np.zeros(2), np.zeros(2), np.zeros((3, 4)), 8)
    with pytest.raises(UserError, match="cannot have 65 columns"):
        small_fields(np.zeros(2), np.zeros(2), np.zeros(4), 65)
