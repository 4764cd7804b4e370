"""Grids of up to 64 cells: a set of cells is one 64-bit word, and a step moves all of its cells at once.

Importing this module loads numba. Bit `row * cols + col` of a word stands for a cell. A field comes as four
words: the cells in which North, South, West and East are optimal first actions.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planners.grid import grid_first_actions, mutual, plain_grid_field
from worlds import UserError
from worlds.jit import kernel
from worlds.layout import ACTIONS

CELLS: Final = 64
"""How many cells fit into a word."""

Words = NDArray[np.uint64]


def small_fields(free: ArrayLike, goals: ArrayLike, passages: ArrayLike, cols: int) -> Words:
    """Return the optimal first actions of all cells, for many pairs of a grid and its goals.

    Parameters
    ----------
    free
        The free cells of each grid as a word (`words`), shape (N,).
    goals
        The goals of each grid as a word, shape (N,). A goal that is blocked counts for nothing.
    passages
        For each action the cells that have such a step (`passage_words`), shape (4,), or (N, 4) if the
        grids' walls differ.
    cols
        The number of columns of all grids.

    Returns
    -------
    fields
        Shape (N, 4): the cells in which each action is optimal, as `planners.grid.grid_first_actions` has it.

    Raises
    ------
    UserError
        If the shapes do not fit together.

    Examples
    --------
    >>> free = np.array([[[1, 1, 1], [1, 1, 1]], [[1, 0, 1], [1, 1, 1]]], bool)
    >>> goals = np.zeros_like(free)
    >>> goals[:, 0, 2] = True
    >>> fields = small_fields(words(free), words(goals), passage_words(np.full((2, 3), 15)), cols=3)
    >>> action_sets(fields, (2, 3))
    array([[[8, 8, 0],
            [9, 9, 1]],
    <BLANKLINE>
           [[2, 0, 0],
            [8, 8, 1]]], dtype=uint8)
    """
    grids, targets = np.ascontiguousarray(free, np.uint64), np.ascontiguousarray(goals, np.uint64)
    ways = np.ascontiguousarray(passages, np.uint64)
    if grids.ndim != 1 or targets.shape != grids.shape:
        raise UserError(
            f"free and goals have shapes {grids.shape} and {targets.shape}; give one word each a grid"
        )
    if ways.shape not in ((len(ACTIONS),), (grids.size, len(ACTIONS))):
        raise UserError(f"the passages have shape {ways.shape}; give (4,), or (N, 4) for {grids.size} grids")
    if not 1 <= cols <= CELLS:
        raise UserError(f"a grid of {CELLS} cells cannot have {cols} columns")
    fields = np.empty((grids.size, len(ACTIONS)), np.uint64)
    shift = np.uint64(min(cols, CELLS - 1))  # no wider shift is defined, nor needed: such a grid has one row
    _fill(grids, targets, ways.ravel(), np.uint64(ways.ndim - 1), shift, fields)
    return fields


def plain_small_fields(free: NDArray[np.bool_], goals: NDArray[np.bool_], passages: ArrayLike) -> Words:
    """Return what `small_fields` returns, by one readable search for each grid.

    All have shape (N, rows, cols), `passages` perhaps (rows, cols).
    """
    fields = np.empty((len(free), len(ACTIONS)), np.uint64)
    ways = np.broadcast_to(np.asarray(passages, np.uint8), free.shape)
    for i, (grid, goal, way) in enumerate(zip(free, goals, ways, strict=True)):
        cells = [(int(row), int(col)) for row, col in np.argwhere(goal)]
        sets = grid_first_actions(plain_grid_field(grid, cells, way), way)
        fields[i] = [int(words((sets >> a & 1).astype(np.bool_))) for a in range(len(ACTIONS))]
    return fields


def words(cells: ArrayLike) -> Words:
    """Return sets of cells as words.

    Parameters
    ----------
    cells
        Which cells are in each set, shape (..., rows, cols).

    Raises
    ------
    UserError
        If there are more than 64 cells.

    Examples
    --------
    >>> words(np.array([[[1, 0], [0, 0]], [[0, 1], [0, 1]]]))
    array([ 1, 10], dtype=uint64)
    """
    flags = np.asarray(cells, np.bool_)
    rows, cols = flags.shape[-2:]
    if rows * cols > CELLS:
        raise UserError(f"{rows} x {cols} cells do not fit into {CELLS} bits; use planners.grid")
    bits = flags.reshape(*flags.shape[:-2], rows * cols).astype(np.uint64)
    out: Words = (bits << np.arange(rows * cols, dtype=np.uint64)).sum(axis=-1, dtype=np.uint64)
    return out


def cells_in(sets: ArrayLike, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the cells that are in each word, shape (..., rows, cols): `words` undone.

    Examples
    --------
    >>> cells_in([10], (2, 2)).astype(int)
    array([[[0, 1],
            [0, 1]]])
    """
    out = np.asarray(sets, np.uint64)
    bits = out[..., None] >> np.arange(shape[0] * shape[1], dtype=np.uint64) & np.uint64(1)
    return bits.astype(np.bool_).reshape(*out.shape, *shape)


