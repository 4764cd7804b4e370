"""Which figures a study has: those that its kind of run, its factors and its curves allow."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from comparisons.study.figures.grouping import FIGURES, About, check_figures, numeric_sides
from comparisons.study.figures.plate import Plate
from comparisons.study.figures.plates import estimates_plate, improvement_plate, over_plate, parts_plate
from comparisons.study.figures.plates_curves import (
    all_optimal,
    efficiency_plate,
    learning_plate,
    profiles_plate,
    returns_plate,
)
from comparisons.study.figures.plates_kinds import (
    counterexample_plate,
    gaps_map_plate,
    reliability_plate,
    steps_map_plate,
    ways_plate,
)
from comparisons.study.results.rows import Row

Maker = Callable[[About, Sequence[Row]], Plate | None]
MAKERS: Final[Mapping[str, Maker]] = {
    "estimates": estimates_plate,
    "over": over_plate,
    "parts": parts_plate,
    "improvement": improvement_plate,
    "learning": learning_plate,
    "returns": returns_plate,
    "efficiency": efficiency_plate,
    "profiles": profiles_plate,
    "counterexample": counterexample_plate,
    "steps_map": steps_map_plate,
    "gaps_map": gaps_map_plate,
    "ways": ways_plate,
    "reliability": reliability_plate,
}
"""What draws each figure."""


def plates_of(
    about: About, rows: Sequence[Row], names: Sequence[str] | None = None
) -> tuple[list[Plate], tuple[str, ...]]:
    """Return the figures of some runs, in a report's order, and the names of those that cannot be drawn.

    Parameters
    ----------
    about
        What is known of the study.
    rows
        Its runs that have a result; at least one.
    names
        Those that the study asks for; None for all that apply, of which none is missing then.
    """
    check_figures(names)
    wanted = [name for name in FIGURES if names is None or name in names]
    if names is None and numeric_sides(about) is not None:
        wanted.remove("estimates")  # the same numbers, which are read better over their axis
    if names is None and all_optimal(rows):
        wanted.remove("returns")
    made = {name: MAKERS[name](about, rows) for name in wanted}
    missing = () if names is None else tuple(name for name, plate in made.items() if plate is None)
    return [plate for plate in made.values() if plate is not None], missing
