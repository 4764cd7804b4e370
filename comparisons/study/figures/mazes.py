"""Panels with a maze on each, of a paper's widths, whose letters can be read in print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from comparisons.figures_maze import MazePanel
from comparisons.study.figures.panels import ONE_COLUMN, TWO_COLUMNS, entitle
from comparisons.style import VERMILION, grid_of
from worlds import Cell, Layout

SMALLEST: Final = 6.0
"""Points of the smallest letters that can be read in print."""
_MANY: Final = 12  # columns of a maze, of which no three stand in a row


def maze_panels(
    layout: Layout, titles: Sequence[str], ring: Mapping[str, Cell], beside: float = 0.0
) -> tuple[Figure, list[MazePanel]]:
    """Return a figure with a maze for each title.

    Parameters
    ----------
    layout
        The maze.
    titles
        At least one.
    ring
        Cells to frame by the names to write there, such as the trigger and the goal of an episode.
    beside
        Inches to leave on the right.

    Examples
    --------
    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> figure, (first, _) = maze_panels(maze, ["maxq-0", "flat-q"], {"G2": maze.marks["G2"]})
    >>> len(figure.axes), first.axes.texts[0].get_text()
    (2, 'G2')
    """
    rows, columns = grid_of(len(titles), 3 if layout.cols <= _MANY else 2)
    width = ONE_COLUMN if columns == 1 else TWO_COLUMNS
    inches = (width - 0.2 - beside) / columns
    cell = inches / (layout.cols + 0.8)
    figure = Figure((width, rows * (cell * (layout.rows + 1) + 0.5)), layout="constrained")
    panels = []
    for i, title in enumerate(titles):
        maze = MazePanel(figure.add_subplot(rows, columns, i + 1), layout, 72 * cell)
        maze.floor(doors_open=True)
        every = 1 if 72 * cell > 1.7 * SMALLEST else 5
        maze.axes.set_xticks(range(0, layout.cols, every))
        maze.axes.set_yticks(range(0, layout.rows, every))
        maze.axes.tick_params(labelsize=max(SMALLEST, min(7.0, 0.24 * maze.cell)))
        for name, place in ring.items():
            maze.ring(place, VERMILION)
            corner = (place.col - 0.4, place.row - 0.4)
            if maze.cell > 2.2 * SMALLEST:
                text = maze.axes.text(*corner, name, fontsize=SMALLEST, color=VERMILION, va="top", zorder=7)
                text.set_path_effects([withStroke(linewidth=1.2, foreground="white")])
        entitle(maze.axes, i, len(titles), title, inches)
        maze.axes.title.set_fontsize(8)
        panels.append(maze)
    return figure, panels