def passage_words(passages: ArrayLike) -> Words:
    """Return for each action the cells that have such a step.

    Parameters
    ----------
    passages
        Four bits a cell, as for `planners.grid.grid_field`, shape (..., rows, cols).

    Returns
    -------
    words
        Shape (..., 4).

    Examples
    --------
    >>> passage_words([[15, 15]])  # a corridor of two cells: East from the first, West from the second
    array([0, 0, 2, 1], dtype=uint64)
    """
    ways = np.asarray(passages, np.uint8)
    both = np.array([mutual(one) for one in ways.reshape(-1, *ways.shape[-2:])]).reshape(ways.shape)
    return np.stack([words(both >> a & 1) for a in range(len(ACTIONS))], axis=-1)


def action_sets(fields: ArrayLike, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """Return a field as four bits a cell, as `planners.grid.grid_first_actions` does.

    Parameters
    ----------
    fields
        What `small_fields` returns, shape (..., 4).
    shape
        Rows and columns.

    Returns
    -------
    sets
        Shape (..., rows, cols).

    Examples
    --------
    >>> action_sets([0, 0, 2, 1], (1, 2))
    array([[8, 4]], dtype=uint8)
    """
    flags = cells_in(fields, shape).astype(np.uint8)
    powers = np.array([[[1 << a]] for a in range(len(ACTIONS))], np.uint8)
    out: NDArray[np.uint8] = (flags * powers).sum(axis=-3, dtype=np.uint8)
    return out


@kernel()
def _fill(  # noqa: PLR0917 - a kernel takes its arrays one by one
    free: Any, goals: Any, passages: Any, stride: Any, cols: Any, out: Any
) -> None:
    """Search each grid level by level; the cells of a level are one word.

    A cell takes an optimal first action whenever the step leads from outside the levels so far into the last.
    """
    one, none = np.uint64(1), np.uint64(0)
    for i in range(free.size):
        at = np.uint64(4) * np.uint64(i) * stride
        north, south = passages[at], passages[at + one]
        west, east = passages[at + np.uint64(2)], passages[at + np.uint64(3)]
        level = goals[i] & free[i]
        rest = free[i] & ~level
        to_north, to_south, to_west, to_east = none, none, none, none
        while level != none:
            going_north = (level << cols) & north & rest
            going_south = (level >> cols) & south & rest
            going_west = (level << one) & west & rest
            going_east = (level >> one) & east & rest
            to_north |= going_north
            to_south |= going_south
            to_west |= going_west
            to_east |= going_east
            level = going_north | going_south | going_west | going_east
            rest &= ~level
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = to_north, to_south, to_west, to_east
