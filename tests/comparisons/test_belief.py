"""What the robot knows, worked out by hand on the two-room maze."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from comparisons.belief import Belief, Filter
from perception.protocol import LABELS, NOTHING, Chances, Detection
from worlds import ACTIONS, Cell, Change, Episode, MazeState, Obstacle, Push, load_layout, step

MAZE = load_layout("two_rooms")
NORTH, SOUTH, WEST, EAST = range(4)


def cell(row: int, col: int) -> int:
    """Return a cell's number."""
    return MAZE.number(Cell(row, col))


def belief_at(row: int, col: int) -> Belief:
    """Return the belief of a robot that has seen nothing yet."""
    return Belief(MAZE, Episode(MAZE, "T4", "G2", Cell(row, col)))


def change(action: int, *, moved: bool, push: Push | None = None) -> Change:
    """Return what a step did."""
    return Change(action, moved, push, opened=False, appeared=())


def test_a_belief_begins_without_obstacles() -> None:
    """Obstacles that are there from the start are not known before they are seen."""
    obstacle = Obstacle("C1", "cube", Cell(2, 0))
    belief = Belief(MAZE, Episode(MAZE, "T4", "G2", Cell(1, 0), [obstacle]))
    assert belief.state == MazeState(cell(1, 0), cell(6, 1), cell(3, 7))


def test_a_look_places_what_is_seen_at_its_distance() -> None:
    """A cube two cells ahead is believed there, and the cell before it free."""
    belief = belief_at(1, 0)
    assert belief.see(SOUTH, Detection("sphere", 0.9, 1)) == cell(2, 0)
    assert belief.see(SOUTH, Detection("cube", 0.9, 2)) == cell(3, 0)
    assert (belief.state.cubes, belief.state.spheres) == ({cell(3, 0)}, set())


def test_a_later_look_corrects_a_shape() -> None:
    """What is seen anew replaces what was believed of the same cell."""
    belief = belief_at(1, 0)
    belief.see(SOUTH, Detection("cube", 0.6, 1))
    belief.see(SOUTH, Detection("sphere", 0.9, 1))
    assert (belief.state.cubes, belief.state.spheres) == (set(), {cell(2, 0)})


def test_an_empty_look_clears_the_cells_ahead() -> None:
    """Seeing nothing frees both cells ahead, and no other."""
    belief = belief_at(1, 0)
    belief.see(EAST, Detection("cube", 0.9, 1))
    belief.see(SOUTH, Detection("cube", 0.9, 2))
    assert belief.see(SOUTH, NOTHING) is None
    assert belief.state.cubes == {cell(1, 1)}


def test_nothing_is_believed_beyond_a_wall() -> None:
    """A detection two cells ahead with a wall in between is refused."""
    belief = belief_at(0, 3)
    assert belief.see(EAST, Detection("cube", 0.9, 1)) is None
    assert belief.see(SOUTH, Detection("cube", 0.9, 2)) == cell(2, 3)
    assert belief_at(6, 0).see(SOUTH, Detection("cube", 0.9, 2)) is None


def test_a_failed_move_shows_an_obstacle_that_sight_cannot_undo() -> None:
    """What stopped the robot stays believed, whatever a look says."""
    belief = belief_at(1, 0)
    belief.feel(change(SOUTH, moved=False), cell(1, 0), doors_open=False)
    assert belief.see(SOUTH, NOTHING) == cell(2, 0)
    assert belief.state.cubes == {cell(2, 0)}


def test_a_sphere_that_does_not_roll_hides_something_behind_it() -> None:
    """The blocker is inferred behind the sphere, which is still a sphere."""
    belief = belief_at(1, 0)
    belief.see(SOUTH, Detection("sphere", 0.9, 1))
    belief.feel(change(SOUTH, moved=False), cell(1, 0), doors_open=False)
    assert (belief.state.cubes, belief.state.spheres) == ({cell(3, 0)}, {cell(2, 0)})


