"""What a run of learning is on: a ground graph as declared, or with something taken away on purpose."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from math import prod

import numpy as np

from comparisons.study.runs.learn_settings import FLAT, LearnSettings
from hierarchy import GroundGraph, TaskGraph, ground
from hierarchy.abstraction_counts import table_sizes
from hierarchy.check import checked
from hierarchy.grounding import GroundCall, Leaf
from hierarchy.starts import beginning_where
from hierarchy.text import load_graph, load_world
from worlds import Layout, UserError, load_layout, suggest


def problem(settings: LearnSettings) -> GroundGraph:
    """Return the ground graph to learn on.

    The graph is checked as it is declared; what is then taken away from it may be unsafe.

    Raises
    ------
    UserError
        If the graph or the world cannot be read, or something is to be taken away that is not there.

    Examples
    --------
    >>> grounded = problem(LearnSettings("two_rooms", abstraction="drop goal"))
    >>> root = grounded.nodes[grounded.root]
    >>> {grounded.nodes[call.child].task: call.relevant for call in root.calls}
    {'GotoTrigger': ('trigger',), 'GotoDoor': (), 'GotoGoal': ()}
    """
    with _about("world"):
        world = load_world(settings.world) if settings.world else None
    with _about("graph"):
        graph, world = load_graph(settings.graph, world)
        grounded = checked(graph, world.model())
    if settings.starts:
        with _about("starts"):
            grounded = beginning_where(grounded, settings.starts)
            if settings.learner not in FLAT:  # the others have no use for a task that is never called
                checked(graph, grounded.model)
    if settings.abstraction == "full":
        grounded = _unabstracted(grounded)
    if settings.dropped:
        grounded = _without(grounded, settings.dropped)
    if settings.pseudo_reward == "none":
        untaught = tuple(replace(node, pseudo_reward=None) for node in grounded.nodes)
        grounded = replace(grounded, nodes=untaught)
    return grounded


@lru_cache(maxsize=64)
def refuse_wrong(settings: LearnSettings) -> None:
    """Refuse settings whose graph or world cannot be had, or has not got what they name.

    Files are not looked for: where they lie is known only when a run begins.

    Raises
    ------
    UserError
        The message begins with the wrong setting's name.

    Examples
    --------
    >>> refuse_wrong(LearnSettings("two_rooms", abstraction="drop gaol"))
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: abstraction: there is no state variable 'gaol'; did you mean 'goal'?
    """
    if not settings.graph_is_a_file and not settings.world_is_a_file:
        problem(settings)


def layout_of(settings: LearnSettings, grounded: GroundGraph) -> Layout | None:
    """Return the maze that is learnt in; None if the world is no maze that a text describes."""
    if settings.world_is_a_file:
        return load_layout(settings.world)
    named = settings.world or load_graph(settings.graph).world.name
    if named != "two_rooms":
        return None
    layout = load_layout(named)
    return layout if grounded.model.index.names == ("robot", "trigger", "goal", "doors") else None


@contextmanager
def _about(setting: str) -> Iterator[None]:
    """Let errors begin with a setting's name."""
    try:
        yield
    except UserError as error:
        raise UserError(f"{setting}: {error}") from error


def stored_values(grounded: GroundGraph, learner: str) -> int | None:
    """Return how many values a learner's tables need; None for a learner without tables.

    They are counted as in Dietterich (2000), section 5.1.6: values that are read in some state that can
    occur, without those that are 0 for certain.

    Parameters
    ----------
    grounded
        What it learns on.
    learner
        Its name.

    Examples
    --------
    >>> taxi = problem(LearnSettings("taxi"))
    >>> stored_values(taxi, "maxq-0"), stored_values(taxi, "flat-q")
    (632, 3000)
    """
    if learner == "flat-q":
        return table_sizes(grounded).flat
    reachable = grounded.model.reachable()
    if learner == "hsmq":
        tasks, index = grounded.graph.tasks, grounded.model.index
        return sum(
            len(node.calls) * int(np.unique(index.project(tasks[node.task].uses)[node.live & reachable]).size)
            for node in grounded.nodes
            if node.calls
        )
    if learner not in ("maxq-0", "maxq-q"):
        return None
    sizes = table_sizes(grounded)
    completions = sum(table.needed for table in sizes.tables) * (2 if learner == "maxq-q" else 1)
    return completions + sum(sizes.leaves.values())


def _unabstracted(grounded: GroundGraph) -> GroundGraph:
    """Return the graph with all state variables relevant to every task, call and primitive action."""
    names = grounded.graph.index.names
    tasks = {
        name: replace(task, uses=names, do=tuple(replace(call, relevant=None) for call in task.do))
        for name, task in grounded.graph.tasks.items()
    }
    graph = TaskGraph(grounded.graph.name, grounded.graph.index.variables, grounded.graph.actions)
    graph.tasks.update(tasks)
    again = ground(graph, grounded.model)
    states = grounded.model.index.size
    leaf = Leaf(np.arange(states, dtype=np.int64), states)
    nodes = tuple(node if node.leaf is None else replace(node, leaf=leaf) for node in again.nodes)
    return replace(again, nodes=nodes)


def _without(grounded: GroundGraph, dropped: tuple[str, ...]) -> GroundGraph:
    """Return the graph with completions stored without some variables; its declaration stays as it is.

    Raises
    ------
    UserError
        If a variable is unknown, or nothing is stored by it as it is.
    """
    index = grounded.model.index
    used = {name for node in grounded.nodes for call in node.calls for name in call.relevant}
    for name in dropped:
        if name not in index.names:
            raise UserError(f"abstraction: there is no state variable {name!r}; {suggest(name, index.names)}")
        if name not in used:
            raise UserError(
                f"abstraction: no completion is stored by {name}; "
                f"there is nothing to drop but {', '.join(sorted(used))}"
            )

    def stored(call: GroundCall) -> GroundCall:
        relevant = tuple(name for name in call.relevant if name not in dropped)
        rows = prod(len(index.variable(name)) for name in relevant)
        return replace(call, relevant=relevant, projection=index.project(relevant), rows=rows)

    return replace(
        grounded,
        nodes=tuple(replace(node, calls=tuple(map(stored, node.calls))) for node in grounded.nodes),
    )
