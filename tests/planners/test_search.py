"""The replanning oracle and its proofs, held to networkx on joint state graphs made by `worlds.step`."""

from collections.abc import Mapping
from dataclasses import replace

import networkx as nx
import pytest
from beliefs import MAZE, any_maze_graph, knowing, number
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import ACTION_NUMBERS, maze_layouts

from hierarchy import Call, TaskGraph, ground, two_rooms
from planners import Plan, Replanner, prove, verify
from worlds import (
    ACTIONS,
    Cell,
    Layout,
    MazeState,
    maze_model,
    maze_variables,
    parse_layout,
    step,
)

NORTH, SOUTH, WEST, EAST = range(4)
END = "end"  # the node behind every state in which the task has ended


def _ended(task: str, state: MazeState) -> bool:
    """Return whether a task has ended, by the words of its declaration."""
    return state.robot == state.trigger if task == "Near" else state.doors_open and state.robot == state.goal


def _inside(layout: Layout, task: str, state: MazeState) -> bool:
    """Return whether a state is in a task's working space."""
    return task == "Root" or layout.cells[state.robot] in layout.room(layout.start)


def _distances(layout: Layout, task: str, belief: MazeState) -> Mapping[MazeState, int]:
    """Return the steps to the task's end of every joint state that it can come to and end from."""
    graph: nx.DiGraph = nx.DiGraph()
    graph.add_nodes_from([belief, END])
    stack, seen = [belief], {belief}
    while stack:
        state = stack.pop()
        if _ended(task, state):
            graph.add_edge(state, END)
            continue
        if not _inside(layout, task, state):
            continue
        for action in range(len(ACTIONS)):
            after, _ = step(layout, state, action)
            if _ended(task, after) or _inside(layout, task, after):
                graph.add_edge(state, after)
                if after not in seen:
                    seen.add(after)
                    stack.append(after)
    found = nx.single_source_shortest_path_length(graph.reverse(copy=False), END)
    return {state: length - 1 for state, length in found.items() if state != END}


def _optimal(layout: Layout, belief: MazeState, distance: Mapping[MazeState, int]) -> set[int]:
    """Return the actions that lead one step nearer."""
    left = distance[belief]
    after = {action: step(layout, belief, action)[0] for action in range(len(ACTIONS))}
    return {action for action, state in after.items() if left and distance.get(state, left) == left - 1}


@st.composite
def _problems(draw: st.DrawFn) -> tuple[Replanner, str, MazeState]:
    """Draw a maze, a task, and a belief with up to four cubes and two spheres."""
    layout = draw(maze_layouts(most=4))
    free = [layout.number(cell) for cell in layout.cells if cell not in layout.solid]
    robot = draw(st.sampled_from(free))
    things = draw(st.lists(st.sampled_from(free), max_size=6, unique=True))
    things = [cell for cell in things if cell != robot]
    belief = MazeState(
        robot=robot,
        trigger=layout.number(draw(st.sampled_from(list(layout.triggers.values())))),
        goal=layout.number(draw(st.sampled_from(list(layout.goals.values())))),
        doors_open=draw(st.booleans()),
        cubes=frozenset(things[2:]),
        spheres=frozenset(things[:2]),
    )
    oracle = Replanner(layout, ground(any_maze_graph(layout), maze_model(layout)))
    return oracle, draw(st.sampled_from(["Near", "Root"])), belief


PROBLEMS = _problems()


@settings(max_examples=150, deadline=None)
@given(PROBLEMS)
def test_a_plan_is_networkx_s_shortest_path(problem: tuple[Replanner, str, MazeState]) -> None:
    """Length, set of first actions and first plan in order are networkx's; None exactly where it has none."""
    oracle, task, belief = problem
    distance = _distances(oracle.layout, task, belief)
    plan = oracle.plan(oracle.grounded.place(task), belief)
    if belief not in distance:
        assert plan is None
        return
    assert plan is not None
    assert len(plan.actions) == distance[belief]
    assert plan.first_actions == _optimal(oracle.layout, belief, distance)
    first, state = [], belief
    while distance[state]:
        first.append(min(_optimal(oracle.layout, state, distance)))
        state, _ = step(oracle.layout, state, first[-1])
    assert plan.actions == tuple(first)


