"""How options are used: measures worked by hand on routes that are known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hierarchy import GroundGraph, ground, two_rooms
from hierarchy.taxi import taxi_graph
from planners import flat_optimum
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.measures import Degeneracy, Oracle, degeneracy
from planners.option_critic.options import Options, compile_options
from worlds import TransitionModel, UserError, load_layout, maze_model, parse_layout
from worlds.taxi import taxi_model

ROWS = "grid", ". . : D1 G1", "T1 . | . .", "start 0,0", "trigger T1", "goal G1"
MAZE = parse_layout("\n".join(ROWS))


def follow(options: Options, chosen: np.ndarray, action: np.ndarray, *, ends: np.ndarray) -> GreedyPolicy:
    """Return a policy that chooses an option where the one before ends, shape (states, options)."""
    option = np.where(ends, chosen[:, None], np.arange(len(options)))
    return GreedyPolicy(options, np.c_[option, chosen], action)


@pytest.fixture(scope="module")
def small() -> Oracle:
    """Return what is best in a maze in which the shortest way takes five steps."""
    return Oracle(compile_options(ground(two_rooms(MAZE), maze_model(MAZE))))


@pytest.fixture(scope="module")
def start(small: Oracle) -> np.ndarray:
    """Return the layout's start."""
    marks = MAZE.triggers["T1"], MAZE.goals["G1"]
    return np.array([small.options.grounded.model.index.number((MAZE.start, *marks, "closed"))])


def best(oracle: Oracle, **change: np.ndarray) -> GreedyPolicy:
    """Return an optimal policy that switches where the graph's tasks end."""
    options = oracle.options
    chosen = (oracle.may_run & options.initiation[:, 0]).argmax(1)
    ends = change.get("ends", options.ended.any(1))
    return follow(options, change.get("chosen", chosen), oracle.optimal.argmax(2), ends=ends)


def test_a_known_route_is_measured_as_by_hand(small: Oracle, start: np.ndarray) -> None:
    """South to the trigger; north, east, east to the door's grid; east to the goal: 1 + 3 + 1 steps."""
    found = degeneracy(best(small), start, oracle=small)
    shares = np.array([0.2, 0.6, 0.2])
    entropy = -(shares * np.log(shares)).sum() / np.log(len(small.options))
    assert found == Degeneracy(
        duration=pytest.approx(5 / 3),
        switch_rate=pytest.approx(2 / 4),
        usage_entropy=pytest.approx(entropy),
        beta_at_subgoals=1.0,
        beta_elsewhere=0.0,
        oracle_subtasks=1.0,
        optimal_actions=1.0,
        steps=5,
    )


def test_options_that_always_end_last_one_step(small: Oracle, start: np.ndarray) -> None:
    """The first failure: each step is a choice, though the same options run and the route is the best."""
    always = np.ones_like(small.options.ended.transpose(0, 2, 1), dtype=float)
    policy = best(small, ends=np.ones_like(small.options.ended[:, 0]))
    found = degeneracy(policy, start, beta=always, oracle=small)
    assert (found.duration, found.beta_elsewhere, found.switch_rate) == (1.0, 1.0, 0.5)


def test_an_option_that_never_ends_runs_for_ever(small: Oracle, start: np.ndarray) -> None:
    """The second failure: one option, no changes; here it walks to the trigger, off it and back."""
    never = np.zeros_like(small.options.ended.transpose(0, 2, 1), dtype=float)
    policy = best(small, ends=np.zeros_like(small.options.ended[:, 0]))
    found = degeneracy(policy, start, beta=never, oracle=small, limit=50)
    assert (found.duration, found.switch_rate, found.usage_entropy) == (50.0, 0.0, 0.0)
    assert found.oracle_subtasks == 1 / 50  # once its task has ended nobody would run it
    assert found.optimal_actions == 0.5  # every step to the trigger is


