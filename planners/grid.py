"""Distance fields of grids, searched fast, the sets of optimal first actions, and a separate check.

Importing this module loads numba. The searches stand here a second time in plain words, `plain_grid_field`
and `plain_first_actions`: what the fast ones return is equal to what those return.

A grid is a bool array of its free cells, shape (rows, cols). Walls between cells, if there are any, come as
`passages`, shape (rows, cols) with four bits a cell: bit 0 is set if no wall stops a step to the North,
bits 1 to 3 likewise South, West and East. A step needs the bits of both of its cells.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planners.borders import V, bordered, bordered_size, places, unbordered
from planners.fields import UNREACHED
from planners.grid_kernels import field, first_actions
from worlds import UserError
from worlds.layout import ACTIONS, DELTAS, Cell, Layout

MOST_CELLS: Final = 2**30 - 2**16
"""How many cells a grid may have; distances are 32-bit integers."""
ROOM: Final = 2**15
"""Entries of a search's queue to start with; it grows."""
_ALL: Final = 15
_BACK: Final = (1, 0, 3, 2)  # the action that undoes each

Free = NDArray[np.bool_]
Passages = NDArray[np.uint8]
Distance = NDArray[np.int32]


def grid_field(
    free: ArrayLike, goals: Iterable[tuple[int, int]], passages: ArrayLike | None = None
) -> Distance:
    """Return every cell's steps to the nearest goal, -1 where it is blocked or no way leads to one.

    Breadth-first search from the goals, in time proportional to the cells.

    Parameters
    ----------
    free
        The free cells, shape (rows, cols).
    goals
        The goals' rows and columns. A goal that is blocked counts for nothing.
    passages
        Four bits a cell for the steps that no wall stops, shape (rows, cols); left out, there are no walls.

    Returns
    -------
    distance
        Shape (rows, cols), 32-bit integers; a view of a larger array.

    Raises
    ------
    UserError
        If a goal is not on the grid, the shapes differ, or the grid has too many cells.

    Examples
    --------
    >>> free = np.array([[1, 1, 1], [1, 0, 1], [1, 0, 1]], bool)
    >>> grid_field(free, [(2, 2)])
    array([[ 4,  3,  2],
           [ 5, -1,  1],
           [ 6, -1,  0]], dtype=int32)
    """
    grid, ways = checked_grid(free, passages)
    at = places(grid.shape, checked_cells(grid.shape, goals))
    steps = np.empty(bordered_size(grid.shape), np.int32)
    field(grid, at, None if ways is None else bordered(ways), steps, np.empty(ROOM, np.uint32))
    return unbordered(steps, grid.shape)


def grid_first_actions(distance: Distance, passages: ArrayLike | None = None) -> NDArray[np.uint8]:
    """Return the set of optimal first actions of every cell: bits 0 to 3 for North, South, West, East.

    An action is optimal where it leads one step nearer. Goals and cells without a way have none.

    Parameters
    ----------
    distance
        What `grid_field` returns, shape (rows, cols).
    passages
        The same as for the field.

    Examples
    --------
    >>> sets = grid_first_actions(grid_field(np.ones((2, 3), bool), [(1, 2)]))
    >>> sets
    array([[10, 10,  2],
           [ 8,  8,  0]], dtype=uint8)
    >>> actions_in(sets[0, 0])
    ('South', 'East')
    """
    steps = np.ascontiguousarray(distance, np.int32)
    sets = np.empty(steps.shape, np.uint8)
    first_actions(steps, sets)
    if passages is not None:
        sets &= mutual(_four_bits(passages, steps.shape))
    return sets


def actions_in(actions: int) -> tuple[str, ...]:
    """Return the names of a set of actions, in the order that breaks ties.

    Examples
    --------
    >>> actions_in(0b1001)
    ('North', 'East')
    """
    return tuple(name for a, name in enumerate(ACTIONS) if int(actions) >> a & 1)


def certify_grid(
    free: ArrayLike, goals: Iterable[tuple[int, int]], distance: ArrayLike, passages: ArrayLike | None = None
) -> tuple[str, ...]:
    """Check a field in O(cells), without searching: each fault in words, none if the field is right.

    Right means, as for `planners.certify`: 0 exactly at free goals; from a reached cell no step leads below
    distance - 1, and some step leads to it; no step leads from an unreached cell to a reached one; blocked
    cells are unreached. By induction on the distance these make every entry the true number of steps.

    Parameters
    ----------
    free, goals, passages
        The grid, as for `grid_field`.
    distance
        The field to check, shape (rows, cols).

    Examples
    --------
    >>> certify_grid([[1, 1, 1]], [(0, 0)], [[0, 1, 2]])
    ()
    >>> certify_grid([[1, 1, 0]], [(0, 0)], [[0, 1, 2]])
    ('a blocked cell has a distance: cell 0,2',)
    """
    grid, ways = checked_grid(free, passages)
    claimed = np.asarray(distance)
    if claimed.shape != grid.shape:
        raise UserError(
            f"the field has shape {claimed.shape}, the grid {grid.shape}; give the field of this grid"
        )
    goal = np.zeros(grid.shape, np.bool_)
    for row, col in checked_cells(grid.shape, goals):
        goal[row, col] = grid[row, col]
    reached = claimed != UNREACHED
    below, nearer, leak = (np.zeros(grid.shape, np.bool_) for _ in range(3))
    for action in range(len(ACTIONS)):
        after = _beside(np.where(grid, claimed, UNREACHED), action, UNREACHED)
        leads = grid & (after != UNREACHED)
        if ways is not None:
            leads &= (ways >> action & 1).astype(np.bool_)
        below |= leads & reached & (after < claimed - 1)
        nearer |= leads & (after == claimed - 1)
        leak |= leads & ~reached
    faults = {
        "distance 0 and the goals differ": (claimed == 0) != goal,
        "a step leads below distance - 1": below,
        "no step leads to distance - 1": grid & reached & ~goal & ~nearer,
        "an unreached cell has a step to a reached one": leak,
        "a blocked cell has a distance": ~grid & reached,
        "a distance is negative": claimed < UNREACHED,
    }
    return tuple(
        f"{fault}: cell {Cell(*map(int, np.argwhere(at)[0]))}" for fault, at in faults.items() if at.any()
    )