def test_a_sphere_wedged_by_a_wall_counts_as_a_cube() -> None:
    """With a wall behind it there is nothing to infer: it blocks."""
    belief = belief_at(1, 0)
    belief.see(NORTH, Detection("sphere", 0.9, 1))
    belief.feel(change(NORTH, moved=False), cell(1, 0), doors_open=False)
    assert (belief.state.cubes, belief.state.spheres) == ({cell(0, 0)}, set())


def test_a_push_moves_the_sphere_to_where_it_came_to_rest() -> None:
    """The robot watches the roll, even of a sphere that it had not seen."""
    belief = belief_at(1, 0)
    push = Push(cell(2, 0), cell(5, 0))
    belief.feel(change(SOUTH, moved=True, push=push), cell(2, 0), doors_open=False)
    assert belief.state == MazeState(cell(2, 0), cell(6, 1), cell(3, 7), spheres=frozenset({cell(5, 0)}))


def test_walking_through_a_phantom_dispels_it() -> None:
    """A cell that the robot enters without a push is free."""
    belief = belief_at(1, 0)
    belief.see(SOUTH, Detection("sphere", 0.9, 1))
    belief.feel(change(SOUTH, moved=True), cell(2, 0), doors_open=True)
    assert belief.state.spheres == set()
    assert belief.state.doors_open


def test_misjudging_means_seeing_wrongly_and_still_believing_it() -> None:
    """A shape seen wrongly counts until it is corrected; what was inferred by touch never does."""
    truth = MazeState(cell(1, 0), cell(6, 1), cell(3, 7), cubes=frozenset({cell(2, 0)}))
    belief = belief_at(1, 0)
    assert not belief.misjudges(truth)
    belief.see(SOUTH, Detection("sphere", 0.9, 1))
    assert belief.misjudges(truth)
    assert belief.corrected(truth) == truth
    belief.see(SOUTH, Detection("cube", 0.9, 1))
    assert not belief.misjudges(truth)
    felt = belief_at(1, 0)
    felt.feel(change(EAST, moved=False), cell(1, 0), doors_open=False)
    assert not felt.misjudges(truth)


def looked(chances: Chances, distance: int = 1, *, abstains: bool = False) -> Detection:
    """Return what a backend with these probabilities says."""
    label = max(range(3), key=lambda place: chances[place])
    return Detection(LABELS[label], chances[label], distance if label else 0, chances, abstains)


def fail(belief: Belief, action: int) -> None:
    """Let a move fail."""
    belief.feel(change(action, moved=False), belief.state.robot, doors_open=False)


def test_the_first_look_is_believed_as_it_is() -> None:
    """Nothing is known before it, so that its probabilities are the belief."""
    belief = belief_at(1, 0)
    assert belief.chances(cell(2, 0)) == pytest.approx((1 / 3, 1 / 3, 1 / 3))
    belief.see(SOUTH, looked((0.1, 0.6, 0.3)))
    assert belief.chances(cell(2, 0)) == pytest.approx((0.1, 0.6, 0.3))
    assert belief.state.cubes == {cell(2, 0)}


def test_looks_from_several_places_add_up() -> None:
    """Two looks at a cube outweigh one that takes it for a sphere; by hand with Bayes' rule."""
    belief = belief_at(1, 0)
    belief.see(SOUTH, looked((0.1, 0.7, 0.2), 2))
    belief.feel(change(SOUTH, moved=True), cell(2, 0), doors_open=False)
    belief.see(SOUTH, looked((0.1, 0.7, 0.2), 1))
    # In between: 0.9 * 0.1 + 0.02 * 0.9 free, 0.005 + 0.97 * 0.7 + 0.01 * 0.2 a cube, the rest a sphere.
    weights = 0.108 * 0.1, 0.686 * 0.7, 0.206 * 0.2
    assert belief.chances(cell(3, 0)) == pytest.approx([w / sum(weights) for w in weights])
    belief.see(SOUTH, looked((0.0, 0.4, 0.6), 1))
    assert belief.state.cubes == {cell(3, 0)}


