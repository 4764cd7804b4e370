"""Numbers that ought to agree within classes of states, and the two states that differ most."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

Mask = NDArray[np.bool_]

TOLERANCE = 1e-7
"""Numbers that differ by less, as a share of the larger or of 1, are what rounding makes of equal ones."""


class Difference(NamedTuple):
    """Two states of one class, a number of each, and the column that it stands in (0 for a vector)."""

    first: int
    second: int
    numbers: tuple[float, float]
    column: int = 0


def uneven(classes: NDArray[np.int64], values: NDArray[np.float64], where: Mask) -> Difference | None:
    """Return two states of one class whose values differ most, the lower one first; None if classes agree.

    Parameters
    ----------
    classes
        Class of every state, shape (states,).
    values
        Value of every state, shape (states,); it must be finite in `where`.
    where
        The states that count, shape (states,).

    Examples
    --------
    >>> everywhere = np.ones(4, bool)
    >>> uneven(np.array([0, 0, 1, 1]), np.array([5.0, 5.0, 1.0, 3.0]), everywhere)
    Difference(first=2, second=3, numbers=(1.0, 3.0), column=0)
    """
    states = np.flatnonzero(where)
    if not states.size:
        return None
    states = states[np.lexsort((values[states], classes[states]))]
    borders = np.flatnonzero(np.diff(classes[states])) + 1
    lowest = states[np.concatenate(([0], borders))]
    highest = states[np.concatenate((borders - 1, [states.size - 1]))]
    low, high = values[lowest], values[highest]
    apart = (high - low) / np.maximum(1.0, np.maximum(np.abs(low), np.abs(high)))
    most = int(np.argmax(apart))
    if apart[most] <= TOLERANCE:
        return None
    return Difference(int(lowest[most]), int(highest[most]), (float(low[most]), float(high[most])))


def uneven_rows(classes: NDArray[np.int64], matrix: csr_array[np.float64], where: Mask) -> Difference | None:
    """Return two states of one class whose rows differ, and the column in which they differ most.

    Every row is compared with the first of its class.

    Examples
    --------
    >>> chances = csr_array(np.array([[1.0, 0.0], [0.25, 0.75]]))
    >>> uneven_rows(np.zeros(2, int), chances, np.ones(2, bool))
    Difference(first=0, second=1, numbers=(1.0, 0.25), column=0)
    """
    states, firsts = _against(classes, where)
    if not states.size:
        return None
    apart = coo_array(matrix[states] - matrix[firsts])
    if not apart.nnz or np.abs(apart.data).max() <= TOLERANCE:
        return None
    most = int(np.argmax(np.abs(apart.data)))
    row, column = (int(part[most]) for part in apart.coords)
    first, second = int(firsts[row]), int(states[row])
    return Difference(first, second, (float(matrix[first, column]), float(matrix[second, column])), column)


def membership(classes: NDArray[np.int64]) -> tuple[csr_array[np.float64], NDArray[np.int64]]:
    """Return the matrix that adds up columns by class, shape (states, classes), and a state of each class.

    Examples
    --------
    >>> matrix, states = membership(np.array([7, 3, 7]))
    >>> matrix.toarray(), states
    (array([[0., 1.],
           [1., 0.],
           [0., 1.]]), array([1, 0]))
    """
    _, states, places = np.unique(classes, return_index=True, return_inverse=True)
    ones, rows = np.ones(classes.size), np.arange(classes.size)
    shape = (classes.size, states.size)
    return csr_array(coo_array((ones, (rows, places.reshape(-1))), shape=shape)), states


def _against(classes: NDArray[np.int64], where: Mask) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the states that count, and beside each the first one of its class."""
    states = np.flatnonzero(where)
    if not states.size:
        return states, states
    _, first, places = np.unique(classes[states], return_index=True, return_inverse=True)
    return states, states[first[places.reshape(-1)]]
