"""The four rooms' task graph: what its options are, and what going by them costs."""

import numpy as np
import pytest

from hierarchy import GroundGraph, check, ground, prove_abstraction
from hierarchy.four_rooms import four_rooms_graph
from hierarchy.text import load_graph, load_world
from planners import flat_optimum, hierarchical_optimum, recursive_optimum
from worlds.four_rooms import AREAS, CELLS, DOORS, FIRST_GOAL, HALLWAYS, Rules, four_rooms_model, starts_for

_WORLDS: tuple[tuple[str, Rules, float], ...] = (
    ("four_rooms", "bacon", 1 / 3),
    ("four_rooms-sutton", "sutton", 1 / 3),
    ("four_rooms-sure", "bacon", 0.0),
)


def _grounded(name: str = "four_rooms") -> GroundGraph:
    return ground(four_rooms_graph(), load_world(name).model())


def test_the_shipped_text_is_the_same_graph() -> None:
    """four_rooms.yaml says what four_rooms_graph declares, in the same order."""
    graph, world = load_graph("four_rooms")
    assert graph.tasks == four_rooms_graph().tasks
    assert list(graph.tasks) == list(four_rooms_graph().tasks)
    assert world.name == "four_rooms"


@pytest.mark.parametrize(("name", "rules", "slip"), _WORLDS)
def test_worlds_by_name_pass_the_check(name: str, rules: Rules, slip: float) -> None:
    """The model is the one of these rules, and the graph has no findings on it."""
    model, named = four_rooms_model(rules=rules, slip=slip), load_world(name).model()
    assert (named.outcomes == model.outcomes).all()
    assert (named.probabilities == model.probabilities).all()
    assert check(four_rooms_graph(), named) == ()


def test_options_are_the_eight_published_ones() -> None:
    """From a room and its other hallway to a hallway; over there, at it, and elsewhere outside the room."""
    grounded = _grounded()
    robots = grounded.model.index.column("robot")
    for room, halls in DOORS.items():
        for name in halls:
            node = grounded.node(f"Leave{room}({name})")
            begins = {CELLS[robot] for robot in robots[node.initiation]}
            assert begins == AREAS[room] - {HALLWAYS[name]}
            assert {CELLS[robot] for robot in robots[node.terminal]} == set(CELLS) - begins
            over = next(other for other in DOORS if other != room and name in DOORS[other])
            assert {CELLS[robot] for robot in robots[node.goal]} == AREAS[over] - begins
    assert len([node for node in grounded.nodes if node.task.startswith("Leave")]) == 8


def test_only_the_goal_s_own_room_knows_the_goal() -> None:
    """GotoGoal runs where robot and goal share a room; moving the goal changes no way to a hallway."""
    grounded = _grounded()
    shape = grounded.model.index.shape
    live = grounded.node("GotoGoal").live.reshape(shape)
    for i, robot in enumerate(CELLS):
        for j, goal in enumerate(CELLS):
            together = any(robot in area and goal in area for area in AREAS.values())
            assert live[i, j] == (together and robot != goal)
    solution = recursive_optimum(grounded)
    for place, node in enumerate(grounded.nodes):
        ways = solution.choice[place].reshape(shape)
        if node.task.startswith("Leave"):
            assert (ways == ways[:, :1]).all()
        elif node.calls:
            assert (ways != ways[:, :1]).any()


@pytest.mark.parametrize(
    ("name", "first", "lost", "worst", "short"),
    [
        ("four_rooms", 8.39249, 0.00009, 0.45467, 300),
        pytest.param("four_rooms-sutton", 15.01642, 0.00474, 1.46431, 10359, marks=pytest.mark.slow),
        ("four_rooms-sure", 7.59223, 0.0, 0.0, 0),
    ],
)
def test_what_the_hierarchy_costs(name: str, first: float, lost: float, worst: float, short: int) -> None:
    """Nothing, if tasks look beyond their end; a little, if they do not and moves slip.

    `first` and `lost` are means over the starts with the goal in the east hallway, of the recursive optimum
    in steps and of what it loses; `worst` and `short` are over all starts and goals.
    """
    grounded = _grounded(name)
    model, root = grounded.model, grounded.root
    here, starts = starts_for(model.index, FIRST_GOAL), model.starts
    best = flat_optimum(model, grounded.nodes[root].terminal).value
    assert hierarchical_optimum(grounded).value[0, starts] == pytest.approx(best[starts], abs=1e-9)
    recursive = recursive_optimum(grounded).value[root]
    assert -recursive[here].mean() == pytest.approx(first, abs=5e-6)
    gap = best - recursive
    assert gap[here].mean() == pytest.approx(lost, abs=5e-6)
    assert gap[starts].max() == pytest.approx(worst, abs=5e-6)
    assert np.count_nonzero(gap[starts] > 1e-9) == short


@pytest.mark.slow
def test_state_abstraction_is_safe() -> None:
    """All of the graph's tables hold what they must, for every policy."""
    assert "45 of 45 tables proved safe for every policy" in str(prove_abstraction(_grounded()))
