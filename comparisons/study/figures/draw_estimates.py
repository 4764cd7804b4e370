"""Figures of estimates with their intervals: by level, over a number, and against a baseline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from comparisons.study.figures.panels import (
    ONE_COLUMN,
    TWO_COLUMNS,
    Mark,
    cut_apart,
    entitle,
    figure_of_panels,
    grid_lines,
    legend_above,
    marks,
)
from comparisons.study.figures.scales import WHOLE, Scale, Spot, axis_words, scale_of, set_scale
from comparisons.style import GREY, INK, Look, grid_of, styled

_DIVERGING: Final = LinearSegmentedColormap.from_list("worse_better", ["#E58A3C", "#FFFFFF", "#2C7FB8"])
_UPRIGHT: Final = 8  # letters that fit below a field
_LONG: Final = 20  # letters of a label that leaves no room beside it in a column
_HEIGHTS: Final = (2.2, 1.9)  # inches of a panel, where up to two stand in a row and where three do


@dataclass(frozen=True)
class Estimates:
    """What one panel shows.

    Parameters
    ----------
    label
        Of the measure's axis, unit included.
    spots
        By colour's label and, within it, by level; shares in per cent. A level may be missing, and a colour
        may have none, which then only keeps its place among the colours.
    share
        Whether they are shares, in per cent.
    title
        Of the panel; "" for none.
    """

    label: str
    spots: Mapping[str, Mapping[str, Spot]]
    share: bool = False
    title: str = ""

    @property
    def all(self) -> list[Spot]:
        """Every spot."""
        return [spot for by_level in self.spots.values() for spot in by_level.values()]


@styled
def estimates_figure(panels: Sequence[Estimates], name: str = "", reference: float | None = None) -> Figure:
    """Draw estimates as dots with their 95 % intervals: a row for each level, a panel for each measure.

    Parameters
    ----------
    panels
        At least one. Levels and colours stand in the order in which they first come.
    name
        What the levels are of, above them; "" for nothing.
    reference
        Where a dashed line marks that there is no difference.

    Examples
    --------
    >>> spots = {"maxq-0": {"1": Spot(900, 800, 1000), "0.9": Spot(1300, 1100, float("inf"))}}
    >>> figure = estimates_figure([Estimates("steps", spots)])
    >>> [label.get_text() for label in figure.axes[0].get_yticklabels()]
    ['1', '0.9']
    """
    levels, colours = _levels(panels), list(dict.fromkeys(c for each in panels for c in each.spots))
    names = list(cut_apart(levels).values())
    longest = max(map(len, names), default=0)
    rows, columns = grid_of(len(panels), 2)
    high = 0.42 + len(levels) * (0.14 + 0.115 * len(colours))
    width = ONE_COLUMN if columns == 1 and longest <= _LONG else TWO_COLUMNS
    figure = Figure((width, 0.3 + rows * (high + 0.2)), layout="constrained")
    inches = (width - 0.075 * longest) / columns - 0.2
    looks = marks(colours)
    for i, each in enumerate(panels):
        axes = figure.add_subplot(rows, columns, i + 1)
        scale = _scale(each.all, reference, share=each.share)
        set_scale(axes, "x", scale, 4)
        if reference is not None:
            axes.axvline(reference, color=GREY, linewidth=0.8, linestyle=(0, (4, 2)), gid="reference")
        for j, colour in enumerate(colours):
            away = (j - (len(colours) - 1) / 2) * 0.72 / len(colours)
            for level, spot in each.spots.get(colour, {}).items():
                _dot(axes, spot, levels.index(level) + away, scale, looks[colour])
            label: Look = {"label": colour or None, "color": looks[colour].colour, "linestyle": ""}
            axes.plot([], [], marker=looks[colour].marker, markersize=4, **label)
        axes.set_ylim(len(levels) - 0.45, -0.55)
        axes.set_yticks(range(len(levels)), names if i % columns == 0 else [""] * len(levels), color=INK)
        axes.tick_params(axis="y", length=0)
        if i % columns == 0 and name:
            above: Look = {"xytext": (-4, 3), "textcoords": "offset points", "ha": "right", "color": GREY}
            axes.annotate(name, (0, 1), xycoords="axes fraction", **above)
        grid_lines(axes, "x")
        axes.set_xlabel(axis_words(each.label, scale, inches))
        entitle(axes, i, len(panels), each.title, inches)
    legend_above(figure)
    return figure


def _dot(axes: Axes, spot: Spot, place: float, scale: Scale, mark: Mark) -> None:
    """Draw one estimate with its interval."""
    low, high = scale.inside(spot.low), scale.inside(spot.high)
    axes.plot([low, high], [place, place], color=mark.colour, linewidth=1.2, zorder=2)
    _mark(axes, (scale.inside(spot.value), place), spot, mark, 4.2)


def _mark(axes: Axes, at: tuple[float, float], spot: Spot, mark: Mark, size: float) -> None:
    """Draw an estimate's mark: hollow if it was not reached, small if it rests on few seeds."""
    look: Look = {"color": mark.colour, "clip_on": False, "zorder": 3, "in_layout": False}
    look["markerfacecolor"] = mark.colour if isfinite(spot.value) else "white"
    axes.plot(
        *([each] for each in at), marker=mark.marker, markersize=size * (0.5 if spot.few else 1), **look
    )


