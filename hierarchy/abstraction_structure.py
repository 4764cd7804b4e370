"""Conditions of safe abstraction that hold for every abstract policy, by enumeration of the model.

A set of variables is closed below a task if the tasks and actions below it decide, end, earn and move,
as far as these variables tell, by these variables alone. Then so does every policy that reads no more
(Dietterich 2000, section 5.1.1; equations 5 and 6 of the paper). What is found here is proved; what is
not may still hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from hierarchy.abstraction_compare import membership, uneven, uneven_rows
from hierarchy.abstraction_scope import Course, course, ends_task
from hierarchy.abstraction_verdict import Witness, as_numbers, describe, witness
from hierarchy.exits import primitive_exits
from hierarchy.grounding import GroundCall, GroundGraph

Mask = NDArray[np.bool_]
Names = Sequence[str]


def subsets(names: Names) -> Iterator[tuple[str, ...]]:
    """Yield every subset, smaller ones first, each in the order of `names`.

    >>> list(subsets("ab"))
    [(), ('a',), ('b',), ('a', 'b')]
    """
    for size in range(len(names) + 1):
        yield from combinations(names, size)


def undeclared(grounded: GroundGraph, place: int, names: Names, then: Course) -> Witness | None:
    """Return two states that agree on `names`, in which a task ends, or may call, not the same.

    Parameters
    ----------
    place
        The task.
    names
        Variables.
    then
        Where the task may decide and end.
    """
    node, index = grounded.nodes[place], grounded.model.index
    classes, met = index.project(names), then.decides | then.ends
    masks = [(node.terminal, met, f"whether {node.name} has ended")]
    if node.pseudo_reward is not None:
        masks.append((node.goal, met, f"whether {node.name} has reached its goal"))
    for call in node.calls:
        child = grounded.nodes[call.child].name
        masks.append((call.available, then.decides, f"whether {node.name} may call {child}"))
    for mask, where, what in masks:
        if found := uneven(classes, as_numbers(mask), where):
            return witness(index, what, found)
    return None


def open_below(grounded: GroundGraph, child: int, names: Names, at: Mask) -> Witness | str | None:
    """Return what keeps variables from being closed below a child that is called in `at`; None if nothing.

    Parameters
    ----------
    child
        The child's place.
    names
        Variables.
    at
        The states in which it is called, shape (states,).

    Returns
    -------
    Witness, str or None
        Two states that agree on the variables, and what differs; or in words, a variable that a policy
        below may read.
    """
    node, model = grounded.nodes[child], grounded.model
    if not node.calls:
        classes = model.index.project(names)
        if found := uneven(classes, model.rewards[:, child], at):
            return witness(model.index, f"expected reward of {node.name}", found)
        return moves_apart(grounded, child, names, names, at)
    if len(node.calls) > 1:
        for name in grounded.graph.tasks[node.task].uses:
            if name not in names:
                return f"a policy of {node.name} may read {name}"
    then = course(grounded, child, at)
    if found_there := undeclared(grounded, child, names, then):
        return found_there
    return _any_open(grounded, child, names, then.decides)


def moves_apart(grounded: GroundGraph, action: int, names: Names, told: Names, at: Mask) -> Witness | None:
    """Return two states that agree on `names`, in which an action leads elsewhere as far as `told` tells."""
    index = grounded.model.index
    columns, states = membership(index.project(told))
    kernel = primitive_exits(grounded.model, action).kernel @ columns
    if found := uneven_rows(index.project(names), kernel, at):
        to = describe(index, int(states[found.column]), told)
        return witness(index, f"chance that {grounded.nodes[action].name} ends where {to}", found)
    return None


def closed(grounded: GroundGraph, place: int, names: Names, then: Course) -> bool:
    """Return whether variables are closed below a task, wherever it may decide and end."""
    told = undeclared(grounded, place, names, then)
    return told is None and _any_open(grounded, place, names, then.decides) is None


def afterwards(grounded: GroundGraph, place: int, call: GroundCall, at: Mask) -> Course:
    """Return where a task may decide and end after a call that it makes in `at`."""
    node = grounded.nodes[place]
    ends = course(grounded, call.child, at).ends
    then = course(grounded, place, ends)
    return Course(then.decides, then.ends | (ends & node.terminal))


def stays_on(grounded: GroundGraph, place: int, call: GroundCall, at: Mask) -> Mask:
    """Return the states in which a child called in `at` may end without ending its caller for good.

    None: the child's termination implies its caller's, and its completion is 0 (Dietterich 2000,
    section 5.1.4).
    """
    return course(grounded, call.child, at).ends & ~ends_task(grounded.nodes[place])


def same_results(
    grounded: GroundGraph, place: int, call: GroundCall, at: Mask, *, discounted: bool
) -> tuple[str, ...] | None:
    """Return variables that are all that matters after a call, and whose outcome the edge's rows settle.

    That is result distribution irrelevance (Dietterich 2000, section 5.1.3) for what is left of the
    task. The outcome is settled if the child is an action whose chances agree; if nothing but the edge's
    variables tells anything below it; or, without discounting, if it is a funnel: all its exits from the
    states of one row agree.

    Parameters
    ----------
    place, call
        A task and one of its calls.
    at
        The states in which it is made, shape (states,).
    discounted
        Whether the time that the child takes counts, too.

    Returns
    -------
    tuple of str or None
        The variables; None if there is no proof.
    """
    then = afterwards(grounded, place, call, at)
    narrow = open_below(grounded, call.child, call.relevant, at) is None
    funnels = _exits_by_row(grounded, call, at) if not discounted and not narrow else []
    for names in subsets(grounded.graph.tasks[grounded.nodes[place].task].uses):
        if narrow and set(names) <= set(call.relevant):
            settled = True
        elif not grounded.nodes[call.child].calls:
            settled = moves_apart(grounded, call.child, call.relevant, names, at) is None
        else:
            told = grounded.model.index.project(names)
            settled = bool(funnels) and all(np.unique(told[ends]).size == 1 for ends in funnels)
        if settled and closed(grounded, place, names, then):
            return names
    return None


def _any_open(grounded: GroundGraph, place: int, names: Names, decides: Mask) -> Witness | str | None:
    for call in grounded.nodes[place].calls:
        made = decides & call.available
        if made.any() and (found := open_below(grounded, call.child, names, made)):
            return found
    return None


def _exits_by_row(grounded: GroundGraph, call: GroundCall, at: Mask) -> list[Mask]:
    """Return where a child may end, called in the states of one row of its completion table, by row."""
    rows = np.unique(call.projection[at])
    return [course(grounded, call.child, at & (call.projection == row)).ends for row in rows]
