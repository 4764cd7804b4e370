"""The steps from each cell of a maze that a learnt policy takes, and what it loses there."""

from __future__ import annotations

from typing import Any

import numpy as np

from hierarchy import GroundGraph
from planners import flat_optimum
from planners.option_critic.greedy import GreedyPolicy
from worlds import Cell, Layout
from worlds.layout_writing import layout_text


def heat_map(layout: Layout, grounded: GroundGraph, policy: GreedyPolicy | None) -> dict[str, Any]:
    """Return steps and what they exceed the fewest by, from each cell, for the layout's own example.

    Parameters
    ----------
    layout
        The maze.
    grounded
        A ground graph on the maze's own model.
    policy
        What is shown; None for the optimum.

    Returns
    -------
    dict
        Plain data under ``heat``: ``cells``, and for each of them ``steps`` and ``gaps``, None where the
        policy does not come to the end; the ``layout`` as text with the names of its ``trigger`` and
        ``goal``; and the policy's ``way``. It is empty if no episode begins with that trigger and goal.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> heat = heat_map(maze, ground(two_rooms(maze), maze_model(maze)), None)["heat"]
    >>> heat["trigger"], heat["goal"], heat["cells"][4], heat["steps"][4], heat["gaps"][4]
    ('T4', 'G2', '1,0', 15.0, 0.0)
    """
    index, model = grounded.model.index, grounded.model
    trigger, goal = layout.triggers[layout.trigger], layout.goals[layout.goal]
    at = {cell: index.number((cell, trigger, goal, "closed")) for cell in _cells(layout, grounded)}
    if not at:
        return {}
    states = np.array(list(at.values()), dtype=np.int64)
    best = flat_optimum(model, grounded.nodes[grounded.root].terminal).value[states]
    returns = best if policy is None else policy.returns(states)
    return {
        "heat": {
            "layout": layout_text(layout),
            "trigger": layout.trigger,
            "goal": layout.goal,
            "cells": [str(cell) for cell in at],
            "steps": [float(-value) if np.isfinite(value) else None for value in returns],
            "gaps": [float(gap) if np.isfinite(gap) else None for gap in best - returns],
            "way": _way(layout, grounded, policy),
        }
    }


def _way(layout: Layout, grounded: GroundGraph, policy: GreedyPolicy | None) -> list[str]:
    """Return the cells that the policy passes in the layout's own example; none if it does not arrive."""
    index, column = grounded.model.index, grounded.model.index.names.index("robot")
    trigger, goal = layout.triggers[layout.trigger], layout.goals[layout.goal]
    if policy is None or not grounded.model.is_deterministic:
        return []
    route = policy.route(index.number((layout.start, trigger, goal, "closed")))
    if not route:
        return []
    state, _, action = route[-1]
    states = [*(step[0] for step in route), int(grounded.model.successors[state, action])]
    return [str(index.state(state)[column]) for state in states]


def _cells(layout: Layout, grounded: GroundGraph) -> list[Cell]:
    """Return the cells that an episode may begin in with the layout's own trigger and goal."""
    trigger, goal = layout.triggers[layout.trigger], layout.goals[layout.goal]
    index = grounded.model.index
    begins = grounded.model.starts & ~grounded.nodes[grounded.root].terminal
    cells = (cell for cell in layout.cells if cell not in layout.solid)
    return [cell for cell in cells if begins[index.number((cell, trigger, goal, "closed"))]]
