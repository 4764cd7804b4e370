"""MAXQ-0 held to values worked out by hand."""

from collections.abc import Sequence

import numpy as np
import pytest

from hierarchy import GroundGraph, TaskGraph, ground, two_rooms
from planners import EpisodeTooLongError, Exploration, LearningRate, MaxQ, Settings
from worlds import ACTIONS, Cell, StateIndex, TransitionModel, Variable, load_layout, maze_model

EXACT = Settings(rate=LearningRate(start=1.0, factor=1.0))
HALF = Settings(rate=LearningRate(start=0.5, factor=1.0))


def _corridor(cells: int, actions: Sequence[str]) -> TransitionModel:
    """Return a corridor whose actions are any of left and right."""
    index = StateIndex((Variable("x", tuple(range(cells))),))
    x = np.arange(cells)
    moves = {"left": np.maximum(x - 1, 0), "right": np.minimum(x + 1, cells - 1)}
    successors = np.stack([moves[action] for action in actions], axis=1)
    starts = np.ones(cells, dtype=np.bool_)
    return TransitionModel(index, tuple(actions), successors, np.full(successors.shape, -1.0), starts)


def _one_task(cells: int, actions: str = "right", *, end: int | None = None) -> GroundGraph:
    """Return Go, which ends at `end` (the last cell if not given), as a graph of its own."""
    model = _corridor(cells, actions.split())
    graph = TaskGraph("corridor", model.index.variables, model.actions)
    (x,) = graph.variables
    graph.task("Go", until=x.eq(cells - 1 if end is None else end), uses=[x], do=actions)
    return ground(graph, model)


def _two_levels() -> GroundGraph:
    """Return Root -> First (to 2), Second (from 2 to 4) -> right, in a corridor of 5."""
    model = _corridor(5, ["right"])
    graph = TaskGraph("legs", model.index.variables, model.actions)
    (x,) = graph.variables
    first = graph.task("First", until=x.eq(2), within=x.isin([0, 1]), uses=[x], do="right")
    second = graph.task("Second", until=x.eq(4), within=x.isin([2, 3]), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[first(), second()])
    return ground(graph, model)


def test_the_first_episode_by_hand() -> None:
    """Table 2 with alpha = 1/2 from 0 to 2: V(right) = -3/4, C(0) = -1/4, C(1) = 0."""
    grounded = _one_task(3)
    learner = MaxQ(grounded, seed=(0,), settings=HALF)
    assert learner.train(grounded.root, [0], episodes=1) == [2]
    # Step 1: V(right) = -1/2, then C(0) = (V(right) + C(1)) / 2 = (-1/2 + 0) / 2. Step 2: V(right) = -3/4.
    assert learner.reward == [[-0.75]]
    assert learner.completion[grounded.root] == [[-0.25, 0.0, 0.0]]
    assert learner.value(grounded.root, 0) == -1.0


def test_the_second_episode_by_hand() -> None:
    """And again: V(right) = -7/8 then -15/16, C(0) = (-1/4 - 7/8) / 2 = -9/16."""
    grounded = _one_task(3)
    learner = MaxQ(grounded, seed=(0,), settings=HALF)
    learner.train(grounded.root, [0], episodes=2)
    assert learner.reward == [[-0.9375]]
    assert learner.completion[grounded.root] == [[-0.5625, 0.0, 0.0]]


def test_q_adds_the_completion_once() -> None:
    """Q(i, s, a) = V(a, s) + C(i, s, a) at both levels (equation 3), with values put in by hand."""
    grounded = _two_levels()
    learner = MaxQ(grounded, seed=(0,))
    first, root = grounded.place("First"), grounded.root
    learner.reward[0] = [-1.0]
    learner.completion[first][0][0] = -4.0
    learner.completion[root][0][0] = -16.0
    assert learner.q(first, 0, 0) == learner.value(first, 0) == -5.0
    assert learner.q(root, 0, 0) == learner.value(root, 0) == -21.0
    assert learner.c(root, 0, 0) == -16.0
    assert learner.value(0, 0) == -1.0


def test_the_completion_is_learnt_on_the_terminal_step() -> None:
    """A wrong completion of the last step is pulled to 0 by that step itself."""
    grounded = _one_task(3)
    learner = MaxQ(grounded, seed=(0,), settings=HALF)
    learner.completion[grounded.root][0][1] = -8.0
    learner.train(grounded.root, [1], episodes=1)
    assert learner.completion[grounded.root][0][1] == -4.0
    learner.train(grounded.root, [1], episodes=2)
    assert learner.completion[grounded.root][0][1] == -1.0


def test_nothing_is_learnt_from_beyond_a_task_s_end() -> None:
    """A value stored at the terminal state itself is never read: V is 0 there, and C(1) stays 0."""
    grounded = _one_task(4, end=2)
    learner = MaxQ(grounded, seed=(0,), settings=EXACT)
    learner.completion[grounded.root][0][2] = -64.0
    learner.train(grounded.root, [0], episodes=5)
    assert learner.value(grounded.root, 2) == 0.0
    assert learner.completion[grounded.root] == [[-1.0, 0.0, -64.0, 0.0]]


def test_a_parent_goes_on_from_where_its_child_has_ended() -> None:
    """The child's terminal state is worth 0 to the child and -2 to the root."""
    grounded = _two_levels()
    learner = MaxQ(grounded, seed=(0,), settings=EXACT)
    learner.train(grounded.root, [0], episodes=5)
    first, root = grounded.place("First"), grounded.root
    assert learner.value(first, 2) == 0.0
    assert learner.value(root, 2) == learner.c(root, 0, 0) == -2.0
    assert learner.value(root, 0) == -4.0
    assert learner.greedy_route(root, 0) == [(0, 0), (1, 0), (2, 0), (3, 0)]


