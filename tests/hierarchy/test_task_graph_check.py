import pytest
from wrong_graphs import ENDS, GHOST, WRONG, Wrong, corridor, corridor_graph

from hierarchy import (
    Call,
    TaskGraphError,
    check,
    checked,
    discounted_funnels,
    two_rooms,
)
from worlds import load_layout, maze_model
from worlds.black_box import UnknownModel


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong.name)
def test_each_wrong_graph_has_one_finding(wrong: Wrong) -> None:
    """A graph that is wrong in one way gets one finding: of that kind, at that place, with its mend."""
    (finding,) = check(wrong.make(), wrong.model)
    assert (finding.kind, finding.where) == (wrong.kind, wrong.where)
    assert wrong.problem in finding.problem
    assert wrong.mend in finding.mend
    assert str(finding) == f"{finding.where}: {finding.problem}; {finding.mend}"


def test_a_ring_of_tasks_is_found() -> None:
    """Tasks that call each other, or themselves, are told with the whole ring."""
    graph, x, _ = corridor_graph()
    graph.task("Ping", until=x.eq(4), uses=[x], do=[Call("Pong"), "right"])
    graph.task("Pong", until=x.eq(4), uses=[x], do=[Call("Ping"), "right"])
    graph.task("Root", until=x.eq(4), uses=[x], do=[Call("Ping")])
    (finding,) = check(graph, corridor())
    assert finding.kind == "cycle"
    assert finding.where in ("Ping", "Pong")
    assert "Ping -> Pong" in finding.problem
    assert "Pong -> Ping" in finding.problem
    assert "remove one of its edges" in finding.mend
    alone, x, _ = corridor_graph()
    alone.task("Root", until=x.eq(4), uses=[x], do=[Call("Root"), "right"])
    (finding,) = check(alone, corridor())
    assert (finding.kind, finding.where) == ("cycle", "Root")
    assert "Root -> Root" in finding.problem


def test_a_guard_s_unknown_and_hidden_variables_are_found_at_the_edge() -> None:
    """Guards are held to the same rules as terminations, and the edge is named."""
    graph, x, lamp = corridor_graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().when(lamp.eq("off") & ~GHOST.eq(0))])
    findings = check(graph, corridor())
    assert {(f.kind, f.where) for f in findings} == {
        ("hidden variable", "Root -> Go"),
        ("unknown variable", "Root -> Go"),
    }


def test_a_name_like_no_other_gets_the_list() -> None:
    """Without a near match the mend lists what is known."""
    graph, x, _ = corridor_graph()
    graph.task("Root", until=x.eq(4), uses=[x], do="teleport right")
    (finding,) = check(graph, corridor())
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
    graph, x, _ = corridor_graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[], do="left rihgt")
    graph.task("Forgotten", until=x.eq(0), uses=[x], do="left")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    model = corridor()
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


def test_tasks_that_all_call_each_other_are_told_at_once() -> None:
    """One ring stands for all, of which there are more than could ever be listed."""
    graph, x, _ = corridor_graph()
    names = [f"T{number}" for number in range(30)]
    for name in names:
        graph.task(name, until=x.eq(4), uses=[x], do=[*(Call(other) for other in names if other != name)])
    (finding,) = check(graph, corridor())
    assert finding.kind == "cycle"


def test_a_discounted_funnel_is_found() -> None:
    """Root stores one completion for all ways to 2, which differ in length and so in what follows."""
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(2), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().when(x.lt(2)).using(), Call("right").when(x.ge(2))])
    grounded = checked(graph, corridor())
    assert discounted_funnels(grounded, 1.0) == ()
    (finding,) = discounted_funnels(grounded, 0.9)
    assert (finding.kind, finding.where) == ("discounted funnel", "Root -> Go")
    assert "with gamma = 0.9 what follows depends on how long Go takes" in finding.problem
    assert "set gamma to 1, or store the edge by all the uses of Root" in finding.mend


@pytest.mark.parametrize("pseudo_reward", [None, -9.0])
def test_goals_may_be_all_terminations_or_hold_elsewhere_too(pseudo_reward: float | None) -> None:
    """A goal may hold where its task has not ended, and a pseudo-reward may have nothing to say."""
    graph, x, _ = corridor_graph()
    goal = x.isin([2, 4])
    go = graph.task("Go", until=x.eq(4), goal=goal, pseudo_reward=pseudo_reward, uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(), "left"])
    assert check(graph, corridor()) == ()


def test_a_wrong_value_is_refused_where_it_is_written() -> None:
    """A comparison with a value, and a binding to one, need no check: the line that makes them fails."""
    graph, x, _ = corridor_graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="right")
    with pytest.raises(ValueError, match="7 is not a value of 'x'; its values are 0, 1, 2, 3, 4"):
        x.eq(7)
    with pytest.raises(TaskGraphError, match="task Go, parameter 'to': 2 is not a value of 'to'; its values"):
        go(to=2)


def test_a_child_moves_only_where_it_is_called() -> None:
    """Go could pass 4 by itself, but Mid calls it only up to 2, where it ends: so Mid never comes to 4."""
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(2), uses=[x], do="left right")
    mid = graph.task("Mid", until=x.eq(4), uses=[x], do=[go(), Call("left").when(x.eq(2))])
    graph.task("Root", until=x.eq(4), uses=[x], do=[mid().when(x.le(1)), "right"])
    (finding,) = check(graph, corridor())
    assert (finding.kind, finding.where) == ("out of reach", "Mid")


def test_a_black_box_is_trusted_to_lead_anywhere() -> None:
    """Without a model every task that has something to do may end, and may end anywhere."""
    graph, x, _ = corridor_graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="right")
    low = graph.task("Low", until=x.isin([1, 4]), goal=x.eq(1), uses=[x], do=[go(to=4), go(to=0), "left"])
    graph.task("Root", until=x.eq(4), uses=[x], do=[low().when(x.eq(2)), "left"])
    (finding,) = check(graph, UnknownModel(graph.index, graph.actions))
    assert (finding.kind, finding.where) == ("ends short", "Low")
