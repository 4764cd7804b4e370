"""Where a node ends and what it earns until then: its model as one action of its parent, computed exactly.

A parent sees each child as one action that takes a random number N of primitive steps (Dietterich 2000,
theorem 1). Reward and next state of that action, discounting included, are all that matters to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, eye_array
from scipy.sparse.linalg import splu

from hierarchy.grounding import GroundGraph, GroundTask
from worlds import TransitionModel

Mask = NDArray[np.bool_]

_LEAK = 1e-9
"""A row that sums to less than 1 by more than this is discounted, so that no loop is for ever."""

_NOISE = 1e-14
"""Entries of a kernel below this are what rounding leaves of 0."""

_COLUMNS = 256
"""Columns of a kernel that are solved for at once, which bounds the memory needed."""


@dataclass(frozen=True, eq=False)
class Exits:
    """What becomes of a node that is run until it ends, from each state.

    Parameters
    ----------
    value
        Expected discounted reward until it ends, shape (states,): 0 where it does not run, -inf where it
        runs but may never end.
    kernel
        Entry [s, s'] is the sum over N of gamma**N P(s', N | s, node), shape (states, states). Rows of
        states where the node does not run, or may never end, are 0.
    """

    value: NDArray[np.float64]
    kernel: csr_array[np.float64]


def primitive_exits(model: TransitionModel, action: int, gamma: float = 1.0) -> Exits:
    """Return what becomes of a primitive action: it ends after one step, everywhere.

    Examples
    --------
    >>> from worlds import StateIndex, Variable
    >>> x, right = StateIndex((Variable("x", (0, 1)),)), np.array([[1], [1]])
    >>> model = TransitionModel(x, ("right",), right, np.full((2, 1), -1.0), np.ones(2, bool))
    >>> exits = primitive_exits(model, 0, gamma=0.5)
    >>> exits.value, exits.kernel.toarray()
    (array([-1., -1.]), array([[0. , 0.5],
           [0. , 0.5]]))
    """
    outcomes, chances = model.outcomes[:, action], model.probabilities[:, action]
    states = np.repeat(np.arange(model.index.size), outcomes.shape[1])
    return Exits(model.rewards[:, action], _matrix(gamma * chances.ravel(), states, outcomes.ravel()))


def task_exits(node: GroundTask, choice: NDArray[np.int64], children: Sequence[Exits]) -> Exits:
    """Return what becomes of a task that follows a policy, from what becomes of its children.

    One sparse linear system is solved, with a column for each state in which the task may end. The
    discount factor is in the children's kernels. Without discounting, a state counts as one from which
    the task may never end (value -inf) if with any probability the policy gets into a loop without a way
    out; with or without, if it may come to a state where it runs and has no choice, where a child may never
    end, or which is outside its working space without ending it.

    Parameters
    ----------
    node
        The task.
    choice
        The place among `node.calls` of the call that it makes, -1 where none, shape (states,).
    children
        What becomes of each node of the ground graph, by place; those above the task are not read.

    Raises
    ------
    ValueError
        If a call is chosen where it is not available.

    Examples
    --------
    Two steps right at a cost of 1 each, the second one discounted.

    >>> from hierarchy import TaskGraph, ground
    >>> from worlds import StateIndex, Variable
    >>> x, right = StateIndex((Variable("x", (0, 1, 2)),)), np.array([[1], [2], [2]])
    >>> model = TransitionModel(x, ("right",), right, np.full((3, 1), -1.0), np.ones(3, bool))
    >>> graph = TaskGraph("corridor", x.variables, model.actions)
    >>> (at,) = graph.variables
    >>> _ = graph.task("Root", until=at.eq(2), uses=[at], do="right")
    >>> root = ground(graph, model).nodes[-1]
    >>> exits = task_exits(root, np.array([0, 0, -1]), [primitive_exits(model, 0, gamma=0.5)])
    >>> exits.value, exits.kernel.toarray()[:, 2]
    (array([-1.5, -1. ,  0. ]), array([0.25, 0.5 , 0.  ]))
    """
    for place, call in enumerate(node.calls):
        if bad := np.flatnonzero((choice == place) & ~call.available).tolist():
            raise ValueError(
                f"{node.name} chooses its call {place} in state {bad[0]}, where it is not available"
            )
    exits = [children[call.child] for call in node.calls]
    step = chain(choice, exits)
    sure = surely_ends(step.kernel, (choice >= 0) & np.isfinite(step.value), node.terminal)
    inside, value = np.flatnonzero(sure), np.where(node.live, -np.inf, 0.0)
    if not inside.size:
        return Exits(value, _matrix(np.empty(0), inside, inside, size=choice.size))
    leaving = step.kernel[inside]
    solved = splu(csc_array(eye_array(inside.size) - leaving[:, inside]))
    value[inside] = solved.solve(step.value[inside])
    outside = leaving[:, node.terminal]
    ends = np.flatnonzero(node.terminal)
    rows, cols, entries = [inside[:0]], [inside[:0]], [np.empty(0)]
    for places, block in _blocks(outside):
        found = solved.solve(block)
        row, col = np.nonzero(found > _NOISE)
        rows.append(inside[row])
        cols.append(ends[places[col]])
        entries.append(found[row, col])
    kernel = _matrix(np.concatenate(entries), np.concatenate(rows), np.concatenate(cols), size=choice.size)
    return Exits(value, kernel)


def evaluate(grounded: GroundGraph, choices: NDArray[np.int64], gamma: float = 1.0) -> tuple[Exits, ...]:
    """Return what becomes of every node under a hierarchical policy, children first.

    Parameters
    ----------
    grounded
        The ground graph.
    choices
        The place of the call that each node makes, -1 where none, shape (nodes, states). The rows of
        primitive actions are not read.
    gamma
        Discount factor for one primitive step.

    Examples
    --------
    >>> from hierarchy import TaskGraph, ground
    >>> from worlds import StateIndex, Variable
    >>> x, right = StateIndex((Variable("x", (0, 1)),)), np.array([[1], [1]])
    >>> model = TransitionModel(x, ("right",), right, np.full((2, 1), -1.0), np.ones(2, bool))
    >>> graph = TaskGraph("step", x.variables, model.actions)
    >>> (at,) = graph.variables
    >>> _ = graph.task("Root", until=at.eq(1), uses=[at], do="right")
    >>> [exits.value.tolist() for exits in evaluate(ground(graph, model), np.array([[-1, -1], [0, -1]]))]
    [[-1.0, -1.0], [-1.0, 0.0]]
    """
    found: list[Exits] = []
    for place, node in enumerate(grounded.nodes):
        if node.calls:
            found.append(task_exits(node, choices[place], found))
        else:
            found.append(primitive_exits(grounded.model, place, gamma))
    return tuple(found)


def chain(choice: NDArray[np.int64], exits: Sequence[Exits]) -> Exits:
    """Return the Markov chain of a policy: from each state the exits of what is chosen there.

    Parameters
    ----------
    choice
        The place among `exits` of what is chosen, -1 where nothing is, shape (states,).
    exits
        What can be chosen.

    Examples
    --------
    >>> stay = Exits(np.array([-1.0, -1.0]), csr_array(np.eye(2)))
    >>> swap = Exits(np.array([-2.0, -2.0]), csr_array(np.eye(2)[::-1]))
    >>> mixed = chain(np.array([1, 0]), [stay, swap])
    >>> mixed.value, mixed.kernel.toarray()
    (array([-2., -1.]), array([[0., 1.],
           [0., 1.]]))
    """
    value = np.zeros(choice.size)
    rows, cols, entries = [np.empty(0, np.int64)], [np.empty(0, np.int64)], [np.empty(0)]
    for place, one in enumerate(exits):
        at = np.flatnonzero(choice == place)
        value[at] = one.value[at]
        part = coo_array(one.kernel[at])
        row, col = part.coords
        rows.append(at[row])
        cols.append(col.astype(np.int64))
        entries.append(part.data)
    kernel = _matrix(np.concatenate(entries), np.concatenate(rows), np.concatenate(cols), size=choice.size)
    return Exits(value, kernel)


def surely_ends(kernel: csr_array[np.float64], running: Mask, terminal: Mask) -> Mask:
    """Return the running states of a chain from which it ends with probability 1, shape (states,).

    A discounted chain counts as ending, since nothing that it does for ever weighs anything. A state that
    is neither running nor terminal is one from which the chain never ends.

    Examples
    --------
    From 0 on to 1, from 1 to 0 or to 2, where the chain ends; 3 goes round in a circle.

    >>> kernel = csr_array([[0, 1, 0, 0], [0.5, 0, 0.5, 0], [0, 0, 0, 0], [0, 0, 0, 1.0]])
    >>> terminal = np.array([False, False, True, False])
    >>> surely_ends(kernel, ~terminal, terminal)
    array([ True,  True, False, False])
    """
    leaking = running & (kernel.sum(axis=1) < 1 - _LEAK)
    lost = may_come_to(kernel, running, ~(running | terminal))
    lost |= running & ~may_come_to(kernel, running, terminal | leaking)
    sure: Mask = running & ~may_come_to(kernel, running, lost)
    return sure


def may_come_to(kernel: csr_array[np.float64], running: Mask, target: Mask) -> Mask:
    """Return the states of `target`, and the running ones from which a chain may reach it."""
    into = csr_array(kernel.T)
    reached, frontier = target.copy(), np.flatnonzero(target)
    while frontier.size:
        before: NDArray[np.int64] = np.unique(into[frontier].indices).astype(np.int64)
        frontier = before[running[before] & ~reached[before]]
        reached[frontier] = True
    return reached


def _blocks(outside: csr_array[np.float64]) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Yield the columns that hold anything, some at a time: their places and themselves, dense."""
    columns = csc_array(outside)
    used = np.flatnonzero(np.diff(columns.indptr))
    for first in range(0, used.size, _COLUMNS):
        places = used[first : first + _COLUMNS]
        yield places, columns[:, places].toarray()


def _matrix(
    entries: NDArray[np.float64], rows: NDArray[np.int64], cols: NDArray[np.int64], size: int | None = None
) -> csr_array[np.float64]:
    """Return a square sparse matrix; entries of one place are added up, and none is stored that is 0."""
    size = int(rows.max()) + 1 if size is None else size
    kept = entries != 0
    return csr_array(coo_array((entries[kept], (rows[kept], cols[kept])), shape=(size, size)))
