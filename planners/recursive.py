"""The recursively optimal policy of a ground graph, exactly, by dynamic programming from the leaves up.

Recursively optimal: every task is optimal given its children's policies (Dietterich 2000, section 4.1).
It may lose against the optimum of the hierarchy and of the world (`planners.gaps`). This solver shares no
code with the learner.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hierarchy import Exits, GroundGraph, primitive_exits, task_exits
from planners.smdp import best_policy


@dataclass(frozen=True, eq=False)
class Solution:
    """A recursively optimal policy.

    Parameters
    ----------
    grounded
        The ground graph.
    gamma
        Discount factor for one primitive step.
    choice
        The call that each task makes, first in order among equals, shape (nodes, states); -1 where none.
    taught
        The value V-tilde that decides the policy, shape (nodes, states): with pseudo-rewards for ending
        outside the goal, -inf where no policy surely ends.
    exits
        What becomes of each node under this policy, pseudo-rewards left out.
    """

    grounded: GroundGraph
    gamma: float
    choice: NDArray[np.int64]
    taught: NDArray[np.float64]
    exits: tuple[Exits, ...]

    @cached_property
    def value(self) -> NDArray[np.float64]:
        """V of each node under the policy, shape (nodes, states): see `hierarchy.Exits.value`."""
        return np.stack([exits.value for exits in self.exits])

    @cached_property
    def steps(self) -> NDArray[np.float64]:
        """Expected primitive steps to the end of each node, shape (nodes, states).

        1 for a primitive action, 0 where a task has ended, inf from where it may never end.
        """
        found: list[Exits] = []
        for place, node in enumerate(self.grounded.nodes):
            if node.calls:
                found.append(task_exits(node, self.choice[place], found))
            else:  # the reward of a step is the step itself
                kernel = primitive_exits(self.grounded.model, place).kernel
                found.append(Exits(np.ones(kernel.shape[0]), kernel))
        rows = (
            np.where(node.terminal | (node.live & np.isfinite(one.value)), one.value, np.inf)
            for node, one in zip(self.grounded.nodes, found, strict=True)
        )
        return np.stack(list(rows))

    @cached_property
    def landing(self) -> NDArray[np.int64]:
        """The state in which each node most likely ends, shape (nodes, states): here if it does not run."""
        here = np.arange(self.grounded.model.index.size)
        rows = (
            np.where(exits.kernel.sum(axis=1) > 0, exits.kernel.argmax(axis=1), here) for exits in self.exits
        )
        return np.stack(list(rows))


def recursive_optimum(grounded: GroundGraph, gamma: float = 1.0) -> Solution:
    """Solve every node, children first; ties go to the first call.

    V(i, s) is the maximum over the calls a of V(a, s) + the sum over s' of kernel(a)[s, s'] V(i, s'), where
    the kernel holds the discount of the steps that the child takes (Dietterich 2000, theorem 1).
    A task with a pseudo-reward maximises V-tilde instead, in which ending outside its goal is worth that
    (MAXQ-Q, section 4.4 there); what its callers see of it is V, without.

    Parameters
    ----------
    grounded
        The ground graph, on a world with any rewards and chances.
    gamma
        Discount factor for one primitive step.

    Raises
    ------
    planners.EndlessRewardError
        If a task can collect reward for ever without discounting.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> solution = recursive_optimum(ground(two_rooms(maze), maze_model(maze)))
    >>> index, root = solution.grounded.model.index, solution.grounded.root
    >>> start = index.number((maze.start, maze.triggers["T4"], maze.goals["G2"], "closed"))
    >>> solution.value[root, start], solution.steps[root, start]
    (np.float64(-15.0), np.float64(15.0))
    """
    shape = (len(grounded.nodes), grounded.model.index.size)
    choice, taught = np.full(shape, -1), np.zeros(shape)
    found: list[Exits] = []
    for place, node in enumerate(grounded.nodes):
        if not node.calls:
            found.append(primitive_exits(grounded.model, place, gamma))
            taught[place] = found[place].value
            continue
        calls = [(call.available, found[call.child]) for call in node.calls]
        ends = np.where(node.terminal & ~node.goal, node.pseudo_reward or 0.0, 0.0)
        best = best_policy(calls, node.terminal, ends, f"task {node.name}")
        choice[place], taught[place] = best.choice, best.value
        found.append(task_exits(node, best.choice, found))
    return Solution(grounded, gamma, choice, taught, tuple(found))
