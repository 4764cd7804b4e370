from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from beliefs import any_maze_graph
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from strategies import maze_layouts

from hierarchy import ground, two_rooms
from planners import UNREACHED, Field, certify, distance_field, flat_field, task_field
from worlds import load_layout, maze_model

Problem = tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]


@st.composite
def _problems(draw: st.DrawFn) -> Problem:
    """Draw any successors, goals (perhaps none) and allowed actions."""
    states, actions = draw(st.integers(1, 12)), draw(st.integers(1, 3))
    successors = draw(arrays.arrays(np.int64, (states, actions), elements=st.integers(0, states - 1)))
    goal = draw(arrays.arrays(np.bool_, states))
    allowed = draw(arrays.arrays(np.bool_, (states, actions)))
    return successors, goal, allowed


@st.composite
def _maze_fields(draw: st.DrawFn) -> Field:
    layout = draw(maze_layouts(most=4))
    model = maze_model(layout)
    grounded = ground(any_maze_graph(layout), model)
    if draw(st.booleans()):
        return task_field(model, grounded.node("Near"))
    return flat_field(model, grounded.nodes[grounded.root].terminal)


FIELDS = st.one_of(_problems().map(lambda problem: distance_field(*problem)), _maze_fields())


def _by_networkx(field: Field) -> list[int]:
    """Return every state's distance to the nearest goal, on the reversed graph of allowed moves."""
    states, actions = field.successors.shape
    graph: nx.DiGraph = nx.DiGraph()
    graph.add_nodes_from(range(states))
    graph.add_edges_from(
        (int(field.successors[s, a]), s) for s in range(states) for a in range(actions) if field.allowed[s, a]
    )
    goals = {int(s) for s in np.flatnonzero(field.goal)}
    if not goals:
        return [UNREACHED] * states
    found = nx.multi_source_dijkstra_path_length(graph, goals)
    return [int(found.get(s, UNREACHED)) for s in range(states)]


def _by_scipy(field: Field) -> NDArray[np.int64]:
    states, actions = field.successors.shape
    source = np.repeat(np.arange(states), actions)[field.allowed.ravel()]
    target = field.successors.ravel()[field.allowed.ravel()]
    backwards = csr_array((np.ones(source.size), (target, source)), shape=(states, states))
    found = dijkstra(backwards, indices=np.flatnonzero(field.goal), unweighted=True, min_only=True)
    return np.where(np.isinf(found), UNREACHED, found).astype(np.int64)


@settings(max_examples=150, deadline=None)
@given(FIELDS)
def test_distances_are_networkx_s_shortest_paths(field: Field) -> None:
    """Steps to the nearest goal, and no way found exactly where networkx finds none."""
    assert field.distance.tolist() == _by_networkx(field)


@settings(max_examples=100, deadline=None)
@given(FIELDS)
def test_distances_are_scipy_s_shortest_paths(field: Field) -> None:
    """The same as Dijkstra's algorithm of scipy.sparse.csgraph from all goals at once."""
    assume(field.goal.any())
    assert np.array_equal(field.distance, _by_scipy(field))


@settings(max_examples=100, deadline=None)
@given(FIELDS)
def test_optimal_first_actions_lead_one_step_nearer(field: Field) -> None:
    """The set, ties included, of the allowed actions whose successor networkx finds one step nearer."""
    distance = _by_networkx(field)
    optimal = field.optimal()
    for state, row in enumerate(field.successors.tolist()):
        expected = {
            a
            for a, after in enumerate(row)
            if field.allowed[state, a] and distance[state] > 0 and distance[after] == distance[state] - 1
        }
        assert set(np.flatnonzero(optimal[state]).tolist()) == expected
        assert bool(expected) == (distance[state] > 0)


@settings(max_examples=100, deadline=None)
@given(FIELDS)
def test_a_right_field_has_no_fault(field: Field) -> None:
    """The certificate of every searched field is accepted."""
    assert certify(field) == ()


@settings(max_examples=300, deadline=None)
@given(FIELDS, st.data())
def test_any_wrong_distance_is_found(field: Field, data: st.DataObject) -> None:
    """One entry changed to any other value, UNREACHED included, is a fault."""
    state = data.draw(st.integers(0, field.distance.size - 1))
    value = data.draw(st.integers(-3, int(field.distance.max()) + 3))
    assume(value != field.distance[state])
    wrong = field.distance.copy()
    wrong[state] = value
    assert certify(replace(field, distance=wrong))


@settings(max_examples=100, deadline=None)
@given(FIELDS, st.data())
def test_any_wrong_goal_is_found(field: Field, data: st.DataObject) -> None:
    """A goal added or forgotten, distances as they were, is a fault."""
    wrong = field.goal.copy()
    wrong[data.draw(st.integers(0, field.goal.size - 1))] ^= True
    assert certify(replace(field, goal=wrong))


def _chain() -> Field:
    """Return 0 - 1 - 2 - 3 with the goal at 3, and an island 4."""
    successors = np.array([[0, 1], [0, 2], [1, 3], [2, 3], [4, 4]])
    return distance_field(successors, np.arange(5) == 3, np.ones((5, 2), np.bool_))


@pytest.mark.parametrize(
    ("distance", "fault"),
    [
        ([3, 2, 1, 1, -1], "distance 0 and the goal differ: state 3"),
        ([3, 2, 0, 0, -1], "distance 0 and the goal differ: state 2"),
        ([4, 3, 1, 0, -1], "a step leads below distance - 1: state 1"),
        ([2, 2, 1, 0, -1], "no step leads to distance - 1: state 0"),
        ([3, 2, 1, 0, 1], "no step leads to distance - 1: state 4"),
        ([-1, 2, 1, 0, -1], "an unreached state has a step to a reached one: state 0"),
        ([3, 2, 1, 0, -2], "a distance is negative: state 4"),
    ],
)
def test_faults_are_named(distance: list[int], fault: str) -> None:
    """Each way of being wrong, worked out by hand, has its words and its state."""
    field = _chain()
    assert field.distance.tolist() == [3, 2, 1, 0, UNREACHED]
    assert fault in certify(replace(field, distance=np.array(distance)))


def test_a_forbidden_action_is_no_way() -> None:
    """Without the step to the right out of 1, states 0 and 1 are cut off and have no optimal action."""
    field = _chain()
    allowed = field.allowed.copy()
    allowed[1, 1] = False
    cut = distance_field(field.successors, field.goal, allowed)
    assert cut.distance.tolist() == [UNREACHED, UNREACHED, 1, 0, UNREACHED]
    assert not cut.optimal()[[0, 1, 3, 4]].any()
    assert cut.optimal()[2].tolist() == [False, True]


def test_a_field_needs_primitive_actions() -> None:
    """A task that calls tasks is refused, and the error says what solves it."""
    layout = load_layout("two_rooms")
    model = maze_model(layout)
    grounded = ground(two_rooms(layout), model)
    with pytest.raises(ValueError, match=r"Root calls tasks; .* primitive actions only"):
        task_field(model, grounded.nodes[grounded.root])
