"""The recursively optimal policy of a ground graph by dynamic programming, and its gap to the optimum.

Recursively optimal: every task is optimal given its children's policies (Dietterich 2000, section 3.2);
it may lose against the flat optimum. This solver shares no code with the learner.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundGraph
from planners.fields import flat_field

NEVER = np.iinfo(np.int64).max // 4
"""Steps of a task that cannot end."""


@dataclass(frozen=True, eq=False)
class Solution:
    """A recursively optimal policy.

    Parameters
    ----------
    steps
        Primitive steps to the end of each node from each state, shape (nodes, states); 1 for a
        primitive action, `NEVER` where a task cannot end.
    landing
        The state in which each node ends, shape (nodes, states).
    choice
        The call that each task makes, first in order among equals, shape (nodes, states); -1 where none.
    """

    steps: NDArray[np.int64]
    landing: NDArray[np.int64]
    choice: NDArray[np.int64]


def recursive_optimum(grounded: GroundGraph) -> Solution:
    """Solve every node, children first, for the fewest primitive steps; ties go to the first call."""
    model, nodes = grounded.model, grounded.nodes
    shape = (len(nodes), model.index.size)
    steps, choice = np.full(shape, NEVER), np.full(shape, -1)
    landing = np.tile(np.arange(model.index.size), (len(nodes), 1))
    for place, node in enumerate(nodes):
        if not node.calls:
            steps[place], landing[place] = 1, model.successors[:, place]
            continue
        own = np.where(node.terminal, 0, NEVER)
        children = [call.child for call in node.calls]
        usable = np.stack([call.available for call in node.calls]) & (steps[children] < NEVER)
        while True:
            through = np.where(usable, steps[children] + own[landing[children]], NEVER)
            best = np.where(node.terminal, 0, np.minimum(through.min(axis=0), NEVER))
            if (best == own).all():
                break
            own = best
        ends = ~node.terminal & (own < NEVER)
        choice[place] = np.where(ends, through.argmin(axis=0), -1)
        steps[place] = own
        landing[place] = _landings(landing, children, choice[place], own)
    return Solution(steps, landing, choice)


def _landings(
    landing: NDArray[np.int64], children: list[int], choice: NDArray[np.int64], steps: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Follow a task's choices to where it ends, nearest states first."""
    ends = np.arange(choice.size)
    for state in np.argsort(steps, kind="stable"):
        if choice[state] >= 0:
            ends[state] = ends[landing[children[choice[state]], state]]
    return ends


@dataclass(frozen=True)
class Gap:
    """How far a hierarchy falls short of the flat optimum over its start states.

    Parameters
    ----------
    starts
        Number of start states.
    short
        Those from which the recursively optimal policy takes more steps than needed.
    worst, total
        The most steps lost from one start, and the sum over all.
    """

    starts: int
    short: int
    worst: int
    total: int


def gap(grounded: GroundGraph, solution: Solution) -> Gap:
    """Compare a recursively optimal policy of the root with the flat optimum."""
    model, root = grounded.model, grounded.nodes[grounded.root]
    best = flat_field(model, root.terminal).distance
    lost = (solution.steps[grounded.root] - best)[model.starts]
    return Gap(int(model.starts.sum()), int((lost > 0).sum()), int(lost.max()), int(lost.sum()))
