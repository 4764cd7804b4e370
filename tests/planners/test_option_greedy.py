from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from option_runs import allowed, choices, left_of, named, sound_graphs

from hierarchy import GroundGraph, evaluate, ground
from hierarchy.taxi import taxi_graph
from planners import hierarchical_optimum, recursive_optimum
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.options import NONE, Options, compile_options
from worlds import Stream, TransitionModel, UserError

Table = NDArray[np.int64]


def _paths(options: Options) -> list[tuple[int, ...]]:
    return [tuple(edge.child for edge in stack) for stack in options.stacks]


def _random_policy(options: Options, seed: int) -> GreedyPolicy:
    """Return a policy that ends what has ended and chooses, once and for all, what it may."""
    grounded, paths, stream = options.grounded, _paths(options), Stream(seed)
    states, count = grounded.model.index.size, len(options)
    option = np.full((states, count + 1), NONE, dtype=np.int64)
    action = np.zeros((states, count), dtype=np.int64)
    for state in range(states):
        for running, path in enumerate([*paths, ()]):
            left = left_of(grounded, path, state)
            ways = sorted(choices(grounded, (grounded.root, *left)[-1], state))
            if path and left == path:
                option[state, running] = running
            elif ways:
                option[state, running] = paths.index((*left, *ways[stream.below(len(ways))]))
            else:
                option[state, running] = max(running, 0) if path else NONE
        for k, path in enumerate(paths):
            may = sorted(allowed(grounded, path, state))
            action[state, k] = may[stream.below(len(may))] if may else 0
    return GreedyPolicy(options, option, action)


def _slow_returns(policy: GreedyPolicy) -> NDArray[np.float64]:
    """Return what each state is worth by a dense chain over (state, option), -inf where endless."""
    grounded = policy.options.grounded
    model, over = grounded.model, grounded.nodes[grounded.root].terminal
    columns = policy.option.shape[1]
    pairs = [(s, o) for s in range(model.index.size) for o in range(columns)]
    move, reward = np.zeros((len(pairs), len(pairs))), np.zeros(len(pairs))
    ends = np.array([bool(over[s]) for s, _ in pairs])
    for row, (s, o) in enumerate(pairs):
        k = policy.option[s, o]
        if over[s]:
            continue
        for chance, to, gain in zip(
            *(
                table[s, policy.action[s, k]]
                for table in (model.probabilities, model.outcomes, model.outcome_rewards)
            ),
            strict=True,
        ):
            move[row, int(to) * columns + int(k)] += chance
            reward[row] += chance * gain
    reaches = np.eye(len(pairs)) + move > 0
    while not (reaches == (again := (reaches.astype(float) @ reaches) > 0)).all():
        reaches = again
    can = reaches[:, ends].any(axis=1)
    sure = ~(reaches & ~can).any(axis=1)
    values = np.where(ends, 0.0, -np.inf)
    inside = sure & ~ends
    values[inside] = np.linalg.solve(np.eye(inside.sum()) - move[np.ix_(inside, inside)], reward[inside])
    found: NDArray[np.float64] = values.reshape(-1, columns)[:, NONE]
    return found


@pytest.mark.parametrize("name", ["taxi", "rainy taxi"])
def test_states_are_given_by_their_numbers(name: str) -> None:
    """A mask would be read as the states 0 and 1, in worlds with chance and without."""
    options = compile_options(named(name))
    policy, model = _random_policy(options, 0), options.grounded.model
    asks: list[Callable[[Any], Any]] = [policy.returns, lambda starts: policy.returns_within(starts, 3)]
    for ask in asks:
        assert ask([3]).shape == (1,)
        with pytest.raises(UserError, match="of a mask, "):
            ask(model.starts)
        with pytest.raises(UserError, match=f"and {model.index.size} is none of them"):
            ask([0, model.index.size])


@settings(max_examples=15, deadline=None)
@given(sound_graphs(), st.integers(0, 99))
def test_returns_are_those_of_the_chain(grounded: GroundGraph, seed: int) -> None:
    """Random policies in worlds of chance, of which some never end, or may not."""
    policy = _random_policy(compile_options(grounded), seed)
    starts = np.flatnonzero(grounded.model.starts)
    assert policy.returns(starts) == pytest.approx(_slow_returns(policy)[starts], rel=1e-6)


