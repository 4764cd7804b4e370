"""The figure of a counter-example: a situation in which a strategy's action is not optimal, and what is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from comparisons.figures import counterexample_figure
from worlds import ACTIONS, Cell, Layout, MazeState, UserError, parse_layout, step

NAMES = {"local-rule": "the paper's local rule", "value-sweep": "value sweep", "replanning": "replanning"}
"""What figures call the strategies of runs of kind "episodes"."""


def draw(details: Mapping[str, Any]) -> Figure:
    r"""Draw the smallest counter-example of a run of kind "episodes".

    On the left the strategy's action and the best that is left after it, on the right a shortest way.

    Parameters
    ----------
    details
        A run's details, or their part ``counterexample``.

    Raises
    ------
    UserError
        If the run found no counter-example.

    Examples
    --------
    >>> from worlds import load_layout
    >>> from worlds.layout_writing import layout_text
    >>> found = {
    ...     "strategy": "local-rule", "layout": layout_text(load_layout("two_rooms")),
    ...     "robot": [3, 1], "trigger": [6, 1], "goal": [3, 7], "doors_open": False, "cubes": [[4, 1]],
    ...     "spheres": [], "task": "GotoTrigger(T4)", "target": [6, 1],
    ...     "action": "North", "optimal": ["West", "East"], "cost": 2,
    ...     "way": ["North", "West", "South", "South", "South", "South", "East"],
    ...     "best": ["West", "South", "South", "South", "East"],
    ... }
    >>> print(*(axes.get_xlabel() for axes in draw(found).axes), sep="\n")
    GotoTrigger(T4): North costs 2 steps more
    5 steps, West or East first; none fewer, by its certificate
    """
    found = details.get("counterexample", details) or {}
    if "layout" not in found:
        raise UserError(
            "there is no counter-example to draw; take a run whose affordances are not all optimal"
        )
    layout = parse_layout(str(found["layout"]), source="counter-example")
    belief = _belief(layout, found)
    way = _passed(layout, belief, found["way"])
    said = f"{found['task']}: {found['action']}{' is blocked, and' if way[0] == way[1] else ''}"
    return counterexample_figure(
        layout,
        belief,
        [Cell(*found["target"])],
        way,
        _passed(layout, belief, found["best"]),
        texts=(f"{said} {_cost(found['cost'])}", _optimum(found)),
        name=NAMES[str(found.get("strategy", "local-rule"))],
    )


def _belief(layout: Layout, found: Mapping[str, Any]) -> MazeState:
    """Return what the robot knew."""
    robot, trigger, goal = (layout.number(Cell(*found[name])) for name in ("robot", "trigger", "goal"))
    cubes, spheres = (
        frozenset(layout.number(Cell(*cell)) for cell in found[name]) for name in ("cubes", "spheres")
    )
    return MazeState(robot, trigger, goal, bool(found["doors_open"]), cubes, spheres)


def _passed(layout: Layout, belief: MazeState, actions: Sequence[str]) -> list[Cell]:
    """Return the cells that the robot passes, by the maze's own dynamics."""
    state, cells = belief, [layout.cells[belief.robot]]
    for action in actions:
        state, _ = step(layout, state, ACTIONS.index(action))
        cells.append(layout.cells[state.robot])
    return cells


def _cost(steps: int | None) -> str:
    if steps is None:
        return "leaves no way"
    return f"costs {steps} step{'' if steps == 1 else 's'} more"


def _optimum(found: Mapping[str, Any]) -> str:
    count, first = len(found["best"]), " or ".join(found["optimal"])
    return f"{count} step{'' if count == 1 else 's'}, {first} first; none fewer, by its certificate"
