"""The conformance kit: put a world, a task graph, a learner or a perception backend of your own through ours.

Each function raises `ConformanceError` with what is wrong, and returns None where all is well, so that a
test of yours takes three lines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from hierarchy import GroundGraph, TaskGraph, checked, two_rooms
from hierarchy.check import examine
from perception.protocol import LABELS, Backend, Detection, View
from planners import task_field
from worlds import Layout, Stream, TransitionModel, maze_model, parse_layout

_SAMPLED = 200  # states in which predicates are evaluated one by one
_MAZE = """
name conformance
grid
.  T1 .  |  .  .
.  .  .  :  D1 G1
.  X  .  |  .  .
start 2,0
trigger T1
goal G1
"""


class ConformanceError(AssertionError):
    """Something does not keep the promises that the rest of affordant relies on."""


class Learner(Protocol):
    """What a learner must offer."""

    def train(self, task: int, starts: Sequence[int], episodes: int) -> Any:
        """Run episodes of a task from random starts."""

    def value(self, task: int, state: int) -> float:
        """Return the learnt value of a task in a state."""

    def greedy_steps(self, task: int, state: int) -> int | None:
        """Return the primitive steps of the learnt policy, or None if it does not arrive."""


def check_world(model: TransitionModel) -> None:
    """Check a world's model.

    There is a state to start in; from every state that can be reached every action leads somewhere with
    finite rewards; numbering states is one to one.

    Raises
    ------
    ConformanceError
        If not; the message names a state.

    Examples
    --------
    >>> from worlds import load_layout, maze_model
    >>> check_world(maze_model(load_layout("two_rooms")))
    """
    index = model.index
    _hold(bool(model.starts.any()), "no state is a start; mark at least one in `starts`")
    for number in _sample(index.size):
        state = index.state(number)
        _hold(index.number(state) == number, f"state {number} is numbered {index.number(state)} again")
    reachable = model.reachable()
    finite = np.isfinite(model.outcome_rewards).all(axis=(1, 2))
    bad = np.flatnonzero(reachable & ~finite)
    if bad.size:
        raise ConformanceError(f"an action's reward is not finite in {_state(model, int(bad[0]))}")
    _hold(len(set(model.actions)) == len(model.actions), "two actions share a name")


def check_graph(graph: TaskGraph, model: TransitionModel) -> None:
    """Check a task graph on a world: it passes `hierarchy.check`, and its masks mean what its predicates say.

    Raises
    ------
    ConformanceError
        If not; the message names the task.

    Examples
    --------
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> check_graph(two_rooms(maze), maze_model(maze))
    """
    _hold(graph.index == model.index, "the graph and the world have different state variables")
    _hold(graph.actions == model.actions, "the graph and the world have different actions, or another order")
    findings, grounded = examine(graph, model)
    _hold(not findings, "; ".join(map(str, findings)))
    assert grounded is not None, "a graph without findings is grounded"
    for node in grounded.nodes:
        if node.leaf is None:
            task, binding = graph.tasks[node.task], {name: c.value for name, c in node.binding}
            for number in _sample(model.index.size):
                values = dict(zip(model.index.names, model.index.state(number), strict=True)) | binding
                said = task.until.holds(values)
                _hold(
                    bool(node.terminal[number]) == said,
                    f"{node.name}: its mask and its until ({task.until}) differ in {_state(model, number)}",
                )


def check_learner(make: Callable[[GroundGraph, tuple[int, ...]], Learner], episodes: int = 1500) -> None:
    """Check a learner on a small maze whose values are known.

    The same seed gives the same values bit for bit, another seed may not; after `episodes` from every
    state in which GotoGoal runs, its greedy steps are the fewest, and its values their negative within 0.1.

    Parameters
    ----------
    make
        Makes a learner of a ground graph and a seed, such as the class `planners.MaxQ` itself.
    episodes
        How long to learn; raise it for a slow learner.

    Raises
    ------
    ConformanceError
        If not; the message names the state and both numbers.

    Examples
    --------
    >>> from planners import MaxQ
    >>> check_learner(MaxQ)
    """
    layout = conformance_maze()
    grounded = checked(two_rooms(layout), maze_model(layout))
    place = grounded.place("GotoGoal(G1)")
    distance = task_field(grounded.model, grounded.nodes[place]).distance
    states = np.flatnonzero((distance > 0) & grounded.model.reachable()).tolist()

    def learnt(seed: int, length: int) -> Learner:
        learner = make(grounded, (seed,))
        learner.train(place, states, length)
        return learner

    twice = [[learnt(1, 20).value(place, state) for state in states] for _ in range(2)]
    _hold(twice[0] == twice[1], "the same seed gave different values; draw every random number from the seed")
    learner = learnt(2, episodes)
    for state in states:
        steps, best = learner.greedy_steps(place, state), int(distance[state])
        where = _state(grounded.model, state)
        _hold(
            steps == best,
            f"after {episodes} episodes its policy takes {steps} steps, not {best}, from {where}",
        )
        value = learner.value(place, state)
        _hold(
            abs(value + best) < 0.1,
            f"after {episodes} episodes it values {where} at {value:.3f}, not {-best}",
        )


def check_backend(backend: Backend, views: Sequence[View]) -> None:
    """Check a perception backend on some views of the kind that it is made for.

    It gives one sound detection a view, in order; the same view the same detection, alone or in a batch;
    and it does not change the frames.

    Raises
    ------
    ConformanceError
        If not; the message names the view.

    Examples
    --------
    >>> from perception import NOTHING, Truth
    >>> check_backend(Truth(), [View(None, NOTHING), View(None, Detection("cube", 1.0, 2))])
    """
    frames = [None if view.frame is None else view.frame.copy() for view in views]
    batch = backend.detect(views)
    _hold(len(batch) == len(views), f"{len(views)} views got {len(batch)} detections")
    for i, (view, frame, found) in enumerate(zip(views, frames, batch, strict=True)):
        _hold(isinstance(found, Detection) and found.label in LABELS, f"view {i} got {found!r}, no detection")
        _hold(backend.detect([view]) == [found], f"view {i} got another detection alone than in the batch")
        if frame is not None and view.frame is not None:
            _hold(bool((frame == view.frame).all()), f"the frame of view {i} was changed")
    _hold(backend.detect([]) == [], "no views must give no detections")


def conformance_maze() -> Layout:
    """Return the small maze that learners are checked on.

    >>> conformance_maze().rows
    3
    """
    return parse_layout(_MAZE, source="conformance.maze")


def _hold(condition: bool, problem: str) -> None:
    if not condition:
        raise ConformanceError(problem)


def _sample(size: int) -> list[int]:
    """Return all states of a small world, some of a large one, always the same."""
    if size <= _SAMPLED:
        return list(range(size))
    stream = Stream(size)
    return [stream.below(size) for _ in range(_SAMPLED)]


def _state(model: TransitionModel, number: int) -> str:
    state = zip(model.index.variables, model.index.state(number), strict=True)
    return ", ".join(f"{variable.name} = {variable.label(value)}" for variable, value in state)
