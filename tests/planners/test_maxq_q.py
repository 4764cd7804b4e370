"""MAXQ-Q held to values worked out by hand, to MAXQ-0, and to dynamic programming."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from learning_worlds import corridor, exact, two_exits

from hierarchy import GroundGraph, TaskGraph, ground
from planners import Exploration, HarmonicRate, LearningRate, MaxQ, MaxQQ, Settings
from planners.learner import Step
from worlds import StateIndex, TransitionModel, Variable

EXACT = Settings(rate=LearningRate(start=1.0, factor=1.0))


@given(st.integers(0, 10_000), st.booleans(), st.sampled_from([0.0, 0.25]), st.sampled_from([1.0, 0.8]))
@settings(max_examples=15, deadline=None)
def test_without_pseudo_rewards_it_is_maxq_0(seed: int, all_states: bool, slip: float, gamma: float) -> None:
    """The same choices, tables and values, to the last bit; C~ equals C."""
    grounded = two_exits(slip=slip, pseudo_reward=None)
    how = Settings(all_states=all_states, gamma=gamma)
    plain, twin = MaxQ(grounded, (seed,), how), MaxQQ(grounded, (seed,), how)
    assert plain.train(grounded.root, [1, 2, 4], 20) == twin.train(grounded.root, [1, 2, 4], 20)
    assert twin.completion == plain.completion == twin.inner_completion
    assert twin.reward == plain.reward
    assert [twin.value(grounded.root, x) for x in range(6)] == [
        plain.value(grounded.root, x) for x in range(6)
    ]


def test_the_early_quitting_trap() -> None:
    """From 1, Out can quit at 0 in one step or reach its goal in four: MAXQ-0 quits, MAXQ-Q does not.

    The root pays for quitting: back to 3 and to the end, six steps in place of four.
    """
    grounded = two_exits()
    out, root = grounded.place("Out"), grounded.root
    learners = MaxQ(grounded, (0,)), MaxQQ(grounded, (0,))
    for learner in learners:
        learner.train(root, [1, 2, 3, 4], episodes=1500)
    quits, stays = learners
    assert quits.greedy_route(out, 1) == [(1, 0)]
    assert quits.greedy_steps(root, 1) == 6
    assert [x for x, _ in stays.greedy_route(out, 1) or []] == [1, 2, 3, 4]
    assert stays.greedy_steps(root, 1) == 4
    assert stays.value(out, 1) == pytest.approx(-4, abs=0.05), "callers see real rewards alone"
    assert stays.value(root, 1) == pytest.approx(-4, abs=0.2), "Out still explores"


def test_a_weak_pseudo_reward_does_not_keep_it_from_quitting() -> None:
    """At -2, quitting from 1 costs -1 - 2 = -3, less than the four steps to the goal."""
    grounded = two_exits(pseudo_reward=-2.0)
    out = grounded.place("Out")
    learner = MaxQQ(grounded, (0,))
    learner.train(grounded.root, [1, 2, 3, 4], episodes=1500)
    assert learner.greedy_route(out, 1) == [(1, 0)]
    assert learner.value(out, 1) == pytest.approx(-1, abs=0.01)
    assert learner.inner_q(out, 1, 0) == pytest.approx(-3, abs=0.01)


def _uneven() -> GroundGraph:
    """Return Go along 0, 1, 2, 3, whose steps cost 1, 2 and 4, and which is taught to cost 32 more."""
    index, x = StateIndex((Variable("x", (0, 1, 2, 3)),)), np.arange(4)
    successors = np.minimum(x + 1, 3)[:, None]
    costs = -np.array([1.0, 2.0, 4.0, 8.0])[:, None]
    model = TransitionModel(index, ("right",), successors, costs, x < 3)
    graph = TaskGraph("uneven", index.variables, model.actions)
    (at,) = graph.variables
    graph.task("Go", until=at.eq(3), goal=at.eq(0), pseudo_reward=-32.0, uses=[at], do="right")
    return ground(graph, model)


def test_both_completions_by_hand() -> None:
    """C(s) = V(right, s') + C(s') with V at s', not at s: -2 - 4, -4 and 0; C~ has 32 less.

    With V(right, s) in place of V(right, s') it would be -1 - 2 - ..., and so on.
    """
    grounded = _uneven()
    learner = MaxQQ(grounded, (0,), EXACT)
    learner.train(grounded.root, [0], episodes=4)
    assert learner.completion[grounded.root] == [[-6.0, -4.0, 0.0, 0.0]]
    assert learner.inner_completion[grounded.root] == [[-38.0, -36.0, -32.0, 0.0]]
    assert learner.value(grounded.root, 0) == learner.q(grounded.root, 0, 0) == -7.0
    assert learner.inner_q(grounded.root, 0, 0) == -39.0


def test_the_first_update_by_hand() -> None:
    """One step from 0 to 1 with alpha = 1/2 and gamma = 1/2, from values put in by hand.

    a* = right, V(right, 1) = -2, C(1) = -8, C~(1) = -16: C(0) becomes half of half of -10,
    C~(0) half of half of -18.
    """
    grounded = _uneven()
    root = grounded.root
    learner = MaxQQ(grounded, (0,), Settings(gamma=0.5))
    leaf = grounded.nodes[0].leaf
    assert leaf is not None
    for at, cost in enumerate((-1.0, -2.0, -4.0, -8.0)):
        learner.reward[0][leaf.projection[at]] = cost
    learner.completion[root][0][1], learner.inner_completion[root][0][1] = -8.0, -16.0
    learner._learn(root, 0, [Step(0, -1.0)], 1, 0.5)
    assert learner.c(root, 0, 0) == -2.5
    assert learner.inner_completion[root][0][0] == -4.5


def test_the_last_step_teaches_the_pseudo_reward_alone() -> None:
    """Nothing stored at the terminal state is read, and wrong completions are pulled to R~ and to 0."""
    grounded = _uneven()
    root = grounded.root
    learner = MaxQQ(grounded, (0,), EXACT)
    for table in (learner.completion, learner.inner_completion):
        table[root][0][2], table[root][0][3] = -64.0, -1024.0
    learner.train(root, [2], episodes=1)
    assert learner.completion[root][0][2:] == [0.0, -1024.0]
    assert learner.inner_completion[root][0][2:] == [-32.0, -1024.0]
    assert learner.value(root, 3) == 0.0


def test_c_follows_the_choice_of_c_tilde() -> None:
    """Where left looks better to C and right to C~, C learns the value of right (table 4, line 17)."""
    grounded = two_exits()
    out = grounded.place("Out")
    learner = MaxQQ(grounded, (0,), EXACT)
    left, right = 0, 1
    learner.completion[out][left][1], learner.completion[out][right][1] = -1.0, -5.0
    learner.inner_completion[out][left][1], learner.inner_completion[out][right][1] = -30.0, -6.0
    learner._learn(out, left, [Step(2, -1.0)], 1, 1.0)
    assert learner.c(out, 2, left) == -5.0
    assert learner.inner_completion[out][left][2] == -6.0
    assert learner.value(out, 1) == -5.0
    assert learner.greedy(out, 1) == right


@pytest.mark.parametrize("seed", range(4))
def test_callers_see_the_child_that_is_taken_among_equals(seed: int) -> None:
    """At -1 for quitting, Out from 2 is indifferent; it takes left, in 2 steps, and not right, in 3.

    Which of the two is larger by C~ hangs on the last digits of what was learnt (seeds 0 and 3: right). V is
    that of the child taken, for Out and for the root, which would have it 7 or 8.
    """
    grounded = two_exits(pseudo_reward=-1.0)
    out, root = grounded.place("Out"), grounded.root
    learner = MaxQQ(grounded, (seed,), Settings(rate=HarmonicRate(20)))
    learner.train(root, [1, 2, 3, 4], episodes=1500)
    solution = exact(grounded)
    assert (solution.values[out, 2], solution.values[root, 2]) == pytest.approx((-2, -7))
    assert (learner.greedy(out, 2), learner.greedy_steps(root, 2)) == (0, 7)
    assert learner.value(out, 2) == pytest.approx(-2, abs=0.02)
    assert learner.value(root, 2) == pytest.approx(-7, abs=0.3)


@pytest.mark.parametrize("all_states", [False, True])
def test_inner_and_outer_values_become_exact(all_states: bool) -> None:
    """On a world with chance, V and V + C~ of every task, against dynamic programming."""
    grounded = two_exits(slip=0.1, pseudo_reward=-12.0)
    how = Settings(rate=HarmonicRate(20), exploration=Exploration(10), all_states=all_states)
    learner = MaxQQ(grounded, (2,), how)
    learner.train(grounded.root, range(5), episodes=10_000)
    solution, out = exact(grounded), grounded.place("Out")
    for x in range(1, 5):
        best = learner.greedy(out, x)
        assert best == solution.choice[out, x]
        assert learner.inner_q(out, x, best) == pytest.approx(solution.inner[out, x], abs=0.25)
        assert learner.value(out, x) == pytest.approx(solution.values[out, x], abs=0.25)


def test_the_reference_solver_knows_the_corridor() -> None:
    """By hand: Out from 1 costs 1 without and 4 with the pseudo-reward of -30; the root then 6 and 4."""
    grounded = two_exits()
    out, root = grounded.place("Out"), grounded.root
    plain, taught = exact(grounded, pseudo_rewards=False), exact(grounded)
    assert (plain.values[out, 1], taught.values[out, 1]) == pytest.approx((-1, -4))
    assert (plain.values[root, 1], taught.values[root, 1]) == pytest.approx((-6, -4))
    assert taught.inner[out, 1] == pytest.approx(-4)
    slippery = exact(ground(*_walk(0.25)))
    # E = -(3/4 + 2/4) + 1/4 (E + E), from 1 to 2 in a corridor whose other end bounces back.
    assert slippery.values[-1, 0] - slippery.values[-1, 1] == pytest.approx(-5 / 3)
    assert slippery.values[-1, 1] == pytest.approx(-20 / 9)


def _walk(slip: float) -> tuple[TaskGraph, TransitionModel]:
    """Return Go, along a slippery corridor of 3 from its left to its right end."""
    model = corridor(3, "right", slip=slip)
    graph = TaskGraph("walk", model.index.variables, model.actions)
    (x,) = graph.variables
    graph.task("Go", until=x.eq(2), uses=[x], do="right")
    return graph, model
