"""Numbers of states as users give them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hierarchy import GroundGraph
from worlds import UserError


def state_numbers(states: ArrayLike, size: int) -> NDArray[np.int64]:
    """Return numbers of states as an array, shape (states,).

    Parameters
    ----------
    states
        The numbers, a sequence of any length.
    size
        How many states the world has.

    Raises
    ------
    UserError
        If there is a number that is no state's, or a mask in place of numbers, which would else be read as
        the states 0 and 1.

    Examples
    --------
    >>> state_numbers([3, 1], size=4)
    array([3, 1])
    >>> state_numbers([False, True, False, True], size=4)
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: states are given by their numbers; of a mask, numpy.flatnonzero gives them
    """
    found = np.asarray(states)
    if not found.size:
        return np.zeros(0, dtype=np.int64)
    if found.ndim != 1 or found.dtype.kind not in "iu":
        raise UserError("states are given by their numbers; of a mask, numpy.flatnonzero gives them")
    wrong = found[(found < 0) | (found >= size)]
    if wrong.size:
        raise UserError(f"states are numbers from 0 to {size - 1}, and {wrong[0]} is none of them")
    return found.astype(np.int64)


def starting_states(grounded: GroundGraph, task: int, states: ArrayLike) -> NDArray[np.int64]:
    """Return numbers of states that a task is to start from, shape (states,).

    Raises
    ------
    UserError
        If there is none, or `state_numbers` refuses them.
    """
    found = state_numbers(states, grounded.model.index.size)
    if not found.size:
        raise UserError(f"task {grounded.nodes[task].name} has no states to start from; give a list of them")
    return found
