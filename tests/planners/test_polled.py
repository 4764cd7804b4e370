"""Polled execution against hierarchical execution of the same values."""

import numpy as np
import pytest
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
    polled_action,
    polled_route,
    polled_steps,
)
from worlds import StateIndex, TransitionModel, Variable


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
