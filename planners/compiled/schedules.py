"""Schedules as tables, so that a kernel need not know what function they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Schedule = Callable[[int], float]


def tabulate(
    schedules: Sequence[Sequence[Schedule]], length: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return where each schedule's table begins, flat, and the tables, one after the other.

    Parameters
    ----------
    schedules
        By node, each of its schedules.
    length
        Episodes that a table holds.

    Examples
    --------
    >>> half, whole = (lambda n: 0.5), (lambda n: 1.0)
    >>> at, tables = tabulate([[half, whole], [half, half]], length=2)
    >>> at.tolist(), tables.tolist()
    ([0, 2, 0, 0], [0.5, 0.5, 1.0, 1.0])
    """
    places: dict[Schedule, int] = {}
    parts: list[NDArray[np.float64]] = []
    at: list[int] = []
    for schedule in (schedule for row in schedules for schedule in row):
        if schedule not in places:
            places[schedule] = len(parts) * length
            parts.append(_table(schedule, length))
        at.append(places[schedule])
    return np.array(at, dtype=np.int64), np.concatenate(parts)


@lru_cache(maxsize=64)
def _table(schedule: Schedule, length: int) -> NDArray[np.float64]:
    # Entry by entry, as the reference does: numpy's own powers may differ in the last bit.
    return np.array([schedule(episode) for episode in range(length)], dtype=np.float64)
