"""MAXQ-0 held to the paper's worked example (figures 5 and 6) and its tables of steps (figure 13)."""

import numpy as np
import pytest

from comparisons.learning import PairLearner
from hierarchy import ground, two_rooms
from planners import MaxQ, Solution, gap, recursive_optimum
from worlds import ACTIONS, load_layout, maze_model, parse_layout

MAZE = load_layout("two_rooms")
MODEL = maze_model(MAZE)

# From 0,0 the only way to T1 is South, East, South.
CROOKED = """\
name crooked
grid
.   X      X   X
.   .   :  D1  G1
X   T1  |  X   X
start 0,0
trigger T1
goal G1
"""

FIGURE_13 = {
    "GotoTrigger(T4)": [
        [7, 6, 7, 8],
        [6, 5, 6, 7],
        [5, 4, 5, 6],
        [4, 3, 4, 5],
        [3, 2, 3, 4],
        [2, 1, 2, 3],
        [1, 0, 1, 2],
        [2, 1, 2, 3],
    ],
    "GotoDoor(D1)": [
        [6, 5, 4, 3],
        [5, 4, 3, 2],
        [4, 3, 2, 1],
        [5, 4, 3, 2],
        [6, 5, 4, 3],
        [7, 6, 5, 4],
        [8, 7, 6, 5],
        [9, 8, 7, 6],
    ],
    "GotoDoor(D2)": [
        [9, 8, 7, 6],
        [8, 7, 6, 5],
        [7, 6, 5, 4],
        [6, 5, 4, 3],
        [5, 4, 3, 2],
        [4, 3, 2, 1],
        [5, 4, 3, 2],
        [6, 5, 4, 3],
    ],
    "GotoGoal(G2)": [
        [6, 5, 4, 3],
        [5, 4, 3, 2],
        [4, 3, 2, 1],
        [3, 2, 1, 0],
        [4, 3, 2, 1],
        [5, 4, 3, 2],
        [6, 5, 4, 3],
        [7, 6, 5, 4],
    ],
}


@pytest.fixture(scope="module")
def pair() -> PairLearner:
    """Return the paper's pair, learnt once."""
    learner = PairLearner(MAZE, ground(two_rooms(MAZE), MODEL), "T4", "G2", seed=0)
    learner.learn()
    return learner


@pytest.fixture(scope="module")
def optimum(pair: PairLearner) -> Solution:
    """Return the recursive optimum of the same graph."""
    return recursive_optimum(pair.grounded)


def _starts(pair: PairLearner) -> list[int]:
    return [pair.state(cell, "closed") for cell in sorted(MAZE.rooms["A"]) if cell != MAZE.triggers["T4"]]


def test_the_worked_example_of_figures_5_and_6() -> None:
    """South, East, South: V = -3, C = -2, -1 and 0 on the way, and every primitive's V = -1."""
    layout = parse_layout(CROOKED)
    grounded = ground(two_rooms(layout), maze_model(layout))
    learner = MaxQ(grounded, seed=(0,))
    task = grounded.place("GotoTrigger(T1)")
    marks = layout.triggers["T1"], layout.goals["G1"]
    start = grounded.model.index.number((layout.start, *marks, "closed"))
    learner.train(task, [start], episodes=400)
    route = learner.greedy_route(task, start)
    assert route is not None
    assert [ACTIONS[action] for _, action in route] == ["South", "East", "South"]
    assert learner.value(task, start) == pytest.approx(-3, abs=1e-3)
    completions = [learner.c(task, state, action) for state, action in route]
    assert completions == pytest.approx([-2, -1, 0], abs=1e-3)
    assert [learner.value(a, start) for a in range(4)] == pytest.approx([-1] * 4, abs=1e-3)


@pytest.mark.parametrize("task", FIGURE_13)
def test_figure_13(pair: PairLearner, task: str) -> None:
    """The learnt steps to the subgoal from each grid of the room, cell by cell."""
    assert pair.step_table(task) == FIGURE_13[task]


def test_the_learnt_values_are_minus_the_steps(pair: PairLearner, optimum: Solution) -> None:
    """V(Root) is the recursive optimum's steps, negated, from every start; so is each subtask's V."""
    root = pair.grounded.root
    for state in _starts(pair):
        assert pair.learner.value(root, state) == pytest.approx(-optimum.steps[root, state], abs=0.01)
    for task, table in FIGURE_13.items():
        place = pair.grounded.place(task)
        doors = "closed" if task.startswith("GotoTrigger") else "open"
        left = 4 if task.startswith("GotoGoal") else 0
        for (row, col), steps in np.ndenumerate(np.array(table)):
            state = pair.state(MAZE.cells[row * 8 + left + col], doors)
            assert pair.learner.value(place, state) == pytest.approx(-steps, abs=0.01)


def test_the_learnt_policy_is_the_recursive_optimum(pair: PairLearner, optimum: Solution) -> None:
    """The same calls at every state on the way, hence the same steps, from every start."""
    learner, grounded = pair.learner, pair.grounded
    for start in _starts(pair):
        assert learner.greedy_steps(grounded.root, start) == optimum.steps[grounded.root, start]
        state = start
        while not grounded.nodes[grounded.root].terminal[state]:
            k = learner.greedy(grounded.root, state)
            assert k == optimum.choice[grounded.root, state]
            child = grounded.nodes[grounded.root].calls[k].child
            route = learner.greedy_route(child, state)
            assert route is not None
            assert [action for _, action in route] == [optimum.choice[child, s] for s, _ in route]
            state = int(optimum.landing[child, state])


def test_another_seed_learns_other_values_of_the_same_policy(pair: PairLearner) -> None:
    """The tables differ in their last digits, the steps do not."""
    other = PairLearner(MAZE, pair.grounded, "T4", "G2", seed=1)
    other.learn()
    assert other.learner.completion != pair.learner.completion
    assert {task: other.step_table(task) for task in FIGURE_13} == FIGURE_13
    assert other.wrong_starts().tolist() == [0]


def test_with_one_door_task_the_learner_falls_short_as_the_recursive_optimum_does() -> None:
    """From all 496 starts: the learner's steps are the recursive optimum's, also where they are too many."""
    grounded = ground(two_rooms(MAZE, one_door_task=True), MODEL)
    optimum = recursive_optimum(grounded)
    assert gap(grounded, optimum).short == 31
    learner = MaxQ(grounded, seed=(0,))
    called: dict[int, set[int]] = {}
    for call in grounded.nodes[grounded.root].calls:
        here = np.flatnonzero(call.available & MODEL.reachable())
        called.setdefault(call.child, set()).update(here.tolist())
    for child, states in called.items():
        learner.train(child, sorted(states), episodes=1200)
    starts = np.flatnonzero(MODEL.starts)
    steps = [learner.greedy_steps(grounded.root, int(start)) for start in starts]
    assert steps == optimum.steps[grounded.root, starts].tolist()
