"""Heat maps over a maze: a number in every cell that the robot may start from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType
from typing import Final

from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from comparisons.study.figures.mazes import SMALLEST, maze_panels
from comparisons.study.figures.scales import short
from comparisons.style import INK, PALE, VERMILION, Look, styled
from worlds import Cell, Layout

_COLOURS: Final = {
    "steps": LinearSegmentedColormap.from_list("steps", ["#F7FBFF", "#4292C6"]),
    "gaps": LinearSegmentedColormap.from_list("gaps", ["#FFFFFF", "#E58A3C"]),
}


@dataclass(frozen=True, eq=False)
class Heat:
    """A panel: a number for each cell.

    Parameters
    ----------
    title
        Of the panel.
    values
        By cell; infinite where the robot does not arrive.
    """

    title: str
    values: Mapping[Cell, float]


@styled
def heat_figure(
    layout: Layout,
    panels: Sequence[Heat],
    label: str,
    *,
    colours: str = "steps",
    ring: Mapping[str, Cell] = MappingProxyType({}),
) -> Figure:
    """Draw numbers over a maze's cells, panels on one scale of colours; a cross is where none arrives.

    Where cells are too small for numbers that can be read in print, their colours alone tell them.

    Parameters
    ----------
    layout
        The maze.
    panels
        At least one.
    label
        What the numbers are, unit included.
    colours
        "steps", or "gaps" for what is better the paler it is.
    ring
        Cells to frame by their names: the trigger and the goal that the numbers are for.

    Examples
    --------
    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> figure = heat_figure(maze, [Heat("maxq-0", {maze.cells[0]: 12.0, maze.cells[1]: 0.25})], "steps")
    >>> [text.get_text() for text in figure.axes[0].texts][:2]
    ['12', '0.25']
    """
    figure, mazes = maze_panels(layout, [each.title for each in panels], ring, beside=0.55)
    finite = [value for each in panels for value in each.values.values() if isfinite(value)]
    low, high = min([*finite, 0.0]), max([*finite, 0.0])
    scale, colour = Normalize(low, high if high > low else low + 1.0), _COLOURS[colours]
    longest = max((len(_number(value)) for value in finite), default=1)
    size = min(7.5, 0.42 * mazes[0].cell, 1.5 * mazes[0].cell / longest)
    for each, maze in zip(panels, mazes, strict=True):
        for place, value in each.values.items():
            reached = isfinite(value)
            face = colour(scale(value)) if reached else PALE
            square = (place.col - 0.5, place.row - 0.5)
            maze.axes.add_patch(Rectangle(square, 1, 1, facecolor=face, edgecolor="white", linewidth=0.4))
            look: Look = {"color": INK if reached else VERMILION, "fontsize": max(size, SMALLEST)}
            text = _number(value) if reached else "\N{MULTIPLICATION SIGN}"
            if not reached or size >= SMALLEST:
                maze.axes.text(place.col, place.row, text, ha="center", va="center_baseline", **look)
    shown = figure.colorbar(ScalarMappable(scale, colour), ax=figure.axes, fraction=0.03, pad=0.02, aspect=28)
    shown.set_label(label, fontsize=8)
    shown.outline.set_visible(False)
    shown.ax.tick_params(labelsize=7, length=2)
    return figure


def _number(value: float) -> str:
    """Return a number that fits into a cell.

    >>> [_number(value) for value in (0, 7.0, 7.26, 0.04, 123.4)]
    ['0', '7', '7.3', '0.04', '123']
    """
    return short(round(value) if value >= 99.5 else round(value, 1) if value >= 1 else round(value, 2))
