"""What the robot knows, worked out by hand on the two-room maze."""

from comparisons.belief import Belief
from perception.protocol import NOTHING, Detection
from worlds import ACTIONS, Cell, Change, Episode, MazeState, Obstacle, Push, load_layout

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


def test_actions_are_in_the_order_that_the_tests_assume() -> None:
    """The names above stand for the places in ACTIONS."""
    assert (ACTIONS[NORTH], ACTIONS[SOUTH], ACTIONS[WEST], ACTIONS[EAST]) == (
        "North",
        "South",
        "West",
        "East",
    )
