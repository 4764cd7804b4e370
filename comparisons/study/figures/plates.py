"""Figures of estimates, each with its caption and its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from comparisons.study.figures.draw_estimates import (
    Estimates,
    estimates_figure,
    improvement_matrix_figure,
    over_figure,
)
from comparisons.study.figures.grouping import (
    MOST_COLOURS,
    MOST_PANELS,
    About,
    Sides,
    axis_of,
    estimate_sides,
    grouped,
    is_numeric,
    named,
    numeric_sides,
    parts_of,
    shown_measures,
    title_of,
)
from comparisons.study.figures.plate import (
    Plate,
    abouts,
    capital,
    chance_of,
    estimates_of,
    few_words,
    seeds_of,
    told,
    without_blanks,
)
from comparisons.study.figures.scales import Spot
from comparisons.study.results.rows import Row
from comparisons.study.results.samples import FEWEST_SEEDS

_MOST_ROWS: Final = 16
_MOST_RANKED: Final = 8


def estimates_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return estimates by level; None without levels, or if they are too many."""
    sides = estimate_sides(about)
    if not sides.rows or about.combinations(sides.rows) > _MOST_ROWS:
        return None
    measures = shown_measures(about, rows)
    found = grouped(rows, about, sides)[""]
    panels = [estimates_of(measure, found, about.statistic) for measure in measures]
    panels = [each for each in panels if each.spots]
    if not panels:
        return None
    caption = (
        f"{capital(about.statistic_in_words)} over {seeds_of(rows, about)} (mark) and its 95 % interval "
        f"(line). {capital(abouts(measures))}.{_few(panels)}"
    )
    figure = estimates_figure(panels, _beside(sides))
    return Plate("estimates", figure, caption, *told(about, sides, panels))


def over_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return measures over a numeric factor; None if the study varies none."""
    sides = numeric_sides(about)
    if sides is None:
        return None
    found = grouped(rows, about, sides)
    measures = [about.measure] if sides.panels else shown_measures(about, rows)
    panels = [
        replace(each, title=title or each.title)
        for measure in measures
        for title, part in found.items()
        if (each := estimates_of(measure, part, about.statistic)).spots
    ]
    if not panels:
        return None
    name = sides.rows[0]
    caption = (
        f"Over {name}: {about.statistic_in_words} over {seeds_of(rows, about)} (line) and its 95 % interval "
        f"(band). {capital(abouts(measures))}.{_few(panels)}"
    )
    return Plate("over", over_figure(panels, name), caption, *told(about, sides, panels))


def parts_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return the answer's measure part by part, such as task by task; None if it has no parts."""
    names = parts_of(about.measure, rows)
    over = numeric_sides(about)
    sides = over if over is not None and not over.panels else estimate_sides(about)
    too_many = sides is not over and about.combinations(sides.rows) > _MOST_ROWS
    if not names or len(names) > MOST_PANELS or not sides.rows or too_many:
        return None
    found = grouped(rows, about, sides)[""]
    panels = [estimates_of(about.kind.measure(name), found, about.statistic) for name in names]
    panels = [
        replace(each, title=each.title.partition(", ")[2], label=axis_of(about.measure))
        for each in panels
        if each.spots
    ]
    if not panels:
        return None
    figure = over_figure(panels, sides.rows[0]) if sides is over else estimates_figure(panels, _beside(sides))
    caption = (
        f"{capital(about.measure.about)}, part by part: {about.statistic_in_words} over "
        f"{seeds_of(rows, about)} and its 95 % interval. Runs in which a part never came up are not in it."
        f"{_few(panels)}"
    )
    return Plate("parts", figure, caption, *told(about, sides, panels))


def improvement_plate(about: About, rows: Sequence[Row]) -> Plate | None:
    """Return how probable it is that a level's run is better than another's; None on too few seeds."""
    levels = () if about.compare is None else tuple(about.factors[about.compare])
    if about.compare is None or len(levels) < 2 or about.measure.better is None:
        return None
    found = grouped(rows, about, Sides((about.compare,), about.others)).get("", {})
    if min((len(runs) for by in found.values() for runs in by.values()), default=0) < FEWEST_SEEDS:
        return None
    if about.against is not None and len(found) <= _MOST_ROWS and len(levels) <= _MOST_ROWS:
        return _against_plate(about, rows, found)
    if len(found) == 1 and len(levels) <= _MOST_RANKED:
        return _matrix_plate(about, rows, *found.values())
    return None


def _matrix_plate(about: About, rows: Sequence[Row], by_level: Mapping[str, Sequence[Row]]) -> Plate | None:
    chances: dict[tuple[str, str], Spot] = {}
    for one in by_level:
        for other in by_level:
            if one != other and (spot := chance_of(about.measure, by_level[one], by_level[other])):
                chances[one, other] = spot
    if not chances:
        return None
    caption = (
        f"Probability that a run of the row's {about.compare} is better than one of the column's, in %, with "
        f"its 95 % interval; a tie counts as half. {_better(about)}; {seeds_of(rows, about)}."
    )
    numbers = tuple((one, other, *spot) for (one, other), spot in chances.items())
    header = ("this", "is better than", "%", "95 % from", "to", "seeds")
    figure = improvement_matrix_figure(list(by_level), chances)
    return Plate("improvement", figure, caption, header, numbers)


def _against_plate(
    about: About, rows: Sequence[Row], found: Mapping[str, Mapping[str, Sequence[Row]]]
) -> Plate | None:
    compare, against = str(about.compare), str(about.against)
    spots = {
        colour: {
            level: spot
            for level, runs in by_level.items()
            if level != against and (spot := chance_of(about.measure, runs, by_level[against])) is not None
        }
        for colour, by_level in found.items()
        if against in by_level
    }
    spots = {colour: by_level for colour, by_level in spots.items() if by_level}
    if not spots:
        return None
    over = len(about.others) == 1 and is_numeric(about.factors[about.others[0]])
    if len(spots) > MOST_COLOURS and not over:
        return None
    baseline = named({compare: against}, [compare], about.factors)
    label = f"chance to beat {baseline}, %"
    if over:
        number = {colour: found[colour][against][0].levels[about.others[0]] for colour in spots}
        turned = {
            level: {number[colour]: by[level] for colour, by in spots.items() if level in by}
            for level in about.factors[compare]  # the baseline too, which keeps its colour
        }
        figure = over_figure([Estimates(label, turned, True)], about.others[0], 50.0)
    else:
        figure = estimates_figure([Estimates(label, spots, True)], compare, 50.0)
    caption = (
        f"Probability that a run is better than one with {baseline}, and its 95 % interval; a tie counts as "
        f"half, so that 50 % (dashed) is no difference. {_better(about)}; {seeds_of(rows, about)}."
    )
    header = (", ".join(about.others) or "line", compare, "% of pairs", "95 % from", "to", "seeds")
    numbers = [(colour, level, *spot) for colour, by in spots.items() for level, spot in by.items()]
    return Plate("improvement", figure, caption, *without_blanks(header, numbers))


def _beside(sides: Sides) -> str:
    """Return what stands beside rows: the name of their factor, unless labels of several hold theirs."""
    return sides.rows[0] if len(sides.rows) == 1 else ""


def _few(panels: Sequence[Estimates]) -> str:
    return few_words(spot for each in panels for spot in each.all)


def _better(about: About) -> str:
    return f"Better is {about.measure.better} of: {title_of(about.measure)} ({about.measure.about})"
