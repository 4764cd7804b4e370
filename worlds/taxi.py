"""Dietterich's Taxi (2000, section 3.1), with the rain and the fickle passenger of section 7.1."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from types import MappingProxyType
from typing import Any, Final, Literal

from worlds.errors import UserError
from worlds.finite import State, finite_world
from worlds.layout import Cell
from worlds.model import TransitionModel
from worlds.variables import Variable

TAXI_ACTIONS: Final = ("North", "South", "East", "West", "Pickup", "Putdown")
SITES: Final[Mapping[str, Cell]] = MappingProxyType(
    {"R": Cell(0, 0), "G": Cell(0, 4), "Y": Cell(4, 0), "B": Cell(4, 3)}
)
ABOARD: Final = "aboard"
"""Where the passenger is while in the taxi."""
DELIVERED: Final = "delivered"
"""Where the passenger is once the episode is over."""
DELTAS: Final = {"North": (-1, 0), "South": (1, 0), "East": (0, 1), "West": (0, -1)}
SIDES: Final = {
    "North": ("West", "East"),
    "South": ("East", "West"),
    "East": ("North", "South"),
    "West": ("South", "North"),
}
"""To the left and to the right of each direction."""
SIZE: Final = 5
WALLS: Final = frozenset({(0, 1), (1, 1), (3, 0), (4, 0), (3, 2), (4, 2)})
"""Cells with a wall on their east side."""

Rules = Literal["dietterich", "gymnasium"]


def taxi_variables(*, fickle: bool = False) -> tuple[Variable, ...]:
    """Return the variables taxi, passenger, destination; and `mind` if the passenger is fickle.

    >>> [(variable.name, len(variable)) for variable in taxi_variables()]
    [('taxi', 25), ('passenger', 6), ('destination', 4)]
    """
    cells = tuple(Cell(row, col) for row, col in product(range(SIZE), range(SIZE)))
    sites, names = tuple(SITES.values()), tuple(SITES)
    mind = (Variable("mind", ("open", "settled")),) if fickle else ()
    return (
        Variable("taxi", cells, tuple(str(cell) for cell in cells)),
        Variable("passenger", (*sites, ABOARD, DELIVERED), (*names, ABOARD, DELIVERED)),
        Variable("destination", sites, names),
        *mind,
    )


def taxi_model(*, rules: Rules = "dietterich", rain: float = 0.0, fickle: float = 0.0) -> TransitionModel:
    """Return the exact model of Taxi: 500 states in which the passenger waits or rides, and 100 after.

    A step costs 1, an illegal Pickup or Putdown 10; a delivery is worth 20 and ends the episode. A state
    in which the passenger is delivered keeps to itself, at the same costs as ever.

    Parameters
    ----------
    rules
        "dietterich": Putdown is illegal anywhere but at the destination, and a passenger may wait at the
        destination (he must be driven nevertheless). "gymnasium": Putdown at another site leaves the
        passenger there at the cost of a step, and no episode begins with the passenger at the destination.
    rain
        Probability that a move, where no wall stops it, slips to one side or the other, half each: 0.2 in
        section 7.1. A move that a wall stops does not slip, and one that slips against a wall stays.
    fickle
        Probability that the passenger chooses another destination as the taxi first moves with him aboard:
        0.3 in section 7.1. For this to be Markov the state needs the variable `mind`, open or settled.

    Raises
    ------
    UserError
        If a probability is not between 0 and 1, or there are no such rules.

    Examples
    --------
    >>> model = taxi_model()
    >>> state = model.index.number((Cell(4, 3), "aboard", SITES["B"]))
    >>> model.successors.shape, dict(zip(model.actions, model.rewards[state].tolist()))["Putdown"]
    ((600, 6), 20.0)
    >>> taxi_model(rain=0.2, fickle=0.3).outcomes.shape
    (1200, 6, 12)
    """
    for name, value in (("rain", rain), ("fickle", fickle)):
        if not 0 <= value <= 1:
            raise UserError(f"taxi: {name} is a probability, not {value}; give 0 to 1")
    if rules not in ("dietterich", "gymnasium"):
        raise UserError(f"taxi: no rules {rules!r}; there are 'dietterich' and 'gymnasium'")

    def outcomes(state: State, action: str) -> list[tuple[float, Any, float]]:
        if state.passenger == DELIVERED:
            return [(1.0, state, -1.0 if action in DELTAS else -10.0)]
        if action in DELTAS:
            return [
                (chance * share, after, -1.0)
                for chance, cell in _slips(state.taxi, action, rain)
                for share, after in changes_of_mind(state, state._replace(taxi=cell), fickle)
            ]
        changed, reward = (_pickup if action == "Pickup" else _putdown)(state, rules)
        return [(1.0, state._replace(passenger=changed), reward)]

    def starts(state: State) -> bool:
        waits = state.passenger in SITES.values() and (not fickle or state.mind == "open")
        return waits and (rules == "dietterich" or state.passenger != state.destination)

    return finite_world(taxi_variables(fickle=fickle > 0), TAXI_ACTIONS, outcomes, starts)


def changes_of_mind(before: State, after: State, fickle: float) -> Iterator[tuple[float, State]]:
    """Yield what the passenger may do about his destination as the taxi moves, with its probability."""
    undecided = fickle and before.mind == "open" and before.passenger == ABOARD
    if not undecided or after.taxi == before.taxi:
        yield 1.0, after
        return
    settled = after._replace(mind="settled")
    yield 1.0 - fickle, settled
    others = [site for site in SITES.values() if site != before.destination]
    for site in others:
        yield fickle / len(others), settled._replace(destination=site)


def _slips(cell: Cell, action: str, rain: float) -> list[tuple[float, Cell]]:
    """Return where a move leads, with probabilities."""
    ahead = _beside(cell, action)
    if not rain or ahead == cell:
        return [(1.0, ahead)]
    return [(1.0 - rain, ahead), *((rain / 2, _beside(cell, side)) for side in SIDES[action])]


def _beside(cell: Cell, direction: str) -> Cell:
    """Return the next cell in a direction, or the cell itself at a wall."""
    rows, cols = DELTAS[direction]
    to = Cell(cell.row + rows, cell.col + cols)
    inside = 0 <= to.row < SIZE and 0 <= to.col < SIZE
    walled = cols and (cell.row, min(cell.col, to.col)) in WALLS
    return to if inside and not walled else cell


def _pickup(state: State, _: Rules) -> tuple[Any, float]:
    """Return where the passenger is after Pickup, and its reward."""
    return (ABOARD, -1.0) if state.passenger == state.taxi else (state.passenger, -10.0)


def _putdown(state: State, rules: Rules) -> tuple[Any, float]:
    """Return where the passenger is after Putdown, and its reward."""
    if state.passenger == ABOARD and state.taxi == state.destination:
        return DELIVERED, 20.0
    if state.passenger == ABOARD and state.taxi in SITES.values() and rules == "gymnasium":
        return state.taxi, -1.0
    return state.passenger, -10.0
