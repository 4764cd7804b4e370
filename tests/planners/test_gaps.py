import numpy as np
import pytest
from decision_problems import ground_graphs, two_errands, two_triggers
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy import GroundGraph, TaskGraph, ground, two_rooms
from planners import Gap, GapReport, flat_optimum, gap, gap_report, hierarchical_optimum, recursive_optimum
from worlds import StateIndex, TransitionModel, Variable, load_layout, maze_model


def test_the_nearest_trigger_costs_14_where_10_would_do() -> None:
    """Triggers at -2 and +3, goal at +10: GotoTrigger takes the nearer, away from the goal."""
    grounded = two_triggers(2, 3, 10)
    report = gap_report(grounded)
    (one,) = report.shortfalls
    assert (one.recursive, one.hierarchical, one.best, one.lost) == (-14, -10, -10, 4)
    assert (one.steps, one.task, one.chosen, one.better) == (14, "GotoTrigger", "left", "right")
    assert one.cost == 2  # the first step left; the second costs 2 more
    assert one.short_of == "hierarchical"
    assert one.state == one.start
    assert (one.by_choice, one.by_hierarchy) == ({"GotoTrigger": 4}, {})
    assert gap(grounded, recursive_optimum(grounded)) == Gap(starts=1, short=1, worst=4, total=4)


@pytest.mark.parametrize(
    ("left", "right", "goal", "steps", "fewest"),
    [(1, 2, 2, 4, 2), (2, 3, 10, 14, 10), (5, 6, 6, 16, 6), (20, 21, 21, 61, 21)],
)
def test_how_much_the_nearest_trigger_can_cost(
    left: int, right: int, goal: int, steps: int, fewest: int
) -> None:
    """The nearer trigger makes left + left + goal steps, the other as many as the goal is away: 3 to 1."""
    (one,) = gap_report(two_triggers(left, right, goal)).shortfalls
    assert (one.steps, one.recursive, one.hierarchical, one.best) == (steps, -steps, -fewest, -fewest)


@pytest.fixture(scope="module")
def doors() -> tuple[GapReport, GapReport]:
    """Return the reports of the paper's graph and of the one with a single GotoDoor."""
    layout = load_layout("two_rooms")
    model = maze_model(layout)
    with_parameter, single = (ground(two_rooms(layout, one_door_task=one), model) for one in (False, True))
    return gap_report(with_parameter), gap_report(single)


def test_with_the_door_as_a_parameter_nothing_falls_short(doors: tuple[GapReport, GapReport]) -> None:
    """None of 496 start states: the hierarchy with parameters reaches the global optimum."""
    report, _ = doors
    assert (report.starts, report.shortfalls, report.by_task) == (496, (), {})
    assert str(report) == "0 of 496 start states fall short of the global optimum"


def test_one_door_task_is_responsible_for_all_that_is_lost(doors: tuple[GapReport, GapReport]) -> None:
    """31 of 496 start states lose 2 steps each, by a choice that GotoDoor makes at the trigger."""
    _, report = doors
    assert len(report.shortfalls) == 31
    assert report.by_task == {"GotoDoor": (31, 62)}
    index = report.grounded.model.index
    for one in report.shortfalls:
        robot, trigger, _, way = index.state(one.state)
        assert (robot == trigger, way) == (True, "open")
        assert (one.short_of, one.cost, one.best - one.hierarchical) == ("hierarchical", 2, 0)
        assert one.by_choice == {"GotoDoor": 2}


def test_all_states_may_be_looked_at(doors: tuple[GapReport, GapReport]) -> None:
    """Also those in which no episode starts: on the trigger, with the doors open, GotoDoor falls short.

    With those there are 512 cases of start, trigger and goal, and 32 of them fall short.
    """
    grounded = doors[1].grounded
    index, reached = grounded.model.index, grounded.model.reachable()
    shut = index.column("doors") == index.variable("doors").values.index("closed")
    on_trigger = np.array([robot == trigger for robot, trigger, _, _ in index])
    cases = grounded.model.starts | (reached & on_trigger & ~shut)
    report = gap_report(grounded, states=cases)
    assert (report.starts, len(report.shortfalls)) == (512, 32)
    assert str(report).startswith(
        "32 of 512 states fall short of the global optimum\nGotoDoor is responsible in 32,"
    )
    everywhere = gap_report(grounded, states=reached)
    assert everywhere.by_task == {"GotoDoor": (79, 158)}
    assert {one.start for one in report.shortfalls} <= {one.start for one in everywhere.shortfalls}
    assert all(one.lost == 2 for one in everywhere.shortfalls)
    assert gap_report(doors[0].grounded, states=reached).shortfalls == ()


