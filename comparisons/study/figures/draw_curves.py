"""Figures of runs: learning curves with bands, and the share of runs that came so far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
from numpy.typing import NDArray

from comparisons.study.figures.panels import (
    Mark,
    entitle,
    figure_of_panels,
    grid_lines,
    legend_above,
    marks,
)
from comparisons.study.figures.scales import Scale, Spot, axis_words, scale_of, set_scale, short
from comparisons.style import Look, styled

_HEIGHTS: Final = (2.1, 1.9)  # inches of a panel, where up to two stand in a row and where three do


@dataclass(frozen=True, eq=False)
class Curve:
    """A line with its 95 % band.

    Parameters
    ----------
    x
        Abscissa, shape (points,), rising.
    value, low, high
        The line and its band, shape (points,); infinite where too many runs have nothing to show.
    """

    x: NDArray[np.float64]
    value: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curves:
    """What one panel shows.

    Parameters
    ----------
    title
        Of the panel; "" for none.
    label
        Of its ordinate, unit included.
    curves
        By label of the legend.
    share
        Whether they are shares, in per cent.
    """

    title: str
    label: str
    curves: Mapping[str, Curve]
    share: bool = False


@styled
def convergence_figure(
    panels: Sequence[Curves], abscissa: str = "environment steps", *, alike: bool = False
) -> Figure:
    """Draw learning curves with their bands, a panel for each group or column of the curve.

    Where a curve or its band is infinite (too many runs have nothing to show yet), it is left out.

    Parameters
    ----------
    panels
        At least one.
    abscissa
        What the abscissa shows.
    alike
        Whether panels have the same ordinate, as they need to be compared with each other.

    Examples
    --------
    >>> x, y = np.array([0.0, 100.0]), np.array([0.0, 90.0])
    >>> figure = convergence_figure([Curves("", "optimal starts, %", {"maxq-0": Curve(x, y, y, y)}, True)])
    >>> figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()
    ('environment steps', 'optimal starts, %')
    """
    figure, places, columns = figure_of_panels(len(panels), _HEIGHTS)
    looks = marks(list(dict.fromkeys(label for each in panels for label in each.curves)))
    for i, (each, axes) in enumerate(zip(panels, places, strict=True)):
        scale = scale_of(_spots(panels if alike else [each]), share=each.share)
        scale = Scale(min(scale.low, 0.0), scale.high, False) if each.share else scale._replace(log=False)
        for label, curve in each.curves.items():
            _band(axes, label, curve, scale, looks[label])
        axes.set_xlim(0, max(curve.x[-1] for curve in each.curves.values()))
        axes.xaxis.set_major_locator(MaxNLocator(4 if columns < 3 else 3))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _place: short(value)))
        set_scale(axes, "y", scale)
        grid_lines(axes, "y")
        if i >= len(panels) - columns:
            axes.set_xlabel(abscissa)
        if i % columns == 0 or each.label != panels[i - 1].label:
            axes.set_ylabel(each.label)
        entitle(axes, i, len(panels), each.title, figure.get_figwidth() / columns - 0.5)
    legend_above(figure)
    return figure


def _spots(panels: Sequence[Curves]) -> list[Spot]:
    """Return every number that some panels' curves and bands have."""
    return [
        Spot(number, number, number)
        for each in panels
        for curve in each.curves.values()
        for part in (curve.value, curve.low, curve.high)
        for number in part[np.isfinite(part)].tolist()
    ]


def _band(axes: Axes, label: str, curve: Curve, scale: Scale, mark: Mark) -> None:
    seen = np.isfinite(curve.value)
    value = np.where(seen, curve.value, np.nan)
    look = mark.curve if seen.any() else mark.look  # matplotlib cannot mark every part of a line without any
    axes.plot(curve.x, value, label=label or None, linewidth=1.2, gid=label or "line", **look)
    axes.fill_between(
        curve.x,
        np.clip(curve.low, scale.low, scale.high),
        np.clip(curve.high, scale.low, scale.high),
        where=seen.tolist(),
        color=mark.colour,
        alpha=0.18,
        linewidth=0,
    )


@styled
def profiles_figure(
    panels: Sequence[Curves], abscissa: str, *, less: bool = True, log: bool = False
) -> Figure:
    """Draw which share of runs is at least so good, a step line with its band for each level.

    Bands are drawn where some runs are and some are not. For a measure of steps or episodes this is sample
    efficiency: the share of runs that came to the oracle's level within so many.

    Parameters
    ----------
    panels
        At least one; the abscissa of their curves is the measure.
    abscissa
        The measure, unit included.
    less
        Whether less of the measure is better: the share grows along the abscissa, or else falls.
    log
        Whether the abscissa is logarithmic.

    Examples
    --------
    >>> x, y = np.array([10.0, 100.0]), np.array([0.0, 100.0])
    >>> figure = profiles_figure([Curves("", "runs, %", {"maxq-0": Curve(x, y, y, y)}, True)], "steps")
    >>> figure.axes[0].get_xlabel(), [float(end) for end in figure.axes[0].get_ylim()]
    ('steps', [-2.0, 102.0])
    """
    figure, places, columns = figure_of_panels(len(panels), _HEIGHTS)
    looks = marks(list(dict.fromkeys(label for each in panels for label in each.curves)))
    # A share holds from the measure's last number on if it grows, and back from the next one if it falls.
    where: Literal["post", "pre"] = "post" if less else "pre"
    ends = [(curve.x.min(), curve.x.max()) for each in panels for curve in each.curves.values()]
    low, high = min(end[0] for end in ends), max(end[1] for end in ends)
    for i, (each, axes) in enumerate(zip(panels, places, strict=True)):
        for label, curve in each.curves.items():
            look = looks[label]
            axes.step(curve.x, curve.value, where=where, label=label or None, linewidth=1.2, **look.curve)
            # Where no run or every run is, the interval is as wide as ever, and bands would hide each other.
            among = ((curve.value > 0) & (curve.value < 100)).tolist()
            band: Look = {"step": where, "color": look.colour, "alpha": 0.16, "linewidth": 0}
            axes.fill_between(curve.x, curve.low, curve.high, where=among, **band)
        scale = Scale(low, high if high > low else low + 1, bool(log and low > 0))
        set_scale(axes, "x", scale, 4)
        axes.set_ylim(-2, 102)
        grid_lines(axes, "y")
        if i >= len(panels) - columns:
            axes.set_xlabel(axis_words(abscissa, scale, figure.get_figwidth() / columns - 0.5))
        if i % columns == 0:
            axes.set_ylabel(each.label)
        entitle(axes, i, len(panels), each.title, figure.get_figwidth() / columns - 0.5)
    legend_above(figure)
    return figure
