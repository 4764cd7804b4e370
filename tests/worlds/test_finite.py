from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from worlds import TransitionModel, UserError, Variable, WorldError, finite_world

X, DOOR = Variable("x", (0, 1, 2)), Variable("door", ("shut", "open"))


def _stay(state: Any, _: str) -> tuple[Any, float]:
    return state, 0


def _occurring(model: TransitionModel, state: int, action: int) -> dict[tuple[int, float], float]:
    """Return the outcomes that occur, with their probabilities."""
    columns = model.outcomes, model.outcome_rewards, model.probabilities
    listed = zip(*(column[state, action].tolist() for column in columns), strict=True)
    return {(to, reward): chance for to, reward, chance in listed if chance > 0}


def test_a_corridor_by_hand() -> None:
    """Each action's outcomes stand where the index says; what is short of outcomes is filled up."""

    def outcomes(state: Any, action: str) -> Any:
        if action == "push":
            return [(0.75, {"door": "open"}, 5), (0.25, state, -1)]
        return state._replace(x=min(state.x + 1, 2)), -1

    model = finite_world([X, DOOR], "right push", outcomes, starts=[{"x": 0, "door": "shut"}])
    assert model.actions == ("right", "push")
    assert _occurring(model, 0, 0) == {(2, -1.0): 1.0}  # from x = 0, shut to x = 1, shut
    assert _occurring(model, 2, 1) == {(3, 5.0): 0.75, (2, -1.0): 0.25}
    assert model.starts.tolist() == [True, False, False, False, False, False]
    assert model.following(np.arange(6) == 0, 0).tolist() == [2]


def test_a_world_without_chance_is_deterministic() -> None:
    """One outcome each needs no probabilities, and outcomes that never occur do not count."""
    model = finite_world([X], ["go"], lambda s, _: [(1, s, 0), (0, {"x": 0}, 5)], lambda s: s.x < 2)
    assert model.is_deterministic
    assert model.successors[:, 0].tolist() == [0, 1, 2]
    assert model.starts.tolist() == [True, True, False]


def test_equal_outcomes_are_added_up() -> None:
    """Three thirds that lead to the same state at the same reward are one outcome."""
    model = finite_world([X], ["go"], lambda *_: [(1 / 3, (2,), 1)] * 3, lambda _: True)
    assert model.is_deterministic
    assert model.rewards[0, 0] == pytest.approx(1)


def test_equal_states_at_different_rewards_stay_apart() -> None:
    """A reward of 0 or 10 is not one of 5."""
    model = finite_world([X], ["go"], lambda *_: [(0.5, (2,), 0), (0.5, (2,), 10)], lambda _: True)
    assert _occurring(model, 0, 0) == {(2, 0.0): 0.5, (2, 10.0): 0.5}


def test_where_an_episode_ends_nothing_is_asked() -> None:
    """Such a state keeps to itself at no reward."""
    asked = set()

    def outcomes(state: Any, _: str) -> tuple[Any, float]:
        asked.add(state.x)
        return {"x": state.x + 1}, -1

    model = finite_world([X], ["go"], outcomes, [(0,)], ends=lambda state: state.x == 2)
    assert asked == {0, 1}
    assert model.successors[:, 0].tolist() == [1, 2, 2]
    assert model.rewards[:, 0].tolist() == [-1, -1, 0]


@st.composite
def _tables(draw: st.DrawFn) -> list[list[list[tuple[float, int, float]]]]:
    """Draw outcomes of 4 states and 2 actions."""
    outcome = st.tuples(st.integers(1, 5), st.integers(0, 3), st.integers(-3, 3).map(float))
    row = st.lists(st.lists(outcome, min_size=1, max_size=3), min_size=2, max_size=2)
    rows = draw(st.lists(row, min_size=4, max_size=4))
    return [
        [[(weight / sum(w for w, *_ in found), to, reward) for weight, to, reward in found] for found in line]
        for line in rows
    ]