def test_each_shortfall_can_be_explained(doors: tuple[GapReport, GapReport]) -> None:
    """The report prints the smallest; the last in words is as far from its start as the longest."""
    _, report = doors
    assert str(report).endswith(report.explain(report.shortfalls[0]))
    assert report.explain(report.shortfalls[-1]).splitlines() == [
        "from robot = 0,0, trigger = T3, goal = G1, doors = closed",
        "  -14 recursively, -12 hierarchically, -12 globally",
        "in robot = 4,2, trigger = T3, goal = G1, doors = open",
        "  GotoDoor chooses South, the hierarchical optimum North: that costs 2 of 2",
    ]


def test_the_smallest_counter_example_stands_first(doors: tuple[GapReport, GapReport]) -> None:
    """By steps, then by number; the first takes 9 steps where 7 would do."""
    _, report = doors
    order = [(one.steps, one.start) for one in report.shortfalls]
    assert order == sorted(order)
    assert report.shortfalls[0].steps == 9
    assert report.shortfalls[0].best == -7


def test_what_the_hierarchy_forbids_is_told_apart() -> None:
    """GotoTrigger ends at the left trigger alone: its choices are right, but the hierarchy loses 4 steps."""
    grounded = two_triggers(2, 3, 10)
    model = grounded.model
    graph = TaskGraph("left trigger", model.index.variables, model.actions)
    x, way = graph.variables
    goto_left = graph.task("GotoLeft", until=x.eq(-2), uses=[x], do="left right")
    goto_goal = graph.task("GotoGoal", until=x.eq(10), uses=[x], do="left right")
    root = [goto_left().when(way.eq("shut")), goto_goal().when(way.eq("open"))]
    graph.task("Root", until=x.eq(10) & way.eq("open"), uses=[x, way], do=root)
    (one,) = gap_report(ground(graph, model)).shortfalls
    assert (one.recursive, one.hierarchical, one.best) == (-14, -14, -10)
    assert (one.short_of, one.task, one.chosen, one.better) == ("global", "GotoLeft", "left", "right")
    assert (one.by_choice, one.by_hierarchy) == ({}, {"GotoLeft": 4})
    assert one.cost == 2  # the first step left; the second costs 2 more


def test_a_policy_that_never_ends_loses_everything() -> None:
    """No choice of its own is wrong for Out, so the root answers for having nothing to choose."""
    report = gap_report(two_errands())
    (one,) = report.shortfalls
    assert (one.recursive, one.hierarchical, one.best) == (-np.inf, -4, -2)
    assert (one.task, one.chosen, one.better, one.cost) == ("Root", "nothing", "First", np.inf)
    assert one.lost == one.steps == np.inf
    assert (one.by_choice, one.by_hierarchy) == ({}, {"Out": 2})
    assert gap(report.grounded, recursive_optimum(report.grounded)).worst == np.inf


@settings(max_examples=40, deadline=None)
@given(ground_graphs(), st.sampled_from([0.9, 1.0]))
def test_each_task_s_losses_add_up(grounded: GroundGraph, gamma: float) -> None:
    """On random stochastic worlds: by choice to hierarchical - recursive, by hierarchy to the rest."""
    root = grounded.root
    recursive = recursive_optimum(grounded, gamma).value[root]
    best = hierarchical_optimum(grounded, gamma).value[0]
    flat = flat_optimum(grounded.model, grounded.nodes[root].terminal, gamma).value
    report = gap_report(grounded, gamma)
    short = {one.start for one in report.shortfalls}
    ends = np.isfinite(flat)
    losing = np.zeros(flat.size, np.bool_)
    losing[ends] = flat[ends] - recursive[ends] > 1e-8
    assert short == set(np.flatnonzero(losing).tolist())
    for one in report.shortfalls:
        if np.isfinite(one.recursive):
            assert sum(one.by_choice.values()) == pytest.approx(
                best[one.start] - recursive[one.start], abs=1e-7
            )
            assert sum(one.by_hierarchy.values()) == pytest.approx(
                flat[one.start] - best[one.start], abs=1e-7
            )
            assert 0 < one.cost < np.inf
            assert one.task in (one.by_choice if one.short_of == "hierarchical" else one.by_hierarchy)
            assert one.chosen != one.better


