"""The conformance kit: put a world, a task graph, a learner or a perception backend of your own through ours.

Each function raises `ConformanceError` with what is wrong, and returns None where all is well, so that a
test of yours takes three lines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from comparisons.conformance_backend import check_backend
from comparisons.conformance_env import check_box
from comparisons.conformance_parts import ConformanceError, hold, sample
from hierarchy import Constant, GroundGraph, Predicate, TaskGraph, checked, prove_abstraction, two_rooms
from hierarchy.check import examine
from planners import task_field
from worlds import Layout, TransitionModel, maze_model, parse_layout
from worlds.black_box import BlackBox

__all__ = ["ConformanceError", "check_backend", "check_graph", "check_learner", "check_world"]

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


class Learner(Protocol):
    """What a learner must offer."""

    def train(self, task: int, starts: Sequence[int], episodes: int) -> Any:
        """Run episodes of a task from random starts."""

    def value(self, task: int, state: int) -> float:
        """Return the learnt value of a task in a state."""

    def greedy_steps(self, task: int, state: int) -> int | None:
        """Return the primitive steps of the learnt policy, or None if it does not arrive."""


def check_world(model: TransitionModel, box: BlackBox | None = None) -> None:
    """Check a world's model, and the environment that it is the model of.

    There is a state to start in; in every state every action's probabilities sum to 1, and lead to states;
    rewards are finite wherever an episode can come; numbering states is one to one. With an environment,
    Gymnasium's own checker accepts it, the same seed and actions give the same episode, and every step is
    one that the model allows, about as often as it says.

    Parameters
    ----------
    model
        The model.
    box
        The environment, if there is one, with how its observations are read.

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
    for number in sample(index.size):
        state = index.state(number)
        hold(index.number(state) == number, f"state {number} is numbered {index.number(state)} again")
    hold(len(set(model.actions)) == len(model.actions), "two actions share a name")
    _sound(model)
    hold(bool(model.starts.any()), "no state is a start; mark at least one in `starts`")
    finite = np.isfinite(model.outcome_rewards) | (model.probabilities == 0)
    _nowhere(model, model.reachable()[:, None] & ~finite.all(axis=2), "the reward is not finite")
    if box is not None:
        check_box(model, box)


def _sound(model: TransitionModel) -> None:
    """Refuse arrays that were changed after the model looked at them, or that a model of one's own gives."""
    chances, after = model.probabilities, model.outcomes
    totals = chances.sum(axis=2)
    wrong = ~np.isclose(totals, 1.0, atol=1e-9)
    _nowhere(model, wrong, "the probabilities do not sum to 1 but to {:.10g}", totals)
    _nowhere(model, np.any(chances < 0, axis=2), "a probability is negative")
    _nowhere(model, np.any((after < 0) | (after >= model.index.size), axis=2), "the next state is no state")


def _nowhere(
    model: TransitionModel,
    wrong: NDArray[np.bool_],
    problem: str,
    numbers: NDArray[np.float64] | None = None,
) -> None:
    """Refuse a fault, given as a mask over states and actions, at the first place that has it."""
    if wrong.any():
        state, action = (int(each) for each in np.argwhere(wrong)[0])
        said = problem if numbers is None else problem.format(numbers[state, action])
        raise ConformanceError(f"{said} in {model.index.words(state)}, action {model.actions[action]}")


