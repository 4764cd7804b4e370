"""Relevant variables found instead of declared: the smallest sets that are safe."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hierarchy.abstraction_compare import uneven
from hierarchy.abstraction_policy import (
    View,
    leaves_open,
    policy_view,
    random_view,
    same_results_at,
    task_apart,
)
from hierarchy.abstraction_scope import Scope, course, scopes
from hierarchy.abstraction_structure import subsets
from hierarchy.abstraction_verdict import Witness
from hierarchy.graph import Call
from hierarchy.grounding import GroundCall, GroundGraph

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class DerivedEdge:
    """The smallest safe set of variables for a call.

    Parameters
    ----------
    task
        The caller.
    call
        The call.
    relevant
        The variables that its completion must be stored by. A call that is bound to a state variable has a
        table for each of its values already.
    zero
        Whether it is always 0, since the child's end is its caller's: then nothing need be stored.
    """

    task: str
    call: Call
    relevant: tuple[str, ...]
    zero: bool

    def __str__(self) -> str:
        stored = "nothing: it is 0" if self.zero else ", ".join(self.relevant) or "one value"
        return f"{self.task} -> {self.call} by {stored}"


@dataclass(frozen=True)
class DerivedUses:
    """The smallest safe sets of variables of a graph.

    Parameters
    ----------
    uses
        Of every task.
    edges
        Of every call that can be made.
    leaves
        What the expected reward of every primitive action depends on.
    """

    uses: dict[str, tuple[str, ...]]
    edges: tuple[DerivedEdge, ...]
    leaves: dict[str, tuple[str, ...]]


def derive_uses(
    grounded: GroundGraph, policy: NDArray[np.int64] | None = None, gamma: float = 1.0
) -> DerivedUses:
    r"""Return the smallest safe set of variables of every task and call.

    Among sets of one size the first in the variables' order is taken. A task's set must do for its
    termination, its guards, and what its children earn and end in; it is sought among all subsets, so that
    the time doubles with each state variable.

    Parameters
    ----------
    grounded
        The ground graph; its declared sets play no part.
    policy
        The place of the call that each node makes, shape (nodes, states): the sets are safe at this policy.
        Left out, they are safe at a policy drawn at random, and so at almost every one, that reads no more
        than the sets found.
    gamma
        Discount factor for one primitive step.

    Examples
    --------
    >>> from hierarchy import ground
    >>> from hierarchy.taxi import taxi_graph
    >>> from worlds.taxi import taxi_model
    >>> model = taxi_model()
    >>> derived = derive_uses(ground(taxi_graph(model), model))
    >>> derived.uses["Navigate"], derived.uses["Get"], derived.leaves["Pickup"]
    (('taxi',), ('taxi', 'passenger'), ('taxi', 'passenger'))
    >>> print(*derived.edges[-4:], sep="\n")
    Put -> Navigate(site=destination) by one value
    Put -> Putdown by taxi, destination
    Root -> Get by passenger, destination
    Root -> Put by nothing: it is 0
    """
    finder = _Finder(grounded, scopes(grounded))
    given = None if policy is None else policy_view(grounded, policy, gamma)
    everything = dict.fromkeys(grounded.graph.tasks, grounded.model.index.names)
    uses: dict[str, tuple[str, ...]] = {}
    edges: list[DerivedEdge] = []
    for task in dict.fromkeys(node.task for node in grounded.nodes if node.calls):
        # Below this task the policy reads what was found; the task's own policy plays no part yet.
        view = given or random_view(grounded, gamma, uses={**everything, **uses})
        uses[task] = finder.task(view, task)
        edges.extend(finder.edges(view, task, uses[task]))
    return DerivedUses(uses, tuple(edges), finder.leaves())


@dataclass(frozen=True)
class _Finder:
    """Searches subsets of variables, smallest first."""

    grounded: GroundGraph
    scopes: tuple[Scope, ...]

    def task(self, view: View, task: str) -> tuple[str, ...]:
        """Return the smallest set that does for every ground task of a task."""
        places = [p for p, node in enumerate(self.grounded.nodes) if node.task == task]
        courses = {p: course(self.grounded, p, self.scopes[p].decides) for p in places}
        return next(
            names
            for names in subsets(self.grounded.model.index.names)
            if all(task_apart(view, p, names, then) is None for p, then in courses.items())
        )

    def edges(self, view: View, task: str, uses: tuple[str, ...]) -> Iterator[DerivedEdge]:
        """Yield the smallest set of every call of a task, over all its bindings."""
        for call in self.grounded.graph.tasks[task].do:
            made = list(self._made(task, call))
            if not made:
                continue
            zero = all(leaves_open(view, *one) is None for one in made)
            found = next(names for names in subsets(uses) if zero or self._does(view, made, names, uses))
            yield DerivedEdge(task, call, found, zero)

    def leaves(self) -> dict[str, tuple[str, ...]]:
        """Return the smallest set that the reward of every action depends on, wherever it is taken."""
        model = self.grounded.model
        return {
            action: next(
                names
                for names in subsets(model.index.names)
                if uneven(model.index.project(names), model.rewards[:, place], self.scopes[place].decides)
                is None
            )
            for place, action in enumerate(model.actions)
        }

    def _made(self, task: str, call: Call) -> Iterator[tuple[int, GroundCall, Mask]]:
        for place, node in enumerate(self.grounded.nodes):
            for edge in node.calls if node.task == task else ():
                at = self.scopes[place].decides & edge.available
                if edge.call is call and at.any():
                    yield place, edge, at

    def _does(
        self,
        view: View,
        made: list[tuple[int, GroundCall, Mask]],
        names: tuple[str, ...],
        uses: tuple[str, ...],
    ) -> bool:
        rows = self.grounded.model.index.project(names)
        return names == uses or all(
            not isinstance(same_results_at(view, place, replace(edge, projection=rows), at, uses), Witness)
            for place, edge, at in made
        )
