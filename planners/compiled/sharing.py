"""Runs shared among threads: each part of them is one call of a kernel."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Work = Callable[[int, int, NDArray[np.int64], NDArray[np.float64]], int]
"""Does the work of the runs from one number up to another, with room for a failure and for calls' values."""
_ENOUGH: Final = 1000
"""Episodes, of all runs together, from which on threads pay."""


class End(NamedTuple):
    """How a kernel came back, and where it was if it failed."""

    status: int
    task: int
    state: int
    run: int
    episode: int


def shared(work: Work, runs: int, *, threads: int, episodes: int, room: int) -> list[End]:
    """Do the work of all runs, and return how each part of them ended.

    Parameters
    ----------
    work
        What is done; it must let go of Python's lock.
    runs
        How many there are.
    threads
        How many parts are done at a time.
    episodes
        Of all runs together.
    room
        The most calls that a task has.

    Examples
    --------
    >>> def work(low, high, trouble, values):
    ...     trouble[:] = 7, 300, low, 0
    ...     return high
    >>> shared(work, 5, threads=2, episodes=2000, room=4)[-1]
    End(status=5, task=7, state=300, run=4, episode=0)
    """
    parts = min(runs, 4 * threads) if threads > 1 and episodes >= _ENOUGH else 1
    bounds = [runs * part // parts for part in range(parts + 1)]

    def one(part: int) -> End:
        # Kernels read these through pointers: they must live here, where nobody frees them meanwhile.
        trouble, values = np.zeros(4, dtype=np.int64), np.empty(room)
        return End(work(bounds[part], bounds[part + 1], trouble, values), *trouble.tolist())

    if parts == 1:
        return [one(0)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(one, range(parts)))
