"""How a study's numbers are worded: no more digits than count, and what was never reached as such."""

from __future__ import annotations

from math import inf, isfinite
from typing import Final

from comparisons.study.kinds import Measure

NEVER: Final = "never"
"""Stands for a number that was never reached."""
CALLED: Final = {"iqm": "IQM", "median": "median", "mean": "mean"}
"""Statistics by their names."""


def plain(value: float, decimals: int | None = None) -> str:
    """Return a finite number; by default with three digits that count, and all before the point.

    >>> [plain(value) for value in (1234567.8, 999.6, 99.96, 0.01234, 0.0, -4.5, 1e-7)]
    ['1,234,568', '1,000', '100', '0.0123', '0', '-4.50', '1e-07']
    >>> plain(-0.001, 2), plain(1234.5, 1)
    ('0.00', '1,234.5')
    """
    if decimals is None:
        decimals = decimals_of(value)
    if decimals > 6:
        return f"{value:.3g}"
    text = f"{value:,.{decimals}f}"
    return text if text.strip("-0.,") else text.removeprefix("-")


def decimals_of(value: float, low: float = inf, high: float = inf) -> int:
    """Return how many decimals a number needs, given the bounds of its interval.

    They are as many as show three digits of the number, or of the interval's width if that is larger.

    >>> decimals_of(986.2, 943.1, 1041.7), decimals_of(1.02, 0.947, 1.112), decimals_of(3.05, 0.95, 12.3)
    (0, 2, 1)
    """
    sizes = [abs(value), high - low if isfinite(low) and isfinite(high) else 0.0]
    size = max((each for each in sizes if isfinite(each)), default=0.0)
    if size == 0:
        finite = [abs(bound) for bound in (low, high) if isfinite(bound)]
        size = max(finite, default=0.0)
    # A hundredth of it is the last that shows: 99.96 shows as 100, without any.
    return next((i for i in range(9) if round(size, i) >= 10.0 ** (2 - i)), 9) if size else 0


def ratio_decimals(value: float, low: float, high: float) -> int:
    """Return how many decimals a ratio needs so that it, and its bounds, show as 1 only where they are.

    >>> ratio_decimals(1.42, 1.38, 1.47), ratio_decimals(1.0052, 1.0004, 1.0098), ratio_decimals(1.1, 1, 1.2)
    (2, 4, 2)
    """
    decimals = decimals_of(value, low, high)
    others = [each for each in (value, low, high) if isfinite(each) and abs(each - 1) > 1e-9]
    return next((i for i in range(decimals, 6) if all(round(each, i) != 1 for each in others)), 6)


def number(value: float, measure: Measure, decimals: int | None = None) -> str:
    """Return a measure's number as text.

    Examples
    --------
    >>> steps = Measure("steps", "steps to the goal", "steps", "less")
    >>> [number(value, steps) for value in (5423.4, 14.26, 1.5, 0, float("inf"))]
    ['5,423', '14.3', '1.50', '0', 'never']
    >>> optimal = Measure("optimal", "share of optimal affordances", "", "more")
    >>> number(0.9342, optimal), number(0.9998, optimal), number(1.0, optimal)
    ('93.4 %', '99.98 %', '100.0 %')
    """
    if not isfinite(value):
        return NEVER
    if measure.unit:
        return plain(value, decimals)
    # What is nearly all or nearly nothing must not look like all or nothing.
    exact = min(abs(value), abs(1 - value)) < 1e-9
    shown = 1 if exact else next((i for i in range(1, 6) if round(100 * value, i) not in (0, 100)), 6)
    return f"{plain(100 * value, shown)} %"


def spread(value: float, low: float, high: float, measure: Measure, *, unit: bool = False) -> str:
    """Return a measure's number with the bounds of its interval.

    Parameters
    ----------
    value, low, high
        The number and the bounds, infinite where it was never reached.
    measure
        What they are of.
    unit
        Whether the unit is to stand behind the number.

    Examples
    --------
    >>> steps = Measure("steps", "steps to the goal", "steps", "less")
    >>> spread(986.2, 943.1, 1041.7, steps), spread(14.26, 12, float("inf"), steps, unit=True)
    ('986 (943 to 1,042)', '14.3 steps (12.0 to never)')
    >>> spread(0.625, 0.5, 0.75, Measure("optimal", "share of optimal affordances", "", "more"))
    '62.5 % (50.0 to 75.0 %)'
    """
    decimals = decimals_of(value, low, high)
    first, least, most = (number(each, measure, decimals) for each in (value, low, high))
    if unit and measure.unit and isfinite(value):
        first = f"{first} {measure.unit}"
    if low == -inf and high == inf:
        return f"{first} (no interval)"
    if low == high and not isfinite(low):
        return first
    return f"{first} ({least if most == NEVER else least.removesuffix(' %')} to {most})"


def reach(low: float, high: float, decimals: int, least: float) -> str:
    """Return what a 95 % interval says of a difference or a ratio.

    Parameters
    ----------
    low, high
        The bounds.
    decimals
        How many of them to show.
    least
        What bounds nothing from below: 0 of ratios, minus infinity of differences.

    Examples
    --------
    >>> reach(1.3, 1.55, 2, 0), reach(1.3, float("inf"), 2, 0), reach(0, 2.5, 2, 0)
    ('95 % 1.30 to 1.55', '95 % at least 1.30', '95 % at most 2.50')
    >>> reach(0, float("inf"), 2, 0)
    '95 %: anything'
    """
    first, second = (plain(bound, decimals) if isfinite(bound) else "" for bound in (low, high))
    if high == inf:
        return f"95 % at least {first}" if low > least else "95 %: anything"
    return f"95 % {first} to {second}" if low > least else f"95 % at most {second}"


def article(measure: Measure) -> str:
    """Return what was measured, as it stands after "of" or "in".

    >>> article(Measure("optimal", "share of optimal affordances")), article(Measure("steps", "steps a run"))
    ('the share of optimal affordances', 'steps a run')
    """
    return f"the {measure.about}" if measure.about.startswith("share") else measure.about


def chance_of(p: float) -> str:
    """Return a p value.

    >>> chance_of(0.0321), chance_of(1.0), chance_of(1e-7), chance_of(0.0496)
    ('p = 0.032', 'p = 1', 'p < 0.0001', 'p = 0.0496')
    """
    if p < 0.0001:
        return "p < 0.0001"
    text = f"{p:.2g}"
    # Which side of 0.05 it is on must be seen.
    return f"p = {text}" if text != "0.05" else f"p = {p:.3g}"


def counted(count: int, noun: str) -> str:
    """Return a number of things.

    >>> counted(1, "seed"), counted(20, "seed"), counted(1200, "run")
    ('1 seed', '20 seeds', '1,200 runs')
    """
    return f"{count:,} {noun}{'s' * (count != 1)}"
