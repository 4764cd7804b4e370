"""A figure with what is told of it, and the words and numbers that many have in common."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan, nan
from typing import Final

from matplotlib.figure import Figure

from comparisons.study.figures.draw_estimates import Estimates
from comparisons.study.figures.grouping import About, Sides, axis_of, title_of
from comparisons.study.figures.scales import Spot
from comparisons.study.kinds import Measure
from comparisons.study.results.rows import Row, by_levels
from comparisons.study.results.samples import FEWEST_SEEDS, samples_of
from comparisons.study.results.statistics import Estimate, estimate, improvement
from comparisons.study.results.tables import Table
from comparisons.study.results.wording import NEVER, counted, plain

Number = str | int | float
Header = tuple[str, ...]
Numbers = tuple[tuple[Number, ...], ...]
_SHOWN: Final = 150  # rows of a figure's numbers on the page
_NOTHING: Final = "\N{EN DASH}"


@dataclass(frozen=True, eq=False)
class Plate:
    """A figure with what is told of it.

    Parameters
    ----------
    name
        Of its files.
    figure
        Itself.
    caption
        What it shows, in whole sentences.
    header, numbers
        Its data as a table. What is infinite was never reached; NaN is what cannot be told.
    """

    name: str
    figure: Figure
    caption: str
    header: Header
    numbers: Numbers


def numbers_table(plate: Plate) -> Table:
    """Return a figure's data for people; of much there are some rows, evenly spread: its file has all.

    Examples
    --------
    >>> numbers = (("1", 1234.5), ("0.9", float("inf")))
    >>> numbers_table(Plate("steps", Figure(), "", ("level", "steps"), numbers)).rows
    (('1', '1,234'), ('0.9', 'never'))
    """
    count = len(plate.numbers)
    few = (
        sorted({round(i * (count - 1) / (_SHOWN - 1)) for i in range(_SHOWN)})
        if count > _SHOWN
        else range(count)
    )
    rows = tuple(tuple(map(_cell, plate.numbers[i])) for i in few)
    first = plate.numbers[0] if plate.numbers else plate.header
    labels = next((i for i, value in enumerate(first) if not isinstance(value, str)), len(first))
    note = ""
    if count > _SHOWN:
        note = f"{_SHOWN} of {count:,} rows, evenly spread; all are in figures/{plate.name}.csv."
    return Table(plate.header, rows, f"The numbers of figure {plate.name}.", note, labels)


def _cell(value: Number) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return f"{value:,}"
    if isfinite(value):
        return plain(value)
    return _NOTHING if isnan(value) else NEVER


def numbers_csv(plate: Plate) -> str:
    r"""Return a figure's data as CSV; what is infinite is ``inf``, what cannot be told is left empty.

    Examples
    --------
    >>> numbers = (("1", 2.5), ("0.9", float("inf")), ("0", float("nan")))
    >>> numbers_csv(Plate("steps", Figure(), "", ("level", "steps"), numbers))
    'level,steps\n1,2.5\n0.9,inf\n0,\n'
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(plate.header)
    for row in plate.numbers:
        writer.writerow(["" if isinstance(value, float) and isnan(value) else value for value in row])
    return text.getvalue()


def spot_of(measure: Measure, runs: Sequence[Row], statistic: str) -> Spot | None:
    """Return a statistic of some runs with its interval, shares in per cent; None if they tell nothing.

    Examples
    --------
    >>> from comparisons.study.kinds import Result
    >>> steps = Measure("steps", "steps to the goal", "steps", "less")
    >>> runs = [Row({}, seed, "", Result({"steps": 9.0 + seed % 2})) for seed in range(10)]
    >>> spot_of(steps, runs, "iqm").value, spot_of(steps, runs[:1], "iqm")
    (9.5, Spot(value=9.0, low=nan, high=nan, seeds=1))
    """
    return _spot(estimate(samples_of(runs, measure), statistic), 1.0 if measure.unit else 100.0)


