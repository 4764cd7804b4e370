"""Learners that collect: let them learn for a while, and compare what they are, bit for bit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.option_critic.collecting import CollectingLearner, Progress

State = dict[str, NDArray[np.generic]]


def learnt(learner: CollectingLearner, updates: int | None = None) -> list[Progress]:
    """Let a learner make so many updates, or all that are left."""
    found = []
    pieces = learner.learn()
    for progress in pieces:
        found.append(progress)
        if len(found) == updates:
            break
    pieces.close()  # type: ignore[attr-defined]  # a generator
    return found


def same(one: State, other: State) -> bool:
    """Return whether two states are equal, bit for bit."""
    return one.keys() == other.keys() and all(
        (one[name].dtype, one[name].tobytes()) == (other[name].dtype, other[name].tobytes()) for name in one
    )
