"""One look for every figure, and files of them that come out the same byte for byte."""

from __future__ import annotations

import string
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from io import BytesIO
from pathlib import Path
from typing import Any, Final, ParamSpec

from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font

P = ParamSpec("P")
Look = dict[str, Any]
"""Properties of something drawn, as matplotlib names them."""

# Okabe and Ito's palette: told apart with any common colour blindness.
BLUE: Final = "#0072B2"
SKY: Final = "#56B4E9"
GREEN: Final = "#009E73"
ORANGE: Final = "#E69F00"
VERMILION: Final = "#D55E00"
PURPLE: Final = "#CC79A7"
PLUM: Final = "#AA3377"  # for lines, where PURPLE is too pale
RED: Final = "#C4161C"
INK: Final = "#1F2933"
GREY: Final = "#6B7785"
PALE: Final = "#D5DCE3"
FLOOR: Final = "#DCEAF7"

PNG_DPI: Final = 200
"""Dots an inch of every PNG."""

_FONT: Final = "DejaVu Sans"  # matplotlib brings it: the same letters on every machine
_SETTINGS: Final[Look] = {
    "axes.edgecolor": GREY,
    "axes.grid": False,
    "axes.labelcolor": INK,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9,
    "figure.constrained_layout.h_pad": 0.07,
    "figure.facecolor": "white",
    "font.family": [_FONT],
    "font.size": 8.5,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "svg.fonttype": "path",  # a reader without the font sees the same picture
    "svg.hashsalt": "affordant",  # ids in an SVG are random without it
    "text.color": INK,
    "text.parse_math": False,  # labels are plain text
    "xtick.color": GREY,
    "xtick.labelsize": 8,
    "ytick.color": GREY,
    "ytick.labelsize": 8,
}


@contextmanager
def house_style() -> Iterator[None]:
    """Make matplotlib draw in our style, whatever the user's own settings are."""
    with warnings.catch_warnings(), style.context(["default", _SETTINGS]):
        # A box stands for a letter that the font has not; reports say so once (`letters_missing`).
        warnings.filterwarnings("ignore", "Glyph .* missing from font", UserWarning)
        yield


def letters_missing(text: str) -> str:
    """Return the letters of a text that figures cannot show, each once.

    Examples
    --------
    >>> letters_missing("na\u00efve \u03b3 \u5b66\u7fd2 \u5b66")
    '\u5b66\u7fd2'
    """
    font = get_font(findfont(_FONT))
    return "".join(
        dict.fromkeys(sign for sign in text if not (sign.isspace() or font.get_char_index(ord(sign))))
    )


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Make a drawing function use our style, and fix its layout once it has drawn."""

    @wraps(draw)
    def in_style(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with house_style():
            figure = draw(*args, **kwargs)
            # A layout engine moves the axes a little at every drawing: files would differ from each other.
            figure.draw_without_rendering()
            figure.set_layout_engine("none")
        return figure

    return in_style


def panel(i: int, title: str) -> str:
    """Return a panel's title with its letter.

    >>> panel(1, "GotoDoor")
    '(b) GotoDoor'
    """
    return f"({string.ascii_lowercase[i]}) {title}"


def grid_of(count: int, most_columns: int) -> tuple[int, int]:
    """Return the rows and columns that `count` panels take.

    Raises
    ------
    ValueError
        If there is no panel to draw.

    Examples
    --------
    >>> grid_of(5, 3)
    (2, 3)
    """
    if not count:
        raise ValueError("there is nothing to draw: give at least one panel's data")
    columns = min(count, most_columns)
    return -(-count // columns), columns


@dataclass(frozen=True)
class Picture:
    """A figure drawn once: as SVG text, as a PNG file's bytes, and its width in inches."""

    svg: str
    png: bytes
    width: float

    def save(self, directory: Path, name: str) -> tuple[Path, Path]:
        """Write ``name.png`` and ``name.svg`` into an existing folder; return the two paths."""
        png, svg = directory / f"{name}.png", directory / f"{name}.svg"
        png.write_bytes(self.png)
        svg.write_text(self.svg, encoding="utf-8", newline="\n")
        return png, svg


def picture(figure: Figure) -> Picture:
    """Draw a figure; the same figure gives the same bytes, whatever matplotlib is set to.

    Examples
    --------
    >>> drawn = picture(Figure((1, 1)))
    >>> drawn.svg.startswith("<?xml"), drawn.png[1:4], drawn.width
    (True, b'PNG', 1.0)
    """
    svg, png = BytesIO(), BytesIO()
    with house_style():
        empty = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure.savefig(svg, format="svg", metadata=empty)
        figure.savefig(png, format="png", dpi=PNG_DPI, metadata={"Software": None})
    return Picture(svg.getvalue().decode("utf-8"), png.getvalue(), float(figure.get_figwidth()))


def save_figure(figure: Figure, directory: Path, name: str) -> tuple[Path, Path]:
    """Draw a figure and write it as ``name.png`` and ``name.svg``; return the two paths.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     [path.name for path in save_figure(Figure((1, 1)), Path(folder), "empty")]
    ['empty.png', 'empty.svg']
    """
    return picture(figure).save(directory, name)
