"""Grounding: a task graph with every parameter bound, as masks and projections over a world's states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from hierarchy.graph import Call, Task, TaskGraph
from hierarchy.predicates import ALWAYS
from hierarchy.terms import Constant, Equal, Var
from worlds import TransitionModel

Binding = tuple[tuple[str, Constant], ...]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class GroundCall:
    """An edge of the ground graph.

    Parameters
    ----------
    child
        The child's place among the nodes.
    available
        Where the call may be made, shape (states,).
    relevant
        The state variables that its completion is stored by.
    projection
        Every state's row of the completion table, shape (states,).
    rows
        Number of rows in that table.
    call
        The call of the task graph that it came from.
    """

    child: int
    available: Mask
    relevant: tuple[str, ...]
    projection: NDArray[np.int64]
    rows: int
    call: Call


@dataclass(frozen=True, eq=False)
class Leaf:
    """How a primitive action's value is stored: one value for each expected reward (leaf irrelevance).

    Parameters
    ----------
    projection
        Every state's row, shape (states,).
    rows
        Number of rows: of different expected rewards.
    """

    projection: NDArray[np.int64]
    rows: int


@dataclass(frozen=True, eq=False)
class GroundTask:
    """A task with its parameters bound, or a primitive action (which has no calls).

    Parameters
    ----------
    name
        Such as ``GotoTrigger(T4)``.
    task
        The task's name in the task graph.
    binding
        Its parameters' values.
    terminal
        Where it has ended, shape (states,).
    live
        Where it is running: within its working space and not terminal, shape (states,).
    initiation
        Where it may be called: where it is live and its `start` holds, shape (states,).
    goal
        Where it has ended well: the terminal states in which its `goal` holds, shape (states,).
    pseudo_reward
        What it is taught to expect of ending elsewhere; None if it has no say in that.
    calls
        What it may do, in the order that breaks ties.
    leaf
        How a primitive action's value is stored; None for a task.
    """

    name: str
    task: str
    binding: Binding
    terminal: Mask
    live: Mask
    initiation: Mask
    goal: Mask
    pseudo_reward: float | None = None
    calls: tuple[GroundCall, ...] = ()
    leaf: Leaf | None = None


@dataclass(frozen=True, eq=False)
class GroundGraph:
    """A grounded task graph on a world.

    Nodes stand children before parents: the primitive actions first, in their order, the root last.
    """

    graph: TaskGraph
    model: TransitionModel
    nodes: tuple[GroundTask, ...]

    @property
    def root(self) -> int:
        """The root's place among the nodes."""
        return len(self.nodes) - 1

    @cached_property
    def places(self) -> Mapping[str, int]:
        """Each node's place, by name."""
        return {node.name: place for place, node in enumerate(self.nodes)}

    def place(self, name: str) -> int:
        """Return a node's place by its name, such as ``GotoDoor(D1)``.

        Raises
        ------
        KeyError
            If there is no such node; the message lists them.
        """
        if name not in self.places:
            raise KeyError(f"no ground task {name!r}; there are {', '.join(self.places)}")
        return self.places[name]

    def node(self, name: str) -> GroundTask:
        """Return a node by its name."""
        return self.nodes[self.place(name)]

    def instances(self, task: str) -> tuple[GroundTask, ...]:
        """Return every ground task of a task."""
        return tuple(node for node in self.nodes if node.task == task)

    def networkx(self) -> nx.DiGraph[str]:
        """Return ground tasks and actions as a directed graph."""
        graph: nx.DiGraph[str] = nx.DiGraph(name=self.graph.name)
        graph.add_nodes_from(node.name for node in self.nodes)
        for node in self.nodes:
            graph.add_edges_from((node.name, self.nodes[call.child].name) for call in node.calls)
        return graph


def ground(graph: TaskGraph, model: TransitionModel) -> GroundGraph:
    """Bind every parameter in every way the graph calls for, and compile predicates to masks.

    A child bound to a state variable becomes one call for each value that its parameter can take, guarded
    by that value; with another value of the variable it cannot be called. The graph must have passed
    `hierarchy.check`.

    Examples
    --------
    >>> from hierarchy import two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> print(*[node.name for node in grounded.nodes][4:9])
    GotoTrigger(T1) GotoTrigger(T2) GotoTrigger(T3) GotoTrigger(T4) GotoDoor(D1)
    """
    builder = _Builder(graph, model)
    builder.add(graph.root, ())
    return GroundGraph(graph, model, tuple(builder.nodes))


