from itertools import product

import numpy as np
import pytest
from decision_problems import ground_graphs, models, two_errands
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import csr_array

from hierarchy import Exits, GroundGraph, TaskGraph, evaluate, ground, two_rooms
from planners import (
    EndlessRewardError,
    best_policy,
    flat_field,
    flat_optimum,
    hierarchical_optimum,
    recursive_optimum,
    stack_problem,
)
from worlds import StateIndex, TransitionModel, Variable, load_layout, maze_model

Running = tuple[tuple[int, ...], int]
"""A task stack and a state."""


def _value_iteration(
    model: TransitionModel, terminal: NDArray[np.bool_], gamma: float
) -> NDArray[np.float64]:
    """Return the optimal values as a textbook would, state by state (Bellman, 1957)."""
    value = [0.0] * model.index.size
    for _ in range(400):
        value = [
            0.0
            if terminal[s]
            else max(
                sum(
                    p * (r + gamma * value[to])
                    for p, r, to in zip(
                        model.probabilities[s, a],
                        model.outcome_rewards[s, a],
                        model.outcomes[s, a],
                        strict=True,
                    )
                )
                for a in range(2)
            )
            for s in range(model.index.size)
        ]
    return np.array(value)


@settings(max_examples=25, deadline=None)
@given(models(least=-4, most=4, sizes=(2, 4)), st.data())
def test_the_flat_optimum_is_value_iteration_s(model: TransitionModel, data: st.DataObject) -> None:
    """Discounted, with rewards of either sign."""
    terminal = np.arange(model.index.size) == data.draw(st.integers(0, model.index.size - 1))
    expected = _value_iteration(model, terminal, 0.9)
    best = flat_optimum(model, terminal, gamma=0.9)
    assert best.value == pytest.approx(expected, abs=1e-7)
    assert (best.choice[terminal] == -1).all()
    assert (best.choice[~terminal] >= 0).all()


