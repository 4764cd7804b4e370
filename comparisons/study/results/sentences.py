"""A comparison in a sentence, right also where there is no difference, or a goal was never reached."""

from __future__ import annotations

from math import inf, isfinite
from typing import Final, NamedTuple

from comparisons.study.kinds import Measure
from comparisons.study.results.paired import Comparison
from comparisons.study.results.samples import FEWEST_SEEDS
from comparisons.study.results.significance import SIGNIFICANT
from comparisons.study.results.sizes import FAR
from comparisons.study.results.statistics import Estimate, Interval
from comparisons.study.results.wording import (
    CALLED,
    article,
    chance_of,
    counted,
    decimals_of,
    number,
    plain,
    ratio_decimals,
    reach,
    spread,
)

NO_PAIR: Final = "no seed has both"
"""Why nothing can be said of two levels, as a rule."""


class Sides(NamedTuple):
    """What a sentence is about besides its numbers.

    Parameters
    ----------
    where
        Where the comparison is made; "" for everywhere.
    first, second
        What is compared, such as "gamma 0.9" and "gamma 1".
    measure
        What was measured.
    missing
        Number of runs of the two that were declared and have no result.
    untold
        Number of runs of the two that had nothing to tell.
    reason
        Why nothing can be said, should there be no comparison.
    """

    where: str
    first: str
    second: str
    measure: Measure
    missing: int = 0
    untold: int = 0
    reason: str = NO_PAIR


def sentence(sides: Sides, comparison: Comparison | None) -> str:
    """Return a comparison in words, such as `comparisons.study.results.answers.answers` shows."""
    where = f"{sides.where}: " if sides.where else ""
    if comparison is None:
        left = _left_out(sides, 0)
        return f"{where}nothing can be said of {sides.first} against {sides.second}: {sides.reason}{left}."
    if comparison.few:
        return f"{where}{_too_few(sides, comparison)}{_left_out(sides, comparison.unpaired)}."
    if not (isfinite(comparison.first.value) and isfinite(comparison.second.value)):
        said = _never(sides, comparison)
    else:
        said = f"{_finite(sides, comparison)}{_some_never(sides, comparison)}"
    ending = f"{_runs(comparison)}{_left_out(sides, comparison.unpaired)}"
    return f"{where}{said}; {ending}."


def _too_few(sides: Sides, comparison: Comparison) -> str:
    """Return the two estimates, unranked."""
    called, seeds = CALLED[comparison.statistic], counted(comparison.seeds, "seed")
    of = f"{called} of {sides.measure.about}"
    first, second = (_estimate(side, sides.measure) for side in (comparison.first, comparison.second))
    there = "there is" if comparison.seeds == 1 else "there are"
    if comparison.tasks > 1:
        there = "a task has but"
    return (
        f"not ranked, for {there} {seeds} and {FEWEST_SEEDS} are needed; {of}: {sides.first} {first}, "
        f"{sides.second} {second}"
    )


def _finite(sides: Sides, comparison: Comparison) -> str:
    """Return what a difference is, or that there is none to be seen."""
    between = f"between {sides.first} and {sides.second}"
    about = article(sides.measure)
    if not comparison.differing:
        alike = f"all {comparison.pairs} pairs are alike"
        return f"no difference {between} in {about}: {alike}"
    if not comparison.significant:
        size = f"{_size(sides.measure, comparison)}{_uncorrected(comparison)}"
        return f"no difference {between} that {_power(comparison)}, in {about}: {size}"
    if comparison.clear and not comparison.contrary:
        return _effect(sides, comparison)
    # The test looks at pairs, the statistic at both sides' middles: they may well tell different things.
    lies = "above" if comparison.ahead > 0 else "below"
    called = f"{CALLED[comparison.statistic]}s"
    doubt = (
        f"{called} lie the other way"
        if comparison.clear
        else f"interval of their {called} takes in no difference"
    )
    return (
        f"pair by pair {sides.first} mostly lies {lies} {sides.second} in {about}, though the {doubt}: "
        f"{_size(sides.measure, comparison)}"
    )


def _uncorrected(comparison: Comparison) -> str:
    """Return why an interval leaves out what the test does not, if it does."""
    if not comparison.clear or comparison.powerless:
        return ""
    if comparison.p < SIGNIFICANT:
        return f", an interval that is not corrected for {comparison.tests} comparisons"
    return ", though pair by pair neither side is surely ahead"


