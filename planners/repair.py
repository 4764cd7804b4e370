"""Replanning on a grid: a distance field that is repaired when an obstacle appears or goes.

Importing this module loads numba. A repaired field equals the field searched anew, always.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planners.borders import bordered, bordered_size, place, places, row_width, unbordered
from planners.fields import UNREACHED
from planners.grid import ROOM, checked_cells, checked_grid
from planners.grid_kernels import BLOCKED, FAR, MANY, again, block_cell, free_cell
from worlds.layout import ACTIONS

SMALLEST: Final = 64 * 64
"""Fewer cells than these are always searched anew."""
SHARE: Final = 1 / 6
"""The share of the reached cells that may lose their way before the field is searched anew.

A repair takes about five times as long for each lost cell as a search does for each cell that it reaches.
"""
_FEW: Final = 1 / 1024
"""The share of all cells that may lose their way with no sign that a search would reach them again.

Behind an obstacle in a corridor near the goal a search has next to nothing left to do but to write the
field: what the repair does until it gives up must be little beside that.
"""


class RepairableField:
    """The distance field of a grid whose cells are blocked and freed one at a time.

    Parameters
    ----------
    free
        The free cells at first, shape (rows, cols).
    goals
        The goals' rows and columns. A goal counts for nothing while it is blocked.
    passages
        Four bits a cell for the steps that no wall stops, as for `planners.grid.grid_field`.
    smallest
        Below so many cells every change is followed by a search anew.
    share
        The share of the reached cells that may lose their way before a search anew takes over.

    Attributes
    ----------
    shape
        The grid's rows and columns.
    reached
        How many cells have a way to a goal.
    searches
        How often the whole field has been searched, the first time included.

    Raises
    ------
    UserError
        If a goal is not on the grid, the shapes differ, or the grid has too many cells.

    Examples
    --------
    >>> field = RepairableField(np.ones((3, 3), bool), [(0, 2)])
    >>> field.steps((2, 2)), field.block((1, 2)), field.steps((2, 2))
    (2, True, 4)
    >>> field.first_actions((2, 2)), field.first_actions((2, 1))
    (4, 1)
    >>> field.free((1, 2)), field.block((0, 0)), field.block((0, 0))
    (True, True, False)
    >>> field.distance
    array([[-1,  1,  0],
           [ 3,  2,  1],
           [ 4,  3,  2]], dtype=int32)
    """

    def __init__(
        self,
        free: ArrayLike,
        goals: Iterable[tuple[int, int]],
        passages: ArrayLike | None = None,
        *,
        smallest: int = SMALLEST,
        share: float = SHARE,
    ) -> None:
        grid, ways = checked_grid(free, passages)
        self.shape: Final = (grid.shape[0], grid.shape[1])
        self._goals = places(grid.shape, checked_cells(grid.shape, goals))
        self._at_goal = frozenset(self._goals.tolist())
        self._passages = None if ways is None else bordered(ways)
        self._width = np.uint64(row_width(grid.shape[1]))
        self._steps = np.full(bordered_size(grid.shape), BLOCKED, np.int32)
        unbordered(self._steps, grid.shape)[grid] = FAR
        self._repairs = grid.size >= smallest
        most = int(share * grid.size) + 1 if self._repairs else 0
        self._share = share
        self._few = int(_FEW * grid.size)
        self._lost = np.empty(3 * most, np.uint32)
        self._queue = np.empty(max(ROOM, 4 * (most + 2)), np.uint32)
        self.searches = 0
        self.reached: int
        self.recompute()

    @property
    def distance(self) -> NDArray[np.int32]:
        """Every cell's steps to the nearest goal, -1 where there is no way, shape (rows, cols); a copy."""
        steps = unbordered(self._steps, self.shape)
        return np.where(steps == FAR, np.int32(UNREACHED), steps)

    @property
    def free_cells(self) -> NDArray[np.bool_]:
        """The cells that are free now, shape (rows, cols); a copy."""
        free: NDArray[np.bool_] = unbordered(self._steps, self.shape) != BLOCKED
        return free

    def steps(self, cell: tuple[int, int]) -> int:
        """Return the steps from a cell to the nearest goal, -1 if it is blocked or there is no way."""
        steps = int(self._steps[self._place(cell)])
        return UNREACHED if steps == FAR else steps

    def first_actions(self, cell: tuple[int, int]) -> int:
        """Return the set of optimal first actions of a cell: bits 0 to 3 for North, South, West, East."""
        here = self._place(cell)
        steps = int(self._steps[here])
        if steps <= 0 or steps == FAR:
            return 0
        ways = (1 << len(ACTIONS)) - 1 if self._passages is None else int(self._passages[here])
        width = int(self._width)
        beside = (here - width, here + width, here - 1, here + 1)
        return ways & sum(1 << a for a, there in enumerate(beside) if self._steps[there] == steps - 1)

    def block(self, cell: tuple[int, int]) -> bool:
        """Put an obstacle on a cell; return whether it was free."""
        here = self._place(cell)
        if self._steps[here] == BLOCKED:
            return False
        if self._repairs:
            reached = block_cell(
                self._steps,
                self._passages,
                self._width,
                here,
                self._goals,
                self._queue,
                self._lost,
                self.reached,
                self._share,
                self._few,
            )
            self.searches += reached < 0
            self.reached = reached if reached >= 0 else reached + MANY
        else:
            self._steps[here] = BLOCKED
            self.recompute()
        return True

    def free(self, cell: tuple[int, int]) -> bool:
        """Take the obstacle off a cell; return whether it was blocked."""
        here = self._place(cell)
        if self._steps[here] != BLOCKED:
            return False
        if self._repairs:
            goal = here in self._at_goal
            self.reached = free_cell(
                self._steps, self._passages, self._width, here, goal, self._queue, self.reached
            )
        else:
            self._steps[here] = FAR
            self.recompute()
        return True

    def recompute(self) -> None:
        """Search the whole field anew."""
        self.searches += 1
        self.reached = again(self._steps, self._passages, self._width, self._goals, self._queue)

    def _place(self, cell: tuple[int, int]) -> int:
        row, col = cell
        rows, cols = self.shape
        if not (0 <= row < rows and 0 <= col < cols):
            next(checked_cells(self.shape, [cell]))  # which tells what is wrong
        return place(self.shape, row, col)
