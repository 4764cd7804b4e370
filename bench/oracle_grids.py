"""The grids of `bench_oracle`: free cells, among them shapes in which an obstacle cuts much off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.sparse import csr_array
from scipy.sparse.csgraph import minimum_spanning_tree

from worlds import Stream

Free = NDArray[np.bool_]
Cell = tuple[int, int]


def uniform(seed: int, *shape: int) -> NDArray[np.float64]:
    """Return the draws of a stream, all at once."""
    return Stream(seed).uniforms(int(np.prod(shape))).reshape(shape)


def maze(side: int, more: float = 0.0) -> Free:
    """Return a perfect maze, with a share of its walls open besides."""
    rooms = side // 2
    number = np.arange(rooms * rooms).reshape(rooms, rooms)
    one = np.concatenate([number[:, :-1].ravel(), number[:-1].ravel()])
    other = np.concatenate([number[:, 1:].ravel(), number[1:].ravel()])
    weights = csr_array((1 + uniform(1, one.size), (one, other)), shape=(rooms**2, rooms**2))
    tree = minimum_spanning_tree(weights).tocoo()
    free = np.zeros((side, side), np.bool_)
    free[:-1:2, :-1:2] = True
    free[tree.row // rooms + tree.col // rooms, tree.row % rooms + tree.col % rooms] = True
    between = np.add.outer(np.arange(side), np.arange(side)) % 2 == 1
    return free | (between & (uniform(2, side, side) < more))


def spiral(side: int) -> Free:
    """Return one corridor that winds inwards."""
    free = np.zeros((side, side), np.bool_)
    for ring in range(0, side // 2 - 1, 2):
        last = side - 1 - ring
        free[ring, ring : last + 1] = free[last, ring : last + 1] = True
        free[ring : last + 1, last] = free[ring + 2 : last + 1, ring] = True
        free[ring + 2, ring : ring + 3] = True
    return free


def comb(side: int) -> Free:
    """Return a corridor with a dead end at every second cell."""
    free = np.zeros((side, side), np.bool_)
    free[0] = free[:, ::2] = True
    return free


def halves(side: int) -> Free:
    """Return two halves joined by one cell beside the goal."""
    free = np.ones((side, side), np.bool_)
    free[:, side // 3 + 1] = False
    free[side // 3, side // 3 + 1] = True
    return free


def grids(side: int) -> dict[str, Free]:
    """Return the grids to replan on."""
    return {
        "open": np.ones((side, side), np.bool_),
        "30 %": uniform(0, side, side) >= 0.3,
        "perfect maze": maze(side),
        "maze with rings": maze(side, 0.1),
        "spiral": spiral(side),
        "comb": comb(side),
        "halves": halves(side),
    }


def goal_of(free: Free) -> Cell:
    """Return the cell of the largest connected part that is nearest to a third of the way."""
    parts, _ = label(free)
    cells = np.argwhere(parts == np.argmax(np.bincount(parts[free])))
    row, col = cells[np.abs(cells - free.shape[0] // 3).sum(axis=1).argmin()]
    return int(row), int(col)
