"""Distance fields on a transition model, the sets of optimal first actions, and a separate check of both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundTask
from worlds import TransitionModel

UNREACHED = -1
"""The distance of a state from which the goal cannot be reached."""
_LARGE: Final = 2**16  # entries of a table of successors from which on a kernel pays, its loading included


@dataclass(frozen=True, eq=False)
class Field:
    """Steps to the nearest goal state, where every action costs one step.

    Parameters
    ----------
    goal
        The goal states, shape (states,).
    allowed
        Which action may be taken where, shape (states, actions).
    successors
        Number of the next state, shape (states, actions).
    distance
        Steps to a goal; `UNREACHED` where there is no way, shape (states,).
    """

    goal: NDArray[np.bool_]
    allowed: NDArray[np.bool_]
    successors: NDArray[np.int64]
    distance: NDArray[np.int64]

    def optimal(self) -> NDArray[np.bool_]:
        """Return the set of optimal first actions of every state, shape (states, actions).

        An action is optimal where it is allowed and leads one step nearer. Goal states have none.
        """
        nearer = self.distance[self.successors] == (self.distance - 1)[:, None]
        optimal: NDArray[np.bool_] = self.allowed & nearer & (self.distance > 0)[:, None]
        return optimal


def distance_field(
    successors: NDArray[np.int64], goal: NDArray[np.bool_], allowed: NDArray[np.bool_]
) -> Field:
    """Breadth-first search backwards from the goal states; in machine code where there are many.

    Parameters
    ----------
    successors
        Number of the next state, shape (states, actions).
    goal
        The goal states, shape (states,); no step is taken out of them.
    allowed
        Which action may be taken where, shape (states, actions).

    Examples
    --------
    >>> successors = np.array([[0, 1], [0, 2], [1, 2]])  # a corridor: left, right
    >>> field = distance_field(successors, np.array([False, False, True]), np.ones((3, 2), bool))
    >>> field.distance, field.optimal()[0]
    (array([2, 1, 0]), array([False,  True]))
    """
    if successors.size < _LARGE:
        return plain_distance_field(successors, goal, allowed)
    from planners.field_kernels import search  # noqa: PLC0415 - loads numba, which small fields do without

    table, may = np.ascontiguousarray(successors, np.int64), np.ascontiguousarray(allowed, np.bool_)
    return Field(goal, allowed, successors, search(table, np.ascontiguousarray(goal, np.bool_), may))


def plain_distance_field(
    successors: NDArray[np.int64], goal: NDArray[np.bool_], allowed: NDArray[np.bool_]
) -> Field:
    """Return what `distance_field` returns, by a search that can be read."""
    states, actions = successors.shape
    source = np.repeat(np.arange(states), actions)[allowed.ravel()]
    order = np.argsort(successors.ravel()[allowed.ravel()], kind="stable")
    predecessors = source[order]
    first = np.searchsorted(successors.ravel()[allowed.ravel()][order], np.arange(states + 1))
    distance = np.where(goal, 0, UNREACHED)
    frontier = np.flatnonzero(goal)
    depth = 0
    while frontier.size:
        depth += 1
        before = np.concatenate([predecessors[first[s] : first[s + 1]] for s in frontier])
        frontier = np.unique(before[distance[before] == UNREACHED])
        distance[frontier] = depth
    return Field(goal, allowed, successors, distance)


def task_field(model: TransitionModel, task: GroundTask) -> Field:
    """Return the field of a task whose children are primitive actions.

    Raises
    ------
    ValueError
        If a child is a task: such a task needs `planners.recursive_optimum`.
    """
    actions = len(model.actions)
    if any(call.child >= actions for call in task.calls):
        raise ValueError(f"{task.name} calls tasks; a distance field needs primitive actions only")
    allowed = np.zeros(model.successors.shape, dtype=np.bool_)
    for call in task.calls:
        allowed[:, call.child] |= call.available
    return distance_field(model.successors, task.terminal, allowed)


def flat_field(model: TransitionModel, goal: NDArray[np.bool_]) -> Field:
    """Return the field of a goal when every action is always allowed: the global optimum."""
    return distance_field(model.successors, goal, np.ones(model.successors.shape, dtype=np.bool_))


def certify(field: Field) -> tuple[str, ...]:
    """Check a field in one pass, without searching: each fault in words, none if the field is right.

    Right means: 0 exactly at goals; no allowed step from a reached state leads below distance - 1, and
    some allowed step leads to it; from an unreached state no allowed step leads to a reached one.
    By induction on the distance these make every entry the true number of steps.
    """
    distance, after = field.distance, field.distance[field.successors]
    inside = ~field.goal
    reached = distance != UNREACHED
    step_ok = field.allowed & inside[:, None]
    below = step_ok & reached[:, None] & (after != UNREACHED) & (after < distance[:, None] - 1)
    nearer = (step_ok & (after == distance[:, None] - 1) & (after != UNREACHED)).any(axis=1)
    leak = step_ok & ~reached[:, None] & (after != UNREACHED)
    faults = {
        "distance 0 and the goal differ": (distance == 0) != field.goal,
        "a step leads below distance - 1": below.any(axis=1),
        "no step leads to distance - 1": inside & reached & ~nearer,
        "an unreached state has a step to a reached one": leak.any(axis=1),
        "a distance is negative": distance < UNREACHED,
    }
    return tuple(f"{fault}: state {int(np.flatnonzero(at)[0])}" for fault, at in faults.items() if at.any())
