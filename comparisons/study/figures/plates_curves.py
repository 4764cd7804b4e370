"""Figures of learning curves and of the share of runs that came so far, each with caption and numbers."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite
from typing import Final

import numpy as np
from numpy.typing import NDArray

from comparisons.study.figures.curves import iqm_bands, step_aligned
from comparisons.study.figures.draw_curves import Curve, Curves, convergence_figure, profiles_figure
from comparisons.study.figures.grouping import About, Sides, axis_of, curve_sides, grouped
from comparisons.study.figures.plate import Number, Plate, capital, seeds_of, without_blanks
from comparisons.study.figures.scales import WIDE_RANGE
from comparisons.study.kinds import Measure
from comparisons.study.results.rows import Row, by_levels
from comparisons.study.results.samples import samples_of
from comparisons.study.results.statistics import Profile, profile

_LEARNING: Final = "learning"
_SHARE: Final = "share_optimal"


def is_effort(measure: Measure) -> bool:
    """Return whether a measure says how much a run took to come somewhere.

    Examples
    --------
    >>> is_effort(Measure("steps_to_optimal", "steps until every start is optimal", "steps", "less"))
    True
    >>> is_effort(Measure("cost_per_episode", "steps that mistakes cost an episode", "steps", "less"))
    False
    """
    return measure.better == "less" and bool(measure.unit) and measure.name.startswith(f"{measure.unit}_to_")


def learning_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return the share of optimal starts while learning, with bands; None if no run keeps one that moves."""
    return _learning_plate(_LEARNING, about, rows, _SHARE)


def returns_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return the mean return while learning, with bands; None if the runs keep no such curve.

    A run tells none while an episode may never end.
    """
    return _learning_plate("returns", about, rows, "mean_return")


def all_optimal(rows: Sequence[Row]) -> bool:
    """Return whether every run's curve ends with every start optimal: its returns then tell nothing more."""
    return all(row.result.curves.get(_LEARNING, {}).get(_SHARE, [None])[-1:] == [1.0] for row in rows)


def _learning_plate(name: str, about: About, rows: Sequence[Row], column: str) -> Plate | None:
    sides = curve_sides(about)
    curves_of = {row.hash: row.result.curves.get(_LEARNING, {}) for row in rows}
    rows = [row for row in rows if any(y is not None for y in curves_of[row.hash].get(column, ()))]
    if not rows or sides is None:
        return None
    abscissa = next(iter(curves_of[rows[0].hash]))
    share = column == _SHARE
    axis = column.replace("_", " ") + ", %" * share
    panels, numbers = [], list[tuple[Number, ...]]()
    alike = about.compare in sides.panels  # what is compared stands on the same axes
    for title, by_colour in grouped(rows, about, sides).items():
        shown = [row for by_row in by_colour.values() for part in by_row.values() for row in part]
        end = max(
            x for row in (rows if alike else shown) for x in curves_of[row.hash][abscissa] if x is not None
        )
        curves = {}
        for label, by_row in by_colour.items():
            runs = [row for part in by_row.values() for row in part]
            curve = _band([_points(row, abscissa, column) for row in runs], share, end)
            curves[label] = curve
            drawn = np.isfinite(curve.value)
            points = np.stack([curve.x, curve.value, curve.low, curve.high])[:, drawn].T.tolist()
            numbers += [(title, label, *point, len(runs)) for point in points]
        panels.append(Curves(title, axis, curves, share))
    if len({point[3] for point in numbers}) < 2:
        return None  # all that would be seen is one line from end to end
    caption = (
        f"{capital(column.replace('_', ' '))} while learning: interquartile mean over "
        f"{seeds_of(rows, about)} (line) and its 95 % bootstrap band, whole runs resampled. A run that "
        "ended keeps its last value"
    )
    begins = "; a line begins where the middle half of its runs end from every start"
    silent = any(None in curves_of[row.hash][column] for row in rows)
    caption += f"{begins * silent}."
    caption += " Each panel has axes of its own." * (len(panels) > 1 and not alike)
    header = ("panel", "line", abscissa, axis, "95 % from", "to", "seeds")
    figure = convergence_figure(panels, {"steps": "environment steps"}.get(abscissa, abscissa), alike=alike)
    return Plate(name, figure, caption, *without_blanks(header, numbers))


