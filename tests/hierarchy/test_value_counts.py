import numpy as np
import pytest

from hierarchy import Param, TaskGraph, ground, two_rooms, value_counts
from worlds import StateIndex, TransitionModel, Variable, load_layout, maze_model, parse_layout

SMALL = """\
name small
grid
.   T1  |  .   .
T2  .   :  D1  G1
start 0,0
trigger T1
goal G1
"""


def test_the_paper_s_counts() -> None:
    """Section 5.3: 512 + 256 + 512 + 4 = 1284 against 4096; 12288 as printed, 16384 by its own words."""
    layout = load_layout("two_rooms")
    counts = value_counts(ground(two_rooms(layout), maze_model(layout)), ignoring=["doors"])
    assert counts.per_task == {"GotoTrigger": 512, "GotoDoor": 256, "GotoGoal": 512}
    assert counts.leaves == 4
    assert counts.abstracted == 1284
    assert counts.flat == 4096
    assert counts.flat_markov == 8192
    assert counts.unabstracted_tasks == 12288
    assert counts.unabstracted_subtasks == 16384


def test_live_and_root_counts() -> None:
    """31 live grids for each target, 32 on the way to a door; the root stores 16 + 4 + 4 + 1 values."""
    layout = load_layout("two_rooms")
    counts = value_counts(ground(two_rooms(layout), maze_model(layout)))
    assert counts.per_task_live == {"GotoTrigger": 31 * 4 * 4, "GotoDoor": 32 * 2 * 4, "GotoGoal": 31 * 4 * 4}
    assert counts.root == 16 + 4 + 4 + 1
    assert counts.flat == counts.flat_markov == 8192, "nothing ignored"


def test_one_door_task_halves_the_values_of_goto_door() -> None:
    """Without its parameter GotoDoor stores 32 x 4 values; its edge then depends on the goal and more."""
    layout = load_layout("two_rooms")
    counts = value_counts(ground(two_rooms(layout, one_door_task=True), maze_model(layout)))
    assert counts.per_task == {"GotoTrigger": 512, "GotoDoor": 128, "GotoGoal": 512}


def test_a_small_maze_by_hand() -> None:
    """Two rooms of 4 grids, 2 triggers, 1 goal, 1 door.

    Flat: 8 x 2 x 1 x 4 = 64, doors included 128. GotoTrigger: 4 x 2 x 4 = 32, of which 3 + 3 grids are
    live. GotoDoor: 4 x 1 x 4 = 16. GotoGoal: the goal's own grid never occurs, 3 x 1 x 4 = 12. The root:
    2 + 1 + 1. Without abstraction: 64 x 3 tasks, and 64 x 3 calls.
    """
    layout = parse_layout(SMALL)
    counts = value_counts(ground(two_rooms(layout), maze_model(layout)), ignoring=["doors"])
    assert (counts.flat, counts.flat_markov) == (64, 128)
    assert counts.per_task == {"GotoTrigger": 32, "GotoDoor": 16, "GotoGoal": 12}
    assert counts.per_task_live == {"GotoTrigger": 24, "GotoDoor": 16, "GotoGoal": 12}
    assert counts.root == 4
    assert counts.leaves == 4
    assert counts.abstracted == 64
    assert (counts.unabstracted_tasks, counts.unabstracted_subtasks) == (192, 192)


@pytest.mark.parametrize("action", [0, 3])
def test_a_reward_that_depends_on_the_state_takes_a_value_each(action: int) -> None:
    """Leaf irrelevance (equation 7) keeps one value of an action for each reward that it may bring."""
    layout = parse_layout(SMALL)
    model = maze_model(layout)
    rewards = model.rewards.copy()
    rewards[np.flatnonzero(model.reachable())[0], action] = -2.0
    uneven = ground(
        two_rooms(layout),
        TransitionModel(model.index, model.actions, model.successors, rewards, model.starts),
    )
    assert value_counts(uneven).leaves == 3 + 2


def test_another_world_by_hand() -> None:
    """A corridor of 5 cells, 2 actions, 2 targets: 5 x 2 x 2 values, of which 4 + 4 cells are live.

    The root stores 2 values for the call that its guard allows in 2 cells, and 4 for the action.
    """
    x = np.arange(5)
    index = StateIndex((Variable("x", (0, 1, 2, 3, 4)),))
    successors = np.stack([np.maximum(x - 1, 0), np.minimum(x + 1, 4)], axis=1)
    model = TransitionModel(index, ("left", "right"), successors, np.full((5, 2), -1.0), x < 4)
    graph = TaskGraph("corridor", index.variables, model.actions)
    (pos,) = graph.variables
    to = Param.over("to", {"near": 0, "far": 4})
    go = graph.task("Go", to, until=pos.eq(to), uses=[pos], do="left right")
    low = pos.isin([0, 1])
    calls = [go(to=4).when(low), go(to=0).when(pos.eq(3)), "right"]
    graph.task("Root", until=pos.eq(4), uses=[pos], do=calls)
    counts = value_counts(ground(graph, model))
    assert counts.flat == counts.flat_markov == 10
    assert counts.per_task == {"Go": 20}
    assert counts.per_task_live == {"Go": 16}
    assert counts.root == 2 + 1 + 4
    assert (counts.leaves, counts.abstracted) == (2, 22)
    assert (counts.unabstracted_tasks, counts.unabstracted_subtasks) == (10, 30)
