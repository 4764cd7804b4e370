"""Figures of learning: convergence (figure 12), step counts (figure 13), value counts (section 5.3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from comparisons.style import BLUE, GREY, INK, PALE, RED, VERMILION, Look, grid_of, panel, styled
from worlds import Cell

Band = NDArray[np.float64]
"""First quartile, median and third quartile of some runs' steps, one an episode, shape (3, episodes)."""

_BEYOND = 1e6
_NO_ROUTE = "\N{EN DASH}"
_NEAR_TO_FAR = LinearSegmentedColormap.from_list("near_to_far", ["#F7FBFF", "#8DBBDD"])


@styled
def convergence_figure(curves: Mapping[str, Mapping[str, Band]], optima: Mapping[str, int]) -> Figure:
    """Draw how many steps each subtask takes as it is learnt, a panel each (figure 12).

    The axis ends at 10 steps as the paper's does (or just above the optimum, if that is more):
    early episodes of training leave it at the top.

    Parameters
    ----------
    curves
        Per panel, in order: a band of ``training`` episodes, of the ``greedy`` policy without exploration,
        or of both. A shorter one is spread over the episodes of the longest.
    optima
        Per panel, the fewest possible steps; drawn dashed.

    Examples
    --------
    >>> training = band([[9, 7], [8, 6], [8, 7]])
    >>> figure = convergence_figure({"GotoTrigger(T4)": {"training": training}}, {"GotoTrigger(T4)": 6})
    >>> figure.axes[0].get_title(loc="left")
    '(a) GotoTrigger(T4)'
    """
    rows, columns = grid_of(len(curves), 3)
    figure = Figure((7.2, 0.5 + 1.95 * rows), layout="constrained")
    grid = figure.add_gridspec(rows, columns)
    axes = None
    for i, (name, curve) in enumerate(curves.items()):
        axes = figure.add_subplot(grid[divmod(i, columns)])
        _draw_bands(axes, curve, optima.get(name))
        axes.set_title(panel(i, name), loc="left")
        axes.set_xlabel("episodes")
        if i % columns == 0:
            axes.set_ylabel("steps to the subgoal")
    handles = {
        handle.get_label(): handle for axes in figure.axes for handle in axes.get_legend_handles_labels()[0]
    }
    free = rows * columns - len(curves)
    if free:
        corner = figure.add_subplot(grid[rows - 1, columns - free :])
        corner.set_axis_off()
        corner.legend(handles=list(handles.values()), loc="center")
    else:
        figure.legend(handles=list(handles.values()), loc="outside lower center", ncols=3)
    return figure


def band(steps: ArrayLike) -> Band:
    """Return quartiles over runs, each a number of steps that some run took.

    Parameters
    ----------
    steps
        Steps, shape (runs, episodes); inf where a policy does not arrive.

    Examples
    --------
    >>> band([[4.0], [6.0], [5.0], [9.0]])[:, 0]
    array([4., 5., 6.])
    """
    quartiles: Band = np.quantile(np.asarray(steps, float), (0.25, 0.5, 0.75), axis=0, method="inverted_cdf")
    return quartiles


def _draw_bands(axes: Axes, bands: Mapping[str, Band], optimum: int | None) -> None:
    looks: dict[str, tuple[str, Look]] = {
        "training": ("training episodes", {"color": BLUE, "linewidth": 1.0}),
        "greedy": ("greedy policy", {"color": INK, "linewidth": 0.9}),
    }
    longest = max(quartiles.shape[1] for quartiles in bands.values())
    for name, (low, middle, high) in bands.items():
        label, look = looks[name]
        episodes = np.arange(1, len(middle) + 1) * (longest / len(middle))
        axes.plot(episodes, middle, gid=name, label=f"{label}: median", **look)
        shade: Look = {"color": look["color"], "alpha": 0.2, "linewidth": 0}
        capped = np.minimum(high, _BEYOND)  # what never arrives has no place on the axis
        axes.fill_between(
            episodes, low, capped, gid=f"{name}-band", label=f"{label}: interquartile range", **shade
        )
    top = 10.0
    if optimum is not None:
        dashed: Look = {"linestyle": (0, (4, 2)), "linewidth": 1.1, "zorder": 3}
        axes.axhline(
            optimum, color=VERMILION, gid="optimum", label="optimum (breadth-first search)", **dashed
        )
        axes.annotate(
            str(optimum),
            (1, optimum),
            xycoords=("axes fraction", "data"),
            xytext=(3, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
            color=VERMILION,
        )
        top = max(top, optimum + 2.0)
    axes.set_xlim(0, longest)
    axes.set_ylim(0, top)
    axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))