def test_the_same_picture_is_evidence_once() -> None:
    """Looking again from the same place, with the same answer, changes nothing."""
    belief = belief_at(1, 0)
    belief.see(SOUTH, looked((0.1, 0.6, 0.3)))
    before = belief.chances(cell(2, 0))
    belief.see(SOUTH, looked((0.1, 0.6, 0.3)))
    assert belief.chances(cell(2, 0)) == before
    belief.see(SOUTH, looked((0.1, 0.61, 0.29)))
    assert belief.chances(cell(2, 0))[1] > before[1]


def test_an_obstacle_that_appears_is_believed_at_once() -> None:
    """However often a cell was seen free, one sure look outweighs it."""
    belief = belief_at(1, 0)
    for sure in (0.96, 0.97, 0.98, 0.99):
        belief.see(SOUTH, looked((sure, (1 - sure) / 2, (1 - sure) / 2)))
    assert belief.see(SOUTH, looked((0.02, 0.96, 0.02))) == cell(2, 0)
    assert belief.state.cubes == {cell(2, 0)}


def test_an_abstaining_look_leaves_the_shape_to_a_push() -> None:
    """Something is there: it is believed a sphere, and a cube once it did not roll."""
    belief = belief_at(1, 0)
    assert belief.see(SOUTH, looked((0.1, 0.8, 0.1), abstains=True)) == cell(2, 0)
    assert belief.state.spheres == {cell(2, 0)}
    fail(belief, SOUTH)
    assert (belief.state.cubes, belief.state.spheres) == ({cell(2, 0)}, set())


def test_a_doubtful_sphere_that_does_not_roll_is_a_cube() -> None:
    """0.2 for a cube outweighs 0.7 for a sphere that something unseen holds, a case in ten."""
    belief = belief_at(1, 0)
    belief.see(SOUTH, looked((0.1, 0.2, 0.7)))
    fail(belief, SOUTH)
    assert (belief.state.cubes, belief.state.spheres) == ({cell(2, 0)}, set())


def test_where_the_cell_behind_was_seen_free_a_sphere_is_doubted_sooner() -> None:
    """0.09 for a cube is less than a case in ten of 0.9, and more than nothing behind at all."""
    belief = Belief(MAZE, Episode(MAZE, "T4", "G2", Cell(1, 0)), Filter(appears=0.1))
    never = Belief(MAZE, Episode(MAZE, "T4", "G2", Cell(1, 0)), Filter(appears=0.01))
    for one in (belief, never):
        one.see(SOUTH, NOTHING)
        one.see(SOUTH, looked((0.0, 0.05, 0.95)))
        fail(one, SOUTH)
    assert belief.state.spheres == {cell(2, 0)}
    assert (never.state.cubes, never.state.spheres) == ({cell(2, 0)}, set())


def test_what_seemed_to_hold_a_sphere_is_forgotten_once_it_is_a_cube() -> None:
    """The second failed push, from another side, says cube; the blocker inferred from the first goes."""
    belief = belief_at(1, 1)
    belief.see(SOUTH, looked((0.0, 0.08, 0.92)))
    fail(belief, SOUTH)
    assert (belief.state.cubes, belief.state.spheres) == ({cell(3, 1)}, {cell(2, 1)})
    for action, to in ((EAST, (1, 2)), (SOUTH, (2, 2))):
        belief.feel(change(action, moved=True), cell(*to), doors_open=False)
    fail(belief, WEST)
    assert (belief.state.cubes, belief.state.spheres) == ({cell(2, 1)}, set())
    assert belief.chances(cell(3, 1)) == Filter().prior


