"""Figures of a maze: its layout (figures 3 and 14), routes (figure 15), and a counter-example."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from comparisons.figures_maze import MARK_COLOURS, Drawn, MazePanel
from comparisons.style import BLUE, GREEN, GREY, INK, ORANGE, PLUM, VERMILION, Look, panel, styled
from worlds import Cell, Layout, MazeState, Obstacle

_CUBE = ("#5B6673", "cube: blocks")
_SPHERE = ("#E58A3C", "sphere: rolls")


@styled
def layout_figure(layout: Layout) -> Figure:
    """Draw a maze with its marks, its start and the obstacles that will appear (figures 3 and 14).

    Marks that the layout's source fixes are bold; chosen ones are italic and grey. The trigger and
    the goal of the example run are framed.

    Examples
    --------
    >>> from worlds import load_layout
    >>> figure = layout_figure(load_layout("two_rooms"))
    >>> {"T4", "start", "C1"} <= {text.get_text() for text in figure.axes[0].texts}
    True
    """
    figure, panels = _panels(layout, [""], foot=0.72, width=4.4)
    maze = panels[0]
    maze.floor(doors_open=False)
    maze.marks({obstacle.cell for obstacle in layout.obstacles} | {layout.start})
    _example(maze)
    maze.robot(layout.start, "start")
    for obstacle in layout.obstacles:
        maze.obstacle(drawn(obstacle))
    handles = [
        _square_mark(VERMILION, "trigger of the example run"),
        _square_mark(GREEN, "goal of the example run"),
        _solid_mark("s", GREY, "cube"),
        _solid_mark("o", GREY, "sphere"),
        _line(ORANGE, "-", "door"),
    ]
    _legend(figure, handles, columns=3, bottom=0.3)
    if layout.chosen:
        note = "bold: position fixed by the source;  italic and grey: chosen"
        if layout.obstacles and layout.chosen.issuperset(obstacle.name for obstacle in layout.obstacles):
            note = note.replace(": chosen", ", and obstacles: chosen")
        figure.text(
            0.5, 0.1 / figure.get_figheight(), note, ha="center", va="bottom", fontsize=7.5, color=GREY
        )
    return figure


@styled
def trajectories_figure(
    layout: Layout,
    without: Sequence[Cell],
    with_obstacles: Sequence[Cell],
    obstacles: Sequence[Drawn],
    rolls: Sequence[tuple[Cell, Cell]] = (),
) -> Figure:
    """Draw the example run without and with obstacles, side by side (figure 15).

    Parameters
    ----------
    layout
        The maze.
    without, with_obstacles
        Cells that the robot passed, the start first; a step that did not move repeats its cell.
    obstacles
        Where each obstacle first appeared: name, kind, cell, colour, size.
    rolls
        The pushes in order: the cell that a sphere left and the one that it came to rest in.

    Examples
    --------
    >>> from worlds import Cell, load_layout
    >>> route = [Cell(1, 0), Cell(2, 0), Cell(3, 0)]
    >>> figure = trajectories_figure(load_layout("two_rooms"), route, route, [])
    >>> [axes.get_title(loc="left") for axes in figure.axes]
    ['(a) without obstacles: 2 steps', '(b) with obstacles: 2 steps']
    """
    routes = {"without obstacles": without, "with obstacles": with_obstacles}
    titles = [f"{title}: {_steps(route)}" for title, route in routes.items()]
    figure, panels = _panels(layout, titles, foot=0.36)
    for maze, route in zip(panels, routes.values(), strict=True):
        maze.floor(doors_open=True)
        maze.marks(corner=True)
        _example(maze)
        maze.route(route)
        maze.robot(route[0])
    panels[1].rolls(rolls, obstacles)
    for obstacle in obstacles:
        panels[1].obstacle(obstacle)
    handles = [
        _line(BLUE, "-", "route"),
        _line(GREY, ":", "roll of a pushed sphere"),
        _solid_mark("s", GREY, "cube where it appeared"),
        _solid_mark("o", GREY, "sphere where it appeared"),
    ]
    _legend(figure, handles, columns=4, bottom=0.06)
    return figure


@styled
def counterexample_figure(
    layout: Layout,
    state: MazeState,
    goals: Sequence[Cell],
    local_route: Sequence[Cell],
    optimal_route: Sequence[Cell],
    *,
    texts: tuple[str, str] = ("", ""),
    name: str = "the paper's local rule",
) -> Figure:
    """Draw a state in which a strategy falls short, beside an optimal one.

    Parameters
    ----------
    layout
        The maze.
    state
        Where the robot is, and the obstacles it knows of.
    goals
        Cells that end the current subtask.
    local_route, optimal_route
        Cells passed under each, the robot's own first. A route that does not end in `goals` gets a
        cross at its end.
    texts
        A line or two below each panel.
    name
        The strategy that falls short.

    Examples
    --------
    >>> from worlds import Cell, MazeState, load_layout
    >>> maze = load_layout("two_rooms")
    >>> state = MazeState(robot=0, trigger=49, goal=31, cubes=frozenset({1}))
    >>> figure = counterexample_figure(maze, state, [Cell(6, 1)], [Cell(0, 0)], [Cell(0, 0), Cell(1, 0)])
    >>> len(figure.axes)
    2
    """
    routes = {name: local_route, "an optimal strategy": optimal_route}
    ends = ["" if route[-1] in goals else "not there after " for route in routes.values()]
    titles = [
        f"{title}: {end}{_steps(route)}" for (title, route), end in zip(routes.items(), ends, strict=True)
    ]
    lines = max(text.count("\n") + 1 for text in texts) if any(texts) else 0
    figure, panels = _panels(layout, titles, foot=0.42 + 0.17 * lines)
    known: list[Drawn] = [("", "cube", layout.cells[n], _CUBE[0], "middle") for n in sorted(state.cubes)]
    known += [("", "sphere", layout.cells[n], _SPHERE[0], "middle") for n in sorted(state.spheres)]
    looks = zip(panels, routes.values(), (PLUM, BLUE), texts, strict=True)
    for maze, route, colour, text in looks:
        maze.floor(doors_open=state.doors_open)
        maze.marks(corner=True)
        for goal in goals:
            maze.ring(goal, GREEN)
        for obstacle in known:
            maze.obstacle(obstacle)
        maze.route(route, colour, stuck=route[-1] not in goals)
        maze.robot(layout.cells[state.robot])
        maze.axes.set_xlabel(text, labelpad=4)
    handles = [_square_mark(GREEN, "subgoal"), _solid_mark("s", *_CUBE), _solid_mark("o", *_SPHERE)]
    if any(ends):
        handles.append(Line2D([], [], marker="x", color=VERMILION, linestyle="", label="subgoal not reached"))
    _legend(figure, handles, columns=4, bottom=0.06)
    return figure


def drawn(obstacle: Obstacle) -> Drawn:
    """Return what the figures draw of an obstacle."""
    return (obstacle.name, obstacle.kind, obstacle.cell, obstacle.colour, obstacle.size)


def _panels(
    layout: Layout, titles: Sequence[str], *, foot: float, width: float = 3.5
) -> tuple[Figure, list[MazePanel]]:
    """Return a figure with one maze panel a title; `foot` and `width` (of a panel) are in inches."""
    cell = min(width / layout.cols, 1.5 * width / layout.rows)  # inches
    wide, high = cell * layout.cols, cell * layout.rows
    left, gap, head = 0.25, 0.3, 0.45 if any(titles) else 0.25
    size = (left + len(titles) * (wide + gap) - gap + 0.1, foot + high + head)
    figure = Figure(size)
    panels = []
    for i, title in enumerate(titles):
        x = left + i * (wide + gap)
        axes = figure.add_axes((x / size[0], foot / size[1], wide / size[0], high / size[1]))
        if title:
            axes.set_title(panel(i, title), loc="left", pad=14)
        panels.append(MazePanel(axes, layout, 72 * cell))
    return figure, panels


def _example(maze: MazePanel) -> None:
    """Frame the trigger and the goal of the layout's example run."""
    layout = maze.layout
    maze.ring(layout.triggers[layout.trigger], MARK_COLOURS["T"])
    maze.ring(layout.goals[layout.goal], MARK_COLOURS["G"])


def _steps(route: Sequence[Cell]) -> str:
    steps = len(route) - 1
    return f"{steps} step" if steps == 1 else f"{steps} steps"


def _legend(figure: Figure, handles: Iterable[Artist], *, columns: int, bottom: float) -> None:
    at = (0.5, bottom / figure.get_figheight())
    figure.legend(
        handles=list(handles),
        loc="lower center",
        bbox_to_anchor=at,
        ncols=columns,
        borderaxespad=0,
        borderpad=0,
        columnspacing=1.4,
        handletextpad=0.5,
        labelcolor=INK,
    )


def _line(colour: str, linestyle: Literal["-", ":"], label: str) -> Line2D:
    return Line2D([], [], color=colour, linestyle=linestyle, linewidth=2.2, label=label)


def _square_mark(colour: str, label: str) -> Line2D:
    look: Look = {"markersize": 8, "markerfacecolor": "none", "markeredgewidth": 1.6}
    return Line2D([], [], marker="s", color=colour, linestyle="", label=label, **look)


def _solid_mark(marker: str, colour: str, label: str) -> Line2D:
    return Line2D([], [], marker=marker, color=colour, linestyle="", markersize=8, label=label)