@styled
def step_tables_figure(
    tables: Mapping[str, Sequence[Sequence[int]]],
    subgoals: Mapping[str, Cell] | None = None,
    origins: Mapping[str, Cell] | None = None,
) -> Figure:
    """Draw tables of learnt step counts over the maze's grids, a panel each (figure 13).

    A grid at 0 steps is the subgoal itself and stands in red. A negative count means that the subgoal
    cannot be reached, and is shown as a dash.

    Parameters
    ----------
    tables
        Per panel, in order: steps to the subgoal from each grid, shape (rows, columns).
    subgoals
        Where each table's subgoal stands in the maze. One in the column beside its table (the grid
        behind a door) is drawn in red there.
    origins
        The grid of the maze at each table's top left; 0,0 where not given.

    Examples
    --------
    >>> figure = step_tables_figure({"GotoTrigger(T1)": [[1, 0], [2, 1]]})
    >>> [text.get_text() for text in figure.axes[0].texts]
    ['1', '0', '2', '1']
    """
    rows, columns = grid_of(len(tables), 4)
    shapes = [np.asarray(table).shape for table in tables.values()]
    cell = min(0.3, 1.6 / max(shape[1] for shape in shapes))  # inches
    high = cell * max(shape[0] for shape in shapes) + 0.65
    figure = Figure((1.85 * columns, rows * high), layout="constrained")
    most = max(max(map(max, table)) for table in tables.values())
    for i, (name, table) in enumerate(tables.items()):
        axes = figure.add_subplot(rows, columns, i + 1)
        origin = (origins or {}).get(name, Cell(0, 0))
        _draw_table(axes, np.asarray(table), origin, max(most, 1))
        if subgoals and name in subgoals:
            _draw_subgoal_beside(axes, subgoals[name], origin, np.asarray(table).shape)
        axes.set_title(panel(i, name), loc="left", fontsize=8.5, pad=6)
    return figure


def _draw_table(axes: Axes, table: np.ndarray, origin: Cell, most: int) -> None:
    rows, columns = table.shape
    for row, col in np.ndindex(rows, columns):
        count = int(table[row, col])
        colour = PALE if count < 0 else _NEAR_TO_FAR(count / most)
        x, y = col + origin.col, row + origin.row
        axes.add_patch(
            Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=colour, edgecolor="white", linewidth=0.8)
        )
        axes.text(
            x,
            y,
            _NO_ROUTE if count < 0 else str(count),
            ha="center",
            va="center_baseline",
            color=RED if count == 0 else INK,
            fontweight="bold" if count == 0 else "normal",
        )
        if count == 0:
            _frame(axes, x, y)
    axes.set_aspect("equal")
    # A column's room on the right, so that the grid behind a door has its place and panels are alike.
    axes.set_xlim(origin.col - 0.55, origin.col + columns + 0.5)
    axes.set_ylim(origin.row + rows - 0.45, origin.row - 0.55)
    axes.set_xticks(range(origin.col, origin.col + columns))
    axes.set_yticks(range(origin.row, origin.row + rows))
    axes.tick_params(length=0, labelsize=7, pad=1)
    axes.spines[:].set_visible(False)


def _draw_subgoal_beside(axes: Axes, subgoal: Cell, origin: Cell, shape: tuple[int, ...]) -> None:
    """Draw a subgoal that stands in the column next to its table, as the grid behind a door does."""
    if subgoal.col not in (origin.col - 1, origin.col + shape[1]):
        return
    if subgoal.col < origin.col:
        axes.set_xlim(left=subgoal.col - 0.5)
    _frame(axes, subgoal.col, subgoal.row)
    look: Look = {"ha": "center", "va": "center_baseline", "color": RED, "fontweight": "bold"}
    axes.text(subgoal.col, subgoal.row, "0", **look)


def _frame(axes: Axes, x: float, y: float) -> None:
    axes.add_patch(
        Rectangle((x - 0.44, y - 0.44), 0.88, 0.88, fill=False, edgecolor=RED, linewidth=1.2, zorder=3)
    )


@styled
def value_counts_figure(rows: Sequence[tuple[str, int]]) -> Figure:
    """Draw how many values each representation stores, as bars from zero (section 5.3).

    Examples
    --------
    >>> figure = value_counts_figure([("flat Q", 4096), ("MAXQ, abstracted", 1284)])
    >>> [text.get_text() for text in figure.axes[0].texts]
    ['4096', '1284']
    """
    figure = Figure((6.4, 0.6 + 0.3 * len(rows)), layout="constrained")
    axes = figure.add_subplot()
    labels, counts = [label for label, _ in rows], [count for _, count in rows]
    places = np.arange(len(rows))
    bars = axes.barh(places, counts, height=0.66, color=BLUE)
    axes.bar_label(bars, padding=3, color=INK)
    axes.set_yticks(places, labels, color=INK)
    axes.invert_yaxis()
    axes.margins(x=0.1)
    axes.set_xlabel("values stored")
    axes.tick_params(axis="y", length=0)
    axes.spines.left.set_color(GREY)
    return figure
