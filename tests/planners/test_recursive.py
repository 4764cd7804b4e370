import networkx as nx
import numpy as np
import pytest
from decision_problems import ground_graphs
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import maze_layouts

from hierarchy import GroundGraph, Param, TaskGraph, checked, ground, two_rooms
from planners import Gap, Solution, gap, recursive_optimum, task_field
from worlds import (
    ACTIONS,
    Layout,
    StateIndex,
    TransitionModel,
    Variable,
    load_layout,
    maze_model,
    maze_variables,
)


def _corridor(cells: int, starts: tuple[int, ...]) -> TransitionModel:
    index = StateIndex((Variable("x", tuple(range(cells))),))
    x = np.arange(cells)
    successors = np.stack([np.maximum(x - 1, 0), np.minimum(x + 1, cells - 1)], axis=1)
    return TransitionModel(
        index, ("left", "right"), successors, np.full(successors.shape, -1.0), np.isin(x, starts)
    )


def _nearest_end(cells: int, starts: tuple[int, ...]) -> GroundGraph:
    """Return Root -> Out (to either end), Back (from the left end): the root wants the right end."""
    model = _corridor(cells, starts)
    last = cells - 1
    graph = TaskGraph("either end", model.index.variables, model.actions)
    (x,) = graph.variables
    out = graph.task("Out", until=x.isin([0, last]), uses=[x], do="left right")
    back = graph.task("Back", until=x.eq(last), uses=[x], do="left right")
    graph.task("Root", until=x.eq(last), uses=[x], do=[out(), back().when(x.eq(0))])
    return checked(graph, model)


def test_a_task_with_two_ends_takes_the_nearer_by_hand() -> None:
    """In 0 to 5, Out goes left from 1 and 2; the root then comes all the way back.

    Steps: from 1 it is 1 + 5 where 4 would do, from 2 it is 2 + 5 for 3, from 3 and 4 it is 2 and 1.
    """
    grounded = _nearest_end(6, (1, 2, 3, 4))
    solution = recursive_optimum(grounded)
    out, root = grounded.place("Out"), grounded.root
    assert solution.steps[out].tolist() == [0, 1, 2, 2, 1, 0]
    assert solution.landing[out].tolist() == [0, 0, 0, 5, 5, 5]
    assert solution.choice[out].tolist() == [-1, 0, 0, 1, 1, -1]
    assert solution.steps[root].tolist() == [5, 6, 7, 2, 1, 0]
    assert solution.choice[root].tolist() == [1, 0, 0, 0, 0, -1]
    assert solution.landing[root].tolist() == [5] * 6
    assert gap(grounded, solution) == Gap(starts=4, short=2, worst=4, total=6)


def test_a_tie_goes_to_the_first_action_by_hand() -> None:
    """In 0 to 4, both ends are 2 steps from 2; left comes first, and costs the root 4 steps."""
    grounded = _nearest_end(5, (2,))
    solution = recursive_optimum(grounded)
    assert solution.landing[grounded.place("Out"), 2] == 0
    assert solution.steps[grounded.root, 2] == 2 + 4
    assert gap(grounded, solution) == Gap(starts=1, short=1, worst=4, total=4)


def test_a_primitive_action_takes_one_step() -> None:
    """Its landing is its successor, and it chooses nothing."""
    grounded = _nearest_end(5, (2,))
    solution = recursive_optimum(grounded)
    assert (solution.steps[:2] == 1).all()
    assert np.array_equal(solution.landing[:2], grounded.model.successors.T)
    assert (solution.choice[:2] == -1).all()


def test_a_task_that_cannot_end_says_never() -> None:
    """Left of its end a task that only goes left has no way, and chooses nothing."""
    model = _corridor(4, (0,))
    graph = TaskGraph("left only", model.index.variables, model.actions)
    (x,) = graph.variables
    graph.task("Go", until=x.eq(1), uses=[x], do="left")
    solution = recursive_optimum(ground(graph, model))
    assert solution.steps[-1].tolist() == [np.inf, 0, 1, 2]
    assert solution.value[-1].tolist() == [-np.inf, 0, -1, -2]
    assert solution.choice[-1].tolist() == [-1, -1, 0, 0]
    assert solution.landing[-1].tolist() == [0, 1, 1, 1]