@settings(max_examples=30, deadline=None)
@given(ground_graphs(least=-4, most=4))
def test_losses_add_up_whatever_the_rewards(grounded: GroundGraph) -> None:
    """Also where a child passes the root's end and earns more there than the flat optimum."""
    report = gap_report(grounded, gamma=0.9)
    for one in report.shortfalls:
        assert one.best > one.recursive
        if np.isfinite(one.recursive):
            assert sum(one.by_choice.values()) == pytest.approx(one.hierarchical - one.recursive, abs=1e-7)
            assert sum(one.by_hierarchy.values()) == pytest.approx(one.best - one.hierarchical, abs=1e-7)
            both = *one.by_choice.values(), *one.by_hierarchy.values()
            assert sum(both) == pytest.approx(one.lost, abs=1e-7)


def test_earning_more_than_the_flat_optimum_is_no_loss() -> None:
    """The root's end is 1, but Far goes on to 2 for a reward of 5: 4 in all, against -1."""
    index = StateIndex((Variable("x", (0, 1, 2)),))
    rewards = np.array([[-1.0], [5.0], [0.0]])
    model = TransitionModel(index, ("right",), np.array([[1], [2], [2]]), rewards, np.arange(3) == 0)
    graph = TaskGraph("further", index.variables, model.actions)
    (x,) = graph.variables
    far = graph.task("Far", until=x.eq(2), uses=[x], do="right")
    graph.task("Root", until=x.ne(0), uses=[x], do=[far()])
    grounded = ground(graph, model)
    solution = recursive_optimum(grounded)
    assert solution.value[grounded.root].tolist() == [4, 0, 0]
    assert gap(grounded, solution) == Gap(starts=1, short=0, worst=0, total=0)
    assert gap_report(grounded).shortfalls == ()


def test_losses_off_the_likely_path_are_found() -> None:
    """A detour that one start in ten is blown into: its loss is 0.1 x 2, however unlikely.

    From 0 a step leads to 1 with a chance of 0.9 or to 2 with 0.1; from 1 both tasks agree; from 2 Near
    ends at once at 3, two steps from the end, where going by 4 would save a step.
    """
    index = StateIndex((Variable("x", tuple(range(7))),))
    outcomes = np.zeros((7, 2, 2), np.int64)
    for state, (a, b) in enumerate([(1, 1), (6, 6), (3, 4), (5, 5), (6, 6), (4, 4), (6, 6)]):
        outcomes[state] = [[a, a], [b, b]]
    outcomes[0] = [[1, 2], [1, 2]]
    chances = np.broadcast_to(np.array([0.9, 0.1]), outcomes.shape).copy()
    starts = np.arange(7) == 0
    rewards = np.full(outcomes.shape, -1.0)
    model = TransitionModel(index, ("a", "b"), outcomes, rewards, starts, probabilities=chances)
    graph = TaskGraph("blown", index.variables, model.actions)
    (x,) = graph.variables
    near = graph.task("Near", until=x.isin([3, 4, 6]), uses=[x], do="a b")
    graph.task("Root", until=x.eq(6), uses=[x], do=[near().when(x.isin([0, 1, 2])), "a"])
    (one,) = gap_report(ground(graph, model)).shortfalls
    assert one.best == pytest.approx(-(0.9 * 2 + 0.1 * 3))
    assert one.recursive == pytest.approx(-(0.9 * 2 + 0.1 * 5))
    assert (one.task, one.state, one.chosen, one.better, one.cost) == ("Near", 2, "a", "b", 2)
    assert one.by_choice == pytest.approx({"Near": 0.2})
