import re

import networkx as nx

from hierarchy import TaskGraph, mermaid, task_graph_picture, two_rooms
from worlds import ACTIONS, Variable, load_layout

GRAPH = two_rooms(load_layout("two_rooms"))


def test_mermaid_holds_every_task_and_action() -> None:
    """One node each, in a shape that tells root, task and action apart."""
    lines = [line.strip() for line in mermaid(GRAPH).splitlines()]
    assert lines[0] == "flowchart TD"
    assert lines[1:5] == [
        'Root(["Root"])',
        'GotoTrigger["GotoTrigger(target)"]',
        'GotoDoor["GotoDoor(target)"]',
        'GotoGoal["GotoGoal(target)"]',
    ]
    assert lines[5:9] == [f"{action}{{{{{action}}}}}" for action in ACTIONS]


def test_mermaid_holds_every_edge_with_its_binding_and_guard() -> None:
    """The edges read back are the calls of the graph, each once."""
    edges = []
    for line in mermaid(GRAPH).splitlines():
        if match := re.fullmatch(r'\s+(\w+) -- "(.*)" --> (\w+)', line):
            edges.append(match.groups())
        elif match := re.fullmatch(r"\s+(\w+) --> (\w+)", line):
            edges.append((match[1], "", match[2]))
    assert edges[:4] == [
        ("Root", "target=trigger<br>when doors = closed", "GotoTrigger"),
        ("Root", "target=D1<br>when doors = open and robot in room A", "GotoDoor"),
        ("Root", "target=D2<br>when doors = open and robot in room A", "GotoDoor"),
        ("Root", "target=goal<br>when robot in room B", "GotoGoal"),
    ]
    tasks = ("GotoTrigger", "GotoDoor", "GotoGoal")
    assert edges[4:] == [(task, "", action) for task in tasks for action in ACTIONS]


def test_the_picture_has_a_node_for_each_call_of_a_task() -> None:
    """Figure 7: the two bindings of GotoDoor stand apart, the actions are shared."""
    picture = task_graph_picture(GRAPH)
    kinds = dict(picture.nodes(data="kind"))
    assert kinds == {
        "Root": "root",
        **dict.fromkeys(ACTIONS, "action"),
        "GotoTrigger(target=trigger)": "task",
        "GotoDoor(target=D1)": "task",
        "GotoDoor(target=D2)": "task",
        "GotoGoal(target=goal)": "task",
    }
    assert all(label == node for node, label in picture.nodes(data="label"))
    assert picture.edges["Root", "GotoTrigger(target=trigger)"]["label"] == "when doors = closed"
    assert picture.edges["GotoDoor(target=D2)", "West"]["label"] == ""
    assert picture.number_of_edges() == 4 + 4 * len(ACTIONS)
    assert nx.is_directed_acyclic_graph(picture)


def test_a_shared_subtask_is_drawn_once_below_all_its_callers() -> None:
    """A call that two tasks make alike is one node with two edges."""
    graph = TaskGraph("shared", [Variable("x", (0, 1, 2))], ["left", "right"])
    (x,) = graph.variables
    leaf = graph.task("Leaf", until=x.eq(2), uses=[x], do="right")
    one = graph.task("One", until=x.eq(2), uses=[x], do=[leaf()])
    two = graph.task("Two", until=x.eq(2), uses=[x], do=[leaf(), "left"])
    graph.task("Root", until=x.eq(2), uses=[x], do=[one(), two().when(x.eq(1))])
    picture = task_graph_picture(graph)
    assert set(picture.predecessors("Leaf")) == {"One", "Two"}
    assert picture.edges["Root", "Two"]["label"] == "when x = 1"
    assert set(picture.successors("Two")) == {"Leaf", "left"}


def test_the_same_call_under_two_guards_keeps_both() -> None:
    """One edge of the picture carries both labels."""
    graph = TaskGraph("twice", [Variable("x", (0, 1, 2))], ["go"])
    (x,) = graph.variables
    task = graph.task("Task", until=x.eq(2), uses=[x], do="go")
    graph.task("Root", until=x.eq(2), uses=[x], do=[task().when(x.eq(0)), task().when(x.eq(1))])
    assert task_graph_picture(graph).edges["Root", "Task"]["label"] == "when x = 0 or when x = 1"