def test_a_composite_of_composites_by_hand() -> None:
    """Root -> Trip(via, to) -> Leg(to) -> left, right, in 0 to 6.

    From 3: Trip(0, 6) makes 3 steps to 0, then 6 to 6; Trip(4, 6) makes 1 and 2. The root takes the
    second, though it stands second, and there is no shorter way.
    """
    model = _corridor(7, (2, 3))
    graph = TaskGraph("trips", model.index.variables, model.actions)
    (x,) = graph.variables
    via, to = Param.over("via", {"a": 0, "b": 4}), Param.over("to", {"a": 0, "b": 4, "c": 6})
    leg = graph.task("Leg", to, until=x.eq(to), uses=[x], do="left right")
    trip = graph.task(
        "Trip",
        via,
        to,
        until=x.eq(to),
        uses=[x],
        do=[leg(to=via).when(x.isin([1, 2, 3])), leg(to=to).when(~x.isin([1, 2, 3]))],
    )
    graph.task("Root", until=x.eq(6), uses=[x], do=[trip(via=0, to=6), trip(via=4, to=6)])
    grounded = checked(graph, model)
    solution = recursive_optimum(grounded)
    far, near = grounded.place("Trip(a, c)"), grounded.place("Trip(b, c)")
    assert solution.steps[far].tolist() == [6, 1 + 6, 2 + 6, 3 + 6, 2, 1, 0]
    assert solution.steps[near].tolist() == [6, 5, 4, 3, 2, 1, 0]
    assert solution.landing[far, 3] == solution.landing[near, 3] == 6
    assert solution.landing[grounded.place("Leg(a)"), 3] == 0
    assert solution.choice[grounded.root].tolist() == [0, 1, 1, 1, 0, 0, -1]
    assert gap(grounded, solution) == Gap(starts=2, short=0, worst=0, total=0)


@pytest.fixture(scope="module", params=[False, True], ids=["a door each", "one door task"])
def solved(request: pytest.FixtureRequest) -> tuple[bool, GroundGraph, Solution]:
    """Return the paper's graph and its variant, solved."""
    layout = load_layout("two_rooms")
    grounded = ground(two_rooms(layout, one_door_task=request.param), maze_model(layout))
    return request.param, grounded, recursive_optimum(grounded)


def test_what_one_door_task_loses(solved: tuple[bool, GroundGraph, Solution]) -> None:
    """With the door as a parameter nothing is lost from 496 starts; with one task, 31 lose 2 steps each."""
    one_door_task, grounded, solution = solved
    expected = Gap(496, 31, 2, 62) if one_door_task else Gap(496, 0, 0, 0)
    assert gap(grounded, solution) == expected


def test_a_task_of_primitive_actions_is_solved_as_its_field(
    solved: tuple[bool, GroundGraph, Solution],
) -> None:
    """Two solvers without a line in common: the same steps, and choices within the optimal sets."""
    _, grounded, solution = solved
    for place in range(len(ACTIONS), grounded.root):
        field = task_field(grounded.model, grounded.nodes[place])
        assert np.array_equal(np.where(field.distance < 0, np.inf, field.distance), solution.steps[place])
        first = np.where(field.optimal().any(axis=1), field.optimal().argmax(axis=1), -1)
        assert np.array_equal(first, solution.choice[place])


def _nested(layout: Layout) -> TaskGraph:
    """Return Root -> Open -> Near -> actions: three levels that lead to the trigger and on to the goal."""
    graph = TaskGraph("nested", maze_variables(layout), ACTIONS)
    robot, trigger, goal, doors = graph.variables
    everything = [robot, trigger, goal, doors]
    moves = " ".join(ACTIONS)
    near = graph.task("Near", until=robot.eq(trigger), uses=[robot, trigger], do=moves)
    opening = graph.task("Open", until=doors.eq("open"), uses=everything, do=[near()])
    far = graph.task("Far", until=robot.eq(goal), uses=[robot, goal], do=moves)
    graph.task(
        "Root",
        until=doors.eq("open") & robot.eq(goal),
        uses=everything,
        do=[opening().when(doors.eq("closed")), far().when(doors.eq("open"))],
    )
    return graph


