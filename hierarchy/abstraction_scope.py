"""Where a task may come to decide: the states in which its completion tables are read, and shielding.

Only these states count for an abstraction. A task that cannot be called in a state, or has a caller that
has ended there, never asks its tables about it (shielding: Dietterich 2000, section 5.1.5).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hierarchy.grounding import GroundGraph, GroundTask
from worlds import UserError

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Scope:
    """Where a node of a ground graph may come to decide.

    Parameters
    ----------
    decides
        Reachable states in which it runs, called from a state in which a caller of its own decides, and
        whatever was done below it since, shape (states,). A primitive action: where it is taken.
    shielded
        Reachable states in which it would run, but on every path from the root some caller has ended or
        left its working space, shape (states,).
    """

    decides: Mask
    shielded: Mask

    @property
    def breached(self) -> Mask:
        """States that are shielded, and in which it decides all the same: a child ran on past its caller."""
        return self.decides & self.shielded


@dataclass(frozen=True, eq=False)
class Course:
    """What may become of a node, whatever is decided in and below it.

    Parameters
    ----------
    decides
        The states in which it may decide, shape (states,).
    ends
        The states in which it may end, shape (states,).
    """

    decides: Mask
    ends: Mask


def course(grounded: GroundGraph, place: int, entry: Mask) -> Course:
    """Follow a node from every state of `entry` in which it runs, through everything that it may do.

    Call and return: a child runs to its own end, even past a state in which its caller has ended.

    Examples
    --------
    >>> from hierarchy import TaskGraph, ground
    >>> from worlds import StateIndex, TransitionModel, Variable
    >>> x, right = StateIndex((Variable("x", (0, 1, 2, 3)),)), np.array([[1], [2], [3], [3]])
    >>> model = TransitionModel(x, ("right",), right, np.full((4, 1), -1.0), np.ones(4, bool))
    >>> graph = TaskGraph("corridor", x.variables, model.actions)
    >>> (at,) = graph.variables
    >>> _ = graph.task("Root", until=at.eq(2), uses=[at], do="right")
    >>> then = course(ground(graph, model), 1, np.array([False, True, False, False]))
    >>> then.decides.tolist(), then.ends.tolist()
    ([False, True, False, False], [False, False, True, False])
    """
    search = _Search(grounded)
    if not grounded.nodes[place].calls:
        ends = np.zeros_like(entry)
        ends[search.after(entry, place)] = True
        return Course(entry, ends)
    run = _Run(np.zeros_like(entry), np.zeros_like(entry))
    search.follow(place, entry, run)
    return Course(run.decides, run.ends)


@dataclass(frozen=True, eq=False)
class _Run:
    """What is known so far of one task on one path of calls, so that nothing is followed twice.

    Parameters
    ----------
    decides, ends
        As in `Course`.
    below
        The same for the tasks that it calls, by place.
    """

    decides: Mask
    ends: Mask
    below: dict[int, _Run] = field(default_factory=dict)


class _Search:
    """Follows tasks through a ground graph."""

    def __init__(self, grounded: GroundGraph) -> None:
        self.nodes = grounded.nodes
        self.model = grounded.model
        try:
            self.occurs: Mask | None = grounded.model.probabilities > 0
        except UserError:  # a black box shows none, but tells what may follow
            self.occurs = None

    def after(self, states: Mask, action: int) -> NDArray[np.int64]:
        """Return the states that an action may lead to, maybe repeated."""
        if self.occurs is None:
            return self.model.following(states, action)
        at = np.flatnonzero(states)
        led: NDArray[np.int64] = self.model.outcomes[at, action][self.occurs[at, action]]
        return led

    def follow(self, place: int, entry: Mask, run: _Run) -> Mask:
        """Follow a task from more entries; return the states in which it may end and was not known to."""
        node, known = self.nodes[place], run.ends.copy()
        new = entry & node.live & ~run.decides
        while new.any():
            run.decides[new] = True
            after = np.zeros_like(entry)
            for call in node.calls:
                made = new & call.available
                if not made.any():
                    continue
                if self.nodes[call.child].calls:
                    below = run.below.setdefault(call.child, _Run(np.zeros_like(entry), np.zeros_like(entry)))
                    after |= self.follow(call.child, made, below)
                else:
                    after[self.after(made, call.child)] = True
            run.ends[after & node.terminal] = True
            new = after & node.live & ~run.decides
        return run.ends & ~known


def scopes(grounded: GroundGraph) -> tuple[Scope, ...]:
    """Return where every node may come to decide, by place.

    The root counts in every reachable state in which it runs.

    Examples
    --------
    GotoDoor counts where the doors are open and the robot is in room A but not at that door.

    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> scope = scopes(grounded)[grounded.place("GotoDoor(D1)")]
    >>> robot = grounded.model.index.column("robot")
    >>> len(set(robot[scope.decides])), int(scope.breached.sum())
    (32, 0)
    """
    reachable = grounded.model.reachable()
    nowhere = np.zeros_like(reachable)
    called = [nowhere.copy() for _ in grounded.nodes]
    callers: list[list[int]] = [[] for _ in grounded.nodes]
    open_to = [nowhere.copy() for _ in grounded.nodes]
    called[grounded.root] = reachable
    found: list[Scope | None] = [None] * len(grounded.nodes)
    for place in range(grounded.root, -1, -1):
        node = grounded.nodes[place]
        runs = reachable & node.live
        above = [open_to[caller] for caller in callers[place]]
        open_to[place] = runs & (np.logical_or.reduce(above) if above else runs)
        decides = course(grounded, place, called[place]).decides
        found[place] = Scope(decides, runs & ~open_to[place])
        for call in node.calls:
            called[call.child] |= decides & call.available
            callers[call.child].append(place)
    return tuple(scope for scope in found if scope is not None)


def ends_task(node: GroundTask) -> Mask:
    """Return where ending a task is worth nothing more to it: where it has ended, with no say in how."""
    return node.terminal if node.pseudo_reward is None else node.goal
