"""A task graph as a layered picture (figures 4 and 7)."""

from __future__ import annotations

import textwrap
from collections.abc import Hashable, Sequence
from typing import Any, Final

import networkx as nx
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from matplotlib.path import Path

from comparisons.figures_graph_layout import Item, linked, place_rows
from comparisons.style import BLUE, GREEN, GREY, INK, Look, styled

_LOOKS: Final = {  # fill and edge
    "root": ("#DCEAF7", BLUE),
    "task": ("#FFFFFF", BLUE),
    "action": ("#E3F3EC", GREEN),
}
_FONT: Final = 8.0
_EDGE_FONT: Final = 6.8
_PAD: Final = 0.09  # inside a box, inches
_WORDS: Final = 24  # characters of a label's line, unless it has very many
_SHARED: Final = 3  # as many parents that guard a child alike share one label


@styled
def task_graph_figure(graph: nx.DiGraph[Any]) -> Figure:
    """Draw a task graph, root at the top and primitive actions at the bottom (figures 4 and 7).

    An edge's label stands above its child. Three or more parents that guard a child alike share a label.

    Parameters
    ----------
    graph
        Nodes have a ``label`` and a ``kind`` (root, task or action); edges may have a ``label``.
        Labels may have several lines; an edge's is broken into more where it is long.

    Raises
    ------
    ValueError
        If the graph is empty or has a cycle.

    Examples
    --------
    >>> graph = nx.DiGraph()
    >>> graph.add_node("Root", label="Root", kind="root")
    >>> graph.add_node("North", label="North", kind="action")
    >>> graph.add_edge("Root", "North", label="always")
    >>> [text.get_text() for text in task_graph_figure(graph).axes[0].texts]
    ['Root', 'North', 'always']
    """
    if not graph or not nx.is_directed_acyclic_graph(graph):
        raise ValueError("a task graph's picture needs at least one task and no cycle")
    figure = Figure((1, 1), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    boxes: dict[Hashable, Item] = {}
    for node, data in graph.nodes(data=True):
        width, height = _text_size(axes, data["label"], _FONT, _weight(data["kind"]))
        boxes[node] = Item("box", width + 2 * _PAD, height + 2 * _PAD, data["label"])
    rows = _rows(graph, boxes, axes)
    width, height = place_rows(rows)
    figure.set_size_inches(width, height)
    axes.set(xlim=(0, width), ylim=(0, height))  # data units are inches
    for node, data in graph.nodes(data=True):
        _draw_box(axes, boxes[node], data["kind"])
    for item in (item for row in rows for item in row):
        if item.kind == "label":
            middle: Look = {"ha": "center", "va": "center", "fontsize": _EDGE_FONT, "linespacing": 1.15}
            axes.text(item.x, item.y, item.text, color=INK, zorder=3, **middle)
        for child in item.below:
            _draw_edge(axes, item, child)
    return figure


def _rows(graph: nx.DiGraph[Any], boxes: dict[Hashable, Item], axes: Axes) -> list[list[Item]]:
    """Return what stands in each row: boxes by longest path from the root, and between them edges' labels.

    An edge has a place of its own in every row that it passes, so that it crosses neither box nor label.
    """
    levels = _levels(graph)
    rows: list[list[Item]] = [[] for _ in range(2 * max(levels.values()) + 1)]  # boxes stand in even ones
    for node, level in levels.items():
        rows[2 * level].append(boxes[node])
    labels = {(a, b): _wrapped(data["label"]) for a, b, data in graph.edges(data=True) if data.get("label")}
    labelled = {2 * levels[child] - 1 for _, child in labels}
    shared: dict[tuple[Hashable, str], Item] = {}
    for parent, child in graph.edges:
        text = labels.get((parent, child), "")
        parents = [each for each in graph.predecessors(child) if labels.get((each, child)) == text]
        last, at = 2 * levels[child] - 1, boxes[parent]
        for place in range(2 * levels[parent] + 1, last + 1):
            if place == last and text:
                label = shared.get((child, text)) if len(parents) >= _SHARED else None
                if label is None:
                    width, height = _text_size(axes, text, _EDGE_FONT)
                    label = shared[child, text] = Item("label", width, height + _PAD, text)
                    rows[place].append(label)
                at = linked(at, label)
            elif place % 2 == 0 or place in labelled:
                point = Item("point")
                rows[place].append(point)
                at = linked(at, point)
        if boxes[child] not in at.below:
            linked(at, boxes[child])
    return [row for row in rows if row]


def _levels(graph: nx.DiGraph[Any]) -> dict[Hashable, int]:
    """Return each node's level by its longest path from the root; actions are the last one."""
    depth = {node: i for i, layer in enumerate(nx.topological_generations(graph)) for node in layer}
    actions = {node for node, data in graph.nodes(data=True) if data["kind"] == "action"}
    tasks = max((level for node, level in depth.items() if node not in actions), default=-1)
    return {node: tasks + 1 if node in actions else depth[node] for node in graph}


def _wrapped(text: str) -> str:
    """Return a label in short lines; a very long one gets longer lines rather than a tower of them."""
    most = max(_WORDS, round((3 * len(text)) ** 0.5))
    lines = (textwrap.wrap(line, most, break_on_hyphens=False) for line in text.split("\n"))
    return "\n".join("\n".join(parts) for parts in lines)


def _port(item: Item, others: Sequence[Item], other: Item) -> float:
    """Return where on its side an item meets the edge to `other`: boxes spread their edges."""
    if item.kind != "box":
        return item.x
    place = sorted(others, key=lambda each: each.x).index(other)
    return item.x + 0.7 * item.width * ((place + 0.5) / len(others) - 0.5)


def _draw_edge(axes: Axes, item: Item, child: Item) -> None:
    """Draw an edge's part from one row to the next, and along a point that it passes."""
    start = (_port(item, item.below, child), item.y - item.height / 2)
    end = (_port(child, child.above, item), child.y + child.height / 2)
    bend = 0.35 * (start[1] - end[1])
    vertices = [start, (start[0], start[1] - bend), (end[0], end[1] + bend), end]
    codes = [Path.MOVETO, Path.CURVE4, Path.CURVE4, Path.CURVE4]
    if item.kind == "point" and item.height:
        vertices.insert(0, (item.x, item.y + item.height / 2))
        codes.insert(1, Path.LINETO)
    style = "-|>" if child.kind == "box" else "-"
    look: Look = {"arrowstyle": style, "mutation_scale": 7, "shrinkA": 0, "shrinkB": 0, "zorder": 1}
    axes.add_patch(FancyArrowPatch(path=Path(vertices, codes), linewidth=0.7, color=GREY, **look))


def _text_size(axes: Axes, text: str, points: float, weight: str = "normal") -> tuple[float, float]:
    """Return the width and height of a drawn text, in inches."""
    figure = axes.get_figure(root=True)
    assert figure is not None, "the axes belong to a figure"
    probe = axes.text(0, 0, text, fontsize=points, fontweight=weight, linespacing=1.15)
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    extent = probe.get_window_extent(renderer)
    probe.remove()
    return extent.width / figure.dpi, extent.height / figure.dpi


def _draw_box(axes: Axes, box: Item, kind: str) -> None:
    fill, edge = _LOOKS[kind]
    corner = (box.x - box.width / 2, box.y - box.height / 2)
    shape = f"round,pad=0,rounding_size={0.5 * box.height if kind == 'action' else 0.06}"
    look: Look = {
        "facecolor": fill,
        "edgecolor": edge,
        "linewidth": 1.4 if kind == "root" else 1.0,
        "zorder": 2,
    }
    axes.add_patch(FancyBboxPatch(corner, box.width, box.height, boxstyle=shape, **look))
    place: Look = {
        "ha": "center",
        "va": "center_baseline",
        "fontsize": _FONT,
        "linespacing": 1.15,
        "zorder": 3,
    }
    axes.text(box.x, box.y, box.text, fontweight=_weight(kind), color=INK, **place)


def _weight(kind: str) -> str:
    return "bold" if kind == "root" else "normal"