@settings(max_examples=25, deadline=None)
@given(maze_layouts(most=4))
def test_nested_tasks_take_networkx_s_shortest_legs(layout: Layout) -> None:
    """To the trigger with doors shut, then on to the goal with doors open: the sum of two shortest paths."""
    model = maze_model(layout)
    grounded = ground(_nested(layout), model)
    solution = recursive_optimum(grounded)
    graph = nx.DiGraph((s, int(to)) for s, row in enumerate(model.successors) for to in row)
    for start in np.flatnonzero(model.starts).tolist():
        _, trigger, goal, _ = model.index.state(start)
        between = model.index.number((trigger, trigger, goal, "open"))
        end = model.index.number((goal, trigger, goal, "open"))
        legs = nx.shortest_path_length(graph, start, between) + nx.shortest_path_length(graph, between, end)
        assert solution.steps[grounded.root, start] == legs
        assert solution.landing[grounded.root, start] == end


def _backed_up(grounded: GroundGraph, solution: Solution, place: int, state: int) -> list[float]:
    """Return what each call of a task is worth in a state, by the task's own values; -inf if it may not."""
    node, taught = grounded.nodes[place], solution.taught[place]
    worth = []
    for call in node.calls:
        exits = solution.exits[call.child]
        row = exits.kernel.toarray()[state]
        after = np.flatnonzero(row)
        ready = call.available[state] and np.isfinite(exits.value[state])
        worth.append(exits.value[state] + (row[after] * taught[after]).sum() if ready else -np.inf)
    return worth


@settings(max_examples=60, deadline=None)
@given(ground_graphs(least=-3, most=-1), st.just(1.0) | st.just(0.9))
def test_every_task_satisfies_its_bellman_equation(grounded: GroundGraph, gamma: float) -> None:
    """V-tilde is the best that any call gives, and the first such call is chosen; V follows that call."""
    solution = recursive_optimum(grounded, gamma)
    for place in range(2, len(grounded.nodes)):
        node = grounded.nodes[place]
        ends = np.where(node.terminal & ~node.goal, node.pseudo_reward or 0.0, 0.0)
        assert (solution.taught[place][node.terminal] == ends[node.terminal]).all()
        for state in np.flatnonzero(node.live).tolist():
            worth, choice = _backed_up(grounded, solution, place, state), solution.choice[place, state]
            assert solution.taught[place, state] == pytest.approx(max(worth))
            if choice < 0:
                assert solution.value[place, state] == -np.inf
                continue
            assert all(one < max(worth) - 1e-10 for one in worth[:choice])
            exits = solution.exits[node.calls[choice].child]
            row, here = exits.kernel.toarray()[state], np.where(node.terminal, 0.0, solution.value[place])
            follows = exits.value[state] + (row[row > 0] * here[row > 0]).sum()
            assert solution.value[place, state] == pytest.approx(follows)


@settings(max_examples=40, deadline=None)
@given(ground_graphs(least=-4, most=4))
def test_without_pseudo_rewards_both_values_are_one(grounded: GroundGraph) -> None:
    """A task that has none is taught its true value, with rewards of either sign."""
    solution = recursive_optimum(grounded, gamma=0.9)
    for place in range(2, len(grounded.nodes)):
        node = grounded.nodes[place]
        if node.pseudo_reward is None:
            assert solution.value[place][node.live] == pytest.approx(solution.taught[place][node.live])


def _quitting(pseudo_reward: float | None) -> GroundGraph:
    """Return Root -> Fetch -> left, right in 0 to 5: Fetch may end at 0, short of its goal at 5."""
    model = _corridor(6, (1, 2))
    graph = TaskGraph("quitting", model.index.variables, model.actions)
    (x,) = graph.variables
    fetch = graph.task(
        "Fetch",
        until=x.isin([0, 5]),
        uses=[x],
        do="left right",
        goal=x.eq(5),
        pseudo_reward=pseudo_reward,
    )
    graph.task("Root", until=x.eq(5), uses=[x], do=[fetch(), "right"])
    return ground(graph, model)


@pytest.mark.parametrize(
    ("pseudo_reward", "taught", "value", "choice"),
    [
        (None, [0, -1, -2, -2, -1, 0], [0, -1, -2, -2, -1, 0], [-1, 0, 0, 1, 1, -1]),
        (-2.0, [-2, -3, -3, -2, -1, 0], [0, -1, -3, -2, -1, 0], [-1, 0, 1, 1, 1, -1]),
        (-10.0, [-10, -4, -3, -2, -1, 0], [0, -4, -3, -2, -1, 0], [-1, 1, 1, 1, 1, -1]),
    ],
)
def test_a_pseudo_reward_decides_the_policy_alone_by_hand(
    pseudo_reward: float | None, taught: list[float], value: list[float], choice: list[int]
) -> None:
    """The dearer it is to quit at 0, the fewer states quit; what callers see holds no pseudo-reward."""
    grounded = _quitting(pseudo_reward)
    solution, fetch = recursive_optimum(grounded), grounded.place("Fetch")
    assert solution.taught[fetch].tolist() == taught
    assert solution.value[fetch].tolist() == value
    assert solution.choice[fetch].tolist() == choice