def check_graph(graph: TaskGraph, model: TransitionModel, *, safe: bool = False) -> None:
    """Check a task graph on a world: it passes `hierarchy.check`, and its masks mean what its predicates say.

    Parameters
    ----------
    graph
        The task graph.
    model
        The world.
    safe
        Whether its state abstraction must be proved, too, for every policy and without discounting.

    Raises
    ------
    ConformanceError
        If not; the message names the task.

    Examples
    --------
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> check_graph(two_rooms(maze), maze_model(maze), safe=True)
    """
    hold(graph.index == model.index, "the graph and the world have different state variables")
    hold(graph.actions == model.actions, "the graph and the world have different actions, or another order")
    findings, grounded = examine(graph, model)
    hold(not findings, "; ".join(map(str, findings)))
    assert grounded is not None, "a graph without findings is grounded"
    for node in grounded.nodes:
        if node.leaf is None:
            task, binding = graph.tasks[node.task], dict(node.binding)
            said = {"until": task.until, "goal": task.goal, "within": task.within, "start": task.start}
            said |= {f"guard of {call}": call.guard for call in task.do}
            for key, predicate in said.items():
                _meant(model, f"{node.name}: its {key}", predicate, binding)
    if safe and (refused := next(prove_abstraction(grounded).unsafe(), None)):
        raise ConformanceError(str(refused).splitlines()[0])


def _meant(model: TransitionModel, what: str, predicate: Predicate, binding: dict[str, Constant]) -> None:
    """Refuse a predicate whose mask over all states differs from what it says of a state."""
    mask = predicate.bind(binding).mask(model.index)
    bound = {name: constant.value for name, constant in binding.items()}
    for number in sample(model.index.size):
        values = dict(zip(model.index.names, model.index.state(number), strict=True)) | bound
        hold(
            bool(mask[number]) == predicate.holds(values),
            f"{what} ({predicate}) and its mask differ in {model.index.words(number)}",
        )


def check_learner(make: Callable[[GroundGraph, tuple[int, ...]], Learner], episodes: int = 1500) -> None:
    """Check a learner on a small maze whose values are known.

    The same seed gives the same values bit for bit, whatever was learnt before, and another seed others;
    asking for values and greedy steps changes nothing of what is learnt after it; after `episodes` from every
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

    def values(learner: Learner) -> list[float]:
        return [learner.value(place, state) for state in states]

    _honours_seeds([values(learnt(seed, 20)) for seed in (1, 1, 2, 3, 1)])
    _only_looks(learnt(1, 20), learnt(1, 20), place, states)
    learner = make(grounded, (2,))
    fresh = values(learner)
    learner.train(place, states, episodes)
    hold(values(learner) != fresh, f"{episodes} episodes changed no value; let train learn")
    for state in states:
        steps, best = learner.greedy_steps(place, state), int(distance[state])
        where = grounded.model.index.words(state)
        hold(
            steps == best,
            f"after {episodes} episodes its policy takes {steps} steps, not {best}, from {where}",
        )
        value = learner.value(place, state)
        hold(
            abs(value + best) < 0.1,
            f"after {episodes} episodes it values {where} at {value:.3f}, not {-best}",
        )


def _honours_seeds(values: Sequence[list[float]]) -> None:
    """Refuse values of the seeds 1, 1, 2, 3 and 1 that differ where they should not, or do not at all."""
    first, again, *others, last = values
    mend = "draw every random number from the seed"
    hold(first == again, f"the same seed gave different values; {mend}, and keep nothing between learners")
    hold(
        first == last,
        "the same seed gave different values once others had learnt; keep nothing between learners",
    )
    alike = all(first == other for other in others)
    hold(not alike, f"three seeds gave the same values; {mend}, starts and exploration included")


def _only_looks(asked: Learner, unasked: Learner, place: int, states: Sequence[int]) -> None:
    """Refuse a learner that learns otherwise for having been asked in between."""
    for state in states:
        asked.greedy_steps(place, state)
    for learner in (asked, unasked):
        learner.train(place, states, 20)
    for state in states:
        hold(
            asked.value(place, state) == unasked.value(place, state),
            "asking for greedy steps changes what is learnt; let them neither learn nor draw from its stream",
        )


def conformance_maze() -> Layout:
    """Return the small maze that learners are checked on.

    >>> conformance_maze().rows
    3
    """
    return parse_layout(_MAZE, source="conformance.maze")