@settings(max_examples=100, deadline=None)
@given(PROBLEMS)
def test_a_plan_s_certificate_is_accepted(problem: tuple[Replanner, str, MazeState]) -> None:
    """Verify finds no fault, and the certificate's depths stay below the plan's length."""
    oracle, task, belief = problem
    place = oracle.grounded.place(task)
    plan = oracle.plan(place, belief)
    assume(plan is not None)
    assert plan is not None
    assert verify(oracle.layout, oracle.area(place, belief), belief, plan) == ()
    assert all(0 <= depth < len(plan.actions) for depth in plan.depths.values())


@settings(max_examples=150, deadline=None)
@given(PROBLEMS, st.data())
def test_a_corrupted_certificate_is_refused(
    problem: tuple[Replanner, str, MazeState], data: st.DataObject
) -> None:
    """Too short or too long a plan, a depth raised or removed: each is a fault."""
    oracle, task, belief = problem
    place = oracle.grounded.place(task)
    plan = oracle.plan(place, belief)
    assume(plan is not None and plan.actions)
    assert plan is not None
    near = data.draw(st.sampled_from(sorted(plan.depths, key=lambda s: (s[0], s[1], sorted(s[2])))))
    match data.draw(st.sampled_from(["shorter", "longer", "raised", "removed"])):
        case "shorter":
            wrong = replace(plan, actions=plan.actions[:-1])
        case "longer":
            wrong = replace(plan, actions=(*plan.actions, data.draw(ACTION_NUMBERS)))
        case "raised":
            more = data.draw(st.integers(1, 3))
            wrong = replace(plan, depths={**plan.depths, near: plan.depths[near] + more})
        case _:
            wrong = replace(plan, depths={s: d for s, d in plan.depths.items() if s != near})
    assert verify(oracle.layout, oracle.area(place, belief), belief, wrong)


@settings(max_examples=100, deadline=None)
@given(PROBLEMS, ACTION_NUMBERS)
def test_a_proof_says_what_networkx_says(problem: tuple[Replanner, str, MazeState], action: int) -> None:
    """Optimal exactly if networkx finds the successor one nearer; the loss is the difference of lengths."""
    oracle, task, belief = problem
    distance = _distances(oracle.layout, task, belief)
    proof = prove(oracle, oracle.grounded.place(task), belief, action)
    if belief not in distance:
        assert proof is None
        return
    assert proof is not None
    assert proof.faults == ()
    assert len(proof.best.actions) == distance[belief]
    assert proof.optimal == (action in _optimal(oracle.layout, belief, distance))
    assume(distance[belief])
    after, _ = step(oracle.layout, belief, action)
    assert proof.loss == (1 + distance[after] - distance[belief] if after in distance else None)


@pytest.fixture(scope="module")
def oracle() -> Replanner:
    """Return the oracle of the paper's maze."""
    return Replanner(MAZE, ground(two_rooms(MAZE), maze_model(MAZE)))


def _plan(oracle: Replanner, task: str, belief: MazeState) -> tuple[list[str], set[str]]:
    plan = oracle.plan(oracle.grounded.place(task), belief)
    assert plan is not None
    return [ACTIONS[a] for a in plan.actions], {ACTIONS[a] for a in plan.first_actions}


def test_an_open_room_by_hand(oracle: Replanner) -> None:
    """From 4,0 to T4 = 6,1: South and East are both optimal, and South comes first."""
    assert _plan(oracle, "GotoTrigger(T4)", knowing("4,0")) == (["South", "South", "East"], {"South", "East"})


def test_a_sphere_on_the_way_is_pushed(oracle: Replanner) -> None:
    """It rolls South to 7,0, out of the way, and costs nothing."""
    belief = knowing("4,0", cubes="4,1", spheres="5,0")
    assert _plan(oracle, "GotoTrigger(T4)", belief) == (["South", "South", "East"], {"South"})