def layout_grid(layout: Layout, *, doors_open: bool) -> tuple[Free, Passages]:
    """Return a layout's free cells and its passages, each of shape (rows, cols).

    Examples
    --------
    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> free, passages = layout_grid(maze, doors_open=True)
    >>> int(grid_field(free, [maze.goals["G2"]], passages)[maze.start])
    9
    >>> free, passages = layout_grid(maze, doors_open=False)
    >>> int(grid_field(free, [maze.goals["G2"]], passages)[maze.start])
    -1
    """
    free = np.ones((layout.rows, layout.cols), np.bool_)
    for cell in layout.solid:
        free[cell] = False
    passages = np.full(free.shape, _ALL, np.uint8)
    for one, other in layout.walls if doors_open else layout.walls | layout.doors:
        action = DELTAS.index((other.row - one.row, other.col - one.col))
        passages[one] &= ~np.uint8(1 << action)
        passages[other] &= ~np.uint8(1 << _BACK[action])
    return free, mutual(passages)


def plain_grid_field(
    free: ArrayLike, goals: Iterable[tuple[int, int]], passages: ArrayLike | None = None
) -> Distance:
    """Return what `grid_field` returns, by a search that can be read."""
    grid, ways = checked_grid(free, passages)
    distance = np.full(grid.shape, UNREACHED, np.int32)
    queue = deque(dict.fromkeys(goal for goal in checked_cells(grid.shape, goals) if grid[goal]))
    for goal in queue:
        distance[goal] = 0
    while queue:
        cell = queue.popleft()
        for _, to in _steps(grid, ways, cell):
            if distance[to] == UNREACHED:
                distance[to] = distance[cell] + 1
                queue.append(to)
    return distance


def plain_first_actions(
    free: ArrayLike, distance: Distance, passages: ArrayLike | None = None
) -> NDArray[np.uint8]:
    """Return what `grid_first_actions` returns, cell by cell."""
    grid, ways = checked_grid(free, passages)
    sets = np.zeros(grid.shape, np.uint8)
    for cell in np.ndindex(grid.shape):
        for action, to in _steps(grid, ways, (cell[0], cell[1])):
            if distance[cell] > 0 and distance[to] == distance[cell] - 1:
                sets[cell] |= np.uint8(1 << action)
    return sets


def _steps(free: Free, ways: Passages | None, cell: tuple[int, int]) -> Iterator[tuple[int, tuple[int, int]]]:
    """Yield each action that leads from a cell to a free one, and that cell."""
    rows, cols = free.shape
    for action, (down, right) in enumerate(DELTAS):
        to = (cell[0] + down, cell[1] + right)
        open_way = ways is None or ways[cell] >> action & 1
        if open_way and 0 <= to[0] < rows and 0 <= to[1] < cols and free[cell] and free[to]:
            yield action, to


def checked_grid(free: ArrayLike, passages: ArrayLike | None) -> tuple[Free, Passages | None]:
    """Return a grid and its mutual passages as arrays.

    Raises
    ------
    UserError
        If the shapes differ, or the grid has too many cells.
    """
    grid = np.ascontiguousarray(free, np.bool_)
    if grid.ndim != len(Cell._fields):
        raise UserError(f"a grid has rows and columns, not shape {grid.shape}; give it two dimensions")
    if grid.size > MOST_CELLS:
        raise UserError(f"the grid has {grid.size} cells; fields go up to {MOST_CELLS}")
    return grid, None if passages is None else mutual(_four_bits(passages, grid.shape))


def checked_cells(shape: tuple[int, ...], cells: Iterable[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Yield cells, each of which must be on the grid.

    Raises
    ------
    UserError
        If one is not.
    """
    rows, cols = shape
    for row, col in cells:
        if not (0 <= row < rows and 0 <= col < cols):
            raise UserError(f"the cell {row},{col} is not on the grid of {rows} rows and {cols} columns")
        yield int(row), int(col)


def mutual(passages: Passages) -> Passages:
    """Return the passages less those that the other cell does not have, or that lead off the grid."""
    ways = np.zeros_like(passages)
    for action, back in enumerate(_BACK):
        ways |= (passages >> action & _beside(passages, action, 0) >> back & 1) << action
    return ways


def _four_bits(passages: ArrayLike, shape: tuple[int, ...]) -> Passages:
    ways = np.asarray(passages, np.uint8)
    if ways.shape != shape:
        raise UserError(
            f"the passages have shape {ways.shape}, the grid {shape}; give four bits for each cell"
        )
    return ways


def _beside(values: NDArray[V], action: int, edge: int) -> NDArray[V]:
    """Return for each cell the value of the cell that an action leads to, `edge` off the grid."""
    out = np.full_like(values, edge)
    rows, cols = values.shape
    down, right = DELTAS[action]
    here = (slice(max(-down, 0), rows - max(down, 0)), slice(max(-right, 0), cols - max(right, 0)))
    there = (slice(max(down, 0), rows - max(-down, 0)), slice(max(right, 0), cols - max(-right, 0)))
    out[here] = values[there]
    return out
