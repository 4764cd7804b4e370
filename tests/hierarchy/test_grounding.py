import networkx as nx
import numpy as np
import pytest

from hierarchy import GroundGraph, Param, TaskGraph, check, ground, two_rooms
from worlds import ACTIONS, Cell, StateIndex, TransitionModel, Variable, load_layout, maze_model

MAZE = load_layout("two_rooms")
MODEL = maze_model(MAZE)
EAST, WEST = ACTIONS.index("East"), ACTIONS.index("West")


@pytest.fixture(scope="module")
def paper() -> GroundGraph:
    """Return the paper's graph, grounded."""
    return ground(two_rooms(MAZE), MODEL)


def _state(cell: Cell, doors: str, trigger: str = "T4", goal: str = "G2") -> int:
    return MODEL.index.number((cell, MAZE.triggers[trigger], MAZE.goals[goal], doors))


def test_nodes_carry_their_bindings_in_their_names(paper: GroundGraph) -> None:
    """Actions first, one node a binding, the root last."""
    names = [node.name for node in paper.nodes]
    triggers, goals = (f"GotoTrigger(T{i})" for i in range(1, 5)), (f"GotoGoal(G{i})" for i in range(1, 5))
    assert names == [*ACTIONS, *triggers, "GotoDoor(D1)", "GotoDoor(D2)", *goals, "Root"]
    assert paper.root == len(names) - 1
    assert paper.node("GotoDoor(D2)") is paper.nodes[paper.place("GotoDoor(D2)")]
    assert [node.name for node in paper.instances("GotoDoor")] == ["GotoDoor(D1)", "GotoDoor(D2)"]
    with pytest.raises(KeyError, match=r"no ground task 'GotoDoor\(D3\)'; there are North,"):
        paper.place("GotoDoor(D3)")


def test_children_stand_before_their_parents(paper: GroundGraph) -> None:
    """The ground graph has no cycle, each edge leads to an earlier node, and the root is the only source."""
    graph = paper.networkx()
    assert nx.is_directed_acyclic_graph(graph)
    assert list(graph) == list(paper.places)
    assert all(paper.place(child) < paper.place(parent) for parent, child in graph.edges())
    assert [name for name, degree in graph.in_degree() if degree == 0] == ["Root"]
    assert nx.descendants(graph, "GotoGoal(G2)") == set(ACTIONS)


def test_an_equal_binding_is_grounded_once() -> None:
    """A constant and a variable that may take the same value share one ground task."""
    x = Variable("x", (0, 1, 2))
    index = StateIndex((x,))
    successors = np.array([[0, 1], [0, 2], [1, 2]])
    model = TransitionModel(index, ("left", "right"), successors, np.full((3, 2), -1.0), np.ones(3, np.bool_))
    graph = TaskGraph("corridor", [x], ["left", "right"])
    (pos,) = graph.variables
    to = Param(Variable("to", (0, 1, 2)))
    go = graph.task("Go", to, until=pos.eq(to), uses=[pos], do="left right")
    graph.task("Root", until=pos.eq(2), uses=[pos], do=[go(to=2), go(to=pos)])
    grounded = ground(graph, model)
    assert sorted(node.name for node in grounded.instances("Go")) == ["Go(0)", "Go(1)", "Go(2)"]
    calls = [grounded.nodes[call.child].name for call in grounded.nodes[grounded.root].calls]
    assert calls == ["Go(2)", "Go(0)", "Go(1)", "Go(2)"]
    bound_to_itself = grounded.nodes[grounded.root].calls[1:]
    assert not any(call.available.any() for call in bound_to_itself), (
        "each has ended where it would be called"
    )


def test_a_variable_s_value_guards_its_call(paper: GroundGraph) -> None:
    """GotoTrigger(T3) may be called exactly where the trigger is T3, doors closed, the robot in room A."""
    call = next(c for c in paper.nodes[paper.root].calls if paper.nodes[c.child].name == "GotoTrigger(T3)")
    for number, (robot, trigger, _, doors) in enumerate(MODEL.index):
        expected = trigger == MAZE.triggers["T3"] != robot and doors == "closed" and robot in MAZE.rooms["A"]
        assert call.available[number] == expected


def test_a_task_s_moves_stay_in_its_working_space(paper: GroundGraph) -> None:
    """GotoTrigger never leaves room A, even through an open door."""
    for task in paper.instances("GotoTrigger"):
        for call in task.calls:
            after = MODEL.successors[call.available, call.child]
            assert all(MODEL.index.state(int(number))[0] in MAZE.rooms["A"] for number in np.unique(after))
    east_at_door = paper.node("GotoTrigger(T4)").calls[EAST].available
    assert not east_at_door[_state(Cell(5, 3), "open")]
    assert east_at_door[_state(Cell(5, 3), "closed")], "into a shut door it bumps, and stays"
    assert east_at_door[_state(Cell(5, 2), "open")]


