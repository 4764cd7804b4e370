"""The search of `planners.fields.distance_field` in machine code. Importing this module loads numba."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from worlds.jit import kernel

_UNREACHED: Final = np.int64(-1)
_ONE: Final = np.uint64(1)


@kernel()
def search(  # noqa: C901 - plain loops, one after the other; a call would cost
    successors: Any, goal: Any, allowed: Any
) -> Any:
    """Return the steps from each state to the nearest goal, -1 where there is no way, shape (states,).

    The steps into each state are listed first, by counting; then a queue holds the states in the order
    in which they are reached. Successors that are no states lead nowhere.

    Parameters
    ----------
    successors
        Number of the next state, shape (states, actions).
    goal
        The goal states, shape (states,).
    allowed
        Which action may be taken where, shape (states, actions).
    """
    states, actions = successors.shape
    first = np.zeros(states + 2, np.int64)
    for state in range(states):
        for action in range(actions):
            after = successors[state, action]
            if allowed[state, action] and 0 <= after < states:
                first[np.uint64(after) + np.uint64(2)] += 1
    for state in range(1, states + 2):
        first[state] += first[state - 1]
    before = np.empty(first[states + 1], np.uint32)  # the states with a step into 0, then into 1, ...
    for state in range(states):
        for action in range(actions):
            after = successors[state, action]
            if allowed[state, action] and 0 <= after < states:
                place = np.uint64(after) + _ONE  # counts up from where the list of `after` begins
                before[np.uint64(first[place])] = np.uint32(state)
                first[place] += 1
    distance = np.empty(states, np.int64)
    queue = np.empty(states, np.uint32)
    head, end = np.uint64(0), np.uint64(0)
    for state in range(states):
        distance[state] = 0 if goal[state] else _UNREACHED
        if goal[state]:
            queue[end] = np.uint32(state)
            end += _ONE
    while head < end:
        nearest = np.uint64(queue[head])
        head += _ONE
        steps = distance[nearest] + 1
        for i in range(np.uint64(first[nearest]), np.uint64(first[nearest + _ONE])):
            source = np.uint64(before[np.uint64(i)])
            if distance[source] == _UNREACHED:
                distance[source] = steps
                queue[end] = np.uint32(source)
                end += _ONE
    return distance
