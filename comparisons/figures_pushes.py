"""Figures of pushing: what pushed obstacles did, and what backends learn from pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator

from comparisons.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    VERMILION,
    Look,
    grid_of,
    styled,
)

_LINES = ((BLUE, "o"), (ORANGE, "s"), (VERMILION, "^"), (GREEN, "D"))  # told by marker as well as by colour
_BESIDE = 0.13  # rows: how far the two accuracies on a group stand from its middle
_APART = 1.05  # lines' dots stand beside each other: pushes times so much from line to line


class Learnt(NamedTuple):
    """Shares of right frames after some pushes: the mean, its interval, and each seed's."""

    pushes: int
    mean: float
    low: float
    high: float
    seeds: Sequence[float]


class Pair(NamedTuple):
    """A share with the bounds of its interval, of who learnt a group and of who did not."""

    learnt: tuple[float, float, float]
    left_out: tuple[float, float, float]


@styled
def push_figure(counts: Mapping[str, Mapping[str, int]]) -> Figure:
    """Draw what pushed obstacles did: a panel for each kind, a bar for each behaviour.

    Parameters
    ----------
    counts
        Per kind, trials by behaviour (rolls, slides, topples, stays).

    Examples
    --------
    >>> figure = push_figure({"cube": {"rolls": 0, "slides": 5}, "sphere": {"rolls": 6}})
    >>> [axes.get_title(loc="left") for axes in figure.axes]
    ['cube (5 trials)', 'sphere (6 trials)']
    """
    labels = list(dict.fromkeys(label for by_label in counts.values() for label in by_label))
    palette = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION)
    colours = [palette[i % len(palette)] for i in range(len(labels))]
    rows, columns = grid_of(len(counts), 3)
    figure = Figure((0.6 + 2.9 * columns, rows * (0.75 + 0.27 * len(labels))), layout="constrained")
    most = max((max(by_label.values(), default=0) for by_label in counts.values()), default=0)
    places = np.arange(len(labels))
    for i, (kind, by_label) in enumerate(counts.items()):
        axes = figure.add_subplot(rows, columns, i + 1)
        trials = [by_label.get(label, 0) for label in labels]
        bars = axes.barh(places, trials, height=0.68, color=colours)
        axes.bar_label(bars, padding=3, color=INK)
        axes.set_yticks(places, labels if i % columns == 0 else [""] * len(labels), color=INK)
        axes.invert_yaxis()
        axes.set_xlim(0, 1.14 * max(most, 1))
        axes.set_title(f"{kind} ({sum(trials)} trials)", loc="left")
        axes.tick_params(axis="y", length=0)
        if i // columns == rows - 1:
            axes.set_xlabel("trials")
    return figure


@styled
def learning_figure(panels: Mapping[str, Mapping[str, Sequence[Learnt]]]) -> Figure:
    """Draw accuracy over the number of pushes: a panel for each backend, a line for each set of labels.

    Pushes stand on a logarithmic axis. A line is the mean over training seeds with its 95 % interval as a
    band; the small dots are the seeds.

    Parameters
    ----------
    panels
        By backend and line, what was reached after each number of pushes, the fewest first.

    Examples
    --------
    >>> line = [Learnt(25, 0.5, 0.4, 0.6, (0.45, 0.55)), Learnt(100, 0.9, 0.8, 0.95, (0.9, 0.9))]
    >>> figure = learning_figure({"cnn": {"labels right": line}})
    >>> figure.axes[0].get_xscale(), len(figure.axes[0].collections)
    ('log', 3)
    """
    rows, columns = grid_of(len(panels), 3)
    points = [point for lines in panels.values() for line in lines.values() for point in line]
    ticks = sorted({point.pushes for point in points})
    lowest = min(min(point.low, *point.seeds) for point in points)
    figure = Figure((0.6 + 2.5 * columns, 0.6 + 2.4 * rows), layout="constrained")
    for i, (title, lines) in enumerate(panels.items()):
        axes = figure.add_subplot(rows, columns, i + 1)
        axes.set_xscale("log")
        for j, (name, line) in enumerate(lines.items()):
            _draw_line(axes, name, line, j, _APART ** (j - (len(lines) - 1) / 2))
        axes.set_title(title, loc="left")
        axes.set_xlim(ticks[0] / 1.3, ticks[-1] * 1.3)
        axes.set_ylim(100 * lowest - 3, 102)
        axes.xaxis.set_major_locator(FixedLocator(ticks))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xticklabels([str(tick) for tick in ticks], fontsize=7)
        axes.grid(visible=True, axis="y", color=PALE, linewidth=0.6)
        axes.set_xlabel("pushes")
        if i % columns == 0:
            axes.set_ylabel("right, %")
    handles, shown = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, shown, loc="outside upper center", ncols=len(shown))
    return figure


