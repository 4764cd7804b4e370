"""Kaelbling's landmark maze: an open grid, a goal anywhere, and regions around landmarks (HDG, 1993).

The published figure's landmarks are not given in words, so that their positions are our choice.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np

from worlds.errors import UserError
from worlds.layout import ACTIONS, DELTAS, Cell
from worlds.model import TransitionModel
from worlds.variables import StateIndex, Variable

_APART: Final = 3
"""Cells between rows of landmarks, and between landmarks of a row, where we place them."""
SIDEWAYS: Final = {"North": "West East", "South": "West East", "West": "North South", "East": "North South"}


@dataclass(frozen=True)
class LandmarkMaze:
    """An open square grid with landmarks.

    Parameters
    ----------
    side
        Cells along an edge; 10 in Kaelbling's.
    landmarks
        Cells by name. Left out, they stand three apart, each second row one further east.

    Raises
    ------
    UserError
        If there is no landmark, two share a cell, or one stands outside the grid.

    Examples
    --------
    >>> maze = LandmarkMaze(side=5)
    >>> for name, cell in maze.landmarks.items():
    ...     print(name, "at", cell, "with", len(maze.regions[name]), "cells, beside", *maze.beside[name])
    L1 at 1,1 with 11 cells, beside L2 L3
    L2 at 1,4 with 7 cells, beside L1 L3
    L3 at 4,2 with 7 cells, beside L1 L2
    """

    side: int = 10
    landmarks: Mapping[str, Cell] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.landmarks:
            rows = range(1, self.side, _APART)
            spots = (
                Cell(row, col) for i, row in enumerate(rows) for col in range(1 + i % 2, self.side, _APART)
            )
            object.__setattr__(self, "landmarks", {f"L{i}": cell for i, cell in enumerate(spots, start=1)})
        at = list(self.landmarks.values())
        if not at or len(set(at)) != len(at):
            raise UserError(f"maze of side {self.side}: give it landmarks, each in a cell of its own")
        for name, cell in self.landmarks.items():
            if cell not in self.cells:
                limit = self.side - 1
                raise UserError(
                    f"landmark {name} at {cell} is outside the grid; give rows and columns 0 to {limit}"
                )

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """Every cell, row by row."""
        return tuple(Cell(row, col) for row, col in product(range(self.side), range(self.side)))

    def nearest(self, cell: Cell) -> str:
        """Return the landmark that is the fewest steps from a cell, the first among equals."""
        return min(self.landmarks, key=lambda name: _steps(cell, self.landmarks[name]))

    @cached_property
    def regions(self) -> dict[str, frozenset[Cell]]:
        """The cells that each landmark is the nearest of."""
        nearest = {cell: self.nearest(cell) for cell in self.cells}
        return {name: frozenset(c for c in self.cells if nearest[c] == name) for name in self.landmarks}

    @cached_property
    def beside(self) -> dict[str, tuple[str, ...]]:
        """The landmarks whose regions border on each landmark's."""
        return {
            name: tuple(other for other in self.landmarks if other != name and self._border(name, other))
            for name in self.landmarks
        }

    def _border(self, one: str, other: str) -> bool:
        return any(_steps(a, b) == 1 for a in self.regions[one] for b in self.regions[other])

    @cached_property
    def around(self) -> dict[str, frozenset[Cell]]:
        """The cells of each landmark's region and of those beside it."""
        regions = self.regions
        return {name: regions[name].union(*(regions[o] for o in self.beside[name])) for name in regions}


def landmark_variables(maze: LandmarkMaze) -> tuple[Variable, Variable]:
    """Return the state variables: robot and goal, each any cell."""
    labels = tuple(str(cell) for cell in maze.cells)
    return Variable("robot", maze.cells, labels), Variable("goal", maze.cells, labels)


def landmark_model(maze: LandmarkMaze, *, slip: float = 0.0) -> TransitionModel:
    """Return the exact model: side ** 4 states, every step costs 1.

    An episode may begin with the robot and the goal in any two cells.

    Parameters
    ----------
    maze
        The maze.
    slip
        Probability that a move goes sideways, half to either side. At the border the robot stays.

    Raises
    ------
    UserError
        If `slip` is not between 0 and 1.

    Examples
    --------
    >>> maze = LandmarkMaze(side=5)
    >>> landmark_model(maze).successors.shape
    (625, 4)
    >>> model = landmark_model(maze, slip=0.2)
    >>> state = model.index.number((Cell(2, 2), Cell(0, 0)))
    >>> [str(model.index.state(int(to))[0]) for to in model.outcomes[state, ACTIONS.index("North")]]
    ['1,2', '2,1', '2,3']
    """
    if not 0 <= slip <= 1:
        raise UserError(f"landmark maze: slip is a probability, not {slip}; give 0 to 1")
    index = StateIndex(landmark_variables(maze))
    cells = len(maze.cells)
    towards = [(action, *SIDEWAYS[action].split()) if slip else (action,) for action in ACTIONS]
    table = [[[_beside(maze, cell, way) for way in ways] for ways in towards] for cell in maze.cells]
    robot, goal = index.column("robot"), index.column("goal")
    successors = np.array(table, dtype=np.int64)[robot] * cells + goal[:, None, None]
    chances = np.array([1 - slip, slip / 2, slip / 2] if slip else [1.0])
    return TransitionModel(
        index,
        ACTIONS,
        successors,
        np.full(successors.shape, -1.0),
        robot != goal,
        probabilities=np.broadcast_to(chances, successors.shape).copy(),
    )


def _beside(maze: LandmarkMaze, cell: Cell, action: str) -> int:
    """Return the number of the cell that a move leads to."""
    rows, cols = DELTAS[ACTIONS.index(action)]
    row, col = cell.row + rows, cell.col + cols
    inside = 0 <= row < maze.side and 0 <= col < maze.side
    return row * maze.side + col if inside else cell.row * maze.side + cell.col


def _steps(one: Cell, other: Cell) -> int:
    return abs(one.row - other.row) + abs(one.col - other.col)
