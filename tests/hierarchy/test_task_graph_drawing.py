import html
import re

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

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


def named(task: str, label: str = "0") -> TaskGraph:
    """Return a graph with a task of this name, called where x has the value of this label."""
    graph = TaskGraph("named", [Variable("x", (0, 1), (label, "other"))], ["go"])
    (x,) = graph.variables
    child = graph.task(task, until=x.eq(1), uses=[x], do="go")
    graph.task("Root", until=x.eq(1), uses=[x], do=[child().when(x.eq(0))])
    return graph


@pytest.mark.parametrize(
    ("text", "coded"),
    [
        ('say "hi"', "say #34;hi#34;"),
        ("a\\b", "a#92;b"),
        ("<b>", "#60;b#62;"),
        ("#quot;", "#35;quot#59;"),
        ("two\nlines", "two<br>lines"),
        ("[x] {y} (z) |", "[x] {y} (z) |"),
        ("`code`", "#96;code#96;"),
        ("%%{init}%%", "#37;#37;{init}#37;#37;"),
        ("$$x$$", "#36;#36;x#36;#36;"),
        ("a & b: c", "a #38; b#58; c"),
        ("bell\x07", "bell\u2407"),
    ],
)
def test_mermaid_gets_its_marks_in_entity_codes(text: str, coded: str) -> None:
    """In a node's label and in an edge's; the node is called by a number, since the name will not do."""
    lines = mermaid(named(text, text)).splitlines()
    assert f'    n1["{coded}"]' in lines
    assert f'    Root -- "when x = {coded}" --> n1' in lines


@given(st.text(st.characters(exclude_categories=["Cc", "Cs", "Zl", "Zp"]), min_size=1, max_size=12))
def test_mermaid_loses_no_letter(text: str) -> None:
    """Read back as a browser reads it, each label is what was written, within its quotes."""
    (label,) = re.findall(r'-- "(.*)" -->', mermaid(named("Task", text)))
    assert not set(label) & set('"`<>\\')
    assert html.unescape(re.sub(r"#(\d+);", r"&#\1;", label)) == f"when x = {text}"


@pytest.mark.parametrize(
    "word", ["end", "graph", "Style", "classDef", "two words", "1st", "n1", "\u00e9t\u00e9"]
)
def test_mermaid_nodes_have_names_that_mermaid_takes(word: str) -> None:
    """A word of Mermaid's own, or no word, is a label alone; no two nodes share a name."""
    lines = [line.strip() for line in mermaid(named(word)).splitlines()[1:4]]
    ids = [re.split(r"\W", line)[0] for line in lines]
    assert ids == ["Root", "n1", "go"]
    assert lines[1] == f'n1["{word}"]'


def test_a_number_that_a_task_has_already_is_not_given_again() -> None:
    """The task that is called n2 keeps its name."""
    graph = TaskGraph("numbers", [Variable("x", (0, 1))], ["go on", "n2"])
    (x,) = graph.variables
    graph.task("n1", until=x.eq(1), uses=[x], do=["go on", "n2"])
    lines = [line.strip() for line in mermaid(graph).splitlines()[1:4]]
    assert lines == ['n1(["n1"])', 'n1_{{"go on"}}', "n2{{n2}}"]