def test_a_slippery_choice_by_hand() -> None:
    """Short and slippery, or long and sure: 1 / chance tries against 3 steps.

    From 0 `leap` lands at 3 with a chance of 1/2 or 1/4, and else stays; `walk` goes one cell at a time.
    """
    for chance, expected, chosen in ((0.5, -2.0, 0), (0.25, -3.0, 1)):
        index = StateIndex((Variable("x", (0, 1, 2, 3)),))
        outcomes = np.array([[[3, 0], [1, 1]], [[1, 1], [2, 2]], [[2, 2], [3, 3]], [[3, 3], [3, 3]]])
        chances = np.broadcast_to(np.array([chance, 1 - chance]), outcomes.shape).copy()
        rewards, starts = np.full(outcomes.shape, -1.0), np.ones(4, np.bool_)
        model = TransitionModel(index, ("leap", "walk"), outcomes, rewards, starts, probabilities=chances)
        graph = TaskGraph("leap", index.variables, model.actions)
        (x,) = graph.variables
        go = graph.task("Go", until=x.eq(3), uses=[x], do="leap walk")
        graph.task("Root", until=x.eq(3), uses=[x], do=[go()])
        solution = recursive_optimum(ground(graph, model))
        assert solution.value[-1] == pytest.approx([expected, -2, -1, 0])
        assert solution.steps[-1] == pytest.approx([-expected, 2, 1, 0])
        assert solution.choice[-2].tolist() == [chosen, 1, 1, -1]


def test_a_small_taxi_by_hand() -> None:
    """Root -> Get, Put -> Go(t), Pick, Drop on three cells: +20 for a delivery, -10 for a wrong Pick or Drop.

    The passenger waits at 0 and wants to go to 2. From 1 with nobody aboard: west, pick, east, east, drop
    make 4 steps at -1 and +20, that is 16, of which Get has -2 and Put 18.
    """
    where = Variable("passenger", ("waiting", "aboard", "home"))
    index = StateIndex((Variable("x", (0, 1, 2)), where))
    successors, rewards = np.zeros((9, 4), np.int64), np.full((9, 4), -1.0)
    for state, (x, passenger) in enumerate(index):
        picks, drops = (x, passenger) == (0, "waiting"), (x, passenger) == (2, "aboard")
        after = [(max(x - 1, 0), passenger), (min(x + 1, 2), passenger)]
        after += [(x, "aboard" if picks else passenger), (x, "home" if drops else passenger)]
        successors[state] = [index.number(one) for one in after]
        rewards[state, 2:] = -1 if picks else -10, 20 if drops else -10
    starts = np.array([passenger == "waiting" for _, passenger in index])
    model = TransitionModel(index, ("West", "East", "Pick", "Drop"), successors, rewards, starts)
    graph = TaskGraph("small taxi", index.variables, model.actions)
    x, passenger = graph.variables
    to = Param.over("to", {"house": 0, "work": 2})
    go = graph.task("Go", to, until=x.eq(to), uses=[x], do="West East")
    get = graph.task("Get", until=passenger.eq("aboard"), uses=[x, passenger], do=["Pick", go(to=0)])
    put = graph.task("Put", until=passenger.eq("home"), uses=[x, passenger], do=["Drop", go(to=2)])
    graph.task(
        "Root",
        until=passenger.eq("home"),
        uses=[x, passenger],
        do=[get().when(passenger.eq("waiting")), put().when(passenger.eq("aboard"))],
    )
    grounded = checked(graph, model)
    solution = recursive_optimum(grounded)
    start, between = index.number((1, "waiting")), index.number((0, "aboard"))
    assert solution.value[grounded.root, start] == 16
    assert solution.value[grounded.place("Get"), start] == -2
    assert solution.value[grounded.place("Put"), between] == 18
    assert solution.landing[grounded.place("Get"), start] == between
    assert gap(grounded, solution) == Gap(starts=3, short=0, worst=0, total=0)
    discounted = recursive_optimum(grounded, gamma=0.5).value[grounded.root, start]
    assert discounted == pytest.approx(-1 - 0.5 - 0.25 - 0.125 + 20 * 0.0625)