def test_a_move_that_ends_the_task_may_leave_its_working_space(paper: GroundGraph) -> None:
    """GotoDoor(D1) steps out of room A by D1, and by no other door."""
    to_first = paper.node("GotoDoor(D1)").calls[EAST].available
    assert to_first[_state(Cell(2, 3), "open")]
    assert not to_first[_state(Cell(5, 3), "open")]


def test_goto_goal_does_not_go_back_through_a_door(paper: GroundGraph) -> None:
    """West at D1's grid, doors open, leads out of room B and is not available; elsewhere it is."""
    west = paper.node("GotoGoal(G2)").calls[WEST].available
    assert not west[_state(MAZE.thresholds["D1"], "open")]
    assert west[_state(Cell(2, 5), "open")]
    assert west[_state(Cell(1, 4), "open")], "a wall stops it, so it stays in room B"


def test_a_task_runs_within_its_working_space_until_it_ends(paper: GroundGraph) -> None:
    """Live and terminal never overlap, and outside the working space a task is neither."""
    task = paper.node("GotoGoal(G2)")
    for number, (robot, *_) in enumerate(MODEL.index):
        assert task.terminal[number] == (robot == MAZE.goals["G2"])
        assert task.live[number] == (robot in MAZE.rooms["B"] and robot != MAZE.goals["G2"])
    for node in paper.nodes:
        assert not (node.live & node.terminal).any()


def test_a_composite_is_available_where_guard_and_child_allow(paper: GroundGraph) -> None:
    """The root may call a task where the root runs, the guard holds and the task is live."""
    root = paper.nodes[paper.root]
    index = MODEL.index
    for call in root.calls:
        trigger_bound = call.call.binding[0][1].name if call.call.child != "GotoDoor" else None
        guard = call.call.guard.mask(index) & root.live & paper.nodes[call.child].live
        if trigger_bound is not None:
            value = paper.nodes[call.child].binding[0][1].value
            domain = index.variable(trigger_bound)
            guard &= index.column(trigger_bound) == domain.position(value)
        assert np.array_equal(call.available, guard)


def test_projections_group_states_that_agree_on_what_matters(paper: GroundGraph) -> None:
    """Two states share a row exactly if they agree on the edge's relevant variables."""
    states = [dict(zip(MODEL.index.names, state, strict=True)) for state in MODEL.index]
    for call in (*paper.node("GotoDoor(D1)").calls, *paper.nodes[paper.root].calls):
        meant = [tuple(state[name] for name in call.relevant) for state in states]
        rows = call.projection.tolist()
        assert len(set(zip(rows, meant, strict=True))) == len(set(rows)) == len(set(meant)) == call.rows


def test_the_root_s_edges_store_by_their_own_variables(paper: GroundGraph) -> None:
    """GotoTrigger's completion is stored by trigger and goal, GotoDoor's by the goal, GotoGoal's once."""
    rows = {paper.nodes[c.child].task: (c.relevant, c.rows) for c in paper.nodes[paper.root].calls}
    assert rows == {
        "GotoTrigger": (("trigger", "goal"), 16),
        "GotoDoor": (("goal",), 4),
        "GotoGoal": ((), 1),
    }
    assert {c.relevant for c in paper.node("GotoGoal(G2)").calls} == {("robot",)}


def test_a_variable_with_more_values_than_the_parameter_binds_those_they_share() -> None:
    """Where the variable has another value, the child cannot be called."""
    index = StateIndex((Variable("x", (0, 1, 2)), Variable("wish", (0, 2, "none"))))
    cells, wishes = index.column("x"), index.column("wish")
    step = [np.clip(cells + by, 0, 2) * 3 + wishes for by in (-1, 1)]
    successors = np.stack(step, axis=1)
    model = TransitionModel(
        index, ("left", "right"), successors, np.full((9, 2), -1.0), (cells == 1) & (wishes < 2)
    )
    graph = TaskGraph("wishes", index.variables, model.actions)
    x, wish = graph.variables
    to = Param.over("to", {"low": 0, "high": 2})
    go = graph.task("Go", to, until=x.eq(to), uses=[x], do="left right")
    graph.task("Root", until=x.eq(wish), uses=[x, wish], do=[go(to=wish)])
    assert check(graph, model) == ()
    root = ground(graph, model).nodes[-1]
    called = [(call.child, np.flatnonzero(call.available).tolist()) for call in root.calls]
    assert called == [(2, [3, 6]), (3, [1, 4])]
