"""Table 3's rule, table 4's rows, and both strategies where they part."""

from dataclasses import replace

import pytest
from beliefs import MAZE, knowing, number, numbers

from comparisons.learning import PairLearner
from hierarchy import ground, two_rooms
from planners import Affordance, LocalRule, Replanner, Replanning, Strategy, prove
from worlds import ACTIONS, Kind, maze_model

NORTH, SOUTH, WEST, EAST = range(4)
STRATEGIES = ("local", "replanning")


@pytest.fixture(scope="module")
def strategies() -> dict[str, Strategy]:
    """Return both strategies on the paper's pair, learnt once."""
    grounded = ground(two_rooms(MAZE), maze_model(MAZE))
    pair = PairLearner(MAZE, grounded, "T4", "G2", seed=0)
    pair.learn()
    return {
        "local": LocalRule(MAZE, pair.learner),
        "replanning": Replanning(Replanner(MAZE, grounded), pair.learner),
    }


@pytest.fixture
def local(strategies: dict[str, Strategy]) -> LocalRule:
    """Return the paper's rule."""
    rule = strategies["local"]
    assert isinstance(rule, LocalRule)
    return rule


@pytest.fixture
def replanning(strategies: dict[str, Strategy]) -> Replanning:
    """Return the replanning strategy."""
    strategy = strategies["replanning"]
    assert isinstance(strategy, Replanning)
    return strategy


def _place(replanning: Replanning, task: str) -> int:
    return replanning.grounded.place(task)


@pytest.mark.parametrize("name", STRATEGIES)
@pytest.mark.parametrize(
    ("cell", "expected"),
    [
        ("2,0", Affordance("sphere", on_route=True, action=SOUTH)),
        ("2,0", Affordance("cube", on_route=True, action=EAST)),
        ("1,1", Affordance("sphere", on_route=False, action=None)),
        ("1,1", Affordance("cube", on_route=False, action=None)),
    ],
)
def test_table_3(
    strategies: dict[str, Strategy],
    replanning: Replanning,
    name: str,
    cell: str,
    expected: Affordance,
) -> None:
    """From 1,0 the route is South: a sphere on it is pushed, a cube passed, one off it is no care of ours."""
    belief = knowing("1,0", **{f"{expected.shape}s": cell})
    task = _place(replanning, "GotoTrigger(T4)")
    assert strategies[name].affordance(task, number(cell), belief) == expected


TABLE_4 = {  # obstacle: subtask, its cell, the action under the affordance, and what is known by then
    "C1": ("GotoTrigger(T4)", "5,0", "East", knowing("4,0", cubes="5,0", spheres="7,0")),
    "C3": ("GotoGoal(G2)", "3,4", "East", knowing("4,4", "5,0 3,4", "7,0 2,4", doors_open=True)),
    "S1": ("GotoTrigger(T4)", "3,0", "South", knowing("1,0", spheres="3,0")),
    "S2": ("GotoGoal(G2)", "4,4", "North", knowing("5,4", "5,0", "7,0 4,4", doors_open=True)),
}


@pytest.mark.parametrize("name", STRATEGIES)
@pytest.mark.parametrize("obstacle", TABLE_4)
def test_table_4(strategies: dict[str, Strategy], replanning: Replanning, name: str, obstacle: str) -> None:
    """The example run's four rows, as printed, and each proved an optimal first action."""
    task, cell, word, belief = TABLE_4[obstacle]
    place, action = _place(replanning, task), ACTIONS.index(word)
    shape: Kind = "cube" if obstacle.startswith("C") else "sphere"
    expected = Affordance(shape, on_route=True, action=action)
    assert strategies[name].affordance(place, number(cell), belief) == expected
    proof = prove(replanning.replanner, place, belief, action)
    assert proof is not None
    assert proof.optimal


@pytest.mark.parametrize("name", STRATEGIES)
@pytest.mark.parametrize("cell", ["1,6", "0,1"])
def test_table_4_s_none(
    strategies: dict[str, Strategy], replanning: Replanning, name: str, cell: str
) -> None:
    """C2 and S3 stand off the route and afford nothing, in either subtask."""
    kind = "cubes" if cell == "1,6" else "spheres"
    for task, belief in (
        ("GotoTrigger(T4)", knowing("2,0", **{kind: cell})),
        ("GotoGoal(G2)", knowing("5,4", doors_open=True, **{kind: cell})),
    ):
        affordance = strategies[name].affordance(_place(replanning, task), number(cell), belief)
        assert not affordance.on_route
        assert affordance.action is None


def test_a_cube_that_boxes_in_leaves_no_action(
    strategies: dict[str, Strategy], replanning: Replanning
) -> None:
    """With cubes on all four sides neither strategy has an action or a route, and no subtask is left."""
    belief = knowing("3,1", cubes="2,1 4,1 3,0 3,2")
    task = _place(replanning, "GotoTrigger(T4)")
    for strategy in strategies.values():
        assert strategy.affordance(task, number("4,1"), belief) == Affordance(
            "cube", on_route=True, action=None
        )
        assert strategy.route(task, belief) is None
    assert replanning.choose(belief) is None


def test_a_wedged_sphere_is_pushed_in_vain_by_the_local_rule(
    local: LocalRule, replanning: Replanning
) -> None:
    """Table 3 calls every sphere rollable; replanning sees that the cube behind this one holds it."""
    belief = knowing("4,0", cubes="6,0", spheres="5,0")
    task = _place(replanning, "GotoTrigger(T4)")
    wrong = local.affordance(task, number("5,0"), belief)
    right = replanning.affordance(task, number("5,0"), belief)
    assert (wrong.action, right.action) == (SOUTH, EAST)
    proof = prove(replanning.replanner, task, belief, SOUTH)
    assert proof is not None
    assert not proof.optimal


