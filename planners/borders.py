"""A grid in one row with a border, as the kernels of `planners.grid_kernels` read it.

Each row of the grid has one entry more, or some, which stand for what is right of it and left of the next
row; a row of such entries lies above the grid and one below.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

V = TypeVar("V", bound=np.generic)

_LINE: Final = 16  # 32-bit entries in a line of the cache
_WIDE: Final = 256  # columns from which on it matters how rows lie in the cache


def row_width(cols: int) -> int:
    """Return how many entries a row has.

    A search moves through the grid in diagonals. If those met the same few places of the cache again and
    again, as they do where rows are a power of two long, it would take a quarter longer; so wide rows take
    an odd number of the cache's lines.

    Examples
    --------
    >>> row_width(8), row_width(1024)
    (9, 1040)
    """
    return cols + 1 if cols < _WIDE else cols + 1 + (_LINE - cols - 1) % (2 * _LINE)


def bordered_size(shape: tuple[int, ...]) -> int:
    """Return how many entries a grid of this shape has with its border.

    Examples
    --------
    >>> bordered_size((2, 3))
    16
    """
    rows, cols = shape
    return (rows + 2) * row_width(cols)


def place(shape: tuple[int, ...], row: int, col: int) -> int:
    """Return where a cell lies among the entries.

    Examples
    --------
    >>> place((2, 3), 0, 0)
    4
    """
    return (row + 1) * row_width(shape[1]) + col


def places(shape: tuple[int, ...], cells: Iterable[tuple[int, int]]) -> NDArray[np.uint32]:
    """Return where some cells lie, each once."""
    return np.array(list(dict.fromkeys(place(shape, row, col) for row, col in cells)), np.uint32)


def bordered(values: NDArray[V]) -> NDArray[V]:
    """Return a grid's values with a border of zeros, shape (entries,).

    Examples
    --------
    >>> bordered(np.array([[1, 2], [3, 4]]))
    array([0, 0, 0, 1, 2, 0, 3, 4, 0, 0, 0, 0])
    """
    out = np.zeros(bordered_size(values.shape), values.dtype)
    unbordered(out, values.shape)[:] = values
    return out


def unbordered(entries: NDArray[V], shape: tuple[int, ...]) -> NDArray[V]:
    """Return a view of the grid without its border, shape (rows, cols)."""
    rows, cols = shape
    return entries.reshape(rows + 2, row_width(cols))[1:-1, :cols]
