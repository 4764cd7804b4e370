"""Figures of what runs of one kind keep besides measures: maps of a maze, a counter-example, reliability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Final, NamedTuple

import numpy as np

from comparisons.study.figures.draw_counterexample import draw as draw_counterexample
from comparisons.study.figures.draw_heat import Heat, heat_figure
from comparisons.study.figures.draw_reliability import Bins, reliability_figure
from comparisons.study.figures.draw_ways import Ways, ways_figure
from comparisons.study.figures.grouping import MOST_PANELS, About, Sides, curve_sides, grouped
from comparisons.study.figures.plate import Number, Plate, capital, seeds_of, without_blanks
from comparisons.study.results.rows import Row
from comparisons.study.results.statistics import Statistic, aggregate
from comparisons.study.runs.judging import smallest
from worlds import Cell, Layout, parse_layout

_HEAT: Final = "heat"
_RELIABILITY: Final = "reliability"


def steps_map_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return the steps that the learnt policy takes from each cell; None if the runs keep no such map."""
    what = "steps to the end of the task from each cell where it may begin"
    return _map_plate("steps_map", "steps", what, about, rows)


def gaps_map_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return the steps that the learnt policy loses from each cell; None where it loses none anywhere."""
    what = "return that the learnt policy loses from each cell where the task may begin"
    return _map_plate("gaps_map", "gaps", what, about, rows)


_SUMMED: Final[Mapping[str, Statistic]] = {"steps": "median", "gaps": "mean"}
"""What sums up the runs' maps: a few runs' losses must show, and do not in a median."""
_CROSSES: Final = {"steps": "where half of the runs or more do", "gaps": "where a run or more does"}


def ways_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return the ways that learnt policies take in the layout's own example; None if runs keep none."""
    kept = _maps(about, rows)
    if kept is None or len(kept.panels) > MOST_PANELS:
        return None
    start = str(kept.layout.start)
    told = {title: [one for one in maps if _has_way(one, start)] for title, maps in kept.panels.items()}
    panels = {
        title: Ways(title, [[_cell(cell) for cell in one["way"]] for one in maps])
        for title, maps in told.items()
        if maps
    }
    if not any(ways.arrived for ways in panels.values()):
        return None
    figure = ways_figure(kept.layout, list(panels.values()), _ring(kept))
    caption = (
        f"Ways of the learnt policies of {seeds_of(rows, about)} from the start to trigger {kept.marks[0]} "
        f"and goal {kept.marks[1]} (framed): the wider a line, the more runs go there."
    )
    numbers = [
        (title, str(here), str(there), 100 * share)
        for title, ways in panels.items()
        for (here, there), share in ways.shares().items()
    ]
    return Plate("ways", figure, caption, *without_blanks(("panel", "from", "to", "runs, %"), numbers))


def _has_way(one: Mapping[str, Any], start: str) -> bool:
    """Return whether a run's map tells its way; that of the optimum, or of a world with chance, does not."""
    steps = dict(zip(one["cells"], one["steps"], strict=True))
    return bool(one["way"]) or steps.get(start) is None


class _Maps(NamedTuple):
    """What runs keep of one maze: panel by panel the maps of all its runs."""

    layout: Layout
    marks: tuple[str, str]
    cells: tuple[str, ...]
    panels: dict[str, list[Mapping[str, Any]]]


def _maps(about: About, rows: Sequence[Row]) -> _Maps | None:
    """Return the maps of all runs; None unless all keep one of the same maze."""
    maps = [row.result.details[_HEAT] for row in rows if row.result.details.get(_HEAT)]
    places = {(m["layout"], m["trigger"], m["goal"], tuple(m["cells"])) for m in maps}
    if len(places) != 1 or len(maps) < len(rows):
        return None
    ((text, trigger, goal, cells),) = places
    sides = Sides((), (), tuple(f for f, labels in about.factors.items() if len(labels) > 1))
    panels = {
        title: [row.result.details[_HEAT] for row in found[""][""]]
        for title, found in grouped(rows, about, sides).items()
    }
    return _Maps(parse_layout(text), (trigger, goal), cells, panels)


