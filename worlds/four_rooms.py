"""The four rooms of Sutton, Precup and Singh (1999, section 2, figure 2), and of the option-critic after.

Two things are published under this name. In the article a move fails in one of three cases and goes in one
of the other three directions. In the code of the option-critic (Bacon, Harb and Precup, 2017), whose comment
repeats these words, a move never fails; where no wall stopped it, in one of three cases a second one follows
it, to any free cell beside. The rules "sutton" and "bacon" are these; docs/four-rooms.md tells them apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from worlds.errors import UserError, suggest
from worlds.layout import ACTIONS, DELTAS, Cell
from worlds.model import TransitionModel
from worlds.variables import StateIndex, Variable

Rules = Literal["bacon", "sutton"]

_PLAN: Final = """\
#############
#     #     #
#     #     #
#           #
#     #     #
#     #     #
## ####     #
#     ### ###
#     #     #
#     #     #
#           #
#     #     #
#############"""

CELLS: Final = tuple(
    Cell(row, col)
    for row, line in enumerate(_PLAN.splitlines())
    for col, mark in enumerate(line)
    if mark == " "
)
"""The 104 free cells, row by row; rows and columns count from 0 at the outer wall."""
HALLWAYS: Final[Mapping[str, Cell]] = MappingProxyType(
    {"north": Cell(3, 6), "west": Cell(6, 2), "east": Cell(7, 9), "south": Cell(10, 6)}
)
"""The cells that join two rooms, by the side of the house on which they lie."""
DOORS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {"NW": ("north", "west"), "NE": ("north", "east"), "SW": ("west", "south"), "SE": ("east", "south")}
)
"""The two hallways of each room."""


def _room(name: str) -> frozenset[Cell]:
    """Return all that is joined to the cell in a room's corner, but for the hallways."""
    inside, front = set[Cell](), [Cell(1 if name[0] == "N" else 11, 1 if name[1] == "W" else 11)]
    while front:
        cell = front.pop()
        inside.add(cell)
        beside = {_beside(cell, way) for way in range(len(ACTIONS))}
        front.extend(beside - inside - set(HALLWAYS.values()))
    return frozenset(inside)


def _beside(cell: Cell, way: int) -> Cell:
    """Return the next cell in a direction, or the cell itself at a wall."""
    rows, cols = DELTAS[way]
    to = Cell(cell.row + rows, cell.col + cols)
    return to if to in _FREE else cell


_FREE: Final = frozenset(CELLS)
ROOMS: Final[Mapping[str, frozenset[Cell]]] = MappingProxyType({name: _room(name) for name in DOORS})
"""The cells of each room."""
AREAS: Final[Mapping[str, frozenset[Cell]]] = MappingProxyType(
    {name: room.union(HALLWAYS[hall] for hall in DOORS[name]) for name, room in ROOMS.items()}
)
"""The cells of each room and its two hallways."""
FIRST_GOAL: Final = HALLWAYS["east"]
"""Where the goal is at first in the option-critic's experiment."""
LATER_GOALS: Final = tuple(cell for cell in CELLS if cell in ROOMS["SE"])
"""Where it may be after 1000 episodes: the cells of the lower right room."""


def four_rooms_variables() -> tuple[Variable, Variable]:
    """Return the state variables: robot and goal, each any free cell."""
    labels = tuple(str(cell) for cell in CELLS)
    return Variable("robot", CELLS, labels), Variable("goal", CELLS, labels)