class _Builder:
    """Adds ground tasks, children first."""

    def __init__(self, graph: TaskGraph, model: TransitionModel) -> None:
        self.graph = graph
        self.model = model
        self.nodes = [_primitive(model, place) for place in range(len(model.actions))]
        self.places: dict[tuple[str, Binding], int] = {(a, ()): i for i, a in enumerate(model.actions)}
        self.projections: dict[tuple[str, ...], NDArray[np.int64]] = {}  # long, so shared

    def add(self, task: Task, binding: Binding) -> int:
        """Add a ground task below its children, unless it is there, and return its place."""
        key = (task.name, binding)
        if key in self.places:
            return self.places[key]
        index, values = self.model.index, dict(binding)
        terminal = task.until.bind(values).mask(index)
        within = task.within.bind(values).mask(index)
        live = within & ~terminal
        calls = []
        for call in task.do:
            guard = live & call.guard.bind(values).mask(index)
            for child_binding, where in self._bindings(call, values):
                calls.append(self._call(task, call, child_binding, guard & where, within | terminal))
        label = ", ".join(str(value) for _, value in binding)
        ground_task = GroundTask(
            name=f"{task.name}({label})" if label else task.name,
            task=task.name,
            binding=binding,
            terminal=terminal,
            live=live,
            initiation=live & task.start.bind(values).mask(index),
            goal=terminal & task.goal.bind(values).mask(index),
            pseudo_reward=task.pseudo_reward,
            calls=tuple(calls),
        )
        self.nodes.append(ground_task)
        self.places[key] = len(self.nodes) - 1
        return self.places[key]

    def _call(self, task: Task, call: Call, binding: Binding, guard: Mask, stays: Mask) -> GroundCall:
        index = self.model.index
        if call.child in self.graph.tasks:
            child = self.add(self.graph.tasks[call.child], binding)
            available = guard & self.nodes[child].initiation
        else:
            child = self.places[call.child, ()]
            available = guard & self.model.must_reach(stays)[:, child]
        relevant = task.uses if call.relevant is None else call.relevant
        rows = int(np.prod([len(index.variable(name)) for name in relevant], dtype=np.int64))
        if relevant not in self.projections:
            self.projections[relevant] = index.project(relevant)
        return GroundCall(child, available, relevant, self.projections[relevant], rows, call)

    def _bindings(self, call: Call, values: Mapping[str, Constant]) -> Iterator[tuple[Binding, Mask]]:
        """Yield every binding of a call's child, and the states in which it is meant."""
        index = self.model.index
        options: list[list[tuple[Constant, Mask]]] = []
        everywhere = ALWAYS.mask(index)
        params = {param.name: param for param in self.graph.tasks[call.child].params} if call.binding else {}
        for name, bound in call.binding:
            if isinstance(bound, Constant):
                options.append([(bound, everywhere)])
            elif isinstance(bound, Var):
                shared = (value for value in bound.domain.values if value in params[name].domain)
                constants = [bound.constant(value) for value in shared]
                options.append([(c, Equal(bound, c).mask(index)) for c in constants])
            else:
                options.append([(values[bound.name], everywhere)])
        names = [name for name, _ in call.binding]
        for chosen in product(*options):
            where = everywhere.copy()
            for _, mask in chosen:
                where &= mask
            yield tuple(zip(names, (constant for constant, _ in chosen), strict=True)), where


def _primitive(model: TransitionModel, place: int) -> GroundTask:
    """Return a primitive action as a node: it runs anywhere and has no end of its own."""
    name = model.actions[place]
    nowhere = np.zeros(model.index.size, dtype=np.bool_)
    # Rounding keeps sums of the same outcomes in another order in one class.
    values, rows = np.unique(model.rewards[:, place].round(9), return_inverse=True)
    leaf = Leaf(rows.reshape(-1).astype(np.int64), values.size)
    return GroundTask(name, name, (), nowhere, ~nowhere, ~nowhere, nowhere, leaf=leaf)
