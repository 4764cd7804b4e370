"""From where a task may come to an end: a search backwards, by call and return.

Each transition is looked at once for each path of calls from the task that is asked about, so that time and
memory grow with the transitions times those paths.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hierarchy.grounding import GroundGraph
from worlds import TransitionModel, UserError

Mask = NDArray[np.bool_]
States = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class _Back:
    """What is known so far of one task on one path of calls, so that nothing is followed twice.

    Parameters
    ----------
    found
        Where it ends as wanted, and from where it may come to that, shape (states,).
    below
        The same for the tasks that it calls, by place.
    """

    found: Mask
    below: dict[int, _Back] = field(default_factory=dict)


class Origins:
    """The states from which the tasks of a ground graph may come to an end.

    Parameters
    ----------
    grounded
        The ground graph.

    Examples
    --------
    A corridor to the right: from beyond 1 there is no way back to it.

    >>> from hierarchy import TaskGraph, ground
    >>> from worlds import StateIndex, Variable
    >>> x, right = StateIndex((Variable("x", (0, 1, 2, 3)),)), np.array([[1], [2], [3], [3]])
    >>> model = TransitionModel(x, ("right",), right, np.full((4, 1), -1.0), np.ones(4, bool))
    >>> graph = TaskGraph("corridor", x.variables, model.actions)
    >>> (at,) = graph.variables
    >>> _ = graph.task("Root", until=at.eq(1), uses=[at], do="right")
    >>> grounded = ground(graph, model)
    >>> Origins(grounded).of(grounded.root, at.eq(1).mask(x)).tolist()
    [True, True, False, False]
    """

    def __init__(self, grounded: GroundGraph) -> None:
        self._grounded = grounded
        self._transitions = _transitions(grounded.model)
        self._tasks: dict[int, _Steps] = {}

    def of(self, place: int, ends: Mask) -> Mask:
        """Return from where a task may come to an end in `ends`, and where it has, shape (states,).

        A child runs to its own end, even past a state in which its caller has ended, and moves only where
        it and all its callers may.
        """
        run = _Back(np.zeros_like(ends))
        self._back(place, np.flatnonzero(ends), run)
        return run.found

    def _back(self, place: int, ends: States, run: _Back) -> States:
        """Go back from more ends; return the states from which the task may come to them, if newly found."""
        node, steps = self._grounded.nodes[place], self._steps(place)
        new = ends[node.terminal[ends] & ~run.found[ends]]
        found = [new[:0]]
        while new.size:
            run.found[new] = True
            before = [steps.into(new)]
            for child, available in steps.calls:
                below = run.below.setdefault(child, _Back(np.zeros_like(run.found)))
                origins = self._back(child, new, below)
                before.append(origins[available[origins]])
            joined = np.concatenate(before)
            new = np.unique(joined[~run.found[joined]])
            found.append(new)
        return np.concatenate(found)

    def _steps(self, place: int) -> _Steps:
        if place not in self._tasks:
            self._tasks[place] = _Steps.of(self._grounded, place, self._transitions)
        return self._tasks[place]


@dataclass(frozen=True, eq=False)
class _Transitions:
    """The transitions that occur, in the order of the states that they lead to: states and actions."""

    before: States
    action: States
    after: States


def _transitions(model: TransitionModel) -> _Transitions | None:
    """Return a world's transitions, or None of a black box, which shows none."""
    try:
        before, action, outcome = np.nonzero(model.probabilities > 0)
    except UserError:
        return None
    after = model.outcomes[before, action, outcome]
    order = np.argsort(after, kind="stable")
    return _Transitions(before[order], action[order], after[order])


@dataclass(frozen=True, eq=False)
class _Steps:
    """What a task itself may do: the primitive actions it takes, and the tasks it calls.

    Parameters
    ----------
    model
        The world's transition model.
    taken
        Where each primitive action is taken, shape (states, actions).
    calls
        The place of each task that it calls, and where, shape (states,).
    first, sources
        A primitive action leads into state s from the states ``sources[first[s]:first[s + 1]]``; None in a
        black box, which is asked.
    """

    model: TransitionModel
    taken: Mask
    calls: tuple[tuple[int, Mask], ...]
    first: States | None
    sources: States

    @classmethod
    def of(cls, grounded: GroundGraph, place: int, transitions: _Transitions | None) -> _Steps:
        model = grounded.model
        taken = np.zeros((model.index.size, len(model.actions)), dtype=np.bool_)
        calls: dict[int, Mask] = {}
        for call in grounded.nodes[place].calls:
            if grounded.nodes[call.child].calls:
                calls[call.child] = calls.get(call.child, np.False_) | call.available
            else:
                taken[:, call.child] |= call.available
        if transitions is None:
            return cls(model, taken, tuple(calls.items()), None, np.empty(0, np.int64))
        mine = taken[transitions.before, transitions.action]
        first = np.searchsorted(transitions.after[mine], np.arange(model.index.size + 1))
        return cls(model, taken, tuple(calls.items()), first, transitions.before[mine])

    def into(self, states: States) -> States:
        """Return from where a primitive action of the task may lead into one of `states`, maybe repeated."""
        if self.first is None:
            mask = np.zeros(self.model.index.size, dtype=np.bool_)
            mask[states] = True
            return np.flatnonzero((self.model.may_reach(mask) & self.taken).any(axis=1))
        first, counts = self.first[states], self.first[states + 1] - self.first[states]
        ends = np.cumsum(counts)
        within = np.arange(ends[-1]) - np.repeat(ends - counts, counts)
        sources: States = self.sources[np.repeat(first, counts) + within]
        return sources