def chance_of(measure: Measure, runs: Sequence[Row], others: Sequence[Row]) -> Spot | None:
    """Return how probable it is that a run is better than another one, in per cent; None if none tells."""
    return _spot(improvement(samples_of(runs, measure), samples_of(others, measure)), 100.0)


def _spot(found: Estimate | None, times: float) -> Spot | None:
    if found is None:
        return None
    if not found.bounded:
        return Spot(times * found.value, nan, nan, found.seeds)
    return Spot(times * found.value, times * found.low, times * found.high, found.seeds)


def estimates_of(
    measure: Measure, found: Mapping[str, Mapping[str, Sequence[Row]]], statistic: str
) -> Estimates:
    """Return a measure's estimates by colour and row; combinations that tell nothing are left out."""
    spots = {
        colour: {
            level: spot
            for level, runs in by_level.items()
            if (spot := spot_of(measure, runs, statistic)) is not None
        }
        for colour, by_level in found.items()
    }
    spots = {colour: by_level for colour, by_level in spots.items() if by_level}
    return Estimates(axis_of(measure), spots, not measure.unit, title_of(measure))


def told(about: About, sides: Sides, panels: Sequence[Estimates]) -> tuple[Header, Numbers]:
    """Return estimates as a table's header and rows."""
    rows = [
        (each.title, each.label, colour, level, *spot)
        for each in panels
        for colour, by_level in each.spots.items()
        for level, spot in by_level.items()
    ]
    statistic = about.statistic.upper() if about.statistic == "iqm" else about.statistic
    sides_named = (", ".join(sides.colours) or "line", ", ".join(sides.rows) or "runs")
    header = ("panel", "measure", *sides_named, statistic, "95 % from", "to", "seeds")
    return without_blanks(header, rows)


def without_blanks(header: Header, rows: Sequence[tuple[Number, ...]]) -> tuple[Header, Numbers]:
    """Leave out columns of text that say nothing, or the same as the column after.

    Examples
    --------
    >>> without_blanks(("panel", "line", "steps", "from"), [("", "a", 3.0, 3.0), ("", "b", 4.0, 4.0)])
    (('line', 'steps', 'from'), (('a', 3.0, 3.0), ('b', 4.0, 4.0)))
    """
    kept = [
        i
        for i in range(len(header))
        if any(not isinstance(row[i], str) for row in rows)
        or not all(row[i] in ("", *row[i + 1 : i + 2]) for row in rows)
    ]
    return tuple(header[i] for i in kept), tuple(tuple(row[i] for i in kept) for row in rows)


def seeds_of(rows: Sequence[Row], about: About) -> str:
    """Return how many runs each combination has, such as "20 seeds"."""
    counts = {len(runs) for runs in by_levels(rows, list(about.factors)).values()}
    low, high = min(counts), max(counts)
    return counted(high, "seed") if low == high else f"{low} to {counted(high, 'seed')}"


def few_words(spots: Iterable[Spot]) -> str:
    """Return the sentences that a caption needs where marks rest on few seeds.

    Examples
    --------
    >>> few_words([Spot(1, nan, nan, 1), Spot(2, 1, 3, 20)])
    ' Small marks rest on fewer than 5 seeds; one seed has no interval.'
    >>> few_words([Spot(2, 1, 3, 20)])
    ''
    """
    few = {spot.seeds for spot in spots if spot.few}
    one = "; one seed has no interval" * (1 in few)
    return f" Small marks rest on fewer than {FEWEST_SEEDS} seeds{one}." if few else ""


def abouts(measures: Sequence[Measure]) -> str:
    """Return what measures are, as part of a sentence."""
    return "; ".join(f"{title_of(measure)}: {measure.about}" for measure in measures)


def capital(words: str) -> str:
    """Return words that begin a sentence.

    >>> capital("interquartile mean")
    'Interquartile mean'
    """
    return words[:1].upper() + words[1:]
