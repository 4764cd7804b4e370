"""Drawing a task graph: Mermaid and Graphviz text, and a networkx graph ready for a picture."""

from __future__ import annotations

import networkx as nx

from hierarchy.graph import Call, Task, TaskGraph
from hierarchy.predicates import ALWAYS


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
    for task in tasks:
        label = _title(task)
        box = f'(["{label}"])' if task.name == graph.root.name else f'["{label}"]'
        lines.append(f"    {task.name}{box}")
    lines += [f"    {action}{{{{{action}}}}}" for action in graph.actions]
    for task in tasks:
        for call in task.do:
            label = "<br>".join(_notes(call))
            arrow = f'-- "{label}" -->' if label else "-->"
            lines.append(f"    {task.name} {arrow} {call.child}")
    return "\n".join(lines) + "\n"


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
        label = _title(task)
        style = "rounded,bold" if task.name == graph.root.name else "rounded"
        lines.append(f'    {_quoted(task.name)} [label={_quoted(label)}, shape=box, style="{style}"]')
    lines += [f"    {_quoted(action)} [shape=hexagon]" for action in graph.actions]
    for task in tasks:
        for call in task.do:
            label = "\n".join(_notes(call))
            note = f" [label={_quoted(label)}]" if label else ""
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
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


def task_graph_picture(graph: TaskGraph) -> nx.DiGraph[str]:
    """Return the task graph with one node for each call of a task, labelled for drawing.

    Nodes have attributes ``label`` and ``kind`` (root, task or action); edges have ``label``.
    """
    picture: nx.DiGraph[str] = nx.DiGraph(name=graph.name)
    root = graph.root.name
    picture.add_node(root, label=root, kind="root")
    for action in graph.actions:
        picture.add_node(action, label=action, kind="action")
    stack = [(root, root)]
    while stack:
        node, name = stack.pop()
        for call in graph.tasks[name].do:
            if call.child in graph.actions:
                picture.add_edge(node, call.child, label="")
                continue
            child = str(call)
            if child not in picture:
                picture.add_node(child, label=child, kind="task")
                stack.append((child, call.child))
            label = "" if call.guard == ALWAYS else f"when {call.guard}"
            if picture.has_edge(node, child):  # the same call under another guard
                label = f"{picture.edges[node, child]['label']} or {label}"
            picture.add_edge(node, child, label=label)
    return picture
