"""How many values each representation stores, counted from the task graph (section 5.3 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hierarchy.graph import Call
from hierarchy.grounding import GroundGraph


@dataclass(frozen=True)
class ValueCounts:
    """Numbers of stored values.

    Parameters
    ----------
    flat
        Flat Q over the variables that are counted: joint states x actions.
    flat_markov
        Flat Q over every state variable of the world.
    per_task
        Completion values of each task above the primitive actions, the root apart: relevant values
        that occur x parameters' values x children.
    per_task_live
        The same, counting only values of states in which the task runs.
    root
        Completion values of the root, each edge by its own relevant variables.
    leaves
        Values of the primitive actions, one for each expected reward (leaf irrelevance, equation 7).
    unabstracted_tasks, unabstracted_subtasks
        Without abstraction: flat x tasks between root and actions, and flat x calls of the root.
    """

    flat: int
    flat_markov: int
    per_task: dict[str, int]
    per_task_live: dict[str, int]
    root: int
    leaves: int
    unabstracted_tasks: int
    unabstracted_subtasks: int

    @property
    def abstracted(self) -> int:
        """All completion values below the root and the values of the leaves: the paper's 1284."""
        return sum(self.per_task.values()) + self.leaves


def value_counts(grounded: GroundGraph, *, ignoring: Sequence[str] = ()) -> ValueCounts:
    """Count the values that each representation stores.

    Parameters
    ----------
    grounded
        The ground graph.
    ignoring
        State variables left out of the counts without abstraction. The paper leaves out the doors,
        although without them the flat problem is not Markov.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> counts = value_counts(ground(two_rooms(maze), maze_model(maze)), ignoring=["doors"])
    >>> counts.per_task, counts.leaves, counts.abstracted
    ({'GotoTrigger': 512, 'GotoDoor': 256, 'GotoGoal': 512}, 4, 1284)
    >>> counts.flat, counts.unabstracted_tasks, counts.unabstracted_subtasks
    (4096, 12288, 16384)
    """
    graph, model = grounded.graph, grounded.model
    index, actions = model.index, len(model.actions)
    sizes = {variable.name: len(variable) for variable in index.variables}
    flat = actions * int(np.prod([n for name, n in sizes.items() if name not in ignoring]))
    reachable = model.reachable()
    between = [name for name in graph.tasks if name != graph.root.name]
    per_task: dict[str, int] = {}
    per_task_live: dict[str, int] = {}
    for name in between:
        nodes = grounded.instances(name)
        calls = len(nodes[0].calls)
        live = [node.live & reachable for node in nodes]
        uses = graph.tasks[name].uses
        # The paper counts a product of domains: every value that occurs in any binding, in all of them.
        occurring = [_distinct(index.column(used), np.logical_or.reduce(live)) for used in uses]
        per_task[name] = int(np.prod(occurring)) * len(nodes) * calls
        per_task_live[name] = sum(_distinct(index.project(uses), mask) for mask in live) * calls
    return ValueCounts(
        flat=flat,
        flat_markov=index.size * actions,
        per_task=per_task,
        per_task_live=per_task_live,
        root=sum(_root_edge(grounded, call, reachable) for call in graph.root.do),
        leaves=sum(_distinct(node.leaf.projection, reachable) for node in grounded.nodes if node.leaf),
        unabstracted_tasks=flat * len(between),
        unabstracted_subtasks=flat * len(graph.root.do),
    )


def _distinct(column: NDArray[np.int64], mask: NDArray[np.bool_]) -> int:
    return int(np.unique(column[mask]).size)


def _root_edge(grounded: GroundGraph, call: Call, reachable: NDArray[np.bool_]) -> int:
    """Count the completion values of one call of the root, over all its bindings."""
    bound = [edge for edge in grounded.nodes[grounded.root].calls if edge.call is call]
    made: NDArray[np.bool_] = np.logical_or.reduce([edge.available for edge in bound])
    return _distinct(bound[0].projection, made & reachable)
