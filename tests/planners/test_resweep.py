"""Values swept anew in the experienced model: what it knows, what it plans, and where the oracle differs."""

from dataclasses import replace

import pytest
from beliefs import MAZE, knowing, number
from hypothesis import given
from hypothesis import strategies as st

from comparisons.learning import PairLearner
from hierarchy import ground, two_rooms
from planners import MaxQ, Replanner, Replanning
from planners.dynamics import Reading, judge_snapshot
from planners.resweep import Experience, Remembering, Sweeper, ValueSweep
from worlds import ACTIONS, Cell, MazeState, maze_model, state_number

NORTH, SOUTH, WEST, EAST = range(4)
GROUNDED = ground(two_rooms(MAZE), maze_model(MAZE))
START = state_number(MAZE, GROUNDED.model.index, knowing("1,0"))
FULL = Experience.complete(MAZE, GROUNDED, [START])
ORACLE = Replanner(MAZE, GROUNDED)
TRIGGER, FIRST, SECOND, GOAL = map(
    GROUNDED.place, ("GotoTrigger(T4)", "GotoDoor(D1)", "GotoDoor(D2)", "GotoGoal(G2)")
)


@st.composite
def beliefs(draw: st.DrawFn, *, spheres: int) -> tuple[int, MazeState]:
    """Draw a task and what the robot knows as it runs, up to eight obstacles, so many of them spheres."""
    task = draw(st.sampled_from((TRIGGER, FIRST, SECOND, GOAL)))
    rooms = MAZE.rooms
    room = rooms["B"] if task == GOAL else rooms["A"]
    ended = {TRIGGER: Cell(6, 1), GOAL: Cell(3, 7)}.get(task)
    robot = draw(st.sampled_from(sorted(room - {ended})))
    free = [n for n, cell in enumerate(MAZE.cells) if cell != robot]
    taken = draw(st.lists(st.sampled_from(free), unique=True, max_size=8))
    balls = frozenset(taken[:spheres])
    belief = replace(knowing(str(robot), doors_open=task != TRIGGER), spheres=balls)
    return task, replace(belief, cubes=frozenset(taken) - balls)


@given(beliefs(spheres=0))
def test_among_cubes_full_experience_plans_as_the_oracle_does(drawn: tuple[int, MazeState]) -> None:
    """The same plan, and the same set of optimal first actions, or none by both."""
    mine, best = Sweeper(MAZE, GROUNDED, FULL).plan(*drawn), ORACLE.plan(*drawn)
    if best is None:
        assert mine is None
    else:
        assert mine is not None
        assert (mine.actions, mine.first_actions) == (best.actions, best.first_actions)
        assert mine.depths == {}, "it certifies nothing"


@given(beliefs(spheres=3))
def test_among_spheres_full_experience_plans_as_a_snapshot_as_they_stand(
    drawn: tuple[int, MazeState],
) -> None:
    """Spheres are read as `Reading.STANDING` reads them: passable where they could roll just now."""
    mine, snapshot = (
        Sweeper(MAZE, GROUNDED, FULL).plan(*drawn),
        judge_snapshot(ORACLE, *drawn, Reading.STANDING),
    )
    if snapshot is not None:
        assert (frozenset() if mine is None else mine.first_actions) == snapshot.snapshot


def test_a_sphere_in_a_corner_shows_what_a_snapshot_misses() -> None:
    """G4 is the corner 7,4: pushed South the sphere lies on the goal for ever (docs/dynamics.md)."""
    marks = MAZE.number(MAZE.triggers["T1"]), MAZE.number(MAZE.goals["G4"])
    belief = MazeState(number("5,4"), *marks, doors_open=True, spheres=frozenset({number("6,4")}))
    task = GROUNDED.place("GotoGoal(G4)")
    mine, best = Sweeper(MAZE, GROUNDED, FULL).plan(task, belief), ORACLE.plan(task, belief)
    assert mine is not None
    assert best is not None
    assert (mine.actions[0], best.actions[0]) == (SOUTH, EAST)


def test_a_wedged_sphere_is_not_pushed() -> None:
    """A cube behind it holds it, as the sweep knows and table 3 does not."""
    sweep = ValueSweep(MAZE, MaxQ(GROUNDED, seed=(0,)), FULL)
    belief = knowing("4,0", cubes="6,0", spheres="5,0")
    found = sweep.affordance(TRIGGER, number("5,0"), belief)
    assert (found.shape, found.on_route, found.action) == ("sphere", True, EAST)


