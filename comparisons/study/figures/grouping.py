"""How a study's runs stand in a figure: which factor makes its rows, its colours and its panels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, prod
from typing import Final, Literal

from comparisons.study.kinds import Kind, Measure
from comparisons.study.results.rows import Row
from worlds import UserError, suggest

MOST_COLOURS: Final = 6
"""More are not told apart at a glance."""
MOST_PANELS: Final = 12
NUMERIC_LEVELS: Final = 4
"""A factor with so many numbers for levels is an abscissa; fewer are read better as rows."""
_LITTLE: Final = ("true", "false", "yes", "no", "on", "off", "none", "all", "declared", "full")
_STATISTICS: Final = {"iqm": "interquartile mean", "median": "median", "mean": "mean"}


FIGURES: Final = (
    "estimates",
    "over",
    "parts",
    "improvement",
    "learning",
    "returns",
    "efficiency",
    "profiles",
    "counterexample",
    "steps_map",
    "gaps_map",
    "ways",
    "reliability",
)
"""Names of all figures, in a report's order."""


def check_figures(names: Sequence[str] | None) -> None:
    """Refuse names that no figure has.

    Raises
    ------
    UserError
        If there is such a name.

    Examples
    --------
    >>> check_figures(["learnt"])
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: figures: there is no figure 'learnt'; did you mean 'learning'?
    """
    for name in names or ():
        if name not in FIGURES:
            raise UserError(f"figures: there is no figure {name!r}; {suggest(name, FIGURES)}")


@dataclass(frozen=True)
class About:
    """What figures need to know of a study besides its runs.

    Parameters
    ----------
    kind
        Its runs' kind.
    factors
        Labels of the levels by factor, both in the file's order.
    measure
        What the study's answer is about; the kind's first measure where it has none.
    compare
        The factor that it compares; the first one where it compares none, None without factors.
    against
        The level that others are held against, or None.
    statistic
        What sums up the runs of a combination.
    """

    kind: Kind
    factors: Mapping[str, Sequence[str]]
    measure: Measure
    compare: str | None = None
    against: str | None = None
    statistic: Literal["iqm", "median", "mean"] = "iqm"

    @property
    def others(self) -> tuple[str, ...]:
        """The factors besides the one that is compared, those with one level left out."""
        return tuple(
            name for name, labels in self.factors.items() if name != self.compare and len(labels) > 1
        )

    @property
    def statistic_in_words(self) -> str:
        """The statistic, as part of a sentence."""
        return _STATISTICS[self.statistic]

    def combinations(self, factors: Sequence[str]) -> int:
        """Return how many combinations of levels some factors have."""
        return prod(len(self.factors[name]) for name in factors)


@dataclass(frozen=True)
class Sides:
    """Which factors make what of a figure."""

    rows: tuple[str, ...] = ()
    colours: tuple[str, ...] = ()
    panels: tuple[str, ...] = ()


def estimate_sides(about: About) -> Sides:
    """Return the sides of a figure of estimates: what is compared in rows, the rest in colours if it fits."""
    compare = () if about.compare is None else (about.compare,)
    if about.combinations(about.others) <= MOST_COLOURS:
        return Sides(compare, about.others)
    if compare and len(about.factors[compare[0]]) <= MOST_COLOURS:
        return Sides(about.others, compare)
    return Sides((*compare, *about.others))


def numeric_sides(about: About) -> Sides | None:
    """Return the sides of a figure over a numeric factor, or None if there is no such factor, or no room.

    The abscissa is the numeric factor with the most levels.
    """
    found = [name for name, labels in about.factors.items() if is_numeric(labels)]
    if not found:
        return None
    abscissa = max(found, key=lambda name: len(about.factors[name]))
    left = [name for name, labels in about.factors.items() if name != abscissa and len(labels) > 1]
    if about.combinations(left) <= MOST_COLOURS and (len(left) < 2 or about.compare not in left):
        return Sides((abscissa,), tuple(left))
    first = about.compare if about.compare in left else left[0]
    panels = tuple(name for name in left if name != first)
    if len(about.factors[first]) > MOST_COLOURS or about.combinations(panels) > MOST_PANELS:
        return None
    return Sides((abscissa,), (first,), panels)


def curve_sides(about: About) -> Sides | None:
    """Return the sides of a figure of curves, the compared levels as colours; None if there is no room."""
    if about.compare is None:
        return Sides()
    for colours in ((about.compare,), about.others):
        panels = tuple(name for name in (about.compare, *about.others) if name not in colours)
        if about.combinations(colours) <= MOST_COLOURS and about.combinations(panels) <= MOST_PANELS:
            return Sides((), colours, panels)
    return None


