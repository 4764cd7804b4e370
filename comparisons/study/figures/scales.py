"""Axes of figures: what they show of estimates, where what was never reached stands, and their ticks."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from math import inf, isfinite
from typing import Final, NamedTuple

from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator

from comparisons.study.results.samples import FEWEST_SEEDS

WIDE_RANGE: Final = 30.0
"""Numbers whose largest is so many times the smallest stand on a logarithmic axis."""
_LETTERS: Final = 13.0  # beside each other on an inch, roughly


class Spot(NamedTuple):
    """An estimate and the bounds of its 95 % interval; infinite where it was not reached.

    Parameters
    ----------
    value, low, high
        The estimate, and its bounds; NaN for bounds that cannot be told.
    seeds
        How many it rests on; 0 if that is not told.
    """

    value: float
    low: float
    high: float
    seeds: int = 0

    @property
    def few(self) -> bool:
        """Whether it rests on too few seeds for anything to be ranked by it."""
        return 0 < self.seeds < FEWEST_SEEDS


class Scale(NamedTuple):
    """An axis that fits some spots: its limits, where what is infinite stands, and its kind.

    Parameters
    ----------
    low, high
        Limits.
    log
        Whether it is logarithmic.
    beyond
        Whether anything infinite stands at its upper end, and at its lower one.
    numbered
        Whether there is any number to read on it.
    """

    low: float
    high: float
    log: bool
    beyond: tuple[bool, bool] = (False, False)
    numbered: bool = True

    def inside(self, value: float) -> float:
        """Return where a value is drawn: one beyond the axis at its end."""
        return min(max(value, self.low), self.high)


WHOLE: Final = Scale(-1.5, 101.5, False)
"""An axis for shares from 0 to 100 %."""


def scale_of(spots: Sequence[Spot], *, share: bool = False) -> Scale:
    """Return an axis on which spots are seen with their intervals.

    Parameters
    ----------
    spots
        What is to be seen.
    share
        Whether they are shares, in per cent: the axis then ends at 0 and 100 where it comes near.

    Examples
    --------
    >>> scale_of([Spot(100, 90, 120), Spot(9000, 8000, float("inf"))])
    Scale(low=..., high=..., log=True, beyond=(True, False), numbered=True)
    >>> [round(bound) for bound in scale_of([Spot(50, 40, 60)], share=True)[:2]]
    [38, 62]
    """
    values = [value for spot in spots for value in spot[:3]]
    beyond = (any(value == inf for value in values), any(value == -inf for value in values))
    finite = [value for value in values if isfinite(value)]
    if not finite:
        return Scale(0.0, 1.0, False, beyond, numbered=False)
    low, high = min(finite), max(finite)
    if not share and low > 0 and high > WIDE_RANGE * low:
        return Scale(low / 1.3, high * (1.6 if beyond[0] else 1.3), True, beyond)
    room = (high - low or abs(high) or 1.0) * 0.09
    up, down = (1 + 0.8 * end for end in beyond)
    low, high = low - room * down, high + room * up
    if share:
        low, high = (max(low, -1.5), min(high, 101.5))
    elif 0 <= min(finite) < 0.35 * max(finite) and not beyond[1]:
        low = 0.0  # what is compared by size begins at nothing, where there is room for that
    return Scale(low, high, False, beyond)


def set_scale(axes: Axes, which: str, scale: Scale, ticks: int = 5) -> None:
    """Give an axis, "x" or "y", its limits and readable ticks."""
    axis = axes.xaxis if which == "x" else axes.yaxis
    if not scale.numbered:
        axis.set_major_locator(FixedLocator([]))
    elif scale.log:
        axes.set(**{f"{which}scale": "log"})
        decades = scale.high / scale.low > 1000
        axis.set_major_locator(LogLocator(subs=(1.0,) if decades else (1.0, 2.0, 5.0)))
        axis.set_minor_formatter(FuncFormatter(lambda _value, _place: ""))
    else:
        axis.set_major_locator(
            FixedLocator([0, 25, 50, 75, 100]) if scale[:2] == WHOLE[:2] else MaxNLocator(ticks)
        )
    axis.set_major_formatter(FuncFormatter(lambda value, _place: short(value)))
    axes.set(**{f"{which}lim": (scale.low, scale.high)})


def axis_words(label: str, scale: Scale, inches: float) -> str:
    r"""Return what stands by an axis: what it shows, on lines of its length, and what a reader must know.

    Examples
    --------
    >>> axis_words("steps to optimal", Scale(1, 900, True, (True, False)), 3.0)
    'steps to optimal (log scale)\n(hollow: never reached)'
    """
    words, letters = label + " (log scale)" * scale.log, int(_LETTERS * inches)
    lines = textwrap.wrap(words, letters, break_on_hyphens=False)
    return "\n".join([*lines, *["(hollow: never reached)"] * any(scale.beyond)])


def short(value: float) -> str:
    """Return a number for an axis: thousands and millions by their letter.

    Examples
    --------
    >>> [short(value) for value in (0, 0.25, 12, 2500, 200000, 3e6, -1500)]
    ['0', '0.25', '12', '2.5 k', '200 k', '3 M', '-1.5 k']
    """
    for size, letter in ((1e6, " M"), (1e3, " k")):
        if abs(value) >= size:
            return f"{value / size:.4g}{letter}"
    return f"{value:.4g}"
