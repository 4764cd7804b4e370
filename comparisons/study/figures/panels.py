"""What figures are made of: panels of a paper's widths with titles, levels' marks, labels and a legend."""

from __future__ import annotations

import re
import textwrap
from collections import Counter
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
    grid_of,
    panel,
)

ONE_COLUMN: Final = 3.3
"""Inches of a paper's column."""
TWO_COLUMNS: Final = 6.9
"""Inches of both, and of what is between them."""
_PALETTE: Final = (BLUE, VERMILION, GREEN, PLUM, ORANGE, SKY)
_MARKERS: Final = "osD^vP"
_DASHES: Final[tuple[Any, ...]] = ("-", (0, (4, 1.6)), (0, (1.2, 1.2)))
_LONGEST: Final = 36  # letters of a label
_LETTERS: Final = 13.5  # of a title that fit beside each other on an inch, roughly
_LEGEND_ROW: Final = 0.19  # inches
_BLANKS: Final = re.compile(r"[\t-\r ]+")  # which a no-break space is not


class Mark(NamedTuple):
    """How a level looks: told by its marker and dashes as well as by its colour.

    Parameters
    ----------
    colour, marker, dashes
        As matplotlib names them.
    place
        Where on a curve its first marker stands, so that markers of curves that run together do not.
    """

    colour: str
    marker: str
    dashes: Any
    place: float

    @property
    def look(self) -> Look:
        """As properties of a line."""
        return {"color": self.colour, "linestyle": self.dashes}

    @property
    def curve(self) -> Look:
        """As properties of a line of many points: without colour, its sparse markers tell it."""
        return {**self.look, "marker": self.marker, "markersize": 3.4, "markevery": (self.place, 0.3)}


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
        label: Mark(_PALETTE[i % turns], _MARKERS[i % turns], _DASHES[i // turns % len(_DASHES)], 0.05 * i)
        for i, label in enumerate(labels)
    }


def figure_of_panels(count: int, heights: tuple[float, float]) -> tuple[Figure, list[Axes], int]:
    """Return a figure with so many panels, its axes, and how many stand in a row.

    Parameters
    ----------
    count
        Of panels; at least one.
    heights
        Of a panel, in inches: where up to two stand in a row, and where three do.
    """
    rows, columns = grid_of(count, 3 if count > 4 or count == 3 else 2)
    width = ONE_COLUMN if columns == 1 else TWO_COLUMNS
    figure = Figure((width, 0.35 + rows * heights[columns == 3]), layout="constrained")
    return figure, [figure.add_subplot(rows, columns, i + 1) for i in range(count)], columns


def entitle(axes: Axes, i: int, count: int, title: str, inches: float) -> None:
    """Give panel `i` of `count` its title, with its letter if there are several, on lines of its width."""
    if not title and count == 1:
        return
    letters = int(_LETTERS * inches)
    words = panel(i, cut(title, 2 * letters - 10)) if count > 1 else cut(title, 2 * letters - 10)
    axes.set_title(textwrap.fill(words.rstrip(), letters), loc="left")


def cut(label: str, most: int = _LONGEST) -> str:
    """Return a label that leaves room for the data: one line, the middle of a long one left out.

    Examples
    --------
    >>> cut("maxq-0"), cut("a label of which only the last letter differs: B", 20)
    ('maxq-0', 'a label o…differs: B')
    """
    line = _BLANKS.sub(" ", label).strip()
    if len(line) <= most:
        return line
    head = (most - 1) // 2
    return f"{line[:head]}\N{HORIZONTAL ELLIPSIS}{line[head + 1 - most :]}"


def cut_apart(labels: Sequence[str]) -> dict[str, str]:
    """Return labels cut, those with a number that would be alike.

    Examples
    --------
    >>> long = [f"{'a' * 30} {letter} {'z' * 30}" for letter in "bc"]
    >>> [words[:5] for words in cut_apart([*long, "short"]).values()]
    ['1: aa', '2: aa', 'short']
    """
    words = {label: cut(label) for label in labels}
    count = Counter(words.values())
    return {
        label: short if count[short] == 1 else f"{i}: {cut(label, _LONGEST - 4)}"
        for i, (label, short) in enumerate(words.items(), start=1)
    }


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
    labels = list(cut_apart(list(found)).values())
    room = 15.0 * figure.get_figwidth()  # so many letters fit beside each other, roughly
    widths = sorted((len(label) + 4.5 for label in labels), reverse=True)
    columns = max(n for n in range(1, len(found) + 1) if n == 1 or sum(widths[:n]) <= room)
    more = -(-len(found) // columns) - 1
    figure.set_figheight(figure.get_figheight() + _LEGEND_ROW * more)
    figure.legend(
        list(found.values()),
        labels,
        loc="outside upper center",
        ncols=columns,
        columnspacing=1.2,
        handlelength=1.8,
        labelcolor=INK,
    )
