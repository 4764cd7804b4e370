"""The robot's loop: encounters, ends of episodes, and what blocks it, with hand-made strategies and eyes."""

from collections.abc import Iterable

import pytest

from comparisons.eyes import Sight, truth_ahead
from comparisons.robot import MAX_STEPS, Robot, Run
from hierarchy import GroundGraph, checked, two_rooms
from perception.protocol import NOTHING, Detection, View
from perception.truth import Truth
from planners import Affordance, MaxQ, Replanner, Replanning
from worlds import Cell, Episode, Kind, MazeState, Obstacle, Outcome, load_layout, maze_model

MAZE = load_layout("two_rooms")


@pytest.fixture(scope="module")
def grounded() -> GroundGraph:
    """Return the ground graph of the paper's maze."""
    return checked(two_rooms(MAZE), maze_model(MAZE))


class Told:
    """A backend that says what it was told to say of each shape."""

    name = "told"
    needs_frames = False

    def __init__(self, says: dict[Kind, Kind | None]) -> None:
        self.says = says

    def detect(self, views: Iterable[View]) -> list[Detection]:
        """Return what it was told to say, at the right distance."""
        return [self._detect(view.truth) for view in views]

    def _detect(self, truth: Detection) -> Detection:
        said = None if truth.label == "none" else self.says.get(truth.label, truth.label)
        return NOTHING if said is None else Detection(said, 1.0, truth.distance)


def run(
    grounded: GroundGraph,
    obstacles: Iterable[Obstacle],
    says: dict[Kind, Kind | None] | None = None,
    start: Cell = MAZE.start,
) -> Run:
    """Carry one episode to T4 and G2 through by replanning, completion values unlearnt."""
    strategy = Replanning(Replanner(MAZE, grounded), MaxQ(grounded, seed=(0,)))
    robot = Robot(MAZE, grounded, strategy, Sight(MAZE, Told(says or {})))
    return robot.run(Episode(MAZE, "T4", "G2", start, obstacles))


def cubes(*cells: tuple[int, int]) -> list[Obstacle]:
    """Return cubes that are there from the start."""
    return [Obstacle(f"C{i}", "cube", Cell(*at)) for i, at in enumerate(cells)]


def test_without_obstacles_the_robot_takes_the_shortest_way(grounded: GroundGraph) -> None:
    """15 steps: 6 to T4, 4 to D2, 5 to G2, under the tie break of the paper."""
    done = run(grounded, [])
    assert (done.outcome, done.steps, done.encounters) == (Outcome.REACHED, 15, [])
    names = [grounded.nodes[task].name for task in done.tasks]
    assert names == ["GotoTrigger(T4)"] * 6 + ["GotoDoor(D2)"] * 4 + ["GotoGoal(G2)"] * 5


def test_a_cube_on_the_way_is_met_once_a_subtask(grounded: GroundGraph) -> None:
    """The cube at 3,0 is seen from 1,0 and affords South still: it can be passed one cell later."""
    done = run(grounded, cubes((3, 0)))
    assert done.outcome is Outcome.REACHED
    met = [(e.obstacle, e.distance, e.affordance) for e in done.encounters]
    assert met == [("C0", 2, Affordance("cube", on_route=True, action=1))]
    assert Cell(3, 0) not in done.cells
    assert done.steps == 15


def test_a_boxed_in_robot_has_no_route_left(grounded: GroundGraph) -> None:
    """Cubes on every side of the start end the episode at once, under its name."""
    done = run(grounded, cubes((0, 0), (2, 0), (1, 1)))
    assert (done.outcome, done.steps) == (Outcome.NO_ROUTE, 0)


def test_a_wrong_shape_that_closes_the_way_is_named(grounded: GroundGraph) -> None:
    """Spheres taken for cubes close the way that pushing them would have opened."""
    spheres = [Obstacle(f"S{i}", "sphere", Cell(*at)) for i, at in enumerate([(2, 0), (1, 1)])]
    obstacles = [*cubes((0, 0)), *spheres]
    assert run(grounded, obstacles).outcome is Outcome.REACHED
    done = run(grounded, obstacles, says={"sphere": "cube"})
    assert (done.outcome, done.steps) == (Outcome.WRONG_SHAPE, 0)
    assert done.misread > 0


def test_a_cube_taken_for_a_sphere_is_found_out_by_pushing(grounded: GroundGraph) -> None:
    """The robot bumps, learns, goes round, and arrives."""
    done = run(grounded, cubes((3, 0)), says={"cube": "sphere"})
    assert done.outcome is Outcome.REACHED
    assert done.steps > 15
    assert any(a == b for a, b in zip(done.cells, done.cells[1:], strict=False))