def _effect(sides: Sides, comparison: Comparison) -> str:
    """Return a difference with the measure, as a clause."""
    measure, ratio, difference = sides.measure, comparison.ratio, comparison.difference
    first, second = sides.first, sides.second
    if ratio is not None:
        verb = "needs" if " until " in measure.about else "has"
        times = f"{first} {verb} {_times(ratio)}"
        head, unit, rest = measure.about.partition(measure.unit)
        if unit and (not rest or rest.startswith((" until ", " that "))):
            return f"{times} the {head}{unit} of {second}{rest}"
        return f"{times} what {second} {verb} in {measure.about}"
    assert difference is not None, "both sides are finite"
    less = difference.value < 0
    shown = Interval(-difference.value, -difference.high, -difference.low) if less else difference
    if measure.unit:
        compared = f"{'less' if less else 'more'} than {second}"
        return f"{first} has {_amount(shown, measure)} {compared} in {measure.about}"
    compared = f"{'below' if less else 'above'} {second}"
    both = (number(side.value, measure) for side in (comparison.first, comparison.second))
    return f"{first} is {_amount(shown, measure)} {compared} in {article(measure)}: {' against '.join(both)}"


def _size(measure: Measure, comparison: Comparison) -> str:
    """Return a difference by itself."""
    if comparison.ratio is not None:
        return _times(comparison.ratio)
    assert comparison.difference is not None, "both sides are finite"
    return _amount(comparison.difference, measure)


def _times(ratio: Interval) -> str:
    decimals = ratio_decimals(ratio.value, ratio.low, ratio.high)
    return f"{plain(ratio.value, decimals)} times ({reach(ratio.low, ratio.high, decimals, 0.0)})"


def _amount(difference: Interval, measure: Measure) -> str:
    times, unit = (1.0, measure.unit) if measure.unit else (100.0, "percentage points")
    value, low, high = (times * bound for bound in (difference.value, difference.low, difference.high))
    decimals = decimals_of(value, low, high)
    return f"{plain(value, decimals)} {unit} ({reach(low, high, decimals, -inf)})"


def _never(sides: Sides, comparison: Comparison) -> str:
    """Return a comparison in which a statistic is infinite, since too many runs never got there."""
    called = CALLED[comparison.statistic]
    both = ((sides.first, comparison.first), (sides.second, comparison.second))
    parts = []
    for name, side in both:
        end = f"so that there is no finite {called}"
        if isfinite(side.value):
            end = f"and the {called} is {_estimate(side, sides.measure)}"
        parts.append(
            f"with {name}, {side.runs - side.reached} of {counted(side.runs, 'run')} never got there, {end}"
        )
    lead = f"no difference between {sides.first} and {sides.second} that {_power(comparison)}"
    if comparison.significant:
        better = (comparison.ahead > 0) == (sides.measure.better == "more")
        lead = f"{sides.first} is {'better' if better else 'worse'} than {sides.second}"
        if comparison.contrary:
            missed = next(name for name, side in both if not isfinite(side.value))
            lead = f"pair by pair {lead}, though more of the runs with {missed} never got there"
    return f"{lead}, in {article(sides.measure)}: {'; '.join(parts)}"


def _power(comparison: Comparison) -> str:
    """Return how many seeds show nothing, and whether they could show anything."""
    so_few = " (so few cannot show any by this test)" if comparison.powerless else ""
    return f"{counted(comparison.seeds, 'seed')} can show{so_few}"


def _some_never(sides: Sides, comparison: Comparison) -> str:
    """Return how many runs never got there, if any: they count as infinitely bad."""
    first, second = (side.runs - side.reached for side in (comparison.first, comparison.second))
    if not first + second:
        return ""
    runs = counted(comparison.pairs, "run")
    return f"; {first} of {runs} never got there with {sides.first}, and {second} with {sides.second}"


def _runs(comparison: Comparison) -> str:
    """Return on how much a comparison rests."""
    tasks = f" in {comparison.tasks} tasks" if comparison.tasks > 1 else ""
    if comparison.apart > FAR:
        tasks += " that differ much in size"
    many = f" after Holm's correction for {comparison.tests} comparisons" if comparison.tests > 1 else ""
    seeds = counted(comparison.seeds, "seed")
    called = f"{CALLED[comparison.statistic]}s"
    return f"{called} of {seeds} each{tasks}, paired, {chance_of(comparison.corrected)}{many}"


def _left_out(sides: Sides, unpaired: int) -> str:
    """Return which runs have no say, if any."""
    parts = []
    if sides.missing:
        parts.append(f"; {counted(sides.missing, 'run')} failed or not run yet")
    if unpaired:
        parts.append(f"; {counted(unpaired, 'run')} left out for want of a twin")
    if sides.untold:
        parts.append(f"; {counted(sides.untold, 'run')} had nothing to tell")
    return "".join(parts)


def _estimate(side: Estimate, measure: Measure) -> str:
    return spread(side.value, side.low, side.high, measure, unit=True)
