"""Conditions of safe abstraction at one policy, by exact evaluation; and a policy drawn at random.

What every node earns and where it ends are rational functions of the probabilities with which the tasks
below it choose. So what holds at some policies but not at all fails at almost every one: a policy that
is drawn at random finds the two states that refute it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from hierarchy.abstraction_compare import TOLERANCE, Difference, membership, uneven, uneven_rows
from hierarchy.abstraction_scope import Course, ends_task
from hierarchy.abstraction_structure import afterwards, subsets, undeclared
from hierarchy.abstraction_verdict import Witness, describe, witness
from hierarchy.exits import Exits, evaluate, primitive_exits, task_exits
from hierarchy.grounding import GroundCall, GroundGraph, GroundTask
from worlds import Stream

Mask = NDArray[np.bool_]
Values = NDArray[np.float64]

_SWEEPS = 100_000
"""Sweeps of value iteration before it is given up."""


@dataclass(frozen=True, eq=False)
class View:
    """What every node is to its caller under one policy, and what it is worth to go on with a task.

    Parameters
    ----------
    grounded
        The ground graph.
    exits
        Of every node, by place.
    values
        Value V of every node, by place, each of shape (states,): 0 where it has ended, -inf where it
        neither runs nor has ended, or may never end.
    """

    grounded: GroundGraph
    exits: tuple[Exits, ...]
    values: tuple[Values, ...]

    def completion(self, place: int, call: GroundCall) -> Values:
        """Return C of a call (equation 3 of the paper), shape (states,)."""
        after: Values = np.asarray(self.exits[call.child].kernel @ self.values[place])
        return after

    def counted(self, place: int, call: GroundCall, at: Mask) -> Mask:
        """Return the states of `at` from which the child surely ends, and the caller after it."""
        return at & np.isfinite(self.exits[call.child].value) & np.isfinite(self.completion(place, call))


def policy_view(grounded: GroundGraph, choices: NDArray[np.int64], gamma: float) -> View:
    """Return the view of a policy, given as the place of the call of every node, shape (nodes, states)."""
    exits = evaluate(grounded, choices, gamma)
    values = tuple(_outside(node, one.value) for node, one in zip(grounded.nodes, exits, strict=True))
    return View(grounded, exits, values)


def random_view(
    grounded: GroundGraph, gamma: float, *, seed: int = 0, uses: Mapping[str, Sequence[str]] | None = None
) -> View:
    """Return a view in which every task chooses at random, with odds that depend on its `uses` alone.

    The value of a task is what its best policy, given its children's, is taught to expect: with the
    pseudo-reward of ending short of its goal, if it has one.

    Parameters
    ----------
    grounded
        The ground graph.
    gamma
        Discount factor for one primitive step.
    seed
        Names the policy.
    uses
        Other relevant variables than those declared, by task.

    Raises
    ------
    ValueError
        If the best values grow without end.
    """
    exits: list[Exits] = []
    values: list[Values] = []
    for place, node in enumerate(grounded.nodes):
        if not node.calls:
            exits.append(primitive_exits(grounded.model, place, gamma))
            values.append(exits[place].value)
            continue
        reads = (uses or {}).get(node.task, grounded.graph.tasks[node.task].uses)
        exits.append(_mixed(grounded, place, exits, reads, Stream(seed, place)))
        ends = np.where(node.terminal & ~node.goal, node.pseudo_reward or 0.0, 0.0)
        taught = np.where(node.terminal, ends, exits[place].value + exits[place].kernel @ ends)
        values.append(_best(node, exits, _outside(node, taught)))
    return View(grounded, tuple(exits), tuple(values))


def apart(view: View, child: int, rows: NDArray[np.int64], told: Sequence[str], at: Mask) -> Witness | None:
    """Return two states of one row from which a child earns, or ends, differently, as `told` tells."""
    name, index = view.grounded.nodes[child].name, view.grounded.model.index
    exits = view.exits[child]
    at = at & np.isfinite(exits.value)
    if found := uneven(rows, np.where(at, exits.value, 0.0), at):
        return witness(index, f"value of {name}", found)
    return results_apart(view, child, rows, told, at)


def results_apart(
    view: View, child: int, rows: NDArray[np.int64], told: Sequence[str], at: Mask
) -> Witness | None:
    """Return two states of one row from which a child ends elsewhere, or later if time counts."""
    name, index = view.grounded.nodes[child].name, view.grounded.model.index
    columns, states = membership(index.project(told))
    kernel = csr_array(view.exits[child].kernel @ columns)
    if found := uneven_rows(rows, kernel, at & np.isfinite(view.exits[child].value)):
        to = describe(index, int(states[found.column]), told)
        return witness(index, f"discounted chance that {name} ends where {to}", found)
    return None


def task_apart(view: View, place: int, names: Sequence[str], then: Course) -> Witness | None:
    """Return why variables do not do for a task wherever it may decide and end; None if they do."""
    if found := undeclared(view.grounded, place, names, then):
        return found
    rows = view.grounded.model.index.project(names)
    for call in view.grounded.nodes[place].calls:
        at = view.counted(place, call, then.decides & call.available)
        if found := apart(view, call.child, rows, names, at):
            return found
    return None


def same_results_at(
    view: View,
    place: int,
    call: GroundCall,
    at: Mask,
    uses: Sequence[str] | None = None,
) -> tuple[str, ...] | Witness:
    """Return variables that are all that matters after a call and whose outcome its rows settle.

    They are sought among `uses`: the task's own if left out. If there are none, two states of one row are
    returned, and what differs.
    """
    uses = view.grounded.graph.tasks[view.grounded.nodes[place].task].uses if uses is None else uses
    at = view.counted(place, call, at)
    then = afterwards(view.grounded, place, call, at)
    found: Witness | None = None
    for names in subsets(uses):
        found = results_apart(view, call.child, call.projection, names, at)
        found = found or task_apart(view, place, names, then)
        if found is None:
            return names
    assert found is not None, "the whole of `uses` was tried last"
    return found


def leaves_open(view: View, place: int, call: GroundCall, at: Mask) -> Witness | None:
    """Return where a child ends without ending its caller for good: from one state, in the other."""
    node, child = view.grounded.nodes[place], view.grounded.nodes[call.child]
    kernel = view.exits[call.child].kernel.tocoo()
    row, column = kernel.coords
    open_exits = np.flatnonzero(at[row] & ~ends_task(node)[column] & (kernel.data > TOLERANCE))
    if not open_exits.size:
        return None
    most = int(open_exits[np.argmax(kernel.data[open_exits])])
    first, second = int(row[most]), int(column[most])
    what = f"discounted chance that {child.name}, called in the first state, ends in the other (0 would do)"
    difference = Difference(first, second, (float(kernel.data[most]), 0.0))
    return witness(view.grounded.model.index, what, difference)


def spread(view: View, place: int, call: GroundCall, at: Mask) -> Witness | None:
    """Return two states of one row of a completion table whose completions differ; None if none do."""
    at = view.counted(place, call, at)
    values = np.where(at, view.completion(place, call), 0.0)
    if found := uneven(call.projection, values, at):
        what = f"completion of {view.grounded.nodes[place].name} after {view.grounded.nodes[call.child].name}"
        return witness(view.grounded.model.index, what, found)
    return None


def _outside(node: GroundTask, value: Values) -> Values:
    return np.where(node.live | node.terminal, value, -np.inf) if node.calls else value


def _mixed(
    grounded: GroundGraph, place: int, exits: Sequence[Exits], reads: Sequence[str], stream: Stream
) -> Exits:
    """Return the exits of a task that chooses at random among what is available."""
    node, index = grounded.nodes[place], grounded.model.index
    classes, places = np.unique(index.project(reads), return_inverse=True)
    odds = np.zeros((len(node.calls), index.size))
    for k, call in enumerate(node.calls):
        drawn = 0.5 + stream.uniforms(classes.size)
        sure = call.available & np.isfinite(exits[call.child].value)
        odds[k, sure] = drawn[places.reshape(-1)][sure]
    total = odds.sum(axis=0)
    odds /= np.where(total > 0, total, 1.0)
    value = np.zeros(index.size)
    kernel: csr_array[np.float64] = csr_array((index.size, index.size))
    for share, call in zip(odds, node.calls, strict=True):
        child = exits[call.child]
        value += share * np.where(share > 0, child.value, 0.0)
        kernel = kernel + csr_array(diags_array(share)) @ child.kernel
    kernel.eliminate_zeros()
    # The mixture is one action, so that the task's exits are those of taking it wherever it can.
    chosen = np.where(total > 0, 0, -1)
    only = replace(node.calls[0], child=0, available=total > 0)
    return task_exits(replace(node, calls=(only,)), chosen, [Exits(value, kernel)])


def _best(node: GroundTask, exits: Sequence[Exits], value: Values) -> Values:
    """Return the values of a task's best policy, from those of some policy of it, by value iteration."""
    steps = []
    for call in node.calls:
        child = exits[call.child]
        runs = np.flatnonzero(call.available & np.isfinite(child.value))
        steps.append((runs, child.value[runs], child.kernel[runs]))
    for _ in range(_SWEEPS):
        better = value.copy()
        for runs, earned, kernel in steps:
            better[runs] = np.maximum(better[runs], earned + kernel @ value)
        known = np.isfinite(value)
        least = 1e-12 * np.maximum(1.0, np.abs(value[known]))
        if (np.isfinite(better) == known).all() and (better[known] - value[known] <= least).all():
            return better
        value = better
    raise ValueError(
        f"the values of {node.name} grow without end; discount (gamma below 1), or let loops cost something"
    )