def test_a_cube_that_is_not_seen_is_found_out_too(grounded: GroundGraph) -> None:
    """Blind to cubes, the robot still arrives: a failed move shows what is there, and is remembered."""
    done = run(grounded, cubes((3, 0), (4, 1)), says={"cube": None})
    assert done.outcome is Outcome.REACHED
    assert [e.obstacle for e in done.encounters if e.affordance.on_route] == []


def test_an_obstacle_in_view_but_off_the_route_affords_nothing(grounded: GroundGraph) -> None:
    """At 5,0 the robot looks South to turn East at 6,0: the cube at 7,0 needs no care."""
    done = run(grounded, cubes((7, 0)))
    assert done.steps == 15
    (met,) = done.encounters
    assert (met.obstacle, met.affordance) == ("C0", Affordance("cube", on_route=False, action=None))


def test_the_root_takes_the_other_door_when_one_is_closed(grounded: GroundGraph) -> None:
    """With D2's grid taken, GotoDoor(D2) has no way left and the root chooses GotoDoor(D1)."""
    done = run(grounded, cubes((5, 3)))
    assert done.outcome is Outcome.REACHED
    names = [grounded.nodes[task].name for task in done.tasks]
    assert "GotoDoor(D1)" in names
    refused = [e for e in done.encounters if e.affordance.on_route and e.affordance.action is None]
    assert [grounded.nodes[e.task].name for e in refused] == ["GotoDoor(D2)"]


class Fidget:
    """A strategy that walks to and fro."""

    def __init__(self, task: int) -> None:
        self.task = task

    def choose(self, belief: MazeState) -> int | None:
        """Choose the same subtask always."""
        return self.task if belief.robot >= 0 else None

    def route(self, task: int, belief: MazeState) -> tuple[int, ...] | None:
        """Go North from row 1, South from elsewhere."""
        return ((0,) if belief.robot == MAZE.number(MAZE.start) else (1,)) if task == self.task else None

    def affordance(self, task: int, obstacle: int, belief: MazeState) -> Affordance:
        """Fail: nothing stands in the way."""
        raise AssertionError(f"nothing stands in its way: {task}, {obstacle}, {belief}")


def test_an_episode_that_leads_nowhere_is_truncated(grounded: GroundGraph) -> None:
    """No strategy can hang an episode."""
    strategy = Fidget(grounded.place("GotoTrigger(T4)"))
    robot = Robot(MAZE, grounded, strategy, Sight(MAZE, Truth()))
    done = robot.run(Episode(MAZE, "T4", "G2", MAZE.start))
    assert (done.outcome, done.steps) == (Outcome.TRUNCATED, MAX_STEPS)


def test_watching_sees_every_step_before_it_is_taken(grounded: GroundGraph) -> None:
    """One moment a step, with the action that follows."""
    moments = []
    strategy = Replanning(Replanner(MAZE, grounded), MaxQ(grounded, seed=(0,)))
    robot = Robot(MAZE, grounded, strategy, Sight(MAZE, Truth()))
    done = robot.run(Episode(MAZE, "T4", "G2", MAZE.start, MAZE.obstacles), moments.append)
    assert [moment.step for moment in moments] == list(range(done.steps))
    assert [moment.task for moment in moments] == done.tasks


@pytest.mark.parametrize(
    ("robot", "action", "expected"),
    [
        ((1, 0), 1, Detection("sphere", 1.0, 2)),
        ((2, 0), 1, Detection("sphere", 1.0, 1)),
        ((1, 0), 3, NOTHING),
        ((4, 2), 3, NOTHING),  # a wall stands before the sphere
        ((0, 0), 3, Detection("cube", 1.0, 2)),
    ],
)
def test_the_truth_ahead_ends_at_walls(robot: tuple[int, int], action: int, expected: Detection) -> None:
    """The nearest obstacle within two cells counts, none behind a wall."""
    spheres = frozenset({MAZE.number(Cell(3, 0)), MAZE.number(Cell(4, 4))})
    state = MazeState(MAZE.number(Cell(*robot)), 49, 31, cubes=frozenset({2, 3}), spheres=spheres)
    assert truth_ahead(MAZE, state, action) == expected


def test_a_backend_that_needs_frames_needs_a_twin() -> None:
    """Without one it is refused before anything runs."""
    backend = Told({})
    backend.needs_frames = True
    with pytest.raises(ValueError, match="give it a twin"):
        Sight(MAZE, backend)
