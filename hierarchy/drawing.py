"""Drawing a task graph: Mermaid and Graphviz text, and a networkx graph ready for a picture."""

from __future__ import annotations

import re
from typing import Final

import networkx as nx

from hierarchy.graph import Call, Task, TaskGraph
from hierarchy.predicates import ALWAYS

_PLAIN: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_MERMAIDS: Final = re.compile(
    "accDescr|accTitle|call|class|classDef|click|default|direction|end|flowchart|graph|href|interpolate"
    "|linkStyle|style|subgraph",
    re.IGNORECASE,
)
"""Words that mean something to Mermaid, so that no node can be called so."""
_CODED: Final = frozenset('"#&;:<>`\\%$')
"""What Mermaid reads as more than itself, even in quotes: in entities, HTML, Markdown, directives and TeX."""
_PICTURES: Final = {code: chr(0x2400 + code) for code in range(32) if chr(code) != "\n"} | {127: "\u2421"}
"""Control characters, which no drawing can hold, and the characters that show them."""


def mermaid(graph: TaskGraph) -> str:
    r"""Return the task graph as a Mermaid flowchart; edges carry bindings and guards.

    Examples
    --------
    >>> from hierarchy import two_rooms
    >>> from worlds import load_layout
    >>> print(*mermaid(two_rooms(load_layout("two_rooms"))).splitlines()[:4], sep="\n")
    flowchart TD
        Root(["Root"])
        GotoTrigger["GotoTrigger(target)"]
        GotoDoor["GotoDoor(target)"]
    """
    lines = ["flowchart TD"]
    tasks = sorted(graph.tasks.values(), key=lambda task: task.name != graph.root.name)
    ids = _identifiers([*(task.name for task in tasks), *graph.actions])
    for task in tasks:
        label = _coded(_title(task))
        box = f'(["{label}"])' if task.name == graph.root.name else f'["{label}"]'
        lines.append(f"    {ids[task.name]}{box}")
    for action in graph.actions:
        label = action if ids[action] == action else f'"{_coded(action)}"'
        lines.append(f"    {ids[action]}{{{{{label}}}}}")
    for task in tasks:
        for call in task.do:
            label = "<br>".join(_coded(note) for note in _notes(call))
            arrow = f'-- "{label}" -->' if label else "-->"
            lines.append(f"    {ids[task.name]} {arrow} {ids[call.child]}")
    return "\n".join(lines) + "\n"


def _identifiers(names: list[str]) -> dict[str, str]:
    """Return what Mermaid calls each node: its name, or where that will not do a number."""
    ids: dict[str, str] = {}
    for number, name in enumerate(names):
        plain = _PLAIN.fullmatch(name) and not _MERMAIDS.fullmatch(name)
        free = f"n{number}"
        while not plain and free in names:
            free += "_"
        ids[name] = name if plain else free
    return ids


def _coded(text: str) -> str:
    """Return a text for Mermaid's quotes, in its entity codes where it would be read as something else."""
    shown = text.translate(_PICTURES)
    return "".join(f"#{ord(each)};" if each in _CODED else each for each in shown).replace("\n", "<br>")


def dot(graph: TaskGraph) -> str:
    r"""Return the task graph in Graphviz's language; edges carry bindings and guards.

    Examples
    --------
    >>> from hierarchy import two_rooms
    >>> from worlds import load_layout
    >>> print(*dot(two_rooms(load_layout("two_rooms"))).splitlines()[:5], sep="\n")
    digraph "two_rooms" {
        node [fontname="Helvetica"]
        edge [fontname="Helvetica", fontsize=10]
        "Root" [label="Root", shape=box, style="rounded,bold"]
        "GotoTrigger" [label="GotoTrigger(target)", shape=box, style="rounded"]
    """
    lines = [f"digraph {_quoted(graph.name)} {{"]
    lines += ['    node [fontname="Helvetica"]', '    edge [fontname="Helvetica", fontsize=10]']
    tasks = sorted(graph.tasks.values(), key=lambda task: task.name != graph.root.name)
    for task in tasks:
        label = _labelled(_title(task))
        style = "rounded,bold" if task.name == graph.root.name else "rounded"
        lines.append(f'    {_quoted(task.name)} [label={label}, shape=box, style="{style}"]')
    lines += [f"    {_quoted(name)} [label={_labelled(name)}, shape=hexagon]" for name in graph.actions]
    for task in tasks:
        for call in task.do:
            label = "\n".join(_notes(call))
            note = f" [label={_labelled(label)}]" if label else ""
            lines.append(f"    {_quoted(task.name)} -> {_quoted(call.child)}{note}")
    return "\n".join([*lines, "}"]) + "\n"


def _title(task: Task) -> str:
    """Return a task's name with its parameters."""
    params = ", ".join(param.name for param in task.params)
    return f"{task.name}({params})" if params else task.name


def _notes(call: Call) -> list[str]:
    """Return what stands on a call's edge: its binding and its guard, where it has them."""
    bound = ", ".join(f"{name}={value}" for name, value in call.binding)
    guard = "" if call.guard == ALWAYS else f"when {call.guard}"
    return [part for part in (bound, guard) if part]


def _quoted(text: str) -> str:
    r"""Return a text as a quoted identifier of Graphviz, in which a line break is written \n."""
    escaped = text.translate(_PICTURES).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + escaped.replace("\n", "\\n") + '"'


def _labelled(text: str) -> str:
    """Return a text as a quoted label of Graphviz, which reads HTML's entities in it."""
    return _quoted(text.replace("&", "&amp;"))


def task_graph_picture(graph: TaskGraph) -> nx.DiGraph[str]:
    """Return the task graph with one node for each call of a task, labelled for drawing.

    Nodes have attributes ``label`` and ``kind`` (root, task or action); edges have ``label``.
    Characters that cannot be drawn are shown by others.
    """
    picture: nx.DiGraph[str] = nx.DiGraph(name=graph.name)
    root = graph.root.name
    picture.add_node(root, label=root.translate(_PICTURES), kind="root")
    for action in graph.actions:
        picture.add_node(action, label=action.translate(_PICTURES), kind="action")
    stack = [(root, root)]
    while stack:
        node, name = stack.pop()
        for call in graph.tasks[name].do:
            if call.child in graph.actions:
                picture.add_edge(node, call.child, label="")
                continue
            child = str(call)
            if child not in picture:
                picture.add_node(child, label=child.translate(_PICTURES), kind="task")
                stack.append((child, call.child))
            label = "" if call.guard == ALWAYS else f"when {call.guard}".translate(_PICTURES)
            if picture.has_edge(node, child):  # the same call under another guard
                label = f"{picture.edges[node, child]['label']} or {label}"
            picture.add_edge(node, child, label=label)
    return picture