def test_terminations_are_told_apart_by_where_the_graph_ends(small: Oracle, start: np.ndarray) -> None:
    """Their means are over states of arrival, the world's own end left out: 2 subgoals, 2 others."""
    ended = small.options.ended.transpose(0, 2, 1)
    found = degeneracy(best(small), start, beta=np.where(ended, 0.8, 0.3), oracle=small)
    assert (found.beta_at_subgoals, found.beta_elsewhere) == (pytest.approx(0.8), pytest.approx(0.3))


def test_the_wrong_subtask_is_told_from_the_wrong_action() -> None:
    """A root that takes the same door always has tasks that are right and choices that are not."""
    maze = load_layout("two_rooms")
    oracle = Oracle(compile_options(ground(two_rooms(maze), maze_model(maze))))
    options, starts = oracle.options, np.flatnonzero(oracle.options.grounded.model.starts)
    stubborn = options.initiation[:, 0].argmax(1)  # the first that may be chosen
    found = degeneracy(best(oracle, chosen=stubborn), starts, oracle=oracle)
    assert found.optimal_actions == 1.0
    assert 0.5 < found.oracle_subtasks < 0.95
    backwards = GreedyPolicy(options, best(oracle).option, (~oracle.optimal).argmax(2))
    lost = degeneracy(backwards, starts, oracle=oracle, limit=1)
    assert (lost.oracle_subtasks, lost.optimal_actions) == (1.0, 0.0)


def test_a_hierarchically_optimal_policy_has_something_to_run_everywhere_it_gets() -> None:
    """Taxi: two levels, actions as options; picking up is right at the passenger and nowhere else."""
    model = taxi_model()
    grounded = ground(taxi_graph(model), model)
    oracle = Oracle(compile_options(grounded))
    names, over = list(oracle.options.names), grounded.nodes[grounded.root].terminal
    assert oracle.may_run[model.starts].any(1).all()
    assert not oracle.may_run[over].any()
    pick = next(k for k, name in enumerate(names) if name.endswith("Pickup"))
    may = oracle.may_run[:, pick]
    assert may.any()
    assert not (may & ~oracle.options.initiation[:, 0, pick]).any()
    value = flat_optimum(model, over).value
    action = int(oracle.options.action[pick])
    after = value[model.successors[may, action]]
    np.testing.assert_allclose(model.rewards[may, action] + after, value[may])


@given(st.integers(0, 2**32 - 1))
def test_measures_keep_to_their_ranges(small: Oracle, seed: int) -> None:
    """Whatever a policy does, shares lie in 0 to 1 and an option runs at least a step."""
    draw = np.random.default_rng(seed)
    options = small.options
    states, _, count = options.ended.shape
    policy = GreedyPolicy(
        options, draw.integers(0, count, (states, count + 1)), draw.integers(0, 4, (states, count))
    )
    beta = draw.random((states, count, 1))
    starts = np.flatnonzero(options.grounded.model.starts)
    found = degeneracy(policy, starts, beta=beta, oracle=small, limit=20)
    assert 1 <= found.duration <= 20
    for name in ("switch_rate", "usage_entropy", "beta_elsewhere", "oracle_subtasks", "optimal_actions"):
        assert 0 <= getattr(found, name) <= 1 + 1e-12


def test_a_world_with_chance_is_refused(small: Oracle) -> None:
    """There is no one route to measure."""
    model = small.options.grounded.model
    twice = np.repeat(model.outcomes, 2, axis=2)
    chance = TransitionModel(
        model.index,
        model.actions,
        twice,
        np.full(twice.shape, -1.0),
        model.starts,
        probabilities=np.full(twice.shape, 0.5),
    )
    grounded: GroundGraph = replace(small.options.grounded, model=chance)
    with pytest.raises(UserError, match="deterministic worlds"):
        Oracle(replace(small.options, grounded=grounded))


def test_no_start_is_refused(small: Oracle) -> None:
    """A mean of no routes would be no number; a mask is no list of states."""
    with pytest.raises(UserError, match="of a mask, "):
        degeneracy(best(small), small.options.grounded.model.starts, oracle=small)
    with pytest.raises(UserError, match="no state to start from"):
        degeneracy(best(small), np.zeros(0, dtype=np.int64), oracle=small)
