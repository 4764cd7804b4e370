import pytest

from hierarchy import ALWAYS, Call, Param, TaskGraph, TaskGraphError, Var
from worlds import UserError, Variable

X = Variable("x", (0, 1, 2))
TO = Param.over("to", {"near": 0, "far": 2})


def _graph() -> tuple[TaskGraph, Var]:
    graph = TaskGraph("corridor", [X], ["left", "right"])
    return graph, graph.variables[0]


def test_a_graph_is_declared_in_words() -> None:
    """Tasks keep what they were given; a string of names and a list of calls serve alike as children."""
    graph, x = _graph()
    go = graph.task("Go", TO, until=x.eq(TO), uses=[x], do="left right", within=x.isin([0, 1]))
    root = graph.task("Root", until=x.eq(2), uses=[x], do=[go(to=2), "left"])
    assert list(graph.tasks) == ["Go", "Root"]
    assert (go.params, go.until, go.within, go.uses) == ((TO,), x.eq(TO), x.isin([0, 1]), ("x",))
    assert go.do == (Call("left"), Call("right"))
    assert [call.child for call in root.do] == ["Go", "left"]
    assert root.within == ALWAYS


def test_the_root_is_the_task_added_last() -> None:
    """Adding a task above the root makes it the root."""
    graph, x = _graph()
    first = graph.task("First", until=x.eq(2), uses=[x], do="right")
    assert graph.root is first
    second = graph.task("Second", until=x.eq(2), uses=[x], do=[first()])
    assert graph.root is second


def test_an_empty_graph_has_no_root() -> None:
    """The error says what to add."""
    graph, _ = _graph()
    with pytest.raises(TaskGraphError, match=r"graph corridor: it has no tasks; add one with task"):
        _ = graph.root


@pytest.mark.parametrize("name", ["Go", "left"])
def test_a_name_is_taken_once(name: str) -> None:
    """Neither another task's name nor an action's can be used again, and the graph stays as it was."""
    graph, x = _graph()
    graph.task("Go", until=x.eq(2), uses=[x], do="right")
    with pytest.raises(TaskGraphError, match=f"task {name}: the name is taken .* choose another"):
        graph.task(name, until=x.eq(0), uses=[x], do="left")
    assert graph.root.until == x.eq(2)


def test_an_unknown_parameter_is_refused_at_the_call() -> None:
    """The message lists the task's parameters."""
    graph, x = _graph()
    go = graph.task("Go", TO, until=x.eq(TO), uses=[x], do="left right")
    with pytest.raises(TaskGraphError, match="task Go: unknown parameter 'too'; its parameters: to"):
        go(too=2)
    plain = graph.task("Plain", until=x.eq(2), uses=[x], do="right")
    with pytest.raises(UserError, match="its parameters: none"):
        plain(to=2)


def test_a_value_outside_the_parameter_s_domain_is_refused_at_the_call() -> None:
    """The message names the task, the parameter and its values."""
    graph, x = _graph()
    go = graph.task("Go", TO, until=x.eq(TO), uses=[x], do="left right")
    with pytest.raises(TaskGraphError, match=r"task Go, parameter 'to': 1 is not a value .* near, far"):
        go(to=1)


def test_calls_print_with_labels() -> None:
    """Values by their labels, variables and parameters by their names."""
    graph, x = _graph()
    go = graph.task("Go", TO, until=x.eq(TO), uses=[x], do="left right")
    assert [str(go(to=2)), str(go(to=x)), str(go(to=TO)), str(go())] == [
        "Go(to=far)",
        "Go(to=x)",
        "Go(to=to)",
        "Go",
    ]


def test_guards_add_up_and_calls_stay_as_they_were() -> None:
    """Each `when` narrows a copy; `using` names the edge's own relevant variables."""
    graph, x = _graph()
    go = graph.task("Go", until=x.eq(2), uses=[x], do="right")
    call = go()
    narrow = call.when(x.isin([0, 1])).when(~x.eq(1))
    assert call.guard == ALWAYS
    assert narrow.guard == x.isin([0, 1]) & ~x.eq(1)
    assert call.relevant is None
    assert (call.using(x).relevant, call.using().relevant) == (("x",), ())


def test_networkx_holds_every_task_action_and_call() -> None:
    """Two calls of one child are two edges, and each node tells its kind."""
    graph, x = _graph()
    go = graph.task("Go", TO, until=x.eq(TO), uses=[x], do="left right")
    root = graph.task("Root", until=x.eq(2), uses=[x], do=[go(to=0), go(to=2)])
    structure = graph.networkx()
    assert dict(structure.nodes(data="kind")) == {
        "Go": "task",
        "Root": "root",
        "left": "action",
        "right": "action",
    }
    assert sorted((a, b) for a, b in structure.edges()) == [
        ("Go", "left"),
        ("Go", "right"),
        ("Root", "Go"),
        ("Root", "Go"),
    ]
    assert [call for *_, call in structure.edges("Root", data="call")] == list(root.do)