def test_a_wedged_sphere_blocks_like_a_cube(oracle: Replanner) -> None:
    """A cube behind it holds it: the way leads around by the East."""
    belief = knowing("4,0", cubes="6,0", spheres="5,0")
    assert _plan(oracle, "GotoTrigger(T4)", belief) == (["East", "South", "South"], {"East"})
    as_cube = knowing("4,0", cubes="6,0 5,0")
    assert _plan(oracle, "GotoTrigger(T4)", as_cube) == _plan(oracle, "GotoTrigger(T4)", belief)


def test_a_sphere_may_be_pushed_into_the_way(oracle: Replanner) -> None:
    """South from 4,1 pushes it to T4, against the cube at 7,1, whence it can still be pushed sideways.

    That takes 4 steps (South, West, South, East) and so does the way around the sphere by either side.
    With cubes at 5,0 and 5,2 the robot would have to come back out: 8 steps in place of 6.
    """
    belief = knowing("4,1", cubes="7,1", spheres="5,1")
    actions, firsts = _plan(oracle, "GotoTrigger(T4)", belief)
    assert actions == ["South", "West", "South", "East"]
    assert firsts == {"South", "West", "East"}
    walled = knowing("4,1", cubes="7,1 5,0 5,2", spheres="5,1")
    assert _plan(oracle, "GotoTrigger(T4)", walled)[0] == ["East", "East", "South", "South", "West", "West"]


def test_a_cube_that_closes_a_corridor_leaves_no_way() -> None:
    """In a corridor one cell wide there is no way round a cube, but there is one past a sphere."""
    layout = parse_layout("name corridor\ngrid\n. . . T1 : D1 G1\nstart 0,0\ntrigger T1\ngoal G1\n")
    oracle = Replanner(layout, ground(two_rooms(layout), maze_model(layout)))
    task = oracle.grounded.place("GotoTrigger(T1)")
    belief = MazeState(robot=0, trigger=3, goal=5)
    plan = oracle.plan(task, belief)
    assert plan is not None
    assert plan.actions == (EAST, EAST, EAST)
    closed = replace(belief, cubes=frozenset({2}))
    assert oracle.plan(task, closed) is None
    assert prove(oracle, task, closed, EAST) is None
    # The shut door stops the sphere on the trigger, where it is wedged; no push can free it.
    assert oracle.plan(task, replace(belief, spheres=frozenset({1}))) is None
    opened = replace(belief, doors_open=True, spheres=frozenset({1}))
    through = oracle.plan(task, opened)
    assert through is not None
    assert through.actions == (EAST, EAST, EAST)


def test_the_root_s_plan_opens_the_doors_on_its_way(oracle: Replanner) -> None:
    """From 5,1 the whole task takes 1 step to T4, 4 to D2 and 5 to G2."""
    plan = oracle.plan(oracle.grounded.root, knowing("5,1"))
    assert plan is not None
    assert len(plan.actions) == 1 + 4 + 5
    assert plan.first_actions == {SOUTH}


def test_a_task_that_has_ended_needs_no_step(oracle: Replanner) -> None:
    """The plan is empty, no action is its first, and the certificate stands."""
    belief = knowing("6,1", doors_open=True)
    task = oracle.grounded.place("GotoTrigger(T4)")
    plan = oracle.plan(task, belief)
    assert plan is not None
    assert (plan.actions, plan.first_actions, plan.depths) == ((), frozenset(), {})
    assert verify(MAZE, oracle.area(task, belief), belief, plan) == ()


def test_a_task_does_not_run_outside_its_working_space(oracle: Replanner) -> None:
    """In room B there is no plan to the trigger, even through the open doors."""
    assert oracle.plan(oracle.grounded.place("GotoTrigger(T4)"), knowing("2,4", doors_open=True)) is None


