"""What holds for every learner: MAXQ-0, MAXQ-Q, HSMQ and flat Q-learning."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from learning_worlds import corridor, exact, legs, two_exits

from hierarchy import TaskGraph, ground
from planners import (
    HSMQ,
    Boltzmann,
    EpisodeTooLongError,
    Exploration,
    FlatQ,
    HarmonicRate,
    Learner,
    MaxQ,
    MaxQQ,
    Settings,
)
from planners.learner import Step
from worlds import UserError

LEARNERS: list[type[Learner]] = [MaxQ, MaxQQ, HSMQ, FlatQ]
every_learner = pytest.mark.parametrize("kind", LEARNERS)


def _tables(learner: Learner) -> dict[str, Any]:
    """Return everything that a learner has stored."""
    names = "completion", "inner_completion", "reward", "table", "episodes", "steps"
    return {name: getattr(learner, name) for name in names if hasattr(learner, name)}


@every_learner
@pytest.mark.parametrize("gamma", [1.0, 0.9])
def test_values_become_exact_on_a_world_with_chance(kind: type[Learner], gamma: float) -> None:
    """Every task's value is dynamic programming's, within 0.3 of up to 15."""
    grounded = two_exits(slip=0.1, pseudo_reward=-12.0)
    settings = Settings(rate=HarmonicRate(20), exploration=Exploration(10), gamma=gamma)
    learner = kind(grounded, (1,), settings)
    learner.train(learner.grounded.root, range(5), episodes=10_000)
    # MAXQ-0 knows no pseudo-rewards; HSMQ's values hold the task's own; MAXQ-Q's hold real rewards alone.
    solution = exact(learner.grounded, gamma, pseudo_rewards=kind is not MaxQ)
    expected = solution.inner if kind is HSMQ else solution.values
    for place, node in enumerate(learner.grounded.nodes):
        if node.calls:
            found = [learner.value(place, int(state)) for state in np.flatnonzero(node.initiation)]
            assert found == pytest.approx(expected[place, node.initiation].tolist(), abs=0.3), node.name
            assert not any(learner.value(place, int(state)) for state in np.flatnonzero(node.terminal))


@every_learner
@pytest.mark.parametrize("all_states", [False, True])
@pytest.mark.parametrize("boltzmann", [False, True])
def test_values_become_exact_on_a_deterministic_world(
    kind: type[Learner], boltzmann: bool, all_states: bool
) -> None:
    """The root's values, however it explores and however many states it learns at.

    What a child still explores is noise to its caller, so the children's exploration falls sooner.
    """
    settings = Settings(
        exploration=Exploration(10), explorations={} if kind is FlatQ else {"Out": Exploration(1)}
    )
    if boltzmann:
        settings = Settings(exploration=Boltzmann(start=20, factor=0.98))
    learner = kind(two_exits(), (2,), replace(settings, rate=HarmonicRate(30), all_states=all_states))
    root = learner.grounded.root
    learner.train(root, range(5), episodes=1500)
    solution = exact(learner.grounded, pseudo_rewards=kind is not MaxQ)
    expected = solution.values[root].tolist()
    assert [learner.value(root, x) for x in range(6)] == pytest.approx(expected, abs=0.1)


@every_learner
def test_one_seed_gives_one_set_of_tables(kind: type[Learner]) -> None:
    """Bit for bit, chance included; every part of the seed counts."""

    def learnt(*seed: int) -> dict[str, Any]:
        learner = kind(two_exits(slip=0.2), seed, Settings(all_states=True))
        learner.train(learner.grounded.root, [1, 2, 3], episodes=25)
        return _tables(learner)

    assert learnt(3, 1) == learnt(3, 1)
    assert learnt(3, 1) != learnt(3, 2)
    assert learnt(3, 1) != learnt(4, 1)


@every_learner
def test_measuring_changes_nothing_that_is_learnt(kind: type[Learner]) -> None:
    """Greedy ways draw their own chance: with and without a measurement the tables are the same."""

    def learnt(measure: Callable[[Learner], Callable[[], None] | None]) -> dict[str, Any]:
        learner = kind(two_exits(slip=0.2), (7,))
        learner.train(learner.grounded.root, [1, 3], 30, measure(learner))
        return _tables(learner)

    drawn = []

    def measuring(learner: Learner) -> Callable[[], None]:
        return lambda: drawn.append(learner.greedy_steps(learner.grounded.root, 2, limit=50))

    assert learnt(measuring) == learnt(lambda _: None)
    assert len(set(drawn)) > 1


@every_learner
def test_ties_go_to_the_first_child(kind: type[Learner]) -> None:
    """Before anything is learnt, all values are 0, and the first child in order is taken."""
    learner = kind(two_exits(), (0,))
    task = next(place for place, node in enumerate(learner.grounded.nodes) if len(node.calls) > 1)
    assert learner.choices(task, 3) == (0, 1)
    assert learner.greedy(task, 3) == 0


@every_learner
def test_an_episode_without_end_is_an_error(kind: type[Learner]) -> None:
    """A corridor that only leads away from the end stops at `max_steps`."""
    model = corridor(4, "left")
    graph = TaskGraph("away", model.index.variables, model.actions)
    (x,) = graph.variables
    graph.task("Root", until=x.eq(3), uses=[x], do="left")
    learner = kind(ground(graph, model), (0,), Settings(max_steps=20))
    with pytest.raises(EpisodeTooLongError, match="no end after 20 primitive steps"):
        learner.train(learner.grounded.root, [1], episodes=1)
    assert learner.greedy_route(learner.grounded.root, 1, limit=30) is None


@every_learner
def test_a_task_with_nothing_to_do_says_where(kind: type[Learner]) -> None:
    """A state in which no child may be called is named with its values."""
    model = corridor(4, "right")
    graph = TaskGraph("gap", model.index.variables, model.actions)
    (x,) = graph.variables
    graph.task("Root", until=x.eq(3), within=x.isin([1, 2]), uses=[x], do="right")
    learner = kind(ground(graph, model), (0,))
    with pytest.raises(UserError, match=r"task Root has no child to call in state 0 \(x = 0\)"):
        learner.train(learner.grounded.root, [0], episodes=1)


@every_learner
def test_a_task_ends_where_its_step_has_led(kind: type[Learner]) -> None:
    """Its termination is asked of the state after the step: three legs of 2 take 2 steps each, not 3.

    What is learnt is told of every call: its task, where it began, how many steps it took, where it ended.
    """
    learner = kind(legs(7, 2, 4), (0,))
    nodes, told = learner.grounded.nodes, []
    learn = learner._learn

    def telling(task: int, k: int, trace: list[Step], after: int, rate: float) -> None:
        told.append((nodes[task].calls[k].child, trace[0].state, len(trace), after))
        learn(task, k, trace, after, rate)

    learner._learn = telling  # type: ignore[method-assign]
    assert learner.train(learner.grounded.root, [0], episodes=1) == [6]
    steps = [(0, at, 1, at + 1) for at in range(6)]
    assert [one for one in told if one[0] == 0] == steps
    called = [(nodes[child].name, *rest) for child, *rest in told if child > 0]
    expected = [("Leg0", 0, 2, 2), ("Leg1", 2, 2, 4), ("Leg2", 4, 2, 6)]
    assert called == ([] if kind is FlatQ else expected)


@pytest.mark.parametrize("kind", [MaxQ, MaxQQ, HSMQ])
def test_how_long_each_task_lasts_and_how_often_it_is_called(kind: type[Learner]) -> None:
    """Greedy returns alone would not show tasks that are dropped after a step, or one that lasts for ever.

    From 1 in two exits Out either goes to the goal in one call of 4 steps, or quits after 1, is followed by
    Back's 3, and is called again for 2.
    """
    learner = kind(two_exits(), (0,))
    grounded = learner.grounded
    learner.train(grounded.root, [1, 2, 3, 4], episodes=1500)
    state, calls = 1, []
    while not grounded.nodes[grounded.root].terminal[state] and len(calls) < 9:
        child = grounded.nodes[grounded.root].calls[learner.greedy(grounded.root, state)].child
        route = learner.greedy_route(child, state)
        assert route
        calls.append((grounded.nodes[child].name, len(route)))
        state = learner.follow(route[-1][1], route[-1][0])
    assert calls == ([("Out", 1), ("Back", 3), ("Out", 2)] if kind is MaxQ else [("Out", 4)])
    assert sum(steps for _, steps in calls) == learner.greedy_steps(grounded.root, 1)


@every_learner
def test_what_are_no_states_to_start_from_is_refused(kind: type[Learner]) -> None:
    """None, a number that is no state's, and a mask, with how to mend it; nothing is learnt."""
    learner = kind(two_exits(), (0,))
    grounded = learner.grounded
    with pytest.raises(UserError, match="task Root has no states to start from; give a list of them"):
        learner.train(grounded.root, [], episodes=1)
    for number in (-1, grounded.model.index.size):
        with pytest.raises(UserError, match=f"numbers from 0 to 5, and {number} is none of them"):
            learner.train(grounded.root, [1, number], episodes=1)
    with pytest.raises(UserError, match="of a mask, "):
        learner.train(grounded.root, grounded.model.starts, episodes=1)
    assert learner.steps == 0
