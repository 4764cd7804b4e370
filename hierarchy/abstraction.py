"""Safe state abstraction, proved or refuted: Dietterich's five conditions for every task and child.

Dietterich (2000), "Hierarchical reinforcement learning with the MAXQ value function decomposition",
section 5.1; the first two are equations 5 to 7 of the paper. Only states count in which a task may come
to decide (`hierarchy.abstraction_scope`): reachable ones, called by a caller that may call it there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hierarchy.abstraction_compare import Difference, uneven
from hierarchy.abstraction_policy import (
    View,
    apart,
    leaves_open,
    policy_view,
    random_view,
    same_results_at,
    spread,
)
from hierarchy.abstraction_report import AbstractionReport, EdgeReport
from hierarchy.abstraction_scope import Scope, course, scopes
from hierarchy.abstraction_structure import open_below, same_results, stays_on, undeclared
from hierarchy.abstraction_verdict import NOT_APPLICABLE, Judgement, Verdict, Witness, witness
from hierarchy.grounding import GroundCall, GroundGraph

Mask = NDArray[np.bool_]


def prove_abstraction(
    grounded: GroundGraph, policy: NDArray[np.int64] | None = None, gamma: float = 1.0
) -> AbstractionReport:
    """Prove or refute that the declared relevant variables are safe.

    "For every policy" means: for every policy of the tasks below, stationary, deterministic or not, that
    reads no more than each task's `uses`; the task itself being optimal given these. A proof is found by
    enumeration of the model; a refutation at a policy drawn at random, or at the one given.

    Parameters
    ----------
    grounded
        The ground graph.
    policy
        The place of the call that each node makes, -1 where none, shape (nodes, states), such as the
        choices of a recursively optimal policy. Left out, nothing is said about any policy in particular.
    gamma
        Discount factor for one primitive step.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> print(prove_abstraction(grounded))
    50 of 50 tables proved safe for every policy (gamma 1)
    >>> discounted = prove_abstraction(grounded, gamma=0.95)
    >>> print(discounted.edge("Root", "GotoGoal(G1)").termination.always)
    proved (GotoGoal(G1) ends only where Root has ended)
    >>> print(discounted.edge("Root", "GotoDoor(D1)").table.always.status)
    refuted
    """
    prover = _Prover(grounded, policy, gamma)
    return AbstractionReport(gamma, tuple(prover.edges()))


class _Prover:
    """Holds what the conditions of every call share."""

    def __init__(self, grounded: GroundGraph, policy: NDArray[np.int64] | None, gamma: float) -> None:
        self.grounded = grounded
        self.discounted = gamma < 1
        self.scopes = scopes(grounded)
        self.random = random_view(grounded, gamma)
        self.given = None if policy is None else policy_view(grounded, policy, gamma)

    def edges(self) -> Iterator[EdgeReport]:
        """Yield the report on every call that can be made."""
        for place, node in enumerate(self.grounded.nodes):
            if not node.calls:
                continue
            uses = self.grounded.graph.tasks[node.task].uses
            decides = self.scopes[place].decides
            calls = [(call, decides & call.available) for call in node.calls]
            calls = [(call, at) for call, at in calls if at.any()]
            then = course(self.grounded, place, decides)
            blurred = undeclared(self.grounded, place, uses, then)
            max_nodes = [self._max_node(call, uses, at, blurred) for call, at in calls]
            agreed = all(judged.always.proved for judged in max_nodes)
            for (call, at), max_node in zip(calls, max_nodes, strict=True):
                result, termination = self._result(place, call, at), self._termination(place, call, at)
                whole = set(call.relevant) == set(uses)
                proofs = (
                    ("max-node irrelevance", agreed and whole),
                    ("result distribution irrelevance", result.always.proved),
                    ("termination", termination.always.proved),
                )
                yield EdgeReport(
                    task=node.name,
                    child=self.grounded.nodes[call.child].name,
                    uses=uses,
                    relevant=call.relevant,
                    states=int(at.sum()),
                    max_node=max_node,
                    leaf=self._leaf(call.child, at),
                    result=result,
                    termination=termination,
                    shielding=self._shielding(place, self.scopes[place]),
                    table=self._table(place, call, at, [name for name, holds in proofs if holds]),
                )

    def _max_node(
        self, call: GroundCall, uses: tuple[str, ...], at: Mask, blurred: Witness | None
    ) -> Judgement:
        if blurred:
            refuted = Verdict("refuted", "", blurred)
            return Judgement(refuted, None if self.given is None else refuted)
        rows = self.grounded.model.index.project(uses)
        found = open_below(self.grounded, call.child, uses, at)
        at_random = None if found is None else apart(self.random, call.child, rows, uses, at)
        here = None
        if self.given is not None:
            told = apart(self.given, call.child, rows, uses, at)
            here = _decided(told)
        return Judgement(_always(found, at_random, here), here)

    def _leaf(self, child: int, at: Mask) -> Judgement:
        node, model = self.grounded.nodes[child], self.grounded.model
        if node.leaf is None:
            return Judgement(NOT_APPLICABLE)
        found = uneven(node.leaf.projection, model.rewards[:, child], at)
        told = None if found is None else witness(model.index, f"expected reward of {node.name}", found)
        return Judgement(_decided(told), None if self.given is None else _decided(told))

    def _result(self, place: int, call: GroundCall, at: Mask) -> Judgement:
        uses = self.grounded.graph.tasks[self.grounded.nodes[place].task].uses
        if set(call.relevant) == set(uses):
            return Judgement(NOT_APPLICABLE, None if self.given is None else NOT_APPLICABLE)
        here = None if self.given is None else self._result_at(self.given, place, call, at)
        names = same_results(self.grounded, place, call, at, discounted=self.discounted)
        if names is not None:
            return Judgement(_settled(names), here)
        at_random = self._result_at(self.random, place, call, at)
        return Judgement(_always("no proof was found", at_random.witness, here), here)

    def _result_at(self, view: View, place: int, call: GroundCall, at: Mask) -> Verdict:
        found = same_results_at(view, place, call, at)
        return Verdict("refuted", "", found) if isinstance(found, Witness) else _settled(found)

    def _termination(self, place: int, call: GroundCall, at: Mask) -> Judgement:
        task, child = self.grounded.nodes[place].name, self.grounded.nodes[call.child].name
        reason = f"{child} ends only where {task} has ended"
        here = None
        if self.given is not None:
            told = leaves_open(self.given, place, call, at)
            here = _decided(told, reason)
        if not stays_on(self.grounded, place, call, at).any():
            return Judgement(Verdict("proved", reason), here)
        at_random = leaves_open(self.random, place, call, at)
        return Judgement(_always(f"{child} may end before {task}", at_random, here), here)

    def _shielding(self, place: int, scope: Scope) -> Judgement:
        if not scope.shielded.any():
            return Judgement(NOT_APPLICABLE)
        name = self.grounded.nodes[place].name
        if not scope.breached.any():
            reason = (
                f"{name} is never asked about {int(scope.shielded.sum())} states, every caller having ended"
            )
            return Judgement(Verdict("proved", reason))
        inside = np.flatnonzero(scope.decides & ~scope.shielded)
        first, second = int(inside[0]) if inside.size else -1, int(np.flatnonzero(scope.breached)[0])
        first = second if first < 0 else first
        what = f"whether every caller of {name} has ended although it decides"
        told = witness(self.grounded.model.index, what, Difference(first, second, (0.0, 1.0)))
        return Judgement(Verdict("refuted", "", told))

    def _table(self, place: int, call: GroundCall, at: Mask, proofs: list[str]) -> Judgement:
        here = None
        if self.given is not None:
            here = _decided(spread(self.given, place, call, at))
        if proofs:
            return Judgement(Verdict("proved", " and ".join(proofs)), here)
        at_random = spread(self.random, place, call, at)
        return Judgement(_always("no conditions add up to a proof", at_random, here), here)


def _decided(found: Witness | None, reason: str = "") -> Verdict:
    return Verdict("proved", reason) if found is None else Verdict("refuted", "", found)


def _settled(names: tuple[str, ...]) -> Verdict:
    said = ", ".join(names)
    return Verdict("proved", f"afterwards only {said} matters" if said else "afterwards nothing matters")


def _always(found: Witness | str | None, at_random: Witness | None, here: Verdict | None) -> Verdict:
    """Return the verdict for every policy from what the proof stumbled on, and from two policies."""
    if found is None:
        return Verdict("proved")
    if at_random is not None:
        return Verdict("refuted", "at a policy drawn at random", at_random)
    if here is not None and here.refuted:
        return Verdict("refuted", "at the policy given", here.witness)
    if isinstance(found, Witness):
        return Verdict("undecided", "no proof, and a random policy does not refute it", found)
    return Verdict("undecided", f"no proof, and a random policy does not refute it; {found}")