def test_discounting_by_hand() -> None:
    """With gamma = 1/2: C(Go, s) = gamma V(Go, s'), and C(Root, 0, First) = gamma**2 V(Root, 2).

    V(First, 0) = V(Second, 2) = -1 - 1/2, so C(Root, 0, First) = -3/8 and V(Root, 0) = -15/8, which is
    -(1 + 1/2 + 1/4 + 1/8).
    """
    grounded = _two_levels()
    learner = MaxQ(grounded, (0,), Settings(rate=LearningRate(start=1.0, factor=1.0), gamma=0.5))
    learner.train(grounded.root, [0], episodes=5)
    first, second, root = grounded.place("First"), grounded.place("Second"), grounded.root
    assert learner.c(first, 0, 0) == -0.5
    assert learner.value(first, 0) == learner.value(second, 2) == learner.value(root, 2) == -1.5
    assert learner.c(root, 0, 0) == -0.375
    assert learner.value(root, 0) == -1.875


@pytest.mark.parametrize("best", [[0, 1, 2, 3], [1, 2, 3], [2, 3], [3], [0, 3], [1, 3]])
@pytest.mark.parametrize("slack", [0.0, 0.9])
def test_ties_go_to_the_first_in_order(best: list[int], slack: float) -> None:
    """Among equals, within `tie`, North comes before South, South before West, West before East."""
    layout = load_layout("two_rooms")
    grounded = ground(two_rooms(layout), maze_model(layout))
    tie = 0.125
    learner = MaxQ(grounded, (0,), Settings(tie=tie))
    task = grounded.place("GotoTrigger(T4)")
    at = grounded.model.index.number((Cell(3, 1), layout.triggers["T4"], layout.goals["G2"], "closed"))
    assert learner.choices(task, at) == (0, 1, 2, 3)
    for k in range(4):
        row = grounded.nodes[task].calls[k].projection[at]
        learner.completion[task][k][row] = -slack * tie * (4 - k) / 4 if k in best else -1.5 * tie
    assert ACTIONS[learner.greedy(task, at)] == ACTIONS[best[0]]


def test_an_unavailable_child_is_never_best() -> None:
    """At D1's grid GotoGoal has no West, however good its stored value looks."""
    layout = load_layout("two_rooms")
    grounded = ground(two_rooms(layout), maze_model(layout))
    learner = MaxQ(grounded, seed=(0,))
    task = grounded.place("GotoGoal(G2)")
    marks = layout.triggers["T4"], layout.goals["G2"]
    at = grounded.model.index.number((layout.thresholds["D1"], *marks, "open"))
    learner.completion[task][2] = [100.0] * len(learner.completion[task][2])
    assert learner.choices(task, at) == (0, 1, 3)
    assert ACTIONS[learner.greedy(task, at)] == "North"


def test_one_seed_gives_one_table() -> None:
    """Every stored value is the same to the bit; another seed, or another part of it, gives others."""

    def table(*seed: int) -> tuple[object, list[int]]:
        grounded = _one_task(6, "left right")
        learner = MaxQ(grounded, seed)
        steps = learner.train(grounded.root, [0, 1, 2], episodes=30)
        return (learner.completion, learner.reward, learner.steps), steps

    assert table(3, 1) == table(3, 1)
    assert table(3, 1)[0] != table(3, 2)[0]
    assert table(3, 1)[0] != table(4, 1)[0]


def test_train_returns_the_steps_of_each_episode() -> None:
    """Their sum is the learner's count of steps, and the measurement is taken after every episode."""
    grounded = _one_task(5, "left right")
    learner = MaxQ(grounded, seed=(0,))
    seen: list[int] = []
    steps = learner.train(grounded.root, [0], episodes=20, after_each=lambda: seen.append(learner.steps))
    assert seen == np.cumsum(steps).tolist()
    assert min(steps) >= 4
    assert learner.train(grounded.root, [4], episodes=3) == [0, 0, 0]


def test_training_again_starts_its_schedules_afresh_and_keeps_what_was_learnt() -> None:
    """With exploration at 1 in episode 0, each training's first episode is random; the values stay."""
    grounded = _one_task(4)
    learner = MaxQ(grounded, (0,), Settings(exploration=Exploration(half=1)))
    learner.train(grounded.root, [0], episodes=60)
    before = learner.value(grounded.root, 0)
    assert before == pytest.approx(-3.0, abs=1e-6)
    learner.train(grounded.root, [3], episodes=2)
    assert learner.episodes[grounded.root] == 2
    assert learner.value(grounded.root, 0) == before


def test_an_episode_without_end_is_an_error() -> None:
    """A task that cannot end where it is stops at `max_steps`, and its greedy policy arrives nowhere."""
    grounded = _one_task(4, "left", end=2)
    learner = MaxQ(grounded, (0,), Settings(max_steps=50))
    with pytest.raises(EpisodeTooLongError, match="no end after 50 primitive steps"):
        learner.train(grounded.root, [1], episodes=1)
    assert learner.steps == 51
    assert learner.greedy_route(grounded.root, 1, limit=30) is None
    assert learner.greedy_steps(grounded.root, 1, limit=30) is None
    assert learner.train(grounded.root, [3], episodes=1) == [1], "the next episode has a limit of its own"


def test_greedy_steps_hold_their_limit() -> None:
    """A way of exactly `limit` steps is found, one longer is not."""
    grounded = _one_task(5)
    learner = MaxQ(grounded, seed=(0,))
    assert learner.greedy_steps(grounded.root, 0, limit=4) == 4
    assert learner.greedy_steps(grounded.root, 0, limit=3) is None
