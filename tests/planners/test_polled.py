"""Polled execution against hierarchical execution of the same values."""

import numpy as np
import pytest
from decision_problems import models
from hypothesis import given, settings
from hypothesis import strategies as st
from learning_worlds import corridor, exact

from hierarchy import GroundGraph, TaskGraph, ground
from planners import (
    HSMQ,
    Exploration,
    FlatQ,
    HarmonicRate,
    MaxQ,
    MaxQQ,
    Settings,
    flat_optimum,
    polled_action,
    polled_route,
    polled_steps,
    recursive_optimum,
)
from worlds import StateIndex, TransitionModel, UserError, Variable


def _gusty() -> GroundGraph:
    """Return Root -> ToLeft, ToRight, one for each end of a corridor of 9, either of which ends the root.

    From 5 a step right meets a gust in half of the cases and lands in 1. ToLeft therefore steps right from
    there: either it has one step to go, or it is at 6 and must come back, unless it is given up.
    """
    index, x = StateIndex((Variable("x", tuple(range(9))),)), np.arange(9)
    moves = np.stack([np.maximum(x - 1, 0), np.minimum(x + 1, 8)], axis=1)
    successors = np.stack([moves, moves], axis=2)
    chances = np.tile([1.0, 0.0], (9, 2, 1))
    successors[5, 1, 1], chances[5, 1] = 1, (0.5, 0.5)
    rewards = np.full(successors.shape, -1.0)
    model = TransitionModel(index, ("left", "right"), successors, rewards, x == 5, probabilities=chances)
    graph = TaskGraph("gusty", index.variables, model.actions)
    (at,) = graph.variables
    to_left = graph.task("ToLeft", until=at.eq(0), uses=[at], do="left right")
    to_right = graph.task("ToRight", until=at.eq(8), uses=[at], do="left right")
    graph.task("Root", until=at.isin([0, 8]), uses=[at], do=[to_left(), to_right()])
    return ground(graph, model)


@pytest.fixture(scope="module")
def gusty() -> MaxQ:
    """Return MAXQ-0's values of the gusty corridor, learnt from everywhere."""
    learner = MaxQ(_gusty(), (1,), Settings(rate=HarmonicRate(20), exploration=Exploration(100)))
    grounded = learner.grounded
    learner.train(grounded.place("ToLeft"), range(1, 9), episodes=1500)
    learner.train(grounded.place("ToRight"), range(8), episodes=1500)
    learner.train(grounded.root, range(1, 8), episodes=1500)
    return learner


def test_polling_gives_up_a_subtask_that_has_become_the_worse_one(gusty: MaxQ) -> None:
    """At 6, without the gust, hierarchical execution goes back left with ToLeft; polled, it goes on right."""
    grounded = gusty.grounded
    root, to_left = grounded.root, grounded.place("ToLeft")
    assert grounded.nodes[root].calls[gusty.greedy(root, 5)].child == to_left
    hierarchical = [gusty.greedy_route(root, 5) or [] for _ in range(40)]
    polled = [polled_route(gusty, root, 5) or [] for _ in range(40)]
    assert {action for route in hierarchical for state, action in route if state == 6} == {0}
    assert {action for route in polled for state, action in route if state == 6} == {1}
    assert polled_action(gusty, to_left, 6) == 0, "polled from ToLeft itself, there is no other to take"


def test_polling_takes_fewer_steps(gusty: MaxQ) -> None:
    """From 5: two or three steps when polled; hierarchically four on average, as dynamic programming says."""
    root = gusty.grounded.root
    assert exact(gusty.grounded).values[root, 5] == pytest.approx(-4)
    steps = [gusty.greedy_steps(root, 5) for _ in range(400)]
    assert np.mean(np.array(steps, dtype=float)) == pytest.approx(4, abs=0.4)
    assert {polled_steps(gusty, root, 5) for _ in range(40)} == {2, 3}


def _knowing(grounded: GroundGraph, gamma: float = 1.0) -> MaxQ:
    """Return a learner that has the recursive optimum's values by heart; its rows are states."""
    solution = recursive_optimum(grounded, gamma)
    learner = MaxQ(grounded, (0,), Settings(gamma=gamma, tie=1e-9))
    for place, node in enumerate(grounded.nodes):
        if node.leaf is not None:
            for state, row in enumerate(node.leaf.projection.tolist()):
                learner.reward[place][row] = float(grounded.model.rewards[state, place])
        for k, call in enumerate(node.calls):
            ahead = np.where(node.terminal, 0.0, solution.value[place])
            learner.completion[place][k] = (solution.exits[call.child].kernel @ ahead).tolist()
    return learner


