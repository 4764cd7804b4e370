"""Discounting and funnels: an abstraction that forgets how long a child takes is right without discounting.

Result distribution irrelevance speaks of where a child ends, not when (Dietterich 2000, section 5.1.3). With
gamma below 1 the completion after it is discounted by the time that it took.
"""

from __future__ import annotations

from collections.abc import Iterator

from hierarchy.abstraction_policy import View, random_view, spread
from hierarchy.abstraction_scope import Scope, scopes
from hierarchy.abstraction_structure import same_results
from hierarchy.check import Finding
from hierarchy.graph import Call
from hierarchy.grounding import GroundGraph


def discounted_funnels(grounded: GroundGraph, gamma: float) -> tuple[Finding, ...]:
    """Return the calls whose tables hold a function without discounting, and do not with it.

    Parameters
    ----------
    grounded
        The ground graph.
    gamma
        Discount factor for one primitive step; with 1 there is nothing to find.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> [finding.where for finding in discounted_funnels(grounded, 0.95)]  # doctest: +NORMALIZE_WHITESPACE
    ['Root -> GotoTrigger(target=trigger)', 'Root -> GotoDoor(target=D1)', 'Root -> GotoDoor(target=D2)']
    >>> discounted_funnels(grounded, 1.0)
    ()
    """
    if gamma >= 1:
        return ()
    view, where = random_view(grounded, gamma), scopes(grounded)
    found: dict[tuple[str, int], Finding] = {}
    for task, call, finding in _funnels(grounded, view, where, gamma):
        found.setdefault((task, id(call)), finding)
    return tuple(found.values())


def _funnels(
    grounded: GroundGraph, view: View, where: tuple[Scope, ...], gamma: float
) -> Iterator[tuple[str, Call, Finding]]:
    """Yield a finding for each ground call that is such a funnel."""
    for place, node in enumerate(grounded.nodes):
        for edge in node.calls:
            at = where[place].decides & edge.available
            if not grounded.nodes[edge.child].calls or not at.any():
                continue
            told = spread(view, place, edge, at)
            if told is None or same_results(grounded, place, edge, at, discounted=False) is None:
                continue
            child = grounded.nodes[edge.child].name
            finding = Finding(
                "discounted funnel",
                f"{node.task} -> {edge.call}",
                f"with gamma = {gamma:g} what follows depends on how long {child} takes, which its row "
                f"({', '.join(edge.relevant) or 'one for all states'}) does not tell ({told})",
                f"set gamma to 1, or store the edge by all the uses of {node.task} (leave out using)",
            )
            yield node.task, edge.call, finding
