"""Ways through a maze, of many runs at once: the wider a line, the more runs go there."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Final

from matplotlib.figure import Figure

from comparisons.study.figures.mazes import maze_panels
from comparisons.style import BLUE, styled
from worlds import Cell, Layout

_NO_BREAK: Final = "\N{NO-BREAK SPACE}"
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
def ways_figure(
    layout: Layout, panels: Sequence[Ways], ring: Mapping[str, Cell] = MappingProxyType({})
) -> Figure:
    r"""Draw how many runs make each step through a maze.

    Parameters
    ----------
    layout
        The maze.
    panels
        At least one.
    ring
        Cells to frame by their names: the trigger and the goal.

    Examples
    --------
    >>> from worlds import load_layout
    >>> ways = Ways("maxq-0", [[Cell(0, 0), Cell(0, 1)], []])
    >>> figure = ways_figure(load_layout("two_rooms"), [ways])
    >>> figure.axes[0].get_title(loc="left")
    'maxq-0: 1\xa0of\xa02\xa0runs'
    """
    runs = [f"{ways.arrived} of {len(ways.ways)} runs".replace(" ", _NO_BREAK) for ways in panels]
    titles = [
        f"{ways.title}: {told}" if ways.title else told for ways, told in zip(panels, runs, strict=True)
    ]
    figure, mazes = maze_panels(layout, titles, ring)
    for ways, maze in zip(panels, mazes, strict=True):
        for (here, there), share in ways.shares().items():
            maze.axes.plot(
                (here.col, there.col),
                (here.row, there.row),
                color=BLUE,
                linewidth=max(0.4, _WIDEST * maze.cell * share),
                solid_capstyle="round",
                zorder=3,
            )
        maze.robot(layout.start)
    return figure