@pytest.mark.parametrize("name", ["two_rooms", "taxi", "hdg"])
def test_returns_are_what_routes_add_up_to(name: str) -> None:
    """In a deterministic world, whether a random policy comes to the end or goes round for ever."""
    options = compile_options(named(name))
    policy, model = _random_policy(options, 3), options.grounded.model
    starts = np.flatnonzero(model.starts)
    found = policy.returns(starts)
    for start, value in zip(starts.tolist(), found.tolist(), strict=True):
        route = policy.route(start)
        added = -np.inf if route is None else sum(model.rewards[s, a] for s, _, a in route)
        assert value == pytest.approx(added)
    assert np.isfinite(found).any() == any(policy.route(start) is not None for start in starts.tolist())


def _of_calls(options: Options, calls: Table) -> GreedyPolicy:
    """Return the policy that makes the given calls, shape (nodes, states), as options."""
    grounded, paths = options.grounded, _paths(options)
    states, count = grounded.model.index.size, len(options)
    option = np.full((states, count + 1), NONE, dtype=np.int64)
    action = np.zeros((states, count), dtype=np.int64)
    number = {path: k for k, path in enumerate(paths)}
    for state in range(states):
        for running, path in enumerate([*paths, ()]):
            left = left_of(grounded, path, state)
            while left not in number and calls[(grounded.root, *left)[-1], state] >= 0:
                caller = grounded.nodes[(grounded.root, *left)[-1]]
                left = (*left, caller.calls[calls[grounded.place(caller.name), state]].child)
            option[state, running] = number.get(left, NONE)
        for k, path in enumerate(paths):
            top = grounded.nodes[path[-1]]
            own = calls[path[-1], state] if top.calls else NONE
            action[state, k] = top.calls[own].child if own >= 0 else path[-1] * (not top.calls)
    return GreedyPolicy(options, option, action)


@pytest.mark.parametrize("name", ["two_rooms", "taxi", "rainy taxi"])
def test_hierarchical_policies_are_worth_what_the_planner_says(name: str) -> None:
    """A recursively optimal policy run as options has exactly the value of `hierarchy.evaluate`."""
    grounded = named(name)
    options, best = compile_options(grounded), recursive_optimum(grounded)
    starts = np.flatnonzero(grounded.model.starts & ~grounded.nodes[grounded.root].terminal)
    found = _of_calls(options, best.choice).returns(starts)
    wanted = evaluate(grounded, best.choice)[grounded.root].value[starts]
    assert np.isfinite(wanted).all()
    assert found == pytest.approx(wanted)
    assert (found <= hierarchical_optimum(grounded).value[0, starts] + 1e-9).all()


def test_an_outcome_that_never_occurs_is_no_way_to_go() -> None:
    """A world with outcomes of probability 0, from which no way leads on, has the values of one without."""
    dry = named("taxi")
    model = dry.model
    nowhere = np.broadcast_to(model.index.size - 1, model.outcomes.shape)
    padded = TransitionModel(
        model.index,
        model.actions,
        np.concatenate([model.outcomes, nowhere], axis=2),
        np.concatenate([model.outcome_rewards, -9.0 - nowhere], axis=2),
        model.starts,
        probabilities=np.concatenate([model.probabilities, 0.0 * nowhere], axis=2),
    )
    options, calls = compile_options(ground(taxi_graph(padded), padded)), recursive_optimum(dry).choice
    starts = np.flatnonzero(model.starts & ~dry.nodes[dry.root].terminal)
    found = _of_calls(options, calls).returns(starts)
    assert np.isfinite(found).all()
    assert found == pytest.approx(_of_calls(compile_options(dry), calls).returns(starts))


@pytest.mark.parametrize("name", ["taxi", "rainy taxi"])
def test_with_nothing_to_choose_there_is_no_end(name: str) -> None:
    """A policy that stands still in some state is worth minus infinity from wherever it may come there."""
    grounded = named(name)
    calls = recursive_optimum(grounded).choice
    whole = _of_calls(compile_options(grounded), calls)
    starts = np.flatnonzero(grounded.model.starts & ~grounded.nodes[grounded.root].terminal)
    option = whole.option.copy()
    option[starts[0]] = NONE
    found = GreedyPolicy(whole.options, option, whole.action).returns(starts)
    assert found[0] == -np.inf
    through = found == -np.inf
    assert 1 < through.sum() < starts.size
    assert found[~through] == pytest.approx(whole.returns(starts)[~through])
    if grounded.model.is_deterministic:
        assert GreedyPolicy(whole.options, option, whole.action).route(int(starts[0])) is None
