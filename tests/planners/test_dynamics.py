"""Snapshots held to the exact planner over robot and spheres."""

import numpy as np
import pytest
from beliefs import MAZE, any_maze_graph, knowing
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import maze_layouts

from hierarchy import ground, two_rooms
from planners import Replanner
from planners.dynamics import (
    SNAPSHOTS,
    Fault,
    Reading,
    area_field,
    explore,
    judge_snapshot,
    move,
)
from planners.fields import UNREACHED, certify
from planners.search import Area
from worlds import ACTIONS, Layout, MazeState, maze_model, step

FAR = 10_000  # steps where there is no way


@st.composite
def problems(draw: st.DrawFn, spheres: int = 2) -> tuple[Replanner, int, MazeState]:
    """Draw a maze, a task that has not ended, and a belief with up to two cubes and some spheres."""
    layout: Layout = draw(maze_layouts(most=4))
    free = [layout.number(cell) for cell in layout.cells if cell not in layout.solid]
    robot = draw(st.sampled_from(free))
    things = draw(st.lists(st.sampled_from(free), max_size=spheres + 2, unique=True))
    things = [cell for cell in things if cell != robot]
    belief = MazeState(
        robot=robot,
        trigger=layout.number(layout.triggers["T1"]),
        goal=layout.number(layout.goals["G1"]),
        doors_open=draw(st.booleans()),
        cubes=frozenset(things[spheres:]),
        spheres=frozenset(things[:spheres]),
    )
    oracle = Replanner(layout, ground(any_maze_graph(layout), maze_model(layout)))
    task = oracle.grounded.place(draw(st.sampled_from(["Near", "Root"])))
    assume(not oracle.area(task, belief).terminal[belief.doors_open][belief.robot])
    return oracle, task, belief


def distances(oracle: Replanner, task: int, belief: MazeState) -> dict[Reading, int]:
    """Return the steps from a belief to the task's end, by every reading."""
    area = oracle.area(task, belief)
    fields = {reading: area_field(oracle.layout, area, belief, reading)[1] for reading in Reading}
    steps = {reading: int(field.distance[0]) for reading, field in fields.items()}
    return {reading: FAR if n == UNREACHED else n for reading, n in steps.items()}


@settings(max_examples=100, deadline=None)
@given(problems())
def test_the_exact_field_is_the_replanner_s_search(problem: tuple[Replanner, int, MazeState]) -> None:
    """Backwards over all states or forwards from one: the same steps and the same first actions."""
    oracle, task, belief = problem
    moves, field = area_field(oracle.layout, oracle.area(task, belief), belief, Reading.MOVING)
    assert certify(field) == ()
    for place in np.linspace(0, len(moves.states) - 1, num=5, dtype=int):
        plan = oracle.plan(task, moves.states[place])
        if plan is None:
            assert field.distance[place] == UNREACHED
        else:
            assert field.distance[place] == len(plan.actions)
            assert frozenset(np.flatnonzero(field.optimal()[place]).tolist()) == plan.first_actions


@settings(max_examples=100, deadline=None)
@given(problems())
def test_floor_is_never_longer_and_blocks_never_shorter_than_the_truth(
    problem: tuple[Replanner, int, MazeState],
) -> None:
    """A real way is a way over floor, and a way around every sphere is a real one."""
    steps = distances(*problem)
    assert steps[Reading.FLOOR] <= steps[Reading.MOVING] <= steps[Reading.BLOCKS]
    assert steps[Reading.FLOOR] <= steps[Reading.STANDING] <= steps[Reading.BLOCKS]


@settings(max_examples=60, deadline=None)
@given(problems(spheres=0))
def test_without_spheres_a_snapshot_is_exact(problem: tuple[Replanner, int, MazeState]) -> None:
    """Every reading gives the optimal first actions, or there is no way."""
    oracle, task, belief = problem
    found = [judge_snapshot(oracle, task, belief, reading) for reading in SNAPSHOTS]
    if oracle.plan(task, belief) is None:
        assert found == [None] * len(SNAPSHOTS)
    for judgement in found:
        if judgement is not None:
            assert judgement.fault is Fault.NONE
            assert judgement.snapshot == judgement.exact


