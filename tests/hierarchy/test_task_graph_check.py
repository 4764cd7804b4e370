from collections.abc import Callable, Sequence

import numpy as np
import pytest

from hierarchy import Call, Param, TaskGraph, TaskGraphError, Var, check, checked, two_rooms
from worlds import StateIndex, TransitionModel, Variable, load_layout, maze_model

X = Variable("x", (0, 1, 2, 3, 4))
LAMP = Variable("lamp", ("off", "on"))
ENDS = Param.over("to", {"near": 0, "far": 4})
GHOST = Var(Variable("xx", (0, 1, 2, 3, 4)))


def _corridor(starts: Sequence[int] = (0, 1, 2, 3, 4), wall_at: int = 4) -> TransitionModel:
    """Return a corridor of five cells and a lamp that never changes; East of `wall_at` nobody comes."""
    index = StateIndex((X, LAMP))
    successors = np.empty((index.size, 2), dtype=np.int64)
    begin = np.zeros(index.size, dtype=np.bool_)
    for number, (x, lamp) in enumerate(index):
        assert isinstance(x, int)
        right = x if x == wall_at else min(x + 1, 4)
        successors[number] = [index.number((max(x - 1, 0), lamp)), index.number((right, lamp))]
        begin[number] = x in starts and lamp == "off"
    return TransitionModel(index, ("left", "right"), successors, np.full(successors.shape, -1.0), begin)


def _graph() -> tuple[TaskGraph, Var, Var]:
    graph = TaskGraph("corridor", [X, LAMP], ["left", "right"])
    x, lamp = graph.variables
    return graph, x, lamp


def _no_children() -> TaskGraph:
    graph, x, _ = _graph()
    idle = graph.task("Idle", until=x.eq(4), uses=[x], do="")
    graph.task("Root", until=x.eq(4), uses=[x], do=[idle()])
    return graph


def _unknown_parameter_in_until() -> TaskGraph:
    graph, x, _ = _graph()
    other = Param.over("two", {"near": 0, "far": 4})
    go = graph.task("Go", other, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(two=4)])
    return graph


def _unknown_parameter_in_guard() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().when(~x.eq(ENDS))])
    return graph


def _unknown_parameter_in_binding() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(to=ENDS)])
    return graph


def _unknown_variable_in_within() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", until=x.eq(4), within=~GHOST.eq(1), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _unknown_variable_in_binding() -> TaskGraph:
    graph, x, _ = _graph()
    place = Param(Variable("place", X.values))
    go = graph.task("Go", place, until=x.eq(place), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(place=GHOST)])
    return graph


def _unknown_variable_in_uses() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", until=x.eq(4), uses=[x, GHOST], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _hidden_variable_in_until() -> TaskGraph:
    graph, x, lamp = _graph()
    go = graph.task("Go", until=x.eq(4) | lamp.eq("on"), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _hidden_variable_of_edge() -> TaskGraph:
    graph, x, lamp = _graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().using(lamp)])
    return graph


def _unknown_child() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="left rihgt")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _unbound_parameter() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _mistyped_parameter() -> TaskGraph:
    graph, x, lamp = _graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x, lamp], do=[go(to=lamp)])
    return graph


def _unreachable() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Forgotten", until=x.eq(0), uses=[x], do="left")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _never_runs() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(to=4), go(to=0).when(x.eq(0))])
    return graph


def _never_ends() -> TaskGraph:
    graph, x, _ = _graph()
    beyond = graph.task("Beyond", until=x.eq(4), uses=[x], do="left right")
    graph.task("Root", until=x.eq(3), uses=[x], do=[beyond().when(x.eq(0)), "right"])
    return graph


def _stuck() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", until=x.eq(2), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().when(x.isin([0, 1])), Call("right").when(x.eq(2))])
    return graph


def _out_of_reach() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", until=x.eq(2), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(), "right"])
    return graph


def _fenced() -> TaskGraph:
    graph, x, _ = _graph()
    low = x.isin([0, 1, 2])
    go = graph.task("Go", until=x.eq(4), within=low, uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(), "right"])
    return graph


def _strays() -> TaskGraph:
    graph, x, _ = _graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="left right")
    low = x.isin([0, 1, 2])
    both = graph.task("Low", until=x.eq(2), within=low, uses=[x], do=[go(), "right"])
    graph.task("Root", until=x.eq(4), uses=[x], do=[both().when(low), "right"])
    return graph