@styled
def over_figure(panels: Sequence[Estimates], name: str, reference: float | None = None) -> Figure:
    """Draw estimates over a numeric factor: lines with 95 % bands, a panel for each measure or group.

    Parameters
    ----------
    panels
        At least one; the levels are numbers as text.
    name
        The factor's name, below the axis.
    reference
        Where a dashed line marks that there is no difference; shares then stand on an axis from 0 to 100.

    Examples
    --------
    >>> spots = {"local rule": {"1": Spot(99, 98, 100), "6": Spot(91, 89, 93), "12": Spot(80, 77, 83)}}
    >>> figure = over_figure([Estimates("optimal, %", spots, share=True)], "obstacles")
    >>> figure.axes[0].get_xlabel(), figure.axes[0].lines[0].get_xdata().tolist()
    ('obstacles', [1.0, 6.0, 12.0])
    """
    figure, grid, columns = figure_of_panels(len(panels), _HEIGHTS)
    looks = marks(list(dict.fromkeys(c for each in panels for c in each.spots)))
    places = sorted({float(level) for each in panels for by in each.spots.values() for level in by})
    alike = len({each.label for each in panels}) == 1
    common = _scale([spot for each in panels for spot in each.all], reference, share=panels[0].share)
    for i, (each, axes) in enumerate(zip(panels, grid, strict=True)):
        scale = common if alike else _scale(each.all, reference, share=each.share)
        if reference is not None:
            axes.axhline(reference, color=GREY, linewidth=0.8, linestyle=(0, (4, 2)), gid="reference")
        for j, (colour, by_level) in enumerate(each.spots.items(), start=1):
            if by_level:  # marks that lie on each other are seen if the lower ones are larger
                size = 3.2 + 0.5 * (len(each.spots) - j)
                _line(axes, colour, by_level, scale, looks[colour], size=size)
        set_scale(axes, "y", scale)
        if len(places) <= 12 and places == [round(place) for place in places]:
            every = 1 if len(places) <= 7 or columns == 1 else 2
            axes.set_xticks(places[::every], [f"{place:g}" for place in places[::every]])
        grid_lines(axes, "y")
        if i >= len(panels) - columns:
            axes.set_xlabel(name)
        if i % columns == 0 or not alike:
            axes.set_ylabel(axis_words(each.label, scale, _HEIGHTS[1]))
        entitle(axes, i, len(panels), each.title, figure.get_figwidth() / columns - 0.5)
    legend_above(figure)
    return figure


def _line(
    axes: Axes, label: str, by_level: Mapping[str, Spot], scale: Scale, mark: Mark, *, size: float
) -> None:
    points = sorted((float(level), spot) for level, spot in by_level.items())
    x = np.array([place for place, _ in points])
    value, low, high = (np.array(column) for column in zip(*(spot[:3] for _, spot in points), strict=True))
    inside = np.clip(value, scale.low, scale.high)
    look: Look = {"linewidth": 1.2, "clip_on": False, "in_layout": False, **mark.look}
    axes.plot(x, inside, gid=label or "line", **look)
    axes.plot([], [], label=label or None, marker=mark.marker, markersize=3.6, **look)
    axes.fill_between(
        x,
        np.clip(low, scale.low, scale.high),
        np.clip(high, scale.low, scale.high),
        color=mark.colour,
        alpha=0.16,
        linewidth=0,
    )
    for at, (_, spot) in zip(zip(x, inside, strict=True), points, strict=True):
        _mark(axes, at, spot, mark, size)


@styled
def improvement_matrix_figure(labels: Sequence[str], chances: Mapping[tuple[str, str], Spot]) -> Figure:
    """Draw how probable it is that a run of the row is better than one of the column, in per cent.

    Parameters
    ----------
    labels
        Levels, the best first if there is a best.
    chances
        By row's and column's label, in per cent.

    Examples
    --------
    >>> chances = {("a", "b"): Spot(80, 70, 90), ("b", "a"): Spot(20, 10, 30)}
    >>> figure = improvement_matrix_figure(["a", "b"], chances)
    >>> [text.get_text().splitlines()[0] for text in figure.axes[0].texts]
    ['80', '20']
    """
    n = len(labels)
    names = list(cut_apart(labels).values())
    longest = max(map(len, names))
    turned = longest > _UPRIGHT
    width = ONE_COLUMN if n <= 5 and longest <= 2 * _UPRIGHT else TWO_COLUMNS
    figure = Figure((width, 0.6 + 0.42 * n + 0.04 * longest * turned), layout="constrained")
    axes = figure.add_subplot()
    shares = np.full((n, n), np.nan)
    for (row, column), spot in chances.items():
        shares[labels.index(row), labels.index(column)] = spot.value
    edges = np.arange(n + 1) - 0.5
    axes.pcolormesh(
        edges, edges, shares, cmap=_DIVERGING, vmin=0, vmax=100, edgecolors="white", linewidth=1.2
    )
    for (row, column), (value, low, high, _) in chances.items():
        x, y = labels.index(column), labels.index(row)
        text = f"{value:.0f}\n{low:.0f}\N{EN DASH}{high:.0f}"
        axes.text(x, y, text, ha="center", va="center", fontsize=7, color="white" if value > 92 else INK)
    axes.set_xticks(range(n), names, color=INK, rotation=30 if turned else 0)
    axes.set_yticks(range(n), names, color=INK)
    axes.tick_params(length=0, labelcolor=INK)
    axes.invert_yaxis()
    axes.set_xlabel("than this one")
    axes.set_ylabel("this one is better")
    axes.spines[:].set_visible(False)
    return figure


def _scale(spots: Sequence[Spot], reference: float | None, *, share: bool) -> Scale:
    """Return an axis for spots; shares held against a line are read with the whole way to either side."""
    if reference is None:
        return scale_of(spots, share=share)
    scale = scale_of([*spots, Spot(reference, reference, reference)], share=share)
    return WHOLE._replace(beyond=scale.beyond) if share else scale


def _levels(panels: Sequence[Estimates]) -> list[str]:
    return list(dict.fromkeys(level for each in panels for by in each.spots.values() for level in by))