@settings(max_examples=50, deadline=None)
@given(_tables())
def test_the_model_is_the_table_that_was_given(table: list[list[list[tuple[float, int, float]]]]) -> None:
    """Expected rewards and the chances of each next state are those of the table."""
    a, b = Variable("a", (0, 1)), Variable("b", (0, 1))

    def outcomes(state: Any, action: str) -> Any:
        found = table[2 * state.a + state.b][int(action)]
        return [(chance, divmod(to, 2), reward) for chance, to, reward in found]

    model = finite_world([a, b], "0 1", outcomes, lambda _: True)
    for state, action in np.ndindex(4, 2):
        found = table[state][action]
        assert model.rewards[state, action] == pytest.approx(sum(p * r for p, _, r in found))
        for to in range(4):
            chance = model.expectation(np.eye(4)[to])[state, action]
            assert chance == pytest.approx(sum(p for p, after, _ in found if after == to))


@pytest.mark.parametrize(
    ("outcomes", "message"),
    [
        (lambda *_: [(0.5, (0,), 1)], r"state x = 1, action go: the probabilities sum to 0.5, not to 1"),
        (lambda *_: [], r"the probabilities sum to 0, not to 1"),
        (lambda *_: [(1.5, (0,), 1), (-0.5, (1,), 1)], r"the probability 1.5 is not between 0 and 1"),
        (lambda *_: [(float("nan"), (0,), 1)], r"the probability nan is not between 0 and 1"),
        (lambda *_: ((7,), 1), r"x would be 7, which is outside its domain; its values are 0, 1, 2"),
        (lambda *_: ({"x": 7}, 1), r"x would be 7, which is outside its domain"),
        (lambda *_: ({"x": [1]}, 1), r"x would be \[1\], which is outside its domain"),
        (lambda *_: ({"xx": 1}, 1), r"there is no variable 'xx'; did you mean 'x'\?"),
        (lambda *_: ((0, 1), 1), r"\(0, 1\) is no state; give 1 values: x"),
        (lambda *_: (0, 1), r"0 is no state; give 1 values: x"),
        (lambda *_: ((0,), float("inf")), r"the reward inf is not a finite number"),
        (lambda *_: [(1.0, (0,), "much")], r"the reward 'much' is not a finite number"),
        (lambda *_: None, r"the outcomes are None; return \(next state, reward\), or a list"),
        (lambda *_: [(0,)], r"an outcome is \(0,\); return"),
    ],
)
def test_wrong_outcomes_are_refused(outcomes: Callable[..., Any], message: str) -> None:
    """The error names the state and the action, what is wrong, and the mend."""

    def only_at_1(state: Any, action: str) -> Any:
        return outcomes() if state.x == 1 else _stay(state, action)

    with pytest.raises(WorldError, match=message) as caught:
        finite_world([X], ["stop", "go"], lambda s, a: only_at_1(s, a) if a == "go" else _stay(s, a), [(0,)])
    assert str(caught.value).startswith("state x = 1, action go: ")
    assert isinstance(caught.value, UserError)


@pytest.mark.parametrize(
    ("starts", "message"),
    [
        ([], "no state is a start"),
        (lambda _: False, "no state is a start"),
        ([(9,)], r"start \(9,\): x would be 9"),
        ([{}], r"start \{\}: no value for x; give a start all its values"),
    ],
)
def test_wrong_starts_are_refused(starts: Any, message: str) -> None:
    """An episode must begin somewhere, in a state of the world."""
    with pytest.raises(WorldError, match=message):
        finite_world([X], ["go"], _stay, starts)


@pytest.mark.parametrize("name", ["two words", "class", "_x"])
def test_a_name_that_is_no_field_is_refused(name: str) -> None:
    """States are named tuples, which have rules for names."""
    with pytest.raises(WorldError, match=f"variable '{name}'"):
        finite_world([Variable(name, (0,))], ["go"], _stay, lambda _: True)


@pytest.mark.parametrize("actions", ["", "go go"])
def test_actions_need_names_of_their_own(actions: str) -> None:
    """None at all, or two alike, would make no model."""
    with pytest.raises(WorldError, match="give at least one, and each a name of its own"):
        finite_world([X], actions, _stay, lambda _: True)


def test_an_error_in_the_user_s_function_says_where() -> None:
    """It keeps its type and traceback, and gains a note."""
    with pytest.raises(ZeroDivisionError) as caught:
        finite_world([X], ["go"], lambda s, _: (s, 1 / s.x), lambda _: True)
    assert caught.value.__notes__ == ["while the outcomes were asked for in state x = 0, action go"]