def test_a_sphere_rolls_only_through_free_cells() -> None:
    """What was inferred where a sphere has rolled through is not there."""
    belief = belief_at(1, 0)
    belief.see(SOUTH, Detection("sphere", 1.0, 1))
    fail(belief, SOUTH)
    assert belief.state.cubes == {cell(3, 0)}
    push = Push(cell(2, 0), cell(5, 0))
    belief.feel(change(SOUTH, moved=True, push=push), cell(2, 0), doors_open=False)
    assert (belief.state.cubes, belief.state.spheres) == (set(), {cell(5, 0)})


def test_a_move_that_failed_in_this_belief_is_ruled_out() -> None:
    """It is remembered with the belief, and what stands ahead then counts as a cube; a wall is no news."""
    belief = belief_at(1, 0)
    belief.see(SOUTH, Detection("sphere", 1.0, 1))
    before = belief.state
    fail(belief, SOUTH)
    assert not belief.fails(SOUTH)  # another belief by now
    belief.state = before
    assert belief.fails(SOUTH)
    assert not belief.fails(EAST)
    assert belief.rule_out(SOUTH)
    assert belief.state.cubes >= {cell(2, 0)}
    assert not belief.rule_out(SOUTH)
    assert not belief.rule_out(WEST)


def test_doubt_falls_on_the_least_certain_obstacle_first() -> None:
    """One by one, until only what was touched or told for certain is left."""
    belief = belief_at(1, 1)
    belief.see(NORTH, looked((0.1, 0.8, 0.1)))
    belief.see(EAST, looked((0.1, 0.6, 0.3)))
    belief.see(SOUTH, Detection("cube", 1.0, 1))
    fail(belief, WEST)
    assert belief.doubt()
    assert belief.state.cubes == {cell(0, 1), cell(2, 1), cell(1, 0)}
    assert belief.doubt()
    assert belief.state.cubes == {cell(2, 1), cell(1, 0)}
    assert not belief.doubt()


steps_of = st.tuples(
    st.integers(0, 3),
    st.tuples(st.integers(1, 20), st.integers(0, 20), st.integers(0, 20)),
    st.integers(1, 2),
    st.booleans(),
)


@given(st.lists(steps_of, min_size=1, max_size=30))
def test_after_a_failed_move_the_belief_agrees_that_it_fails(
    looks: list[tuple[int, tuple[int, int, int], int, bool]],
) -> None:
    """Whatever was seen before, the world that is believed in lets the same move fail as well."""
    belief = belief_at(1, 1)
    for action, weights, distance, abstains in looks:
        none, cube, sphere = (weight / sum(weights) for weight in weights)
        belief.see(action, looked((none, cube, sphere), distance, abstains=abstains))
        fail(belief, action)
        assert step(MAZE, belief.state, action) == (belief.state, None)
        assert not belief.state.cubes & belief.state.spheres


@given(
    st.tuples(*[st.floats(0.01, 1)] * 3),
    st.lists(st.tuples(*[st.floats(0, 1)] * 3).filter(lambda row: sum(row) > 0.1), max_size=30),
)
def test_the_filter_gives_probabilities_and_never_certainty_by_sight_alone(
    before: Chances, looks: list[Chances]
) -> None:
    """However many looks agree, they sum to 1, and what is believed later leaves room for anything."""
    filter_ = Filter()
    chances = tuple(b / sum(before) for b in before)
    for none, cube, sphere in looks:
        total = none + cube + sphere
        chances = filter_.look(filter_.later(chances), (none / total, cube / total, sphere / total))
        assert sum(chances) == pytest.approx(1)
        assert min(filter_.later(chances)) > 0


def test_actions_are_in_the_order_that_the_tests_assume() -> None:
    """The names above stand for the places in ACTIONS."""
    assert (ACTIONS[NORTH], ACTIONS[SOUTH], ACTIONS[WEST], ACTIONS[EAST]) == (
        "North",
        "South",
        "West",
        "East",
    )