@pytest.mark.parametrize(
    ("make", "kind", "where", "mend"),
    [
        (_no_children, "no children", "Idle", "do="),
        (_unknown_parameter_in_until, "unknown parameter", "Go", "did you mean 'two'?"),
        (_unknown_parameter_in_guard, "unknown parameter", "Root -> Go", "known parameters: none"),
        (_unknown_parameter_in_binding, "unknown parameter", "Root -> Go", "known parameters: none"),
        (_unknown_variable_in_within, "unknown variable", "Go", "did you mean 'x'?"),
        (_unknown_variable_in_binding, "unknown variable", "Root -> Go", "did you mean 'x'?"),
        (_unknown_variable_in_uses, "unknown variable", "Go", "did you mean 'x'?"),
        (_hidden_variable_in_until, "hidden variable", "Go", "add 'lamp' to the uses of Go"),
        (_hidden_variable_of_edge, "hidden variable", "Root -> Go", "add 'lamp' to the uses of Root"),
        (_unknown_child, "unknown child", "Go -> rihgt", "did you mean 'right'?"),
        (_unbound_parameter, "unbound parameter", "Root -> Go", "write Go(to=...)"),
        (_mistyped_parameter, "mistyped parameter", "Root -> Go", "give 'to' all of off, on"),
        (_unreachable, "unreachable", "Forgotten", "call it, or remove it"),
        (_never_runs, "never runs", "Root -> Go(near)", "relax the guard (when)"),
        (_stuck, "stuck", "Root", "widen a child's guard (when)"),
        (_out_of_reach, "out of reach", "Go", "call it elsewhere (when)"),
        (_strays, "strays", "Low -> Go", "widen the working space (within) of Low"),
        (_fenced, "out of reach", "Go", "widen its working space (within)"),
    ],
)
def test_each_wrong_graph_has_one_finding(
    make: Callable[[], TaskGraph], kind: str, where: str, mend: str
) -> None:
    """A graph that is wrong in one way gets one finding, of that kind, at that place, with its mend."""
    (finding,) = check(make(), _corridor())
    assert (finding.kind, finding.where) == (kind, where)
    assert mend in finding.mend
    assert str(finding) == f"{where}: {finding.problem}; {finding.mend}"


def test_a_termination_out_of_the_world_s_reach_is_found() -> None:
    """Behind the wall nobody comes, so the task that should end there never does."""
    (finding,) = check(_never_ends(), _corridor(starts=(0, 1, 2, 3), wall_at=3))
    assert (finding.kind, finding.where) == ("never ends", "Beyond")
    assert "(x = 4) never holds" in finding.problem
    assert "until" in finding.mend


def test_findings_name_a_state() -> None:
    """What goes wrong in some states is told with their number and one of them."""
    (stuck,) = check(_stuck(), _corridor())
    assert "in 1 states" in stuck.problem
    assert "x = 3, lamp = off" in stuck.problem
    (lost,) = check(_out_of_reach(), _corridor())
    assert "called in 1 states" in lost.problem
    assert "x = 3, lamp = off" in lost.problem


def test_a_ring_of_tasks_is_found() -> None:
    """Tasks that call each other, or themselves, are told with the whole ring."""
    graph, x, _ = _graph()
    graph.task("Ping", until=x.eq(4), uses=[x], do=[Call("Pong"), "right"])
    graph.task("Pong", until=x.eq(4), uses=[x], do=[Call("Ping"), "right"])
    graph.task("Root", until=x.eq(4), uses=[x], do=[Call("Ping")])
    (finding,) = check(graph, _corridor())
    assert finding.kind == "cycle"
    assert finding.where in ("Ping", "Pong")
    assert "Ping -> Pong" in finding.problem
    assert "Pong -> Ping" in finding.problem
    assert "remove one of its edges" in finding.mend
    alone, x, _ = _graph()
    alone.task("Root", until=x.eq(4), uses=[x], do=[Call("Root"), "right"])
    (finding,) = check(alone, _corridor())
    assert (finding.kind, finding.where) == ("cycle", "Root")
    assert "Root -> Root" in finding.problem


def test_a_guard_s_unknown_and_hidden_variables_are_found_at_the_edge() -> None:
    """Guards are held to the same rules as terminations, and the edge is named."""
    graph, x, lamp = _graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().when(lamp.eq("off") & ~GHOST.eq(0))])
    findings = check(graph, _corridor())
    assert {(f.kind, f.where) for f in findings} == {
        ("hidden variable", "Root -> Go"),
        ("unknown variable", "Root -> Go"),
    }


def test_a_name_like_no_other_gets_the_list() -> None:
    """Without a near match the mend lists what is known."""
    graph, x, _ = _graph()
    graph.task("Root", until=x.eq(4), uses=[x], do="teleport right")
    (finding,) = check(graph, _corridor())
    assert finding.mend == "known children: Root, left, right"


@pytest.mark.parametrize("one_door_task", [False, True])
def test_the_paper_s_graph_is_sound(*, one_door_task: bool) -> None:
    """Both variants pass, and ground."""
    layout = load_layout("two_rooms")
    model = maze_model(layout)
    graph = two_rooms(layout, one_door_task=one_door_task)
    assert check(graph, model) == ()
    assert checked(graph, model).nodes[-1].name == "Root"


def test_checked_lists_every_finding() -> None:
    """One error tells everything that is wrong, one line each, and names the graph."""
    graph, x, _ = _graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[], do="left rihgt")
    graph.task("Forgotten", until=x.eq(0), uses=[x], do="left")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    model = _corridor()
    findings = check(graph, model)
    assert {f.kind for f in findings} == {
        "hidden variable",
        "unknown child",
        "unreachable",
        "unbound parameter",
    }
    with pytest.raises(TaskGraphError) as caught:
        checked(graph, model)
    first, *lines = str(caught.value).splitlines()
    assert first == "task graph corridor cannot run:"
    assert lines == [f"  {finding}" for finding in findings]
