"""Learning at all states that a child passes through."""

import numpy as np
import pytest
from learning_worlds import corridor, legs

from hierarchy import Call, TaskGraph, ground
from planners import (
    HSMQ,
    Exploration,
    HarmonicRate,
    Learner,
    LearningRate,
    MaxQ,
    MaxQQ,
    Settings,
    recursive_optimum,
)
from planners.learner import Step
from worlds import StateIndex, TransitionModel, Variable


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
    assert [step.state for step in trace] == [0, 1, 2, 3]
    assert after == 4
    learner._learn(grounded.root, 0, trace, after, 1.0)
    assert [learner.c(grounded.root, at, 0) for at in range(4)] == [-1 / 16, -1 / 8, -1 / 4, -1 / 2]


@pytest.mark.parametrize("kind", [MaxQ, MaxQQ, HSMQ])
def test_a_way_that_its_child_would_not_go_again_teaches_nothing(kind: type[Learner]) -> None:
    """One goes from 0 by 1 to 2 and cannot stop; begun at 1, Mid would take the jump there, for 10.

    The root, learning at all states, must not take One's way through 1 for Mid's: it would then expect of
    Mid at 1 something between the 10 of the jump and the -2 of two more steps.
    """
    index, starts = StateIndex((Variable("x", (0, 1, 2, 3)),)), np.array([True, True, False, False])
    successors = np.array([[1, 0], [2, 3], [3, 3], [3, 3]])
    rewards = np.array([[-1.0, -1.0], [-1.0, 10.0], [-1.0, -1.0], [0.0, 0.0]])
    model = TransitionModel(index, ("walk", "jump"), successors, rewards, starts)
    graph = TaskGraph("no stop", index.variables, model.actions)
    (x,) = graph.variables
    one = graph.task("One", until=x.isin([2, 3]), uses=[x], do="walk")
    mid = graph.task("Mid", until=x.isin([2, 3]), uses=[x], do=[one(), "jump"])
    graph.task("Root", until=x.eq(3), uses=[x], do=[mid(), Call("walk", guard=x.eq(2))])
    grounded = ground(graph, model)
    assert recursive_optimum(grounded).value[grounded.root, :2].tolist() == [-3, 10]
    for all_states in (False, True):
        settings = Settings(
            rate=HarmonicRate(20),
            exploration=Exploration(10),
            explorations={"Mid": Exploration(1)},
            all_states=all_states,
        )
        learner = kind(grounded, (1,), settings)
        learner.train(grounded.root, [0, 1], episodes=1500)
        assert [learner.q(grounded.root, at, 0) for at in (0, 1)] == pytest.approx([-3, 10], abs=0.2)


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
    learner._learn(grounded.root, 0, [Step(4, -1.0), Step(3, -1.0), Step(2, -1.0)], 1, 1.0)
    assert learner.completion[grounded.root][0] == [0.0, 0.0, -1.0, 0.0, -1.0]