def four_rooms_model(*, rules: Rules = "bacon", slip: float = 1 / 3) -> TransitionModel:
    """Return the exact model: 104 * 104 states; every step costs 1, and a wall stops a move.

    The published reward is 1 at the goal and 0 elsewhere, discounted; at a cost for every step a return is
    a count of steps, and the same ways are short. An episode may begin with robot and goal in any two cells.
    The goal stays where it is; to have it in one cell is to begin in some states only (`starts_for`).

    Parameters
    ----------
    rules
        "bacon": after a move that no wall stopped, another one follows with probability `slip`, to any free
        cell beside, each as likely; an episode ends where this ends, not on the way. "sutton": with
        probability `slip` a move goes in one of the other three directions instead, each as likely.
    slip
        That probability, 1/3 in both.

    Raises
    ------
    UserError
        If `slip` is not between 0 and 1, or there are no such rules.

    Examples
    --------
    >>> model = four_rooms_model()
    >>> model.outcomes.shape
    (10816, 4, 5)
    >>> state = model.index.number((Cell(5, 2), FIRST_GOAL))
    >>> for to, chance in zip(model.outcomes[state, 1], model.probabilities[state, 1]):  # South
    ...     print(model.index.state(int(to))[0], round(float(chance), 3))
    6,2 0.667
    5,2 0.167
    7,2 0.167
    5,2 0.0
    5,2 0.0
    """
    if not 0 <= slip <= 1:
        raise UserError(f"four rooms: slip is a probability, not {slip}; give 0 to 1")
    if rules not in get_args(Rules):
        raise UserError(f"four rooms: no rules {rules!r}; {suggest(str(rules), get_args(Rules))}")
    index = StateIndex(four_rooms_variables())
    follow = _bacon if rules == "bacon" else _sutton
    after, chances = _tables([[follow(cell, way, slip) for way in range(len(ACTIONS))] for cell in CELLS])
    robot, goal = index.column("robot"), index.column("goal")
    successors = after[robot] * len(CELLS) + goal[:, None, None]
    return TransitionModel(
        index,
        ACTIONS,
        successors,
        np.full(successors.shape, -1.0),
        robot != goal,
        probabilities=chances[robot],
    )


def starts_for(index: StateIndex, goal: Cell) -> NDArray[np.bool_]:
    """Return the states in which an episode may begin while the goal is in one cell, shape (states,).

    Raises
    ------
    UserError
        If the goal is no free cell.

    Examples
    --------
    >>> int(starts_for(four_rooms_model().index, FIRST_GOAL).sum())
    103
    """
    if goal not in _FREE:
        raise UserError(f"four rooms: goal {goal} is no free cell; choose one of worlds.four_rooms.CELLS")
    robot, goals = index.column("robot"), index.column("goal")
    found: NDArray[np.bool_] = (goals == index.variable("goal").position(goal)) & (robot != goals)
    return found


def _bacon(cell: Cell, way: int, slip: float) -> dict[Cell, float]:
    """Return where a move leads that another may follow, with probabilities."""
    to = _beside(cell, way)
    if to == cell:
        return {cell: 1.0}
    further = [there for there in (_beside(to, other) for other in range(len(ACTIONS))) if there != to]
    return {to: 1.0 - slip, **{there: slip / len(further) for there in further}}


def _sutton(cell: Cell, way: int, slip: float) -> dict[Cell, float]:
    """Return where a move leads that may go in another direction, with probabilities."""
    found = {_beside(cell, way): 1.0 - slip}
    for other in range(len(ACTIONS)):
        if other != way:
            to = _beside(cell, other)
            found[to] = found.get(to, 0.0) + slip / (len(ACTIONS) - 1)
    return found


def _tables(rows: list[list[dict[Cell, float]]]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return cells' numbers and their probabilities, both of shape (cells, actions, outcomes).

    What never occurs is left out; where one move has fewer outcomes than another, the cell itself at
    probability 0 fills up.
    """
    number = {cell: place for place, cell in enumerate(CELLS)}
    most = max(sum(chance > 0 for chance in found.values()) for row in rows for found in row)
    shape = (len(rows), len(rows[0]), most)
    after = np.broadcast_to(np.arange(shape[0])[:, None, None], shape).copy()
    chances = np.zeros(shape)
    for place, row in enumerate(rows):
        for way, found in enumerate(row):
            occur = {cell: chance for cell, chance in found.items() if chance > 0}
            after[place, way, : len(occur)] = [number[cell] for cell in occur]
            chances[place, way, : len(occur)] = list(occur.values())
    return after, chances