def _enumerated(model: TransitionModel, terminal: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the best value of each state over every policy that surely ends from there, one by one."""
    states = model.index.size
    best = np.where(terminal, 0.0, -np.inf)
    matrices = np.zeros((2, states, states))
    for s, a, k in np.ndindex(model.outcomes.shape):
        matrices[a, s, model.outcomes[s, a, k]] += model.probabilities[s, a, k]
    for policy in product(range(2), repeat=states):
        move = np.where(terminal[:, None], np.eye(states), matrices[list(policy), np.arange(states)])
        ends = terminal.copy()
        for _ in range(states):
            ends |= (move[:, ends] > 0).any(axis=1)
        sure = ~ends
        for _ in range(states):
            sure |= (move[:, sure] > 0).any(axis=1)
        inside = ~sure & ~terminal
        reward = model.rewards[np.arange(states), list(policy)]
        solved = np.linalg.solve(np.eye(inside.sum()) - move[np.ix_(inside, inside)], reward[inside])
        best[inside] = np.maximum(best[inside], solved)
    return best


@settings(max_examples=40, deadline=None)
@given(models(sizes=(2, 4)), st.data())
def test_undiscounted_the_flat_optimum_is_the_best_of_all_policies(
    model: TransitionModel, data: st.DataObject
) -> None:
    """Over every policy that surely ends; steps may cost nothing, and going round for ever is no way out."""
    terminal = np.arange(model.index.size) == data.draw(st.integers(0, model.index.size - 1))
    assert flat_optimum(model, terminal).value == pytest.approx(_enumerated(model, terminal), abs=1e-7)


def test_on_the_maze_the_flat_optimum_is_the_distance_field() -> None:
    """Minus the steps, exactly, for each of 2,048 states, and choices within the optimal sets."""
    layout = load_layout("two_rooms")
    model = maze_model(layout)
    grounded = ground(two_rooms(layout), model)
    terminal = grounded.nodes[grounded.root].terminal
    field, best = flat_field(model, terminal), flat_optimum(model, terminal)
    assert (best.value == np.where(field.distance < 0, -np.inf, -field.distance)).all()
    moving = best.choice >= 0
    assert (best.choice[moving] == field.optimal()[moving].argmax(axis=1)).all()


def test_reward_for_ever_is_refused() -> None:
    """Going in a circle at +1 a step: without discounting no policy is best; with it, the circle is."""
    index = StateIndex((Variable("x", (0, 1)),))
    model = TransitionModel(
        index, ("stay", "end"), np.array([[0, 1], [1, 1]]), np.array([[1.0, 0], [0, 0]]), np.ones(2, np.bool_)
    )
    terminal = np.array([False, True])
    with pytest.raises(EndlessRewardError, match=r"the world can collect reward for ever.*gamma below 1"):
        flat_optimum(model, terminal)
    best = flat_optimum(model, terminal, gamma=0.75)
    assert best.value.tolist() == [4, 0]
    assert best.choice.tolist() == [0, -1]


def test_a_tie_that_goes_round_for_ever_is_no_tie() -> None:
    """Staying costs nothing and comes first, but does not end; 0 is left by the second choice."""
    stay = Exits(np.zeros(3), csr_array(np.eye(3)))
    on = Exits(np.array([-1.0, -1, 0]), csr_array(np.eye(3)[[1, 2, 2]]))
    running = np.array([True, True, False])
    best = best_policy([(running, stay), (running, on)], ~running)
    assert best.value.tolist() == [-2, -1, 0]
    assert best.choice.tolist() == [1, 1, -1]


def _root_only(model: TransitionModel, end: int) -> GroundGraph:
    graph = TaskGraph("flat", model.index.variables, model.actions)
    (x,) = graph.variables
    graph.task("Root", until=x.eq(end), uses=[x], do="a b")
    return ground(graph, model)


@settings(max_examples=25, deadline=None)
@given(models(), st.sampled_from([0.9, 1.0]))
def test_without_subtasks_all_degrees_are_one(model: TransitionModel, gamma: float) -> None:
    """A root over primitive actions alone: recursive, hierarchical and global values and choices agree."""
    grounded = _root_only(model, 0)
    recursive, best = recursive_optimum(grounded, gamma), hierarchical_optimum(grounded, gamma)
    flat = flat_optimum(model, grounded.nodes[-1].terminal, gamma)
    assert best.value[0] == pytest.approx(flat.value)
    assert recursive.value[-1] == pytest.approx(flat.value)
    assert (best.choice[0] == flat.choice).all()
    assert (recursive.choice[-1] == flat.choice).all()


@settings(max_examples=80, deadline=None)
@given(ground_graphs(), st.sampled_from([0.9, 1.0]))
def test_the_degrees_are_in_order(grounded: GroundGraph, gamma: float) -> None:
    """Recursive <= hierarchical <= global from every state, where no reward is above 0."""
    root = grounded.root
    recursive = recursive_optimum(grounded, gamma).value[root]
    best = hierarchical_optimum(grounded, gamma).value[0]
    flat = flat_optimum(grounded.model, grounded.nodes[root].terminal, gamma).value
    assert (recursive <= best + 1e-7).all()
    assert (best <= flat + 1e-7).all()


@settings(max_examples=25, deadline=None)
@given(models(least=-4, most=4, sizes=(3, 3)), st.data())
def test_the_hierarchical_optimum_is_the_best_of_all_policies(
    model: TransitionModel, data: st.DataObject
) -> None:
    """Where each task has one stack: over every choice of every task in every state, one by one."""
    graph = TaskGraph("two tasks", model.index.variables, model.actions)
    (x,) = graph.variables
    ends = [data.draw(st.sampled_from([[0], [1], [0, 2], [1, 2]])) for _ in range(2)]
    low = graph.task("Low", until=x.isin(ends[0]), uses=[x], do="a b")
    graph.task("Root", until=x.isin(ends[1]), uses=[x], do=["b", low()])
    grounded = ground(graph, model)
    options = [
        [k for k, call in enumerate(node.calls) if call.available[s]] or [-1]
        for node in grounded.nodes
        for s in range(3)
    ]
    assume(any(len(able) > 1 for able in options))
    expected = np.full(3, -np.inf)
    for choices in product(*options):
        value = evaluate(grounded, np.array(choices).reshape(-1, 3), gamma=0.9)[-1].value
        expected = np.maximum(expected, value)
    assert hierarchical_optimum(grounded, gamma=0.9).value[0] == pytest.approx(expected, abs=1e-7)


def _value_iteration_over_stacks(grounded: GroundGraph, gamma: float, rounds: int) -> dict[Running, float]:
    """Return the optimal values of task stacks and states as a dictionary, in the plainest way.

    Calls take no time; after a step the tasks on top that have ended leave, except the root. Where
    nothing may be called the value is -inf.
    """
    model, nodes = grounded.model, grounded.nodes

    def left(stack: tuple[int, ...], state: int) -> tuple[int, ...]:
        return left(stack[:-1], state) if len(stack) > 1 and nodes[stack[-1]].terminal[state] else stack

    def worth(stack: tuple[int, ...], state: int, now: dict[Running, float]) -> float:
        if stack == (grounded.root,) and nodes[grounded.root].terminal[state]:
            return 0.0
        best = -np.inf
        for call in nodes[stack[-1]].calls:
            if call.available[state] and nodes[call.child].calls:
                best = max(best, worth((*stack, call.child), state, now))
            elif call.available[state]:
                columns = model.probabilities, model.outcome_rewards, model.outcomes
                outcomes = zip(*(column[state, call.child].tolist() for column in columns), strict=True)
                after = ((p, r, (left(stack, to), to)) for p, r, to in outcomes if p > 0)
                best = max(best, sum(p * (r + gamma * now.get(there, 0.0)) for p, r, there in after))
        return best

    stacks = [(grounded.root,)]
    for stack in stacks:
        stacks += [(*stack, c) for c in {call.child for call in nodes[stack[-1]].calls} if nodes[c].calls]
    now: dict[Running, float] = {}
    for _ in range(rounds):
        now = {(stack, s): worth(stack, s, now) for stack in stacks for s in range(model.index.size)}
    return now


@settings(max_examples=25, deadline=None)
@given(ground_graphs(least=-4, most=4, sizes=(2, 4)), st.sampled_from([0.5, 0.7]))
def test_the_hierarchical_optimum_is_value_iteration_s(grounded: GroundGraph, gamma: float) -> None:
    """With three levels, shared tasks and rewards of either sign: every stack where it can run."""
    best = hierarchical_optimum(grounded, gamma)
    expected = _value_iteration_over_stacks(grounded, gamma, rounds=60)
    for place, stack in enumerate(best.problem.stacks):
        for state in range(grounded.model.index.size):
            top = grounded.nodes[stack[-1]]
            if top.live[state] or (stack == (grounded.root,)):
                assert best.value[place, state] == pytest.approx(expected[stack, state], abs=1e-5)


@settings(max_examples=15, deadline=None)
@given(ground_graphs(least=-3, most=-1, sizes=(2, 3)))
def test_undiscounted_the_hierarchical_optimum_is_value_iteration_s(grounded: GroundGraph) -> None:
    """Where every step costs: equal wherever some policy ends, and without bound elsewhere."""
    best = hierarchical_optimum(grounded)
    expected = _value_iteration_over_stacks(grounded, 1.0, rounds=400)
    for state, value in enumerate(best.value[0]):
        slow = expected[(grounded.root,), state]
        assert value == pytest.approx(slow, abs=1e-5) if np.isfinite(value) else slow < -90


def test_what_is_best_may_depend_on_the_stack_by_hand() -> None:
    """Out goes left for First and right for Second, from the same state.

    a, c, b, c, end: 4 steps. One policy of Out for both callers can serve one of them only, so that the
    recursive optimum never ends; the world allows a, c, end.
    """
    grounded = two_errands()
    best = hierarchical_optimum(grounded)
    stacks = [[grounded.nodes[place].name for place in stack] for stack in best.problem.stacks]
    assert stacks == [
        ["Root"],
        ["Root", "First"],
        ["Root", "Second"],
        ["Root", "First", "Out"],
        ["Root", "Second", "Out"],
    ]
    assert best.value[0].tolist() == [-4, -2, -np.inf, 0]
    assert best.choice[3:, 2].tolist() == [0, 1]
    assert best.value[3:, 2].tolist() == [-3, -1]
    assert recursive_optimum(grounded).value[grounded.root].tolist() == [-np.inf, -np.inf, -np.inf, 0]
    assert flat_optimum(grounded.model, grounded.nodes[grounded.root].terminal).value[0] == -2


def test_control_comes_back_to_the_first_caller_that_has_not_ended() -> None:
    """One step from c to the end takes Out and Second off the stack, and the root has ended."""
    problem = stack_problem(two_errands())
    out, states = 4, 4
    joint = out * states + 2
    moves = [exits.kernel[[joint]] for _, exits in problem.choices]
    assert [move.indices.tolist() for move in moves[:2]] == [[2 * states + 1], [3]]
    assert problem.terminal.nonzero()[0].tolist() == [3]


def test_a_policy_without_stacks_spreads_over_them() -> None:
    """Its value over the stacks is the value that bottom-up evaluation gives the root."""
    layout = load_layout("two_rooms")
    grounded = ground(two_rooms(layout, one_door_task=True), maze_model(layout))
    solution, problem = recursive_optimum(grounded), stack_problem(grounded)
    policy = problem.spread(solution.choice)
    only = [(mask & (policy == k), exits) for k, (mask, exits) in enumerate(problem.choices)]
    followed = best_policy(only, problem.terminal).value[: grounded.model.index.size]
    starts = grounded.model.starts
    assert (followed[starts] == solution.value[grounded.root][starts]).all()
