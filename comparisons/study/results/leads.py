"""What sums up an answer of many comparisons, to be read before any of them."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Final

from comparisons.study.kinds import Measure
from comparisons.study.results.question import Asked, Place, Told
from comparisons.study.results.statistics import Estimate, estimate
from comparisons.study.results.wording import CALLED, article, counted, number, plain, spread

_MANY: Final = 4  # comparisons; fewer are read one by one
_MOST_TRENDS: Final = 4  # levels whose way over the numbers is told; of more, that of the one compared with


def summary(asked: Asked, measure: Measure, told: Sequence[Told], places: Sequence[Place]) -> tuple[str, ...]:
    """Return sentences that sum up an answer that is given at many places; none if there are few.

    Parameters
    ----------
    asked
        The question.
    measure
        What is compared.
    told
        All comparisons.
    places
        Where they are made, with all numbers.
    """
    if not asked.within or len(told) < _MANY:
        return ()
    ranked = [each for each in told if each.comparison is not None and not each.comparison.few]
    if not ranked:
        return ()
    return (*_trend(asked, measure, told, places), _count(asked, measure, told, ranked))


def _trend(asked: Asked, measure: Measure, told: Sequence[Told], places: Sequence[Place]) -> tuple[str, ...]:
    """Return how levels go over the numbers of the one factor that the answer is given within."""
    (factor, *more) = asked.within
    numbers = [_number(place.within[factor]) for place in places]
    if more or None in numbers or len(places) < 2:
        return ()
    ordered = [place for _, _, place in sorted(zip(numbers, range(len(places)), places, strict=True))]
    labels = [place.within[factor] for place in ordered]
    levels = [asked.against, *dict.fromkeys(each.level for each in told)]
    parts, seeds = [], []
    for level in levels if len(levels) <= _MOST_TRENDS else levels[:1]:
        found = [
            estimate(place.samples[level], asked.statistic) if level in place.samples else None
            for place in ordered
        ]
        if (way := _way(found, labels, measure)) is not None:
            parts.append(f"{way} with {asked.compare} {level}")
            seeds += [each.seeds for each in found if each is not None]
    if not parts:
        return ()
    about = f"the {CALLED[asked.statistic]} over {counted(min(seeds), 'seed')} of {article(measure)}"
    return (f"From {factor} {labels[0]} to {labels[-1]}, {about} {'; '.join(parts)}.",)


def _way(found: Sequence[Estimate | None], labels: Sequence[str], measure: Measure) -> str | None:
    """Return from where to where estimates go, and how far beyond in between; None if an end is unknown."""
    first, last = found[0], found[-1]
    if first is None or last is None or first.few or last.few:
        return None
    ends = [spread(end.value, end.low, end.high, measure, unit=True) for end in (first, last)]
    between = [
        (each.value, label) for each, label in zip(found, labels, strict=True) if each and not each.few
    ]
    beyond = []
    for pick, words in ((min, "down"), (max, "up")):
        value, label = pick(between, key=lambda pair: pair[0])
        shown = number(value, measure)
        if shown not in (number(first.value, measure), number(last.value, measure)):
            beyond.append(f", {words} to {shown} at {label}")
    if ends[0] == ends[1] and not beyond:
        return f"stays at {ends[0]}"
    return f"goes from {ends[0]} to {ends[1]}{''.join(beyond)}{',' * bool(beyond)}"


def _count(asked: Asked, measure: Measure, told: Sequence[Told], ranked: Sequence[Told]) -> str:
    """Return how many comparisons show a difference, and which way."""
    sure = sum(each.comparison is not None and each.comparison.significant for each in ranked)
    which = "All" if sure == len(ranked) else f"{sure} of" if sure else "None of"
    shows = f"{'show' if sure > 1 else 'shows'} a difference"
    seeds = counted(min(each.comparison.seeds for each in ranked if each.comparison is not None), "seed")
    counts = (
        f"{which} {len(ranked)} comparisons with {asked.compare} {asked.against}, of {seeds} each, {shows}"
    )
    parts = []
    for level in dict.fromkeys(each.level for each in ranked):
        here = [each for each in ranked if each.level == level]
        ways = [
            f"{word} in {len(some)} of {len(here)}{_range(some, measure)}"
            for word, sign in _words(measure)
            if (some := [each for each in here if _ahead(each) == sign])
        ]
        parts.append(f"{asked.compare} {level} is {' and '.join(ways)}" if ways else "")
    told_ways = "; ".join(part for part in parts if part)
    if all(each.comparison.powerless for each in ranked if each.comparison is not None):
        told_ways = "so few cannot show any by this test"
    left = len(told) - len(ranked)
    unranked = f"; {left} more {'is' if left == 1 else 'are'} not ranked" if left else ""
    return f"{counts}{': ' if told_ways else ''}{told_ways}{unranked}."


def _words(measure: Measure) -> tuple[tuple[str, int], tuple[str, int]]:
    """Return the words for either direction, with the sign of what has more there."""
    if measure.better is None:
        return ("above", 1), ("below", -1)
    sign = 1 if measure.better == "more" else -1
    return ("better", sign), ("worse", -sign)


def _ahead(each: Told) -> int:
    """Return which side has more for sure; 0 if neither."""
    return each.comparison.ahead if each.comparison is not None and each.comparison.significant else 0


def _range(told: Sequence[Told], measure: Measure) -> str:
    """Return the least and the largest effect of comparisons, if all are finite and go one way."""
    found = [each.comparison for each in told if each.comparison is not None]
    ratios = [each.ratio.value for each in found if each.ratio is not None]
    factor, unit, values = 1.0, "times", ratios
    if len(ratios) < len(found):
        factor, unit = (1.0, measure.unit) if measure.unit else (100.0, "percentage points")
        values = [abs(each.difference.value) for each in found if each.difference is not None]
    if len(values) < len(found) or not all(map(isfinite, values)) or any(each.contrary for each in found):
        return ""
    least, most = plain(factor * min(values)), plain(factor * max(values))
    return f" ({least} {unit})" if least == most else f" ({least} to {most} {unit})"


def _number(label: str) -> float | None:
    try:
        value = float(label)
    except ValueError:
        return None
    return value if isfinite(value) else None