def _draw_line(axes: Axes, name: str, line: Sequence[Learnt], number: int, aside: float) -> None:
    colour, marker = _LINES[number % len(_LINES)]
    pushes = np.array([point.pushes for point in line]) * aside
    low, high = (100 * np.array([getattr(point, bound) for point in line]) for bound in ("low", "high"))
    axes.fill_between(pushes, low, high, color=colour, alpha=0.12, linewidth=0)
    means = [100 * point.mean for point in line]
    axes.plot(pushes, means, color=colour, marker=marker, markersize=4, linewidth=1.3, label=name)
    for place, point in zip(pushes, line, strict=True):
        if len(point.seeds) == 1:
            continue  # it is the mean
        dots: Look = {"s": 5, "color": colour, "edgecolor": "white", "linewidth": 0.3, "zorder": 3}
        axes.scatter([place * 1.02] * len(point.seeds), [100 * share for share in point.seeds], **dots)


@styled
def held_out_figure(panels: Mapping[str, Mapping[str, Pair]]) -> Figure:
    """Draw accuracy on groups that were kept out of training: a panel for each backend, a row a group.

    Parameters
    ----------
    panels
        By backend and group, the accuracy on it with and without having learnt it.

    Examples
    --------
    >>> pair = Pair((0.99, 0.97, 1.0), (0.2, 0.1, 0.3))
    >>> figure = held_out_figure({"cnn": {"distance 2": pair}})
    >>> [label.get_text() for label in figure.axes[0].get_yticklabels()]
    ['distance 2']
    """
    rows, columns = grid_of(len(panels), 3)
    names = list(dict.fromkeys(group for groups in panels.values() for group in groups))
    figure = Figure((1.4 + 2.2 * columns, 0.4 + rows * (0.9 + 0.24 * len(names))), layout="constrained")
    looks: dict[str, Look] = {
        "learnt": {"color": BLUE, "marker": "o", "markerfacecolor": "white"},
        "left_out": {"color": VERMILION, "marker": "s"},
    }
    labels = {"learnt": "learnt with everything", "left_out": "this group kept out"}
    for i, (title, groups) in enumerate(panels.items()):
        axes = figure.add_subplot(rows, columns, i + 1)
        places = np.array([names.index(group) for group in groups], dtype=float)
        ends = 100 * np.array([[pair.learnt[0], pair.left_out[0]] for pair in groups.values()])
        axes.plot(ends.T, np.stack([places - _BESIDE, places + _BESIDE]), color=GREY, linewidth=0.8, zorder=1)
        for name, look in looks.items():
            share, low, high = 100 * np.array([getattr(pair, name) for pair in groups.values()]).T
            error = np.stack([np.maximum(share - low, 0), np.maximum(high - share, 0)])
            where = places + (-_BESIDE if name == "learnt" else _BESIDE)
            axes.errorbar(
                share,
                where,
                xerr=error,
                linestyle="",
                markersize=4,
                elinewidth=0.9,
                label=labels[name],
                **look,
            )
        axes.set_yticks(range(len(names)), names if i % columns == 0 else [""] * len(names), color=INK)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.set_xlim(-3, 103)
        axes.tick_params(axis="y", length=0)
        axes.grid(visible=True, axis="x", color=PALE, linewidth=0.6)
        axes.set_title(title, loc="left")
        axes.set_xlabel("right, %")
    handles, shown = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, shown, loc="outside upper center", ncols=len(shown))
    return figure
