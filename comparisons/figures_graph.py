"""A task graph as a layered picture (figures 4 and 7)."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import networkx as nx
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from matplotlib.transforms import Bbox

from comparisons.style import BLUE, GREEN, GREY, INK, Look, styled

_LOOKS: Final = {  # fill and edge
    "root": ("#DCEAF7", BLUE),
    "task": ("#FFFFFF", BLUE),
    "action": ("#E3F3EC", GREEN),
}
_FONT: Final = 8.0
_EDGE_FONT: Final = 6.8
_GAP: Final = 0.3  # between boxes of a layer, inches
_PAD: Final = 0.09  # inside a box, inches
_ALONG: Final = (0.5, 0.58, 0.42, 0.66, 0.34, 0.74, 0.26, 0.82, 0.18)  # where an edge's label may stand


@dataclass(frozen=True)
class _Box:
    x: float  # middle; all in inches
    y: float
    width: float
    height: float


@styled
def task_graph_figure(graph: nx.DiGraph[Any]) -> Figure:
    """Draw a task graph, root at the top and primitive actions at the bottom (figures 4 and 7).

    Parameters
    ----------
    graph
        Nodes have a ``label`` and a ``kind`` (root, task or action); edges may have a ``label``.
        Labels may have several lines.

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
    sizes = {
        node: _text_size(axes, data["label"], _FONT, _weight(data["kind"]))
        for node, data in graph.nodes(data=True)
    }
    labels = {(a, b): data["label"] for a, b, data in graph.edges(data=True) if data.get("label")}
    label_sizes = {edge: _text_size(axes, label, _EDGE_FONT) for edge, label in labels.items()}
    boxes, width, height = _place(graph, _layers(graph), sizes, label_sizes)
    figure.set_size_inches(width, height)
    axes.set(xlim=(0, width), ylim=(0, height))  # data units are inches
    for node, data in graph.nodes(data=True):
        _draw_box(axes, boxes[node], data["label"], data["kind"])
    ends = _ends(graph, boxes)
    for (x0, y0), (x1, y1) in ends.values():
        look: Look = {"arrowstyle": "-|>", "mutation_scale": 7, "shrinkA": 0, "shrinkB": 0, "zorder": 1}
        axes.add_patch(FancyArrowPatch((x0, y0), (x1, y1), linewidth=0.7, color=GREY, **look))
    taken = [_bbox(box.x, box.y, box.width, box.height) for box in boxes.values()]
    back: Look = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    middle: Look = {"ha": "center", "va": "center", "fontsize": _EDGE_FONT, "linespacing": 1.15, "zorder": 3}
    for edge, label in labels.items():
        x, y, box = _free_place(ends[edge], label_sizes[edge], taken)
        taken.append(box)
        axes.text(x, y, label, color=INK, bbox=back, **middle)
    return figure


def _layers(graph: nx.DiGraph[Any]) -> list[list[Hashable]]:
    """Return the nodes by longest path from the root, actions last, each layer below its parents."""
    generations: list[list[Hashable]] = [list(layer) for layer in nx.topological_generations(graph)]
    order = {node: i for i, node in enumerate(graph)}
    actions = [node for node, data in graph.nodes(data=True) if data["kind"] == "action"]
    layers = [[node for node in layer if node not in set(actions)] for layer in generations]
    layers = [sorted(layer, key=order.__getitem__) for layer in [*layers, actions] if layer]
    place: dict[Hashable, float] = {}

    def middle_of_parents(node: Hashable) -> float:
        places = [place[parent] for parent in graph.predecessors(node)]
        return sum(places) / len(places) if places else 0.5

    for layer in layers:
        layer.sort(key=middle_of_parents)  # stable: ties keep the graph's order
        place.update({node: (i + 0.5) / len(layer) for i, node in enumerate(layer)})
    return layers