def test_the_local_rule_is_refuted_where_static_values_mislead(
    local: LocalRule, replanning: Replanning
) -> None:
    """Beside a cube straight ahead, stepping back looks as good as stepping aside: 1 + 5 by static values.

    The rule goes North, the first in order; the shortest way leads aside, and is 2 steps shorter.
    """
    belief = knowing("3,1", cubes="4,1")
    task = _place(replanning, "GotoTrigger(T4)")
    assert local.affordance(task, number("4,1"), belief) == Affordance("cube", on_route=True, action=NORTH)
    refuted = prove(replanning.replanner, task, belief, NORTH)
    assert refuted is not None
    assert not refuted.optimal
    assert refuted.faults == ()
    assert refuted.loss == 2
    right = replanning.affordance(task, number("4,1"), belief)
    assert right.action == WEST
    proved = prove(replanning.replanner, task, belief, WEST)
    assert proved is not None
    assert proved.optimal


def test_the_local_rule_turns_aside_from_a_cube_two_grids_ahead(
    local: LocalRule, replanning: Replanning
) -> None:
    """Table 3 asks only whether the cube is on the route, so the preplanned action is refused at once."""
    task = _place(replanning, "GotoTrigger(T4)")
    belief = knowing("1,0", cubes="3,0")
    assert local.affordance(task, number("3,0"), belief) == Affordance("cube", on_route=True, action=EAST)
    assert replanning.affordance(task, number("3,0"), belief).action == SOUTH, "still optimal: it turns later"


def test_the_local_rule_passes_known_cubes(local: LocalRule, replanning: Replanning) -> None:
    """Its next best action is not one that another known cube stops, and its route begins with it."""
    task = _place(replanning, "GotoTrigger(T4)")
    belief = knowing("3,1", cubes="4,1 2,1 3,0")
    assert local.affordance(task, number("4,1"), belief).action == EAST
    route = local.route(task, belief)
    assert route is not None
    assert route == (EAST, SOUTH, SOUTH, SOUTH, WEST), "then on by the learnt values"


def test_without_obstacles_both_strategies_have_the_optimal_route(
    strategies: dict[str, Strategy], replanning: Replanning
) -> None:
    """From each grid of room A, static values and the search give the same route, ties broken alike."""
    task = _place(replanning, "GotoTrigger(T4)")
    for cell in sorted(MAZE.rooms["A"]):
        if cell != MAZE.triggers["T4"]:
            belief = knowing(str(cell))
            assert strategies["local"].route(task, belief) == strategies["replanning"].route(task, belief)


def test_replanning_takes_the_other_door_when_a_cube_closes_one(
    local: LocalRule, replanning: Replanning
) -> None:
    """From T4 D2 is nearer; with a cube in its grid the root goes to D1, and the local rule still to D2."""
    first, second = _place(replanning, "GotoDoor(D1)"), _place(replanning, "GotoDoor(D2)")
    belief = knowing("6,1", doors_open=True)
    assert replanning.choose(belief) == local.choose(belief) == second
    closed = replace(belief, cubes=numbers("5,4"))
    assert replanning.choose(closed) == first
    assert local.choose(closed) == second
    assert replanning.affordance(second, number("5,4"), closed) == Affordance(
        "cube", on_route=True, action=None
    )
    assert replanning.choose(replace(belief, cubes=numbers("5,4 2,4"))) is None


def test_replanning_weighs_the_way_to_a_door_with_the_way_beyond_it(replanning: Replanning) -> None:
    """From 3,3 with the goal at 3,7, D1 takes 2 + 4 steps and D2 3 + 5; a cube before D1 leaves only D2."""
    first, second = _place(replanning, "GotoDoor(D1)"), _place(replanning, "GotoDoor(D2)")
    belief = knowing("3,3", doors_open=True)
    assert replanning.choose(belief) == first
    assert replanning.choose(replace(belief, cubes=numbers("2,3"))) == second


def test_replanning_takes_the_first_door_where_both_are_equal(replanning: Replanning) -> None:
    """From 4,3 D2 is nearer, 2 steps for 3, but 5 steps from the goal for 4: a tie, and D1 comes first."""
    belief = knowing("4,3", doors_open=True)
    assert replanning.choose(belief) == _place(replanning, "GotoDoor(D1)")


def test_an_obstacle_counts_as_on_the_route_that_was_planned_before_it_was_seen(
    replanning: Replanning,
) -> None:
    """A cube that the new route avoids is on the old one; a second one on the new route was not."""
    task = _place(replanning, "GotoTrigger(T4)")
    belief = knowing("4,0", cubes="5,0 4,1")
    assert replanning.affordance(task, number("5,0"), belief).on_route
    assert not replanning.affordance(task, number("4,1"), knowing("4,0", cubes="4,1")).on_route


def test_the_local_rule_does_not_run_into_walls(local: LocalRule, replanning: Replanning) -> None:
    """From 2,0 to D1 past a cube at 2,1: staying at the wall is worth more than North, but avoids nothing."""
    task = _place(replanning, "GotoDoor(D1)")
    affordance = local.affordance(task, number("2,1"), knowing("2,0", cubes="2,1", doors_open=True))
    assert affordance == Affordance("cube", on_route=True, action=NORTH)
