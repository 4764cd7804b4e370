"""Ways through a maze, of many runs at once: the wider a line, the more runs go there."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from matplotlib.figure import Figure

from comparisons.figures_maze import MazePanel
from comparisons.study.figures.saving import ONE_COLUMN, TWO_COLUMNS, cut
from comparisons.style import BLUE, VERMILION, grid_of, panel, styled
from worlds import Cell, Layout

_WIDEST: Final = 0.2
"""Width of a line that every run takes, in cells."""


@dataclass(frozen=True, eq=False)
class Ways:
    """A panel: the cells that each run passes, the start first; none for a run that does not arrive."""

    title: str
    ways: Sequence[Sequence[Cell]]

    @property
    def arrived(self) -> int:
        """How many runs arrive."""
        return sum(bool(way) for way in self.ways)

    def shares(self) -> Mapping[tuple[Cell, Cell], float]:
        """Return which share of all runs makes each step, in order of the cells.

        Examples
        --------
        >>> here, there = Cell(0, 0), Cell(0, 1)
        >>> Ways("", [[here, there], [], [here, here, there], [here, there]]).shares()[here, there]
        0.75
        """
        taken = Counter(step for way in self.ways for step in set(pairwise(way)) if step[0] != step[1])
        return {step: count / len(self.ways) for step, count in sorted(taken.items())}


@styled
def ways_figure(layout: Layout, panels: Sequence[Ways], ring: Sequence[Cell] = ()) -> Figure:
    """Draw how many runs make each step through a maze.

    Parameters
    ----------
    layout
        The maze.
    panels
        At least one.
    ring
        Cells to frame: the trigger and the goal.

    Examples
    --------
    >>> from worlds import load_layout
    >>> ways = Ways("maxq-0", [[Cell(0, 0), Cell(0, 1)], []])
    >>> figure = ways_figure(load_layout("two_rooms"), [ways])
    >>> figure.axes[0].get_title(loc="left")
    'maxq-0: 1 of 2 runs'
    """
    rows, columns = grid_of(len(panels), 3 if layout.cols <= 12 else 2)
    width = ONE_COLUMN if columns == 1 else TWO_COLUMNS
    cell = (width - 0.2) / columns / (layout.cols + 0.8)  # inches
    figure = Figure((width, rows * (cell * (layout.rows + 1) + 0.42)), layout="constrained")
    for i, ways in enumerate(panels):
        axes = figure.add_subplot(rows, columns, i + 1)
        maze = MazePanel(axes, layout, 72 * cell)
        maze.floor(doors_open=True)
        for (here, there), share in ways.shares().items():
            axes.plot(
                (here.col, there.col),
                (here.row, there.row),
                color=BLUE,
                linewidth=max(0.4, _WIDEST * 72 * cell * share),
                solid_capstyle="round",
                zorder=3,
            )
        maze.robot(layout.start)
        for place in ring:
            maze.ring(place, VERMILION)
        runs = f"{ways.arrived} of {len(ways.ways)} runs"
        title = f"{cut(ways.title)}: {runs}" if ways.title else runs
        axes.set_title(panel(i, title) if len(panels) > 1 else title, loc="left", fontsize=8)
    return figure
