"""Flat Q-learning held to the flat optimum."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from learning_worlds import corridor, exact, two_exits

from hierarchy import TaskGraph, ground, two_rooms
from planners import Exploration, FlatQ, HarmonicRate, LearningRate, MaxQ, Settings, flat_field, flattened
from planners.learner import Step
from worlds import maze_model, parse_layout

SMALL = """\
name small
grid
.   .   .  |  G1  .
.   X   .  :  D1  .
.   .   T1 |  .   .
start 0,0
trigger T1
goal G1
"""


def test_one_step_by_hand() -> None:
    """Q(s, a) <- Q + alpha (r + gamma max Q(s', .) - Q): from -2 to -2 + (-1 - 4/2 + 2) / 2."""
    learner = FlatQ(two_exits(), (0,), Settings(gamma=0.5))
    left, right = learner.table[learner.grounded.root]
    right[2], left[3], right[3] = -2.0, -6.0, -4.0
    learner._learn(learner.grounded.root, 1, [Step(2, -1.0)], 3, 0.5)
    assert right[2] == -2.5


def test_it_learns_the_flat_optimum_of_a_maze() -> None:
    """From every start of a maze with two rooms, the steps and values of the oracle's field."""
    layout = parse_layout(SMALL)
    model = maze_model(layout)
    grounded = ground(two_rooms(layout), model)
    learner = FlatQ(grounded, (3,), Settings(rate=LearningRate(1.0, 1.0), exploration=Exploration(300)))
    starts = np.flatnonzero(model.starts).tolist()
    learner.train(learner.grounded.root, starts, episodes=600)
    best = flat_field(model, grounded.nodes[grounded.root].terminal).distance
    for start in starts:
        assert learner.value(learner.grounded.root, start) == -best[start]
        assert learner.greedy_steps(learner.grounded.root, start) == best[start]


def test_it_is_free_of_the_hierarchy_s_shortcomings() -> None:
    """Where MAXQ-0 quits early and goes six steps, flat Q-learning goes four."""
    grounded = two_exits()
    hierarchical, flat = MaxQ(grounded, (0,)), FlatQ(grounded, (0,))
    for learner in (hierarchical, flat):
        learner.train(learner.grounded.root, [1, 2, 3, 4], episodes=1500)
    assert hierarchical.greedy_steps(grounded.root, 1) == 6
    assert flat.greedy_steps(flat.grounded.root, 1) == 4


@given(st.floats(0, 0.4), st.integers(4, 8))
def test_the_flattened_graph_keeps_the_root_and_the_world(slip: float, cells: int) -> None:
    """Its root ends where the root ends, runs where it runs, and may take any action there."""
    grounded = two_exits(cells, slip=slip)
    flat = flattened(grounded)
    root, old = flat.nodes[flat.root], grounded.nodes[grounded.root]
    assert flat.model is grounded.model
    assert [node.name for node in flat.nodes] == [*grounded.model.actions, "Root"]
    for name in ("terminal", "live", "goal", "initiation"):
        assert (getattr(root, name) == getattr(old, name)).all()
    assert all((call.available == root.live).all() and call.rows == cells for call in root.calls)


def test_the_flattened_root_keeps_all_that_the_root_says() -> None:
    """Goal, pseudo-reward, working space and initiation as well as its termination."""
    model = corridor(8)
    graph = TaskGraph("all said", model.index.variables, model.actions)
    (x,) = graph.variables
    graph.task(
        "Root",
        until=x.isin([1, 5]),
        goal=x.eq(5),
        pseudo_reward=-9.0,
        within=x.isin(range(1, 7)),
        start=~x.eq(3),
        uses=[x],
        do="right",
    )
    old = ground(graph, model)
    flat = flattened(old)
    root = flat.nodes[flat.root]
    for name in ("terminal", "live", "goal", "initiation"):
        assert (getattr(root, name) == getattr(old.nodes[old.root], name)).all()
    assert root.pseudo_reward == -9.0
    left, right = root.calls
    assert np.flatnonzero(left.available).tolist() == [2, 3, 4, 6]
    assert np.flatnonzero(right.available).tolist() == [2, 3, 4], "a step right from 6 leaves the space"


def test_the_flat_optimum_is_never_worse_than_the_hierarchy_s() -> None:
    """The reference solver: flattening can only raise a root's values, and raises some where a task quits."""
    grounded = two_exits(slip=0.1)
    hierarchy = exact(grounded, pseudo_rewards=False).values[grounded.root]
    flat = exact(flattened(grounded)).values[-1]
    assert (flat >= hierarchy - 1e-9).all()
    assert (flat > hierarchy + 0.5).any()


def test_settings_of_single_tasks_name_the_root_alone() -> None:
    """There is no other task: the root may have a rate of its own, Out is unknown."""
    grounded = two_exits()
    learner = FlatQ(grounded, (0,), Settings(rates={"Root": HarmonicRate(1)}))
    assert learner.train(learner.grounded.root, [4], episodes=2)
    with pytest.raises(ValueError, match="settings name 'Out', which is no task of two exits flat"):
        FlatQ(grounded, (0,), Settings(rates={"Out": HarmonicRate(1)}))