def is_numeric(labels: Sequence[str]) -> bool:
    """Return whether a factor's labels are numbers, enough of them for an abscissa.

    Examples
    --------
    >>> is_numeric(["1", "2", "3", "12"]), is_numeric(["1", "0.9"]), is_numeric(["1", "2", "3", "nan"])
    (True, False, False)
    """
    return len(labels) >= NUMERIC_LEVELS and all(_is_number(label) for label in labels)


def _is_number(label: str) -> bool:
    try:
        return isfinite(float(label))
    except ValueError:
        return False


def named(levels: Mapping[str, str], names: Sequence[str], factors: Mapping[str, Sequence[str]]) -> str:
    """Return the label of a combination of levels, in which a factor's name stands where labels need it.

    Parameters
    ----------
    levels
        One level's label by factor.
    names
        Factors to name levels of.
    factors
        Labels of all levels by factor.

    Examples
    --------
    >>> factors = {"learner": ("maxq-0", "flat-q"), "gamma": ("1", "0.9"), "door": ("a parameter", "none")}
    >>> levels = {"learner": "maxq-0", "gamma": "0.9", "door": "a parameter"}
    >>> named(levels, ["learner"], factors), named(levels, ["gamma", "door"], factors)
    ('maxq-0', 'gamma 0.9, door a parameter')
    """
    return ", ".join(
        f"{name} {levels[name]}" if any(map(_says_little, factors[name])) else levels[name] for name in names
    )


def _says_little(label: str) -> bool:
    """Return whether a label needs its factor's name beside it."""
    return _is_number(label) or label.lower() in _LITTLE


Groups = Mapping[str, Mapping[str, Mapping[str, Sequence[Row]]]]
"""Runs by panel, colour and row."""


def grouped(rows: Sequence[Row], about: About, sides: Sides) -> Groups:
    """Return runs by panel, colour and row, each in the order of the factors' levels.

    A single factor's numbers stand alone as rows, for its name stands by the axis.
    """
    order = {name: {label: i for i, label in enumerate(labels)} for name, labels in about.factors.items()}
    names = [*sides.panels, *sides.colours, *sides.rows]
    found: dict[str, dict[str, dict[str, list[Row]]]] = {}
    for row in sorted(rows, key=lambda row: [order[name][row.levels[name]] for name in names]):
        panel, colour = (named(row.levels, each, about.factors) for each in (sides.panels, sides.colours))
        level = (
            row.levels[sides.rows[0]]
            if len(sides.rows) == 1
            else named(row.levels, sides.rows, about.factors)
        )
        found.setdefault(panel, {}).setdefault(colour, {}).setdefault(level, []).append(row)
    return found


def title_of(measure: Measure) -> str:
    """Return a measure's name as words.

    Examples
    --------
    >>> title_of(Measure("steps_to_optimal", "...")), title_of(Measure("optimal.GotoDoor", "..."))
    ('steps to optimal', 'optimal, GotoDoor')
    """
    whole, _, part = measure.name.partition(".")
    return whole.replace("_", " ") + (f", {part}" if part else "")


def axis_of(measure: Measure) -> str:
    """Return the label of a measure's axis.

    Examples
    --------
    >>> axis_of(Measure("share_optimal", "...")), axis_of(Measure("steps_to_optimal", "...", "steps"))
    ('share optimal, %', 'steps to optimal')
    """
    title = title_of(measure)
    if not measure.unit:
        return f"{title}, %"
    return title if measure.unit in title else f"{title}, {measure.unit}"


def value_of(row: Row, name: str) -> float | None:
    """Return a run's measure; None also if it has not got it."""
    return row.result.measures.get(name)


def shown_measures(about: About, rows: Sequence[Row], most: int = 4) -> list[Measure]:
    """Return the measures to show: the answer's first, then the kind's, in its order.

    Those that are the same for all runs, or the same run by run as one that is shown, are left out.
    """
    found = {tuple(value_of(row, about.measure.name) for row in rows): about.measure}
    for measure in about.kind.measures:
        values = tuple(value_of(row, measure.name) for row in rows)
        if len(set(values) - {None}) > 1:
            found.setdefault(values, measure)
    return list(found.values())[:most]


def parts_of(measure: Measure, rows: Sequence[Row]) -> list[str]:
    """Return the names of a measure's parts, such as ``optimal.GotoDoor``, as the runs name them."""
    names = (name for row in rows for name in row.result.measures)
    return [name for name in dict.fromkeys(names) if name.startswith(f"{measure.name}.")]