def _faults(oracle: Replanner, belief: MazeState, plan: Plan) -> tuple[str, ...]:
    area = oracle.area(oracle.grounded.place("GotoTrigger(T4)"), belief)
    return verify(MAZE, area, belief, plan)


def test_wrong_certificates_by_hand(oracle: Replanner) -> None:
    """Each way of being wrong is named."""
    belief = knowing("5,0")
    plan = oracle.plan(oracle.grounded.place("GotoTrigger(T4)"), belief)
    assert plan is not None
    start = (belief.robot, False, frozenset[int]())
    beside = (number("5,1"), False, frozenset[int]())
    ended = (number("6,1"), True, frozenset[int]())
    assert plan.actions == (SOUTH, EAST)
    assert _faults(oracle, belief, replace(plan, actions=(EAST, SOUTH))) == (), "the other shortest plan"

    def faults(**changes: object) -> str:
        return "; ".join(_faults(oracle, belief, replace(plan, **changes)))  # type: ignore[arg-type]

    assert "does not end the task" in faults(actions=(SOUTH,))
    assert "does not end the task" in faults(actions=(WEST, SOUTH)), "it bumps into the wall"
    assert "ends the task before its last action" in faults(actions=(SOUTH, EAST, EAST))
    assert "leads further than depth 2" in faults(actions=(WEST, SOUTH, EAST)), "bumping, it is too long"
    assert "leads further than depth 1" in faults(depths={**plan.depths, beside: 2})
    assert "leads further than depth 1" in faults(
        depths={s: d for s, d in plan.depths.items() if s != beside}
    )
    assert "the start's depth is not 0" in faults(depths={**plan.depths, start: 1})
    assert "the start's depth is not 0" in faults(depths={})
    assert "has ended at depth 1, before 2" in faults(depths={**plan.depths, ended: 1})


def test_a_plan_may_not_leave_the_working_space(oracle: Replanner) -> None:
    """Through D1 and back is refused for GotoTrigger, whatever comes of it."""
    belief = knowing("2,3", doors_open=True)
    task = oracle.grounded.place("GotoTrigger(T4)")
    plan = oracle.plan(task, belief)
    assert plan is not None
    detour = replace(plan, actions=(EAST, WEST, *plan.actions))
    assert "the task may not take East from 2,3" in _faults(oracle, belief, detour)


def test_areas_differ_by_trigger_and_goal(oracle: Replanner) -> None:
    """The root's end is the belief's own goal, also after another goal was asked for."""
    belief = knowing("2,4", doors_open=True)
    other = replace(belief, goal=MAZE.number(MAZE.goals["G4"]))
    lengths = []
    for one in (belief, other, belief):
        plan = oracle.plan(oracle.grounded.root, one)
        assert plan is not None
        lengths.append(len(plan.actions))
    assert lengths == [4, 5, 4]


def test_a_plan_takes_only_the_actions_of_its_task() -> None:
    """A task without West goes round by no West; one whose East is guarded waits for the guard's cells."""
    graph = TaskGraph("lame", maze_variables(MAZE), ACTIONS)
    robot, trigger, goal, doors = graph.variables
    lame = graph.task("Lame", until=robot.eq(Cell(6, 1)), uses=[robot], do="North South East")
    low = Call("East").when(robot.isin([Cell(6, 0)]))
    guarded = graph.task("Guarded", until=robot.eq(Cell(6, 1)), uses=[robot], do=["South", low, "North"])
    do = [lame().when(doors.eq("closed")), guarded().when(doors.eq("open"))]
    graph.task("Root", until=robot.eq(goal), uses=[robot, trigger, goal, doors], do=do)
    oracle = Replanner(MAZE, ground(graph, maze_model(MAZE)))
    assert oracle.plan(oracle.grounded.place("Lame"), knowing("1,2")) is None
    plan = oracle.plan(oracle.grounded.place("Guarded"), knowing("5,0"))
    assert plan is not None
    assert [ACTIONS[action] for action in plan.actions] == ["South", "East"]
    assert plan.first_actions == {SOUTH}
