from dataclasses import replace
from typing import Any

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from strategies import ACTION_NUMBERS, maze_layouts

from worlds import (
    ACTIONS,
    Cell,
    Episode,
    Layout,
    MazeState,
    StateIndex,
    StochasticModelError,
    TransitionModel,
    Variable,
    load_layout,
    maze_model,
    state_number,
)


def _graph(layout: Layout) -> nx.DiGraph:
    successors = maze_model(layout).successors
    return nx.DiGraph((s, int(to)) for s, row in enumerate(successors) for to in row)


def test_two_rooms_has_the_paper_s_states() -> None:
    """64 positions x 4 triggers x 4 goals x 2 for the doors, 4 actions, -1 a step."""
    model = maze_model(load_layout("two_rooms"))
    assert model.index.shape == (64, 4, 4, 2)
    assert model.successors.shape == (2048, 4)
    assert model.actions == ("North", "South", "West", "East")
    assert (model.rewards == -1.0).all()


def test_episodes_start_in_room_a_off_the_trigger_with_doors_shut() -> None:
    """31 cells for each of the 16 pairs of trigger and goal."""
    layout = load_layout("two_rooms")
    model = maze_model(layout)
    states = [model.index.state(int(number)) for number in np.flatnonzero(model.starts)]
    assert len(states) == 31 * 16
    assert all(robot in layout.rooms["A"] and robot != trigger for robot, trigger, _, _ in states)
    assert {doors for *_, doors in states} == {"closed"}


def test_the_step_on_to_the_trigger_opens_the_doors() -> None:
    """From 5,1 South leads to T4 = 6,1 and, only for that trigger, to open doors."""
    layout = load_layout("two_rooms")
    model = maze_model(layout)
    for name, doors in (("T4", "open"), ("T1", "closed")):
        state = (Cell(5, 1), layout.triggers[name], layout.goals["G2"], "closed")
        after = model.successors[model.index.number(state), ACTIONS.index("South")]
        assert model.index.state(int(after)) == (Cell(6, 1), *state[1:3], doors)


@settings(max_examples=40, deadline=None)
@given(maze_layouts(most=4), st.data())
def test_reachable_is_networkx_descendants(layout: Layout, data: st.DataObject) -> None:
    """From any set of states, the model finds what networkx finds."""
    model = maze_model(layout)
    starts = np.zeros(model.index.size, dtype=np.bool_)
    chosen = data.draw(st.lists(st.integers(0, model.index.size - 1), max_size=3))
    starts[chosen] = True
    graph = _graph(layout)
    expected = set(chosen).union(*(nx.descendants(graph, s) for s in chosen))
    assert set(np.flatnonzero(model.reachable(starts))) == expected


@settings(max_examples=20, deadline=None)
@given(maze_layouts(most=4))
def test_every_pair_can_be_solved_from_every_start(layout: Layout) -> None:
    """By default reachable states are those from the starts, and hold each goal with doors open."""
    model = maze_model(layout)
    before = model.starts.copy()
    reached = model.reachable()
    assert (model.starts == before).all()
    for trigger in layout.triggers.values():
        for goal in layout.goals.values():
            assert reached[model.index.number((goal, trigger, goal, "open"))]


@settings(max_examples=60, deadline=None)
@given(maze_layouts(most=4), st.lists(ACTION_NUMBERS, max_size=25))
def test_the_model_agrees_with_an_episode_without_obstacles(layout: Layout, actions: list[int]) -> None:
    """Each step of an episode leads to the successor that the model names."""
    model = maze_model(layout)
    episode = Episode(layout, "T1", "G1", layout.start)
    number = state_number(layout, model.index, episode.state)
    assert model.starts[number]
    for action in actions:
        episode.step(action)
        number = int(model.successors[number, action])
        assert number == state_number(layout, model.index, episode.state)


def test_a_state_s_number_leaves_obstacles_out() -> None:
    """Cubes and spheres do not change the number."""
    layout = load_layout("two_rooms")
    index = maze_model(layout).index
    bare = MazeState(robot=8, trigger=49, goal=31)
    crowded = replace(bare, cubes=frozenset({1}), spheres=frozenset({2}))
    expected = index.number((Cell(1, 0), Cell(6, 1), Cell(3, 7), "closed"))
    assert state_number(layout, index, bare) == state_number(layout, index, crowded) == expected


def _changed(model: TransitionModel, **changes: NDArray[Any]) -> TransitionModel:
    """Return a deterministic model with some of its arrays replaced."""
    arrays: dict[str, NDArray[Any]] = {
        "successors": model.successors,
        "rewards": model.rewards,
        "starts": model.starts,
    }
    return TransitionModel(model.index, model.actions, **(arrays | changes))


@pytest.mark.parametrize(
    ("field", "shape", "message"),
    [
        ("successors", (2048, 3), "successors needs shape"),
        ("rewards", (2048, 3), "need the shape of successors"),
        ("starts", (2047,), r"starts needs shape \(states,\) = \(2048,\)"),
    ],
)
def test_arrays_of_the_wrong_shape_are_refused(field: str, shape: tuple[int, ...], message: str) -> None:
    """The error gives the shape wanted."""
    model = maze_model(load_layout("two_rooms"))
    with pytest.raises(ValueError, match=message):
        _changed(model, **{field: np.zeros(shape, dtype=getattr(model, field).dtype)})


@pytest.mark.parametrize("wrong", [-1, 2048])
def test_a_successor_that_is_no_state_is_refused(wrong: int) -> None:
    """Numbers run from 0 to the number of states less one."""
    model = maze_model(load_layout("two_rooms"))
    successors = model.successors.copy()
    successors[5, 2] = wrong
    with pytest.raises(ValueError, match="successors must be state numbers, 0 to 2047"):
        _changed(model, successors=successors)


def test_a_stochastic_model_by_hand() -> None:
    """A coin that sticks or turns: expectations, what may and must follow, and what is refused."""
    index = StateIndex((Variable("coin", ("heads", "tails")),))
    successors = np.array([[[0, 1], [0, 0]], [[1, 0], [0, 0]]])
    chances = np.array([[[0.5, 0.5], [1.0, 0.0]], [[0.9, 0.1], [1.0, 0.0]]])
    rewards = np.array([[[0.0, 2.0], [1.0, 9.0]], [[0.0, 2.0], [1.0, 9.0]]])
    heads = np.array([True, False])
    model = TransitionModel(index, ("toss", "set"), successors, rewards, heads, probabilities=chances)
    assert not model.is_deterministic
    assert model.rewards.tolist() == [[1.0, 1.0], [0.2, 1.0]]
    assert model.expectation(np.array([10.0, 0.0])).tolist() == [[5.0, 10.0], [1.0, 10.0]]
    assert model.may_reach(~heads).tolist() == [[True, False], [True, False]]
    assert model.must_reach(heads).tolist() == [[False, True], [False, True]]
    assert model.following(heads, 0).tolist() == [0, 1]
    assert model.reachable().all()
    assert (
        TransitionModel(index, ("set",), np.array([[0], [0]]), np.zeros((2, 1)), heads).reachable().sum() == 1
    )
    with pytest.raises(StochasticModelError, match="several outcomes"):
        _ = model.successors
    with pytest.raises(ValueError, match="sum to 1"):
        TransitionModel(index, ("toss", "set"), successors, rewards, heads, probabilities=chances / 2)
