"""The robot's loop: encounters, ends of episodes, and what blocks it, with hand-made strategies and eyes."""

from collections.abc import Iterable
from functools import cache
from typing import ClassVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comparisons import robot as robot_module
from comparisons.belief import Belief
from comparisons.dynamic import random_episode
from comparisons.eyes import Sight, truth_ahead
from comparisons.learning import PairLearner
from comparisons.robot import MAX_STEPS, Robot, Run
from hierarchy import GroundGraph, checked, two_rooms
from perception.protocol import LABELS, NOTHING, Detection, Label, View
from perception.truth import Truth
from planners import Affordance, LocalRule, MaxQ, Replanner, Replanning
from worlds import (
    Appears,
    Cell,
    Change,
    Episode,
    Kind,
    Layout,
    MazeState,
    Obstacle,
    Outcome,
    Stream,
    ahead,
    load_layout,
    maze_model,
)

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


class Liar:
    """A backend that lies: of every view it says something else, drawn anew each time."""

    name = "liar"
    needs_frames = False

    def __init__(self, seed: int, habit: str) -> None:
        self.stream = Stream(seed)
        self.habit = habit

    def detect(self, views: Iterable[View]) -> list[Detection]:
        """Return lies."""
        return [self._lie(view.truth) for view in views]

    def _lie(self, truth: Detection) -> Detection:
        other: tuple[Label, ...] = tuple(label for label in LABELS if label != truth.label)
        match self.habit:
            case "swaps":
                swapped: dict[Label, Label] = {"none": "sphere", "cube": "sphere", "sphere": "none"}
                label = swapped[truth.label]
            case "blind":
                label = "none"
            case _:
                label = self.stream.choose(other)
        distance = 0 if label == "none" else truth.distance or 1 + self.stream.below(2)
        if self.habit != "doubts":
            return Detection(label, 1.0, distance)
        own = self.stream.between(0.4, 1.0)
        chances = tuple(own if each == label else (1 - own) / 2 for each in LABELS)
        abstains = label != "none" and self.stream.below(3) == 0
        return Detection(label, own, distance, chances, abstains)


class Remembering(Belief):
    """A belief that keeps what failed in which belief."""

    failures: ClassVar[list[tuple[MazeState, int]]] = []

    def feel(self, change: Change, robot: int, *, doors_open: bool) -> None:
        """Note the move, if it failed, and the belief in which it was made."""
        if not change.moved:
            self.failures.append((self.state, change.action))
        super().feel(change, robot, doors_open=doors_open)


@cache
def strategies() -> tuple[Replanning, LocalRule]:
    """Return replanning and the local rule, on values learnt for T4 and G2."""
    grounded = checked(two_rooms(MAZE), maze_model(MAZE))
    learnt = PairLearner(MAZE, grounded, "T4", "G2", seed=0)
    learnt.learn()
    return Replanning(Replanner(MAZE, grounded), learnt.learner), LocalRule(MAZE, learnt.learner)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    habit=st.sampled_from(["swaps", "blind", "lies", "doubts"]),
    places=st.lists(
        st.tuples(
            st.integers(0, 7), st.integers(0, 7), st.sampled_from(["cube", "sphere"]), st.integers(0, 20)
        ),
        max_size=8,
        unique_by=lambda place: place[:2],
    ),
    local=st.booleans(),
)
def test_no_lie_makes_a_run_repeat_a_failed_move(
    seed: int,
    habit: str,
    places: list[tuple[int, int, Kind, int]],
    local: bool,
) -> None:
    """Under a backend that always lies, a run ends by name and never fails twice in the same belief."""
    marks = {MAZE.start, MAZE.triggers["T4"], MAZE.goals["G2"]}
    obstacles = [
        Obstacle(f"O{i}", kind, Cell(row, col), appears=Appears("step", step=step))
        for i, (row, col, kind, step) in enumerate(places)
        if Cell(row, col) not in marks | MAZE.solid
    ]
    chosen = strategies()[local]
    robot = Robot(MAZE, strategies()[0].grounded, chosen, Sight(MAZE, Liar(seed, habit)))
    failures: list[tuple[MazeState, int]] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Remembering, "failures", failures)
        patch.setattr(robot_module, "Belief", Remembering)
        done = robot.run(Episode(MAZE, "T4", "G2", MAZE.start, obstacles))
    assert done.steps <= MAX_STEPS
    assert done.outcome in set(Outcome)
    assert (done.outcome is Outcome.TRUNCATED) <= (done.steps == MAX_STEPS)
    assert len(failures) == done.blocked
    assert len(set(failures)) == len(failures)


def test_a_ball_that_is_always_taken_for_nothing_does_not_stop_the_robot(grounded: GroundGraph) -> None:
    """It is pushed away unseen."""
    obstacles = [Obstacle("S0", "sphere", Cell(3, 0))]
    done = run(grounded, obstacles, says={"sphere": None})
    assert (done.outcome, done.steps, done.blocked) == (Outcome.REACHED, 15, 0)


def test_a_cube_taken_for_a_sphere_costs_few_blocked_steps(grounded: GroundGraph) -> None:
    """A backend in doubt (0.6 to 0.3) pushes once and believes in the cube from then on."""

    class Doubts(Told):
        """Says what it is told, in doubt."""

        def _detect(self, truth: Detection) -> Detection:
            if truth.label == "none":
                return NOTHING
            return Detection("sphere", 0.6, truth.distance, (0.1, 0.3, 0.6))

    robot = Robot(MAZE, grounded, strategies()[0], Sight(MAZE, Doubts({})))
    done = robot.run(Episode(MAZE, "T4", "G2", MAZE.start, cubes((3, 0))))
    assert (done.outcome, done.blocked) == (Outcome.REACHED, 1)
    assert done.belief.cubes == {MAZE.number(Cell(3, 0))}