def _map_plate(name: str, column: str, what: str, about: About, rows: Sequence[Row]) -> Plate | None:
    kept = _maps(about, rows)
    if kept is None:
        return None
    statistic = _SUMMED[column]
    panels = {title: _summed(maps, column, statistic) for title, maps in kept.panels.items()}
    alike = len({tuple(values) for values in panels.values()}) == 1
    if alike:
        panels = {"every combination": next(iter(panels.values()))} if len(panels) > 1 else panels
    if len(panels) > MOST_PANELS or (column == "gaps" and not any(any(values) for values in panels.values())):
        return None
    trigger, goal = kept.marks
    at = [_cell(cell) for cell in kept.cells]
    heats = [Heat(title, dict(zip(at, values, strict=True))) for title, values in panels.items()]
    label = {"steps": "steps", "gaps": "return lost"}[column] + f" ({statistic})"
    figure = heat_figure(kept.layout, heats, label, colours=column, ring=_ring(kept))
    caption = (
        f"{capital(statistic)} over {seeds_of(rows, about)} of the {what}, with trigger {trigger} and goal "
        f"{goal} (framed). A cross is {_CROSSES[column]} not come to the end."
    )
    numbers = [(each.title, str(cell), value) for each in heats for cell, value in each.values.items()]
    return Plate(name, figure, caption, *without_blanks(("panel", "cell", label), numbers))


def _ring(kept: _Maps) -> dict[str, Cell]:
    """Return the trigger and the goal of the maps by their names."""
    return {mark: kept.layout.marks[mark] for mark in kept.marks}


def _summed(maps: Sequence[Mapping[str, Any]], column: str, statistic: Statistic) -> list[float]:
    """Return a statistic over runs for each cell; where a run does not come to the end it is infinite."""
    values = np.array([[inf if v is None else float(v) for v in one[column]] for one in maps])
    return [float(value) for value in aggregate(values.T, statistic)]


def _cell(text: str) -> Cell:
    row, col = text.split(",")
    return Cell(int(row), int(col))


def counterexample_plate(_: About, rows: Sequence[Row]) -> Plate | None:
    """Return the smallest counter-example of all runs: fewest known obstacles, then the shortest way."""
    found = [row for row in rows if row.result.details.get("counterexample")]
    data = smallest(row.result.details["counterexample"] for row in found)
    if data is None:
        return None
    row = next(row for row in found if row.result.details["counterexample"] == data)
    where = ", ".join(f"{name} {label}" for name, label in row.levels.items())
    known = len(data["cubes"]) + len(data["spheres"])
    caption = (
        f"The smallest counter-example of {len(found)} runs that found one: an affordance that is not an "
        f"optimal first action, with {known} known obstacle{'s' * (known != 1)} (seed {row.seed}; {where})."
    )
    return Plate("counterexample", draw_counterexample(data), caption, ("", ""), ())


def reliability_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return how often a backend is right by how sure it is, frames of all seeds taken together."""
    rows = [row for row in rows if row.result.details.get(_RELIABILITY)]
    if not rows:
        return None
    compared = () if about.compare is None else (about.compare,)
    sides = curve_sides(about) or Sides((), compared)
    panels, numbers = [], list[tuple[Number, ...]]()
    for title, by_colour in grouped(rows, about, sides).items():
        sets = {}
        for label, by_row in by_colour.items():
            sets[label] = bins = _pooled([row for runs in by_row.values() for row in runs])
            three = zip(bins.confidence, bins.accuracy, bins.frames, strict=True)
            numbers += [(title, label, 100 * float(c), 100 * float(a), int(n)) for c, a, n in three]
        panels.append((title, sets))
    pooled = [name for name in about.others if name not in (*sides.colours, *sides.panels)]
    also = f", and of all levels of {' and '.join(pooled)}," if pooled else ""
    caption = (
        "How often the label is right by how sure of it the backend is, in bins; the frames of "
        f"{seeds_of(rows, about)}{also} are taken "
        "together, and marks grow with their number. On the dashed line confidence means what it says."
    )
    header = ("panel", "line", "confidence, %", "right, %", "frames")
    figure = reliability_figure(panels)
    return Plate("reliability", figure, caption, *without_blanks(header, numbers))


def _pooled(rows: Sequence[Row]) -> Bins:
    """Return the bins of all runs' frames."""
    tables = [row.result.details[_RELIABILITY] for row in rows]
    frames = np.array([table["frames"] for table in tables])
    full = frames.sum(axis=0) > 0
    sums = {
        name: (frames * np.array([[v or 0.0 for v in table[name]] for table in tables])).sum(axis=0)
        for name in ("confidence", "accuracy")
    }
    total = frames.sum(axis=0)[full]
    return Bins(sums["confidence"][full] / total, sums["accuracy"][full] / total, total)
