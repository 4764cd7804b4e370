"""Exact transition models of finite, deterministic worlds."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from worlds.layout import ACTIONS, Layout
from worlds.maze import MazeState, step
from worlds.variables import StateIndex, Variable


@dataclass(frozen=True, eq=False)
class TransitionModel:
    """What every action does in every state of a deterministic world.

    Parameters
    ----------
    index
        Numbers the states.
    actions
        Names of the primitive actions, in the order that breaks ties.
    successors
        Number of the next state, shape (states, actions).
    rewards
        Reward of each action in each state, shape (states, actions).
    starts
        The states in which an episode may begin, shape (states,), bool.
    """

    index: StateIndex
    actions: tuple[str, ...]
    successors: NDArray[np.int64]
    rewards: NDArray[np.float64]
    starts: NDArray[np.bool_]

    def __post_init__(self) -> None:
        shape = (self.index.size, len(self.actions))
        if self.successors.shape != shape or self.rewards.shape != shape:
            raise ValueError(f"successors and rewards need shape (states, actions) = {shape}")
        if self.starts.shape != shape[:1]:
            raise ValueError(f"starts needs shape (states,) = {shape[:1]}")
        if self.successors.min() < 0 or self.successors.max() >= self.index.size:
            raise ValueError(f"successors must be state numbers, 0 to {self.index.size - 1}")

    def reachable(self, starts: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
        """Return the states that some action sequence reaches from `starts`, shape (states,)."""
        reach = np.array(self.starts if starts is None else starts)
        frontier = np.flatnonzero(reach)
        while frontier.size:
            new = np.unique(self.successors[frontier])
            frontier = new[~reach[new]]
            reach[frontier] = True
        return reach


def maze_variables(layout: Layout) -> tuple[Variable, Variable, Variable, Variable]:
    """Return a maze's state variables without obstacles: robot, trigger, goal, doors.

    Examples
    --------
    >>> from worlds import load_layout
    >>> [(v.name, len(v)) for v in maze_variables(load_layout("two_rooms"))]
    [('robot', 64), ('trigger', 4), ('goal', 4), ('doors', 2)]
    """
    free = tuple(cell for cell in layout.cells if cell not in layout.solid)
    return (
        Variable("robot", free, tuple(str(cell) for cell in free)),
        Variable("trigger", tuple(layout.triggers.values()), tuple(layout.triggers)),
        Variable("goal", tuple(layout.goals.values()), tuple(layout.goals)),
        Variable("doors", ("closed", "open")),
    )


def maze_model(layout: Layout) -> TransitionModel:
    """Return the exact model of a maze without obstacles; every action costs 1 (section 4).

    An episode may begin anywhere in the start's room except on its trigger, doors closed.
    """
    index = StateIndex(maze_variables(layout))
    successors = np.empty((index.size, len(ACTIONS)), dtype=np.int64)
    starts = np.zeros(index.size, dtype=np.bool_)
    room = layout.room(layout.start)
    free = (cell for cell in layout.cells if cell not in layout.solid)
    places = product(free, layout.triggers.values(), layout.goals.values())
    cells = {cell: layout.number(cell) for cell in layout.cells}
    for (robot, trigger, goal), doors_open in product(places, (False, True)):
        state = MazeState(cells[robot], cells[trigger], cells[goal], doors_open)
        number = state_number(layout, index, state)
        starts[number] = not doors_open and robot in room and robot != trigger
        for action in range(len(ACTIONS)):
            after, _ = step(layout, state, action)
            successors[number, action] = state_number(layout, index, after)
    return TransitionModel(index, ACTIONS, successors, np.full(successors.shape, -1.0), starts)


def state_number(layout: Layout, index: StateIndex, state: MazeState) -> int:
    """Return the number of a maze's state, its obstacles left out."""
    return index.number(
        (
            layout.cells[state.robot],
            layout.cells[state.trigger],
            layout.cells[state.goal],
            "open" if state.doors_open else "closed",
        )
    )
