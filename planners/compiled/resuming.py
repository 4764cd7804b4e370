"""A compiled learner's state as arrays, so that it goes on bit for bit after a break."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.compiled.runs import Compiled


def state_of(learner: Compiled[Any]) -> dict[str, NDArray[np.generic]]:
    """Return all that learning hangs on, besides graph, seeds and settings, as arrays by name."""
    return {name: array.copy() for name, array in _arrays(learner).items()}


def restore(learner: Compiled[Any], state: Mapping[str, NDArray[np.generic]]) -> None:
    """Take up what `state_of` returned, of a learner on the same graph, seeds and settings.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from planners.compiled import CompiledMaxQ
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> starts = np.flatnonzero(grounded.model.starts)
    >>> whole, broken, new = (CompiledMaxQ(grounded, [(0,)]) for _ in range(3))
    >>> _ = whole.train(grounded.root, starts, 20)
    >>> _ = broken.train(grounded.root, starts, 12)
    >>> restore(new, state_of(broken))
    >>> _ = new.train(grounded.root, starts, 8, afresh=False)
    >>> bool((new.values == whole.values).all()), bool((new.steps == whole.steps).all())
    (True, True)
    """
    for name, array in _arrays(learner).items():
        array[:] = state[name]


def _arrays(learner: Compiled[Any]) -> dict[str, NDArray[Any]]:
    return {
        "values": learner.values,
        "episodes": learner.episodes,
        "steps": learner.steps,
        "learning": learner._learning.drawn,  # noqa: SLF001 - of this package
        "following": learner._following.drawn,  # noqa: SLF001
    }
