"""A task graph in Graphviz's language."""

import re

from hierarchy import TaskGraph, two_rooms
from hierarchy.drawing import dot
from worlds import ACTIONS, Variable, load_layout

GRAPH = two_rooms(load_layout("two_rooms"))


def test_dot_holds_every_task_action_and_edge() -> None:
    """Nodes once each, and as many edges as calls, with bindings and guards."""
    text = dot(GRAPH)
    nodes = re.findall(r'^    "(\w+)" \[', text, re.MULTILINE)
    assert nodes == ["Root", "GotoTrigger", "GotoDoor", "GotoGoal", *ACTIONS]
    assert text.count(" -> ") == 4 + 3 * len(ACTIONS)
    assert r'"Root" -> "GotoDoor" [label="target=D2\nwhen doors = open and robot in room A"]' in text
    assert text.startswith('digraph "two_rooms" {\n')
    assert text.endswith("}\n")


def test_words_cannot_break_out_of_their_quotes() -> None:
    """Quotes, backslashes and line breaks in labels are escaped."""
    graph = TaskGraph('a "graph"', [Variable("x", (0, 1), ('"0"', "a\\b\nc"))], ["go"])
    (x,) = graph.variables
    graph.task("Root", until=x.eq(0), uses=[x], do=[])
    child = graph.task("Top", until=x.eq(0), uses=[x], do=[graph.tasks["Root"]().when(x.eq(1))])
    assert child.name == "Top"
    text = dot(graph)
    assert text.startswith('digraph "a \\"graph\\"" {')
    assert '"Top" -> "Root" [label="when x = a\\\\b\\nc"]' in text


def test_html_and_control_characters_are_shown_as_they_are() -> None:
    """Graphviz reads entities in labels, not in names; what no file can hold is shown by a picture of it."""
    graph = TaskGraph("g", [Variable("x", (0, 1))], ["a &lt; b\x00"])
    (x,) = graph.variables
    graph.task("Root", until=x.eq(0), uses=[x], do=graph.actions)
    assert '    "a &lt; b\u2400" [label="a &amp;lt; b\u2400", shape=hexagon]' in dot(graph).splitlines()
