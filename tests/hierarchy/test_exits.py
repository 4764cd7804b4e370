import numpy as np
import pytest
from decision_problems import models
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hierarchy import Exits, GroundGraph, Param, TaskGraph, evaluate, ground, primitive_exits, task_exits
from worlds import StateIndex, TransitionModel, Variable


def _slippery(cells: int, sure: float = 0.75) -> TransitionModel:
    """Return a corridor in which left and right fail, and stay put, with a chance of 1 - `sure`."""
    index = StateIndex((Variable("x", tuple(range(cells))),))
    x = np.arange(cells)
    moved = np.stack([np.maximum(x - 1, 0), np.minimum(x + 1, cells - 1)], axis=1)
    outcomes = np.stack([moved, np.repeat(x[:, None], 2, axis=1)], axis=2)
    chances = np.broadcast_to(np.array([sure, 1 - sure]), outcomes.shape).copy()
    rewards = np.full(outcomes.shape, -1.0)
    return TransitionModel(
        index, ("left", "right"), outcomes, rewards, np.ones(cells, np.bool_), probabilities=chances
    )


def _two_legs(model: TransitionModel) -> GroundGraph:
    """Return Root -> Go(to) -> left, right: to the middle first, then to the last cell."""
    last = model.index.size - 1
    graph = TaskGraph("legs", model.index.variables, model.actions)
    (x,) = graph.variables
    to = Param.over("to", {"middle": last // 2, "end": last})
    go = graph.task("Go", to, until=x.eq(to), uses=[x], do="left right")
    graph.task("Root", until=x.eq(last), uses=[x], do=[go(to=last // 2), go(to=last)])
    return ground(graph, model)


def test_a_slippery_corridor_by_hand() -> None:
    """A step succeeds in 3 of 4 cases: 4/3 tries a cell, and nowhere else to end."""
    grounded = _two_legs(_slippery(5))
    right = np.array([1, 1, -1, -1, -1])
    exits = task_exits(grounded.node("Go(middle)"), right, evaluate(grounded, np.full((5, 5), -1)))
    assert exits.value == pytest.approx([-8 / 3, -4 / 3, 0, -np.inf, -np.inf])
    assert exits.kernel.toarray() == pytest.approx(np.eye(5)[[2, 2, 2, 2, 2]] * [[1], [1], [0], [0], [0]])


def test_discounting_a_slippery_step_by_hand() -> None:
    """With discount g: value v = -1 + g v / 4, and the kernel's entry p = g (3 + p) / 4."""
    grounded, gamma = _two_legs(_slippery(3)), 0.8
    exits = evaluate(grounded, np.array([[-1] * 3, [-1] * 3, [1, -1, -1], [1, 1, -1], [0, 1, -1]]), gamma)
    p = 0.75 * gamma / (1 - gamma / 4)
    v = -1 / (1 - gamma / 4)
    middle, end, root = (exits[grounded.place(name)] for name in ("Go(middle)", "Go(end)", "Root"))
    assert middle.value == pytest.approx([v, 0, -np.inf])
    assert middle.kernel.toarray()[0] == pytest.approx([0, p, 0])
    assert end.value == pytest.approx([v + p * v, v, 0])
    assert end.kernel.toarray()[:, 2] == pytest.approx([p * p, p, 0])
    assert root.value == pytest.approx(end.value)
    assert root.kernel.toarray() == pytest.approx(end.kernel.toarray())


def test_a_task_with_two_ends_by_hand() -> None:
    """From the middle of three cells a coin decides between left and right: the drunkard's walk."""
    index = StateIndex((Variable("x", tuple(range(5))),))
    x = np.arange(5)
    outcomes = np.stack([np.maximum(x - 1, 0), np.minimum(x + 1, 4)], axis=1)[:, None]
    chances = np.full(outcomes.shape, 0.5)
    rewards = np.broadcast_to(np.array([0.0, 2.0]), outcomes.shape).copy()
    model = TransitionModel(index, ("walk",), outcomes, rewards, np.ones(5, np.bool_), probabilities=chances)
    graph = TaskGraph("walk", index.variables, model.actions)
    (at,) = graph.variables
    graph.task("Root", until=at.isin([0, 4]), uses=[at], do="walk")
    exits = evaluate(ground(graph, model), np.array([[-1] * 5, [-1, 0, 0, 0, -1]]))[-1]
    assert exits.value == pytest.approx([0, 3, 4, 3, 0])  # 3, 4 and 3 steps, at 1 each on average
    assert exits.kernel.toarray()[1:4, [0, 4]] == pytest.approx(np.array([[3, 1], [2, 2], [1, 3]]) / 4)
    assert exits.kernel.nnz == 6


def test_a_policy_that_may_never_end() -> None:
    """Where it goes round for ever the value is -inf, and so it is wherever it may come to that."""
    grounded = _two_legs(_slippery(5))
    end = grounded.node("Go(end)")
    children = evaluate(grounded, np.full((5, 5), -1))
    turning = task_exits(end, np.array([1, 1, 1, 0, -1]), children)
    assert turning.value.tolist() == [-np.inf] * 4 + [0]
    assert turning.kernel.nnz == 0
    silent = task_exits(end, np.array([1, 1, -1, 1, -1]), children)
    assert silent.value == pytest.approx([-np.inf] * 3 + [-4 / 3, 0])


def test_discounted_a_policy_may_go_on_for_ever() -> None:
    """It earns -1 / (1 - gamma), and ends nowhere."""
    grounded = _two_legs(_slippery(3))
    choices = np.array([[-1] * 3, [-1] * 3, [0, -1, 1], [0, 1, -1], [-1] * 3])
    exits = evaluate(grounded, choices, gamma=0.9)[grounded.place("Go(end)")]
    assert exits.value[0] == pytest.approx(-10)
    assert exits.kernel.toarray()[0] == pytest.approx([0, 0, 0])


def test_a_child_that_may_never_end_is_seen_by_its_caller() -> None:
    """The root calls Go(middle) from 3, which turns away for ever."""
    grounded = _two_legs(_slippery(5))
    go = [1, 1, -1, 1, 1]
    choices = np.array([[-1] * 5, [-1] * 5, go, [1, 1, 1, 1, -1], [1, 1, 1, 0, -1]])
    exits = evaluate(grounded, choices)
    assert exits[grounded.place("Go(middle)")].value[3] == -np.inf
    assert exits[grounded.root].value.tolist() == pytest.approx([-16 / 3, -4, -8 / 3, -np.inf, 0])


def test_a_task_may_not_choose_what_is_not_available() -> None:
    """At its end Go(middle) runs no longer; the message names task, call and state."""
    grounded = _two_legs(_slippery(3))
    children = evaluate(grounded, np.full((5, 3), -1))
    with pytest.raises(ValueError, match=r"Go\(middle\) chooses its call 1 in state 1, where it is not"):
        task_exits(grounded.node("Go(middle)"), np.array([1, 1, -1]), children)


def _followed(
    terminal: NDArray[np.bool_], choice: NDArray[np.int64], parts: list[Exits]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Follow a policy for 400 calls, adding up: value and kernel without a linear system."""
    states = choice.size
    value, ends, now = np.zeros(states), np.zeros((states, states)), np.diag((choice >= 0).astype(float))
    reward, move = np.zeros(states), np.zeros((states, states))
    for s, k in enumerate(choice):
        if k >= 0:
            reward[s], move[s] = parts[k].value[s], parts[k].kernel.toarray()[s]
    for _ in range(400):
        value += now @ reward
        now = now @ move
        ends += now * terminal
    return value, ends


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_exits_are_what_following_the_policy_adds_up_to(data: st.DataObject) -> None:
    """On random worlds, two tasks deep: the linear systems give what 400 calls in sequence give."""
    model, gamma = data.draw(models(least=-4, most=4)), 0.9
    states, index = model.index.size, model.index
    number = st.integers(0, states - 1)
    graph = TaskGraph("random", index.variables, model.actions)
    (x,) = graph.variables
    end, last = data.draw(st.sets(number, min_size=1)), data.draw(number)
    low = graph.task("Low", until=x.isin(sorted(end)), uses=[x], do="a b")
    graph.task("Root", until=x.eq(last), uses=[x], do=["b", low(), "a"])
    grounded = ground(graph, model)
    choices = np.full((4, states), -1)
    for place in (2, 3):
        for s in range(states):
            able = [k for k, call in enumerate(grounded.nodes[place].calls) if call.available[s]]
            choices[place, s] = data.draw(st.sampled_from(able)) if able else -1
    found = list(evaluate(grounded, choices, gamma))
    for place in (2, 3):
        node = grounded.nodes[place]
        parts = [found[call.child] for call in node.calls]
        value, kernel = _followed(node.terminal, choices[place], parts)
        assert found[place].value == pytest.approx(value, abs=1e-9)
        assert found[place].kernel.toarray() == pytest.approx(kernel, abs=1e-9)


def test_a_primitive_action_ends_where_it_leads() -> None:
    """Outcomes that lead to the same state add up, and one that does not occur is not stored."""
    index = StateIndex((Variable("x", (0, 1)),))
    outcomes = np.array([[[1, 1, 0]], [[0, 0, 1]]])
    chances = np.array([[[0.25, 0.5, 0.25]], [[1.0, 0, 0]]])
    rewards = np.array([[[4.0, 0, 8]], [[1.0, 50, 50]]])
    model = TransitionModel(index, ("a",), outcomes, rewards, np.ones(2, np.bool_), probabilities=chances)
    exits = primitive_exits(model, 0, gamma=0.5)
    assert exits.value.tolist() == [3, 1]
    assert exits.kernel.toarray().tolist() == [[0.125, 0.375], [0.5, 0]]
    assert exits.kernel.nnz == 3