@settings(max_examples=100, deadline=None)
@given(problems())
def test_a_judgement_is_the_difference_of_two_searches(problem: tuple[Replanner, int, MazeState]) -> None:
    """The first action that a snapshot holds optimal, carried out, and the rest searched exactly."""
    oracle, task, belief = problem
    plan = oracle.plan(task, belief)
    for reading in SNAPSHOTS:
        judgement = judge_snapshot(oracle, task, belief, reading)
        if plan is None:
            assert judgement is None
            continue
        assert judgement is not None
        assert judgement.exact == plan.first_actions
        if judgement.fault is Fault.BLIND:
            assert judgement.snapshot == frozenset()
            assert distances(oracle, task, belief)[reading] == FAR
            continue
        after = oracle.plan(task, step(oracle.layout, belief, min(judgement.snapshot))[0])
        loss = None if after is None else 1 + len(after.actions) - len(plan.actions)
        assert judgement.loss == loss
        assert (judgement.fault is Fault.TRAP) == (loss is None)
        assert (judgement.fault is Fault.NONE) == (min(judgement.snapshot) in plan.first_actions)
        assert reading is not Reading.BLOCKS or judgement.fault is not Fault.TRAP


@pytest.fixture(scope="module")
def oracle() -> Replanner:
    """Return the oracle of the paper's maze."""
    return Replanner(MAZE, ground(two_rooms(MAZE), maze_model(MAZE)))


@pytest.mark.parametrize(
    ("task", "belief", "faults"),
    [
        # South rolls the sphere into the corner, on to the goal, where nothing frees it.
        (
            "GotoGoal(G4)",
            knowing("5,4", spheres="6,4", doors_open=True),
            ("leaves no way",) * 2 + ("optimal",),
        ),
        # North bumps into the sphere: the wall behind it holds it, and the robot has lost a step.
        ("GotoTrigger(T1)", knowing("1,1", spheres="0,1"), ("optimal", "longer than needed", "optimal")),
        # The sphere lies on the target, and can be pushed off it.
        ("GotoTrigger(T1)", knowing("0,1", spheres="0,2"), ("optimal", "optimal", "sees no way")),
    ],
)
def test_the_smallest_faults_by_hand(
    oracle: Replanner, task: str, belief: MazeState, faults: tuple[str, str, str]
) -> None:
    """Each fault by one sphere and nothing else: as they stand, as floor, as blocks."""
    found = [judge_snapshot(oracle, oracle.grounded.place(task), belief, reading) for reading in SNAPSHOTS]
    assert tuple(judgement.fault for judgement in found if judgement is not None) == faults


def test_a_task_that_has_ended_affords_nothing(oracle: Replanner) -> None:
    """Asked at its end, the task is named."""
    place = oracle.grounded.place("GotoTrigger(T4)")
    with pytest.raises(ValueError, match=r"GotoTrigger\(T4\) has ended here"):
        judge_snapshot(oracle, place, knowing("6,1"), Reading.FLOOR)


def test_frozen_spheres_stay_and_doors_open() -> None:
    """Over the sphere on the trigger the doors open; no reading but the exact one moves it."""
    belief = knowing("5,1", spheres="6,1")
    south = ACTIONS.index("South")
    after = {reading: move(MAZE, belief, south, reading) for reading in Reading}
    assert {reading for reading, state in after.items() if state.doors_open} == {*Reading} - {Reading.BLOCKS}
    assert {reading for reading, state in after.items() if state.spheres != belief.spheres} == {
        Reading.MOVING
    }


def test_an_area_limits_the_moves() -> None:
    """Only South may be taken: the column below the robot is all there is."""
    everywhere = (((1,),) * 64,) * 2
    area = Area(everywhere, ((False,) * 64,) * 2)
    moves = explore(MAZE, [knowing("4,0")], Reading.FLOOR, area)
    assert [MAZE.cells[state.robot] for state in moves.states] == [(4, 0), (5, 0), (6, 0), (7, 0)]
    assert moves.allowed.sum(axis=1).tolist() == [1] * 4