def test_what_was_never_tried_is_not_planned_with() -> None:
    """Without the move South from 1,0 and from 1,1 the way to T4 leads over column 2."""
    after = {
        key: to
        for key, to in FULL.after.items()
        if key not in {(False, number(cell), SOUTH) for cell in ("1,0", "1,1")}
    }
    plan = Sweeper(MAZE, GROUNDED, Experience(after)).plan(TRIGGER, knowing("1,0"))
    assert plan is not None
    assert [ACTIONS[a] for a in plan.actions[:3]] == ["East", "East", "South"]
    nothing = Sweeper(MAZE, GROUNDED, Experience({}))
    assert nothing.plan(TRIGGER, knowing("1,0")) is None
    ended = nothing.plan(TRIGGER, knowing("6,1"))
    assert ended is not None
    assert ended.actions == (), "a task that has ended needs no experience"


def test_a_direction_never_tried_behind_a_sphere_is_taken_to_be_free() -> None:
    """The wall behind 7,0 holds a sphere; a learner that never ran into it pushes."""
    task = GROUNDED.place("GotoDoor(D1)")
    belief = knowing("6,0", spheres="7,0", cubes="5,0 6,1", doors_open=True)
    assert Sweeper(MAZE, GROUNDED, FULL).plan(task, belief) is None
    unknown = {key: to for key, to in FULL.after.items() if key != (True, number("7,0"), SOUTH)}
    plan = Sweeper(MAZE, GROUNDED, Experience(unknown)).plan(task, belief)
    assert plan is not None
    assert plan.actions[0] == SOUTH


@pytest.fixture(scope="module")
def pair() -> PairLearner:
    """Return a learner of the pair (T4, G2), learnt."""
    learner = PairLearner(MAZE, GROUNDED, "T4", "G2", seed=3)
    learner.learn()
    return learner


@pytest.fixture(scope="module")
def remembering(pair: PairLearner) -> Remembering:
    """Return a learner that has done the same and kept what it tried."""
    learner = Remembering(GROUNDED, pair.runs.seeds[0])
    for phase in pair.phases():
        learner.train(*phase)
    return learner


def test_remembering_changes_nothing_in_what_is_learnt(pair: PairLearner, remembering: Remembering) -> None:
    """Its values are the compiled learner's, to the last bit; what it kept is what the maze does."""
    assert remembering.completion == pair.learner.completion
    successors = GROUNDED.model.successors
    assert len(remembering.tried) > 300
    assert all(successors[state, action] == to for (state, action), to in remembering.tried.items())


def test_a_measurement_is_no_experience(remembering: Remembering) -> None:
    """A greedy way from a state that was never met adds nothing."""
    before = dict(remembering.tried)
    other = replace(knowing("1,0"), goal=number("1,5"))
    state = state_number(MAZE, GROUNDED.model.index, other)
    assert remembering.greedy_route(TRIGGER, state) is not None
    assert remembering.tried == before


def test_what_is_tried_with_one_trigger_is_known_with_another(remembering: Remembering) -> None:
    """A learner never acts from its own trigger while the doors are shut, but from that of another pair."""
    alone = Experience.of(MAZE, GROUNDED, remembering.tried)
    west = False, number("6,1"), WEST
    assert west not in alone.after
    other = PairLearner(MAZE, GROUNDED, "T1", "G2", seed=3)
    learner = Remembering(GROUNDED, other.runs.seeds[0])
    learner.train(*other.phases()[0])
    both = Experience.of(MAZE, GROUNDED, remembering.tried | learner.tried)
    assert both.after[west] == number("6,0")
    assert alone.after.items() <= both.after.items()


def test_experience_of_learning_suffices_among_cubes(pair: PairLearner, remembering: Remembering) -> None:
    """The learner has tried every move of its subtasks: it affords what the oracle does, at each cube."""
    experience = Experience.of(MAZE, GROUNDED, remembering.tried)
    sweep = ValueSweep(MAZE, pair.learner, experience)
    replanning = Replanning(ORACLE, pair.learner)
    compared = 0
    for robot in sorted(MAZE.rooms["A"] - {Cell(6, 1)}):
        for cube in sorted(MAZE.rooms["A"] - {robot, Cell(6, 1)}):
            belief = knowing(str(robot), cubes=str(cube))
            asked = TRIGGER, MAZE.number(cube), belief
            assert sweep.affordance(*asked) == replanning.affordance(*asked)
            assert sweep.choose(belief) == replanning.choose(belief)
            compared += 1
    assert compared == 31 * 30
