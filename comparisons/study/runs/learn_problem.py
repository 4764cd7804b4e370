"""What a run of learning is on: a ground graph as declared, or with something taken away on purpose."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from math import prod
from posixpath import dirname, join, normpath
from types import MappingProxyType

import numpy as np

from comparisons.study.kinds import ReadText
from comparisons.study.runs.learn_settings import FLAT, LearnSettings, files, split
from comparisons.study.spec import Value
from hierarchy import GroundGraph, TaskGraph, ground
from hierarchy.abstraction_counts import table_sizes
from hierarchy.check import checked
from hierarchy.grounding import GroundCall, Leaf
from hierarchy.starts import beginning_where
from hierarchy.text import LoadedGraph, TextWorld, load_graph, load_world, maze_world, parse_graph
from hierarchy.text_nodes import read_yaml
from hierarchy.text_worlds import MAZE_SUFFIX
from worlds import Layout, UserError, load_layout, parse_layout, suggest


def problem(settings: LearnSettings, texts: Mapping[str, str] = MappingProxyType({})) -> GroundGraph:
    """Return the ground graph to learn on.

    The graph is checked as it is declared; what is then taken away from it may be unsafe.

    Parameters
    ----------
    settings
        What is asked for.
    texts
        Texts of files that it names. Others are read.

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
        world = _world(settings.world, texts) if settings.world else None
    with _about("graph"):
        graph, world = _graph(settings.graph, texts, world)
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
    return grounded if settings.pseudo_reward == "declared" else _untaught(grounded)


def _world(name: str, texts: Mapping[str, str]) -> TextWorld:
    return _maze(texts[name], name) if name in texts else load_world(name)


@lru_cache(maxsize=64)
def _maze(text: str, name: str) -> TextWorld:
    return maze_world(parse_layout(text, name), name)


def _graph(name: str, texts: Mapping[str, str], world: TextWorld | None) -> LoadedGraph:
    return parse_graph(texts[name], name, world) if name in texts else load_graph(name, world)


def settle(settings: Mapping[str, Value], read: ReadText) -> dict[str, Value]:
    """Return complete settings with the maze that a task graph's own file names as their world.

    Raises
    ------
    UserError
        If the files have not got what the settings name; the message begins with the setting's name.

    Examples
    --------
    >>> from comparisons.study.runs.learn_settings import settings_of
    >>> texts = {"mine/graph.yaml": "world: house.maze", "mine/house.maze": "name house"}
    >>> settle(settings_of({"graph": "mine/graph.yaml"}), texts.__getitem__)
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: graph: mine/graph.yaml names the world house.maze: mine/house.maze: ...
    """
    named = files(settings)
    if not named:
        return dict(settings)
    graph, world = str(settings["graph"]), str(settings["world"])
    texts = {name: read(name) for name in (str(settings[setting]) for setting in named)}
    if not world and (maze := _maze_of(texts[graph])):
        world = normpath(join(dirname(graph), maze))
        with _about(f"graph: {graph} names the world {maze}"):
            texts[world] = read(world)
            _maze(texts[world], world)  # what is wrong with it is told here
    settled = {**settings, "world": world}
    refuse_wrong(settled, tuple(texts.items()))
    return settled


@lru_cache(maxsize=64)
def _maze_of(graph: str) -> str:
    """Return the name of the maze's file that a task graph's text names; "" if it names none."""
    try:
        data = read_yaml(graph, "").data
    except UserError:  # which is told when the graph is read for its world
        return ""
    named = data.get("world") if isinstance(data, dict) else None
    return named if isinstance(named, str) and named.endswith(MAZE_SUFFIX) else ""


def refuse_wrong(settings: Mapping[str, Value], texts: tuple[tuple[str, str], ...] = ()) -> None:
    """Refuse settings whose graph or world cannot be had, or has not got what they name.

    Parameters
    ----------
    settings
        Complete ones.
    texts
        Names and texts of the files among them.

    Raises
    ------
    UserError
        The message begins with the wrong setting's name.

    Examples
    --------
    >>> from comparisons.study.runs.learn_settings import settings_of
    >>> refuse_wrong(settings_of({"graph": "two_rooms", "abstraction": "drop gaol"}))
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: abstraction: there is no state variable 'gaol'; did you mean 'goal'?
    """
    # Only what the graph and the world hang on: most combinations of a study have that in common.
    names = ("graph", "world", "starts", "learner", "abstraction", "pseudo_reward")
    error = _wrong(split({name: settings[name] for name in names}), texts)
    if error is not None:
        raise UserError(str(error)) from error


@lru_cache(maxsize=64)
def _wrong(settings: LearnSettings, texts: tuple[tuple[str, str], ...]) -> UserError | None:
    """Return what is wrong, rather than raise it, so that it is found once for all combinations."""
    try:
        problem(settings, dict(texts))
    except UserError as error:
        return error
    return None


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


def _untaught(grounded: GroundGraph) -> GroundGraph:
    """Return the graph without pseudo-rewards."""
    if not any(node.pseudo_reward for node in grounded.nodes):
        name = grounded.graph.name
        raise UserError(f"pseudo_reward: task graph {name} has none; there is nothing to leave out")
    return replace(grounded, nodes=tuple(replace(node, pseudo_reward=None) for node in grounded.nodes))
