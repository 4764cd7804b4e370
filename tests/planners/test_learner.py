"""What holds for every learner: MAXQ-0, MAXQ-Q, HSMQ and flat Q-learning."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from learning_worlds import corridor, exact, legs, two_exits

from hierarchy import TaskGraph, ground, two_rooms
from planners import (
    HSMQ,
    Boltzmann,
    EpisodeTooLongError,
    Exploration,
    FlatQ,
    HarmonicRate,
    Learner,
    LearningRate,
    MaxQ,
    MaxQQ,
    Settings,
)
from worlds import UserError, load_layout, maze_model

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


def test_each_task_may_have_schedules_of_its_own() -> None:
    """A ground task's own come before its task's, and the default is for the rest."""
    grounded = legs(7, 2, 4)
    fast, slow = LearningRate(1.0, 1.0), LearningRate(0.5, 1.0)
    settings = Settings(rate=slow, rates={"Leg1": fast}, explorations={"Root": Boltzmann()})
    learner = MaxQ(grounded, (0,), settings)
    learner.reward[0][0] = -1.0
    learner.train(grounded.root, [0], episodes=1)
    # From V(right) = -1 the cells before the last of a leg have learnt V(leg, s') = -1, in full or by half.
    assert learner.completion[grounded.place("Leg0")][0][:3] == [-0.5, 0.0, 0.0]
    assert learner.completion[grounded.place("Leg1")][0][2:5] == [-1.0, 0.0, 0.0]
    assert hash(settings) == hash(Settings(rate=slow))
    with pytest.raises(UserError, match="settings name 'Leg3', which is no task of legs; did you mean 'Leg"):
        MaxQ(grounded, (0,), Settings(rates={"Leg3": fast}))


def test_a_ground_task_s_own_schedule_comes_before_its_task_s() -> None:
    """One door's rate, the rate of the other doors, and the default for the rest."""
    layout = load_layout("two_rooms")
    grounded = ground(two_rooms(layout), maze_model(layout))
    one, doors = LearningRate(0.25, 1.0), LearningRate(0.5, 1.0)
    settings = Settings(LearningRate(1.0, 1.0), rates={"GotoDoor": doors, "GotoDoor(D2)": one})
    learner = MaxQ(grounded, (0,), settings)
    names = "GotoDoor(D1)", "GotoDoor(D2)", "GotoTrigger(T4)"
    assert [learner._rates[grounded.place(name)](0) for name in names] == [0.5, 0.25, 1.0]


def test_each_task_explores_by_its_own_schedule() -> None:
    """Out walks at random for ever and Back is greedy: the share of needless steps tells them apart."""
    grounded = two_exits()
    settings = Settings(
        exploration=Exploration(half=1), explorations={"Out": Exploration(half=10**9)}, rate=LearningRate()
    )
    learner = MaxQ(grounded, (4,), settings)
    learner.train(grounded.place("Out"), [2], episodes=300)
    out = learner.train(grounded.place("Out"), [2], episodes=400)
    learner.train(grounded.place("Back"), [0], episodes=300)
    back = learner.train(grounded.place("Back"), [0], episodes=400)
    assert np.mean(out) == pytest.approx(2 * 3, abs=0.5), "a random walk from 2 to 0 or 5 takes 2 x 3 steps"
    assert np.mean(back) == pytest.approx(3.0, abs=0.1)


def test_all_states_are_a_child_s_primitive_steps_in_one_flat_sequence() -> None:
    """Three levels: the root learns at each of the four states that Trip's two legs pass, N = 4, 3, 2, 1.

    C(Root, x, Trip) = gamma**N V(Root, 4). Nested sequences would count two steps, one for each leg.
    """
    model = corridor(6, "right")
    graph = TaskGraph("trip", model.index.variables, model.actions)
    (x,) = graph.variables
    one = graph.task("One", until=x.eq(2), within=x.isin([0, 1]), uses=[x], do="right")
    two = graph.task("Two", until=x.eq(4), within=x.isin([2, 3]), uses=[x], do="right")
    trip = graph.task("Trip", until=x.eq(4), within=x.isin(range(4)), uses=[x], do=[one(), two()])
    graph.task("Root", until=x.eq(5), uses=[x], do=[trip(), "right"])
    grounded = ground(graph, model)
    settings = Settings(rate=LearningRate(1.0, 1.0), gamma=0.5, all_states=True)
    learner = MaxQ(grounded, (0,), settings)
    learner.train(grounded.root, [4], episodes=1)
    # An episode of Trip called by the root, without exploration by the root.
    trace, after = learner._run(grounded.place("Trip"), 0)
    assert trace == [(0, -1.0), (1, -1.0), (2, -1.0), (3, -1.0)]
    assert after == 4
    learner._learn(grounded.root, 0, trace, after, 1.0)
    assert [learner.c(grounded.root, at, 0) for at in range(4)] == [-1 / 16, -1 / 8, -1 / 4, -1 / 2]


@pytest.mark.parametrize("kind", [MaxQ, MaxQQ])
def test_learning_at_all_states_takes_fewer_episodes_and_ends_the_same(kind: type[MaxQ]) -> None:
    """In a corridor of 24 whose legs are known, the root learns V(Root, x) = x - 23 for every cell.

    Learning at each child's first state it has to start in every cell; learning at all states, in cell 0.
    Ten seeds together.
    """

    def episodes(seed: int, starts: list[int], *, all_states: bool) -> int:
        grounded = legs(24, 8, 16)
        settings = Settings(rate=LearningRate(1.0, 1.0), all_states=all_states)
        learner = kind(grounded, (seed,), settings)
        for leg, begin in (("Leg0", 0), ("Leg1", 8), ("Leg2", 16)):
            learner.train(grounded.place(leg), [begin], episodes=10)
        for count in range(1, 500):
            learner.train(grounded.root, starts, episodes=1)
            if all(learner.value(grounded.root, x) == x - 23 for x in range(24)):
                return count
        return 500

    assert episodes(0, [0], all_states=True) == 2, "Leg1 before Leg0"
    assert episodes(0, [0], all_states=False) == 500
    anywhere = list(range(23))
    few = sum(episodes(seed, anywhere, all_states=True) for seed in range(10))
    many = sum(episodes(seed, anywhere, all_states=False) for seed in range(10))
    assert 2 * few < many < 10 * 500


def test_a_state_where_the_child_may_not_be_called_is_passed_over() -> None:
    """Out is called from 3 alone; on its way through 2 and 1 the root learns nothing of calling it there."""
    model = corridor(5)
    graph = TaskGraph("guarded", model.index.variables, model.actions)
    (x,) = graph.variables
    out = graph.task("Out", until=x.eq(1), uses=[x], do="left")
    graph.task("Root", until=x.eq(0), uses=[x], do=[out().when(x.isin([4, 2])), "left"])
    grounded = ground(graph, model)
    learner = MaxQ(grounded, (0,), Settings(rate=LearningRate(1.0, 1.0), all_states=True))
    learner.reward[0] = [-1.0]
    learner._learn(grounded.root, 0, [(4, -1.0), (3, -1.0), (2, -1.0)], 1, 1.0)
    assert learner.completion[grounded.root][0] == [0.0, 0.0, -1.0, 0.0, -1.0]