def _polled_values(learner: MaxQ) -> np.ndarray:
    """Return what polled execution is worth in each state, by value iteration for its one flat policy."""
    model, root = learner.grounded.model, learner.grounded.nodes[learner.grounded.root]
    value = np.zeros(model.index.size)
    live = np.flatnonzero(root.live)
    actions = [polled_action(learner, learner.grounded.root, int(state)) for state in live]
    for _ in range(300):
        value[live] = (model.rewards + learner.settings.gamma * model.expectation(value))[live, actions]
    return value


@st.composite
def _nested(draw: st.DrawFn) -> GroundGraph:
    """Draw Root -> Mid, Two, a; Mid -> One, b; One, Two -> a, b: where a caller ends its children end."""
    model = draw(models(least=-3, most=-1, sizes=(3, 6)))
    some = st.sets(st.integers(0, model.index.size - 1), max_size=2)
    graph = TaskGraph("nested", model.index.variables, model.actions)
    (x,) = graph.variables
    ends = {draw(st.integers(0, model.index.size - 1))}
    mids = ends | draw(some)
    one = graph.task("One", until=x.isin(sorted(mids | draw(some))), uses=[x], do="a b")
    two = graph.task("Two", until=x.isin(sorted(ends | draw(some))), uses=[x], do="b a")
    mid = graph.task("Mid", until=x.isin(sorted(mids)), uses=[x], do=[one(), "b"])
    graph.task("Root", until=x.isin(sorted(ends)), uses=[x], do=[mid(), two(), "a"])
    return ground(graph, model)


@given(_nested(), st.sampled_from([0.8, 0.5]))
@settings(max_examples=60, deadline=None)
def test_polling_exact_values_is_never_worse(grounded: GroundGraph, gamma: float) -> None:
    """On random stochastic worlds: recursive <= polled <= global, from every state."""
    polled = _polled_values(_knowing(grounded, gamma))
    recursive = recursive_optimum(grounded, gamma).value[grounded.root]
    best = flat_optimum(grounded.model, grounded.nodes[grounded.root].terminal, gamma).value
    assert (polled >= recursive - 1e-7).all()
    assert (polled <= best + 1e-7).all()


def test_polling_exact_values_of_the_gusty_corridor_by_hand() -> None:
    """From 5 recursively 4 steps; polled 1 + (1 + 2) / 2: by the gust to 1 and home, or to 6, 7 and 8."""
    grounded = _gusty()
    assert recursive_optimum(grounded).value[grounded.root, 5] == pytest.approx(-4)
    assert _polled_values(_knowing(grounded))[5] == pytest.approx(-(1 + (1 + 2) / 2))


def test_polling_needs_callers_that_may_call_all_the_way() -> None:
    """The root may call Far in 0 alone; polled, it has nothing to call in 1, where Far is on its way."""
    model = corridor(4, "right")
    graph = TaskGraph("guarded", model.index.variables, model.actions)
    (x,) = graph.variables
    far = graph.task("Far", until=x.eq(3), uses=[x], do="right")
    graph.task("Root", until=x.eq(3), uses=[x], do=[far().when(x.eq(0))])
    learner = _knowing(ground(graph, model))
    assert learner.greedy_steps(learner.grounded.root, 0) == 3
    with pytest.raises(UserError, match=r"task Root has no child to call in state 1 \(x = 1\)"):
        polled_steps(learner, learner.grounded.root, 0)


def test_without_chance_polling_goes_the_hierarchy_s_way() -> None:
    """Exact values of a deterministic world: the same steps from everywhere, for every learner."""
    model = corridor(7)
    graph = TaskGraph("ends", model.index.variables, model.actions)
    (x,) = graph.variables
    to_left = graph.task("ToLeft", until=x.eq(0), uses=[x], do="left right")
    to_right = graph.task("ToRight", until=x.eq(6), uses=[x], do="left right")
    graph.task("Root", until=x.isin([0, 6]), uses=[x], do=[to_left(), to_right()])
    for kind in (MaxQ, MaxQQ, HSMQ, FlatQ):
        learner = kind(ground(graph, model), (0,))
        root = learner.grounded.root
        learner.train(root, range(1, 6), episodes=600)
        for at in range(7):
            assert polled_route(learner, root, at) == learner.greedy_route(root, at)
            assert polled_steps(learner, root, at) == min(at, 6 - at)


def test_polling_holds_its_limit() -> None:
    """A way of exactly `limit` steps is found, one longer is not, and an ended task takes none."""
    model = corridor(5, "right")
    graph = TaskGraph("walk", model.index.variables, model.actions)
    (x,) = graph.variables
    graph.task("Go", until=x.eq(4), uses=[x], do="right")
    learner = MaxQ(ground(graph, model), (0,))
    root = learner.grounded.root
    assert polled_steps(learner, root, 0, limit=4) == 4
    assert polled_steps(learner, root, 0, limit=3) is None
    assert polled_route(learner, root, 4) == []