def _place(
    graph: nx.DiGraph[Any],
    layers: Sequence[Sequence[Hashable]],
    sizes: dict[Hashable, tuple[float, float]],
    label_sizes: dict[tuple[Hashable, Hashable], tuple[float, float]],
) -> tuple[dict[Hashable, _Box], float, float]:
    """Return a box for each node, and the figure's width and height; nothing overlaps."""
    slots: dict[Hashable, float] = {}
    for node, (width, _) in sizes.items():
        incoming = [label_sizes[edge][0] for edge in graph.in_edges(node) if edge in label_sizes]
        # Labels stand half-way up at the least, where edges from one parent are half as far apart.
        slots[node] = max([width + 2 * _PAD, *(1.6 * each for each in incoming)]) + _GAP
    margin = 0.12
    width = max(sum(slots[node] for node in layer) for layer in layers) + 2 * margin - _GAP
    boxes: dict[Hashable, _Box] = {}
    top = margin
    for layer, below in pairwise([*layers, []]):
        x = (width - sum(slots[node] for node in layer)) / 2
        high = max(sizes[node][1] for node in layer) + 2 * _PAD
        for node in layer:
            boxes[node] = _Box(x + slots[node] / 2, top + high / 2, sizes[node][0] + 2 * _PAD, high)
            x += slots[node]
        heights = [label_sizes[edge][1] for edge in graph.in_edges(below) if edge in label_sizes]
        top += high + (max([0.7, *(0.55 + each for each in heights)]) if below else margin)
    # Layers were stacked downwards; the axes' y goes up.
    return {node: _Box(b.x, top - b.y, b.width, b.height) for node, b in boxes.items()}, width, top


def _ends(
    graph: nx.DiGraph[Any], boxes: dict[Hashable, _Box]
) -> dict[tuple[Hashable, Hashable], tuple[tuple[float, float], tuple[float, float]]]:
    """Return where each edge leaves its parent and meets its child, spread along the boxes' sides."""

    def spread(node: Hashable, others: list[Hashable], other: Hashable) -> float:
        others = sorted(others, key=lambda each: boxes[each].x)
        share = (others.index(other) + 0.5) / len(others) - 0.5
        return boxes[node].x + 0.7 * boxes[node].width * share

    ends = {}
    for parent, child in graph.edges:
        x0 = spread(parent, list(graph.successors(parent)), child)
        x1 = spread(child, list(graph.predecessors(child)), parent)
        y0 = boxes[parent].y - boxes[parent].height / 2
        ends[parent, child] = (x0, y0), (x1, boxes[child].y + boxes[child].height / 2)
    return ends


def _free_place(
    ends: tuple[tuple[float, float], tuple[float, float]], size: tuple[float, float], taken: Sequence[Bbox]
) -> tuple[float, float, Bbox]:
    """Return where an edge's label stands: the first place along the edge that covers nothing else."""
    (x0, y0), (x1, y1) = ends
    places = []
    for along in _ALONG:
        x, y = x0 + along * (x1 - x0), y0 + along * (y1 - y0)
        places.append((x, y, _bbox(x, y, size[0] + 0.05, size[1] + 0.05)))
        if not any(places[-1][2].overlaps(box) for box in taken):
            return places[-1]
    return places[0]


def _bbox(x: float, y: float, width: float, height: float) -> Bbox:
    return Bbox.from_bounds(x - width / 2, y - height / 2, width, height)


def _text_size(axes: Axes, text: str, points: float, weight: str = "normal") -> tuple[float, float]:
    """Return the width and height of a drawn text, in inches."""
    figure = axes.get_figure(root=True)
    assert figure is not None, "the axes belong to a figure"
    probe = axes.text(0, 0, text, fontsize=points, fontweight=weight, linespacing=1.15)
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    extent = probe.get_window_extent(renderer)
    probe.remove()
    return extent.width / figure.dpi, extent.height / figure.dpi


def _draw_box(axes: Axes, box: _Box, label: str, kind: str) -> None:
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
    place: Look = {"ha": "center", "va": "center", "fontsize": _FONT, "linespacing": 1.15, "zorder": 3}
    axes.text(box.x, box.y, label, fontweight=_weight(kind), color=INK, **place)


def _weight(kind: str) -> str:
    return "bold" if kind == "root" else "normal"
