"""What every figure of a study has in common: its widths, its marks, and the three files it is saved as."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from math import inf, isfinite
from pathlib import Path
from typing import Any, Final, NamedTuple

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator

from comparisons.style import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    PALE,
    PLUM,
    SKY,
    VERMILION,
    Look,
    Picture,
    house_style,
    picture,
)

ONE_COLUMN: Final = 3.3
"""Inches of a paper's column."""
TWO_COLUMNS: Final = 6.9
"""Inches of both, and of what is between them."""
FORMATS: Final = ("svg", "pdf", "png")
"""Files of each figure."""
_PALETTE: Final = (BLUE, VERMILION, GREEN, PLUM, ORANGE, SKY)
_MARKERS: Final = "osD^vP"
_DASHES: Final[tuple[Any, ...]] = ("-", (0, (4, 1.6)), (0, (1.2, 1.2)))
_LONGEST: Final = 36  # letters of a label
_LEGEND_ROW: Final = 0.19  # inches
WIDE_RANGE: Final = 30.0
"""Numbers whose largest is so many times the smallest stand on a logarithmic axis."""


class Spot(NamedTuple):
    """An estimate and the bounds of its 95 % interval; infinite where it was not reached."""

    value: float
    low: float
    high: float


class Mark(NamedTuple):
    """How a level looks: told by its marker and dashes as well as by its colour."""

    colour: str
    marker: str
    dashes: Any

    @property
    def look(self) -> Look:
        """As properties of a line."""
        return {"color": self.colour, "linestyle": self.dashes}


def marks(labels: Sequence[str]) -> dict[str, Mark]:
    """Return a look for each label, no two of the first eighteen alike.

    Examples
    --------
    >>> looks = marks([str(i) for i in range(18)])
    >>> len(set(looks.values())), looks["0"].marker
    (18, 'o')
    """
    turns = len(_PALETTE)
    return {
        label: Mark(_PALETTE[i % turns], _MARKERS[i % turns], _DASHES[i // turns % len(_DASHES)])
        for i, label in enumerate(labels)
    }


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
    """

    low: float
    high: float
    log: bool
    beyond: tuple[bool, bool] = (False, False)

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
    Scale(low=..., high=..., log=True, beyond=(True, False))
    >>> [round(bound) for bound in scale_of([Spot(50, 40, 60)], share=True)[:2]]
    [38, 62]
    """
    values = [value for spot in spots for value in spot]
    finite = [value for value in values if isfinite(value)] or [0.0, 1.0]
    low, high = min(finite), max(finite)
    beyond = (any(value == inf for value in values), any(value == -inf for value in values))
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
    if scale.log:
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


def cut(label: str) -> str:
    """Return a label that leaves room for the data: one line, the end of a long one left out.

    Examples
    --------
    >>> cut("maxq-0"), len(cut("a very long label " * 10))
    ('maxq-0', 36)
    """
    line = " ".join(label.split())
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST - 1]}\N{HORIZONTAL ELLIPSIS}"


def grid_lines(axes: Axes, which: Any) -> None:
    """Draw pale lines behind the data."""
    axes.grid(visible=True, axis=which, color=PALE, linewidth=0.6)
    axes.set_axisbelow(True)


def legend_above(figure: Figure) -> None:
    """Put one legend of all that has a label above the panels, if there is more than one thing to tell.

    The figure grows by what rows the legend has besides the first, so that panels keep their size.
    """
    found = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if len(found) < 2:
        return
    room = 15.0 * figure.get_figwidth()  # so many letters fit beside each other, roughly
    widths = sorted((len(cut(label)) + 4.5 for label in found), reverse=True)
    columns = max(n for n in range(1, len(found) + 1) if n == 1 or sum(widths[:n]) <= room)
    more = -(-len(found) // columns) - 1
    figure.set_figheight(figure.get_figheight() + _LEGEND_ROW * more)
    figure.legend(
        list(found.values()),
        [cut(label) for label in found],
        loc="outside upper center",
        ncols=columns,
        columnspacing=1.2,
        handlelength=1.8,
        labelcolor=INK,
    )


def save_three(figure: Figure, directory: Path, name: str) -> Picture:
    """Write ``name.svg``, ``name.pdf`` and ``name.png`` into a folder; return what the report shows.

    The same figure gives the same bytes.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     drawn = save_three(Figure((1, 1)), Path(folder), "empty")
    ...     sorted(path.name for path in Path(folder).iterdir())
    ['empty.pdf', 'empty.png', 'empty.svg']
    """
    drawn = picture(figure)
    drawn.save(directory, name)
    pdf = BytesIO()
    # Journals refuse Type 3 fonts; and a date would make each file another one.
    with house_style(), rc_context({"pdf.fonttype": 42}):
        figure.savefig(pdf, format="pdf", metadata=dict.fromkeys(("Creator", "Producer", "CreationDate")))
    (directory / f"{name}.pdf").write_bytes(pdf.getvalue())
    return drawn