def test_before_it_gives_up_the_robot_tries_what_it_doubts(grounded: GroundGraph) -> None:
    """Boxed in by spheres taken for cubes, but not for certain, it pushes one and arrives."""

    class Doubts(Told):
        """Calls every obstacle a cube, in doubt."""

        def _detect(self, truth: Detection) -> Detection:
            return truth if truth.label == "none" else Detection("cube", 0.9, truth.distance)

    boxed = [Obstacle(f"S{i}", "sphere", Cell(*at)) for i, at in enumerate([(0, 0), (2, 0), (1, 1)])]
    robot = Robot(MAZE, grounded, strategies()[0], Sight(MAZE, Doubts({})))
    done = robot.run(Episode(MAZE, "T4", "G2", MAZE.start, boxed))
    assert done.outcome is Outcome.REACHED
    closed = robot.run(Episode(MAZE, "T4", "G2", MAZE.start, cubes((0, 0), (2, 0), (1, 1))))
    assert (closed.outcome, closed.blocked) == (Outcome.NO_ROUTE, 3)


class Plain:
    """What a robot knows whose looks are always right: the last thing seen, felt or watched in each cell."""

    def __init__(self) -> None:
        self.cells: dict[int, str] = {}
        self.touched: set[int] = set()

    def see(self, cells: list[int], detection: Detection) -> None:
        """Believe what is seen, up to what was touched."""
        for distance, at in enumerate(cells, start=1):
            if at < 0 or at in self.touched or (detection.distance and distance > detection.distance):
                break
            self.cells[at] = detection.label if distance == detection.distance else "none"

    def feel(self, change: Change, cells: list[int]) -> None:
        """Believe what is felt; a sphere that should roll and does not is held by something unseen."""
        front, behind = cells
        if change.moved:
            self.put(front, "none")
            if change.push is not None:
                self.put(change.push.end, "sphere")
        elif self.cells.get(front) == "sphere" and behind >= 0 and self.cells.get(behind, "none") == "none":
            self.put(behind, "cube")
            self.touched.add(behind)
        elif front >= 0:
            self.put(front, "cube")
            self.touched.add(front)

    def put(self, at: int, label: str) -> None:
        """Believe so of a cell."""
        self.touched.discard(at)
        self.cells[at] = label


class Twofold(Belief):
    """A belief that is held to the plain one after whatever it takes in."""

    def __init__(self, layout: Layout, episode: Episode) -> None:
        super().__init__(layout, episode)
        self.plain = Plain()

    def _cells(self, action: int) -> list[int]:
        return [ahead(MAZE, self.state, action, distance) for distance in (1, 2)]

    def _hold(self) -> None:
        for label, cells in (("cube", self.state.cubes), ("sphere", self.state.spheres)):
            assert cells == {at for at, believed in self.plain.cells.items() if believed == label}

    def see(self, action: int, detection: Detection) -> int | None:
        """See twice."""
        self.plain.see(self._cells(action), detection)
        found = super().see(action, detection)
        self._hold()
        return found

    def feel(self, change: Change, robot: int, *, doors_open: bool) -> None:
        """Feel twice."""
        self.plain.feel(change, self._cells(change.action))
        super().feel(change, robot, doors_open=doors_open)
        self._hold()


@pytest.mark.parametrize("local", [False, True])
def test_told_the_truth_looks_need_no_adding_up(monkeypatch: pytest.MonkeyPatch, *, local: bool) -> None:
    """In random episodes what is believed is at every moment what was last seen, felt or watched."""
    monkeypatch.setattr(robot_module, "Belief", Twofold)
    robot = Robot(MAZE, strategies()[0].grounded, strategies()[local], Sight(MAZE, Truth()))
    pushed = blocked = 0
    for number in range(400):
        episode, trigger, goal = random_episode(MAZE, 3, number)
        if (trigger, goal) == ("T4", "G2"):
            done = robot.run(episode)
            pushed, blocked = pushed + len(done.pushes), blocked + done.blocked
    assert pushed > 0
    assert blocked > 0


class Headstrong:
    """A strategy that wants to go East whatever is known."""

    def __init__(self, task: int) -> None:
        self.task = task

    def choose(self, belief: MazeState) -> int | None:
        """Choose the same subtask always."""
        return self.task if belief.robot >= 0 else None

    def route(self, task: int, belief: MazeState) -> tuple[int, ...] | None:
        """Go East."""
        return (3,) if task == self.task and belief.robot >= 0 else None

    def affordance(self, task: int, obstacle: int, belief: MazeState) -> Affordance:
        """Let every obstacle afford East."""
        shape: Kind = "cube" if obstacle in belief.cubes else "sphere"
        return Affordance(shape, on_route=task == self.task, action=3)


def test_a_strategy_that_insists_has_no_route_left(grounded: GroundGraph) -> None:
    """Against the wall it fails once; in the same belief it is not tried again."""
    robot = Robot(MAZE, grounded, Headstrong(grounded.place("GotoTrigger(T4)")), Sight(MAZE, Truth()))
    done = robot.run(Episode(MAZE, "T4", "G2", MAZE.start))
    assert (done.outcome, done.steps, done.blocked) == (Outcome.NO_ROUTE, 4, 1)


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