def _points(row: Row, abscissa: str, column: str) -> tuple[list[float], list[float]]:
    """Return a run's curve, the worst where it does not tell."""
    table = row.result.curves[_LEARNING]
    pairs = zip(table[abscissa], table[column], strict=True)
    points = [(x, -inf if y is None else y) for x, y in pairs if x is not None]
    return [x for x, _ in points], [y for _, y in points]


def _band(runs: Sequence[tuple[list[float], list[float]]], share: bool, end: float) -> Curve:
    """Return the interquartile mean of some runs' curves, and its band; shares in per cent."""
    places, values = step_aligned(runs, end)
    return Curve(places, *(iqm_bands(values) * (100.0 if share else 1.0)))


def efficiency_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return the share of runs that came so far within some effort: sample efficiency.

    The effort is the answer's measure if it is one, or else the kind's first.
    """
    for measure in (about.measure, *about.kind.measures):
        if is_effort(measure):
            return _profile_plate("efficiency", about, rows, measure)
    return None


def profiles_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return the share of runs at least so good by the answer's measure, unless that is an effort."""
    if about.measure.better is None or is_effort(about.measure):
        return None
    return _profile_plate("profiles", about, rows, about.measure)


def _profile_plate(name: str, about: About, rows: Sequence[Row], measure: Measure) -> Plate | None:
    sides = curve_sides(about)
    everything = _values(rows, measure)
    finite = everything[np.isfinite(everything)]
    if sides is None or not _vary(rows, about, measure):
        return None
    low, high = float(finite.min()), float(finite.max())
    log = measure.better == "less" and low > 0 and high > WIDE_RANGE * low
    room = 0.04 * ((high - low) or abs(high) or 1.0)
    ends = (low / 1.2, high * 1.1) if log else (low - room, high + room)
    panels, numbers = _profile_panels(about, rows, sides, measure, ends)
    less = measure.better == "less"
    what = f"with at most so many {measure.unit}" if less else "with at least so much"
    caption = (
        f"Share of runs {what}: {measure.about}. Band, where some are and some are not: Wilson's 95 % "
        f"interval; {seeds_of(rows, about)}."
    )
    if less and len(finite) < len(everything):
        caption += " Runs that never came there never count, so that a line need not reach 100 %."
    axis = axis_of(measure)
    header = ("panel", "line", axis, "share of runs, %", "95 % from", "to", "seeds")
    figure = profiles_figure(panels, axis, less=less, log=log)
    return Plate(name, figure, caption, *without_blanks(header, numbers))


def _profile_panels(
    about: About, rows: Sequence[Row], sides: Sides, measure: Measure, ends: tuple[float, float]
) -> tuple[list[Curves], list[tuple[Number, ...]]]:
    panels, numbers = [], list[tuple[Number, ...]]()
    times = 1.0 if measure.unit else 100.0
    for title, by_colour in grouped(rows, about, sides).items():
        curves = {}
        for label, by_row in by_colour.items():
            samples = samples_of([row for part in by_row.values() for row in part], measure)
            if not samples.runs:
                continue
            own = profile(samples, [*{v for v in samples.values.tolist() if abs(v) < inf}, *ends])
            curves[label] = _steps(own, times)
            points = list(zip(*(getattr(curves[label], part) for part in _PARTS), strict=True))
            numbers += [(title, label, *map(float, point), samples.runs) for point in points[1:-1]]
        if curves:
            panels.append(Curves(title, "share of runs, %", curves, True))
    return panels, numbers


_PARTS: Final = ("x", "value", "low", "high")


def _steps(found: Profile, times: float) -> Curve:
    return Curve(times * found.thresholds, 100 * found.shares, 100 * found.low, 100 * found.high)


def _vary(rows: Sequence[Row], about: About, measure: Measure) -> bool:
    """Return whether runs of any combination differ: else its share jumps once, and estimates say as much."""
    combinations = by_levels(rows, list(about.factors)).values()
    found = [set(_values(runs, measure).tolist()) for runs in combinations]
    return any(len(values) > 1 for values in found) and any(map(isfinite, set().union(*found)))


def _values(rows: Sequence[Row], measure: Measure) -> NDArray[np.float64]:
    """Return a measure's numbers of all runs, whatever their levels."""
    return np.concatenate([samples_of([row], measure).values for row in rows])
