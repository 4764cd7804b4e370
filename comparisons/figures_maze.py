"""A maze on paper: its floor, walls, doors and marks, its obstacles, and routes through it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle, FancyBboxPatch, Rectangle
from numpy.typing import NDArray

from comparisons.style import BLUE, FLOOR, GREEN, GREY, INK, ORANGE, VERMILION, Look
from worlds import Cell, Kind, Layout, Size

Drawn = tuple[str, Kind, Cell, str, Size]
"""An obstacle to draw: name, kind, cell, colour (``#rrggbb``), size."""

WIDTHS: Final[dict[Size, float]] = {"small": 0.42, "middle": 0.54, "large": 0.66}
"""Width of a drawn obstacle, in cells."""
MARK_COLOURS: Final = {"T": VERMILION, "G": GREEN, "D": BLUE}
_LANE: Final = 0.11  # how far to the right a route keeps where it comes back the way it went, in cells
_HEADS: Final = {(0, -1): "^", (0, 1): "v", (-1, 0): "<", (1, 0): ">"}


@dataclass(frozen=True)
class MazePanel:
    """Axes with a maze on them; x is the column and y the row, down.

    Parameters
    ----------
    axes
        Where to draw.
    layout
        The maze.
    cell
        Width of a cell, in points: letters and lines follow it.
    """

    axes: Axes
    layout: Layout
    cell: float

    def floor(self, *, doors_open: bool) -> None:
        """Draw the painted floor, the walls and the doors."""
        layout, axes = self.layout, self.axes
        blue = [_square(cell) for cell in layout.cells if (cell.row + cell.col) % 2 == 0]
        axes.add_collection(PatchCollection(blue, facecolor=FLOOR, edgecolor="none"))
        solid = [_square(cell) for cell in sorted(layout.solid)]
        axes.add_collection(PatchCollection(solid, facecolor=INK, edgecolor=INK))
        right, bottom = layout.cols - 0.5, layout.rows - 0.5
        border = [(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom), (-0.5, -0.5)]
        walls = [border, *(_between(a, b) for a, b in sorted(layout.walls))]
        width = max(1.0, 0.08 * self.cell)
        axes.add_collection(LineCollection(walls, colors=INK, linewidths=width, capstyle="projecting"))
        doors = LineCollection(
            [_between(a, b) for a, b in sorted(layout.doors)],
            colors=ORANGE,
            linewidths=1.6 * width,
            linestyles=(0, (0.7, 1.0)) if doors_open else "solid",
            capstyle="butt",
            gid="doors",
        )
        axes.add_collection(doors)
        axes.set_aspect("equal")
        axes.set_xlim(-0.6, right + 0.1)
        axes.set_ylim(bottom + 0.1, -0.6)
        axes.set_xticks(range(layout.cols))
        axes.set_yticks(range(layout.rows))
        axes.tick_params(length=0, pad=1, labelsize=min(7.0, 0.24 * self.cell))
        axes.xaxis.tick_top()
        axes.spines[:].set_visible(False)

    def marks(self, covered: Collection[Cell] = (), *, corner: bool = False) -> None:
        """Name triggers, goals and doors: bold if the layout's source fixes them, italic grey if chosen.

        A name stands in the middle of its cell, or in a corner where `covered` or `corner` ask for it.
        """
        for name, cell in self.layout.marks.items():
            chosen = name in self.layout.chosen
            in_corner = corner or cell in covered
            self.axes.text(
                cell.col - (0.41 if in_corner else 0),
                cell.row - (0.42 if in_corner else 0),
                name,
                ha="left" if in_corner else "center",
                va="top" if in_corner else "center",
                fontsize=(0.19 if in_corner else 0.32) * self.cell,
                fontstyle="italic" if chosen else "normal",
                fontweight="normal" if chosen else "bold",
                color=GREY if chosen else MARK_COLOURS.get(name[0], INK),
                zorder=7,
            )

    def ring(self, cell: Cell, colour: str) -> None:
        """Frame a cell: the subgoal or the marks of an episode."""
        corner = (cell.col - 0.46, cell.row - 0.46)
        look: Look = {"edgecolor": colour, "linewidth": 0.05 * self.cell, "zorder": 2}
        self.axes.add_patch(Rectangle(corner, 0.92, 0.92, facecolor="none", **look))
        self.axes.add_patch(Rectangle(corner, 0.92, 0.92, facecolor=colour, edgecolor="none", alpha=0.12))

    def robot(self, cell: Cell, label: str = "") -> None:
        """Draw the robot, with a word below it."""
        centre = (cell.col, cell.row - (0.1 if label else 0))
        self.axes.add_patch(Circle(centre, 0.21, facecolor=INK, edgecolor="white", linewidth=0.6, zorder=4))
        self.axes.add_patch(Circle(centre, 0.085, facecolor="white", edgecolor="none", zorder=4))
        if label:
            chosen = label in self.layout.chosen
            self.axes.text(
                cell.col,
                cell.row + 0.3,
                label,
                ha="center",
                va="center",
                fontsize=0.21 * self.cell,
                fontstyle="italic" if chosen else "normal",
                color=GREY if chosen else INK,
                zorder=4,
            )

    def obstacle(self, obstacle: Drawn, *, ghost: bool = False) -> None:
        """Draw a cube as a square and a sphere as a disc; as a ghost, only its dotted outline."""
        name, kind, cell, colour, size = obstacle
        width = WIDTHS[size]
        edge = tuple(0.62 * part for part in to_rgb(colour))
        look: Look = {
            "facecolor": "none" if ghost else colour,
            "edgecolor": edge,
            "linewidth": 0.9,
            "linestyle": ":" if ghost else "-",
            "zorder": 3.5 if ghost else 5,
        }
        if kind == "cube":
            corner = (cell.col - width / 2 + 0.04, cell.row - width / 2 + 0.04)
            side = width - 0.08
            box = "round,pad=0.04,rounding_size=0.05"
            self.axes.add_patch(FancyBboxPatch(corner, side, side, boxstyle=box, **look))
        else:
            self.axes.add_patch(Circle((cell.col, cell.row), width / 2, **look))
        if name and not ghost:
            self.axes.text(
                cell.col,
                cell.row,
                name,
                ha="center",
                va="center_baseline",
                fontsize=0.21 * self.cell,
                fontweight="bold",
                color=_readable_on(colour),
                zorder=6,
            )

    def route(self, route: Sequence[Cell], colour: str = BLUE, *, stuck: bool = False) -> None:
        """Draw a route as a line with an arrow on every step; a cross ends it if the robot is stuck."""
        points, heads = lanes(route)
        self.axes.plot(
            points[:, 0],
            points[:, 1],
            color=colour,
            linewidth=0.07 * self.cell,
            solid_joinstyle="round",
            gid="route",
            zorder=3,
        )
        for direction, marker in _HEADS.items():
            at = heads.get(direction)
            if at:
                x, y = zip(*at, strict=True)
                size = 0.21 * self.cell
                look: Look = {"markeredgecolor": "white", "markeredgewidth": 0.4, "zorder": 3.2}
                self.axes.plot(x, y, marker=marker, markersize=size, color=colour, linestyle="", **look)
        end = points[-1:]
        if stuck:
            cross: Look = {"markersize": 0.36 * self.cell, "markeredgewidth": 0.08 * self.cell, "zorder": 7}
            self.axes.plot(end[:, 0], end[:, 1], marker="x", color=VERMILION, gid="stuck", **cross)
        else:
            self.axes.plot(
                end[:, 0], end[:, 1], marker="o", color=colour, markersize=0.18 * self.cell, zorder=3
            )

    def rolls(self, rolls: Iterable[tuple[Cell, Cell]], obstacles: Iterable[Drawn]) -> None:
        """Draw each roll dotted, in its sphere's colour, with the sphere's outline where it comes to rest."""
        at = {obstacle[2]: obstacle for obstacle in obstacles if obstacle[1] == "sphere"}
        for start, end in rolls:
            name, kind, _, colour, size = at.pop(start, ("", "sphere", start, GREY, "middle"))
            at[end] = (name, kind, end, colour, size)
            self.axes.plot(
                (start.col, end.col),
                (start.row, end.row),
                color=colour,
                linestyle=":",
                linewidth=0.06 * self.cell,
                gid="roll",
                zorder=3.4,
            )
            self.obstacle(at[end], ghost=True)


def lanes(
    route: Sequence[Cell],
) -> tuple[NDArray[np.float64], dict[tuple[int, int], list[tuple[float, float]]]]:
    """Return the line of a route, shape (points, 2) as x and y, and its arrowheads by direction.

    A step that does not move is left out. Where a route takes an edge twice it keeps to the right,
    so that the way out and the way back are both seen.

    Examples
    --------
    >>> line, heads = lanes([Cell(0, 0), Cell(0, 1), Cell(0, 1), Cell(1, 1)])
    >>> line.tolist(), heads
    ([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], {(1, 0): [(0.5, 0.0)], (0, 1): [(1.0, 0.5)]})
    """
    cells = [cell for i, cell in enumerate(route) if i == 0 or cell != route[i - 1]]
    steps = list(pairwise(cells))
    taken = Counter(frozenset(step) for step in steps)
    # Each step's offset to its right-hand side, (x, y).
    offsets = [_right(a, b, _LANE if taken[frozenset((a, b))] > 1 else 0.0) for a, b in steps]
    heads: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for (a, b), (x, y) in zip(steps, offsets, strict=True):
        middle = ((a.col + b.col) / 2 + x, (a.row + b.row) / 2 + y)
        heads.setdefault((b.col - a.col, b.row - a.row), []).append(middle)
    points = [(cells[0].col + x, cells[0].row + y) for x, y in offsets[:1] or [(0.0, 0.0)]]
    for i, cell in enumerate(cells[1:], start=1):
        around = offsets[i - 1 : i + 1]
        turns = len(around) == 2 and (cell.row - cells[i - 1].row == 0) != (cells[i + 1].row - cell.row == 0)
        corner = [(around[0][0] + around[1][0], around[0][1] + around[1][1])] if turns else around
        points += [(cell.col + x, cell.row + y) for x, y in dict.fromkeys(corner)]
    return np.array(points, dtype=np.float64), heads


def _right(a: Cell, b: Cell, distance: float) -> tuple[float, float]:
    """Return the offset (x, y) by `distance` to the right of a step; y goes down."""
    return ((a.row - b.row) * distance + 0.0, (b.col - a.col) * distance + 0.0)


def _square(cell: Cell) -> Rectangle:
    return Rectangle((cell.col - 0.5, cell.row - 0.5), 1, 1)


def _between(a: Cell, b: Cell) -> list[tuple[float, float]]:
    """Return the line between two adjacent cells, as points (x, y)."""
    if a.row == b.row:
        x = (a.col + b.col) / 2
        return [(x, a.row - 0.5), (x, a.row + 0.5)]
    y = (a.row + b.row) / 2
    return [(a.col - 0.5, y), (a.col + 0.5, y)]


def _readable_on(colour: str) -> str:
    """Return white or dark ink, whichever reads better on `colour`."""
    red, green, blue = to_rgb(colour)
    return "white" if 0.299 * red + 0.587 * green + 0.114 * blue < 0.6 else INK
