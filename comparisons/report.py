"""A study's report: one HTML file that opens offline, figures, frames and replay inside it."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure
from numpy.typing import NDArray

from comparisons.outputs import Track
from comparisons.style import Picture, picture

_NUMBER: Final = re.compile(r"[-+\N{MINUS SIGN}]?\d[\d,.]*( ?(%|s|ms))?( of \d+| ?/ ?\d+)?")
_NOTHING: Final = "\N{EN DASH}"
_PIXELS: Final = 115  # CSS pixels an inch of figure: its smallest letters read as well as the text around it


@dataclass(frozen=True)
class Verdict:
    """Whether something holds, and that in words: shown with a tick or a cross."""

    holds: bool
    words: str


Value = str | int | float | bool | Verdict | None
"""What a table's cell or the summary shows; None is shown as a dash, a bool as a verdict."""


@dataclass(frozen=True)
class Table:
    """A table; columns of numbers are aligned on the right.

    Raises
    ------
    ValueError
        If a row is not as long as the header.
    """

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[Value, ...], ...]

    def __post_init__(self) -> None:
        for i, row in enumerate(self.rows):
            if len(row) != len(self.header):
                raise ValueError(
                    f"table {self.caption!r}: row {i} has {len(row)} cells, the header {len(self.header)}"
                )


@dataclass(frozen=True)
class Section:
    """A part of a report: plain paragraphs, then figures by (name, caption), then tables."""

    title: str
    paragraphs: tuple[str, ...] = ()
    figures: tuple[tuple[str, str], ...] = ()
    tables: tuple[Table, ...] = ()


@dataclass(frozen=True, eq=False)
class ReplayFrame:
    """One step of a replay.

    Parameters
    ----------
    overview
        The maze from above, uint8 RGB, shape (H, W, 3).
    view
        What the robot's camera sees, the same format, or None.
    caption
        Lines below the pictures.
    """

    overview: NDArray[np.uint8]
    view: NDArray[np.uint8] | None = None
    caption: tuple[str, ...] = ()


@dataclass(frozen=True)
class Replay:
    """A run to be played step by step."""

    frames: tuple[ReplayFrame, ...]
    title: str = "Replay"


@dataclass(frozen=True)
class Report:
    """All that a report holds.

    Parameters
    ----------
    title
        Its heading.
    summary
        What matters most, each as label, value and note.
    sections
        The parts, in order.
    replay
        A run to play, shown after the summary.
    lead
        A sentence or two below the heading.
    """

    title: str
    summary: tuple[tuple[str, Value, str], ...] = ()
    sections: tuple[Section, ...] = ()
    replay: Replay | None = None
    lead: str = ""


def render(report: Report, pictures: Mapping[str, Picture]) -> str:
    """Return a report as one HTML page that needs nothing but itself; the same input gives the same text.

    Parameters
    ----------
    report
        What to show. Its texts are plain: markup in them is shown, not followed.
    pictures
        The figures that its sections name, drawn.

    Raises
    ------
    ValueError
        If a section names a figure that is not given, or a frame of the replay is no uint8 RGB image.

    Examples
    --------
    >>> page = render(Report("Maze & robot", sections=(Section("Results", ("All < 3.",)),)), {})
    >>> "<h1>Maze &amp; robot</h1>" in page, "All &lt; 3." in page
    (True, True)
    """
    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined
    )
    source = files("comparisons").joinpath("templates", "report.html.j2").read_text(encoding="utf-8")
    sections = _sections(report.sections, pictures)
    page = environment.from_string(source).render(
        title=report.title,
        lead=report.lead,
        summary=[(label, _cell(value), note) for label, value, note in report.summary],
        sections=sections,
        replay=None if report.replay is None else _replay(report.replay),
    )
    return page.rstrip() + "\n"


def write_report(report: Report, figures: Mapping[str, Figure], directory: Path, track: Track) -> None:
    """Write a report into an existing folder: ``report.html``, and each figure as PNG and SVG in ``figures``.

    Parameters
    ----------
    report
        What to write.
    figures
        The figures that its sections name; each is drawn once.
    directory
        Where; it has no ``figures`` yet.
    track
        Shows progress.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from comparisons.outputs import untracked
    >>> with TemporaryDirectory() as folder:
    ...     write_report(Report("Maze"), {"blank": Figure((1, 1))}, Path(folder), untracked)
    ...     sorted(path.name for path in Path(folder).rglob("*.*"))
    ['blank.png', 'blank.svg', 'report.html']
    """
    (directory / "figures").mkdir()
    pictures = {}
    for name in track(figures, total=len(figures), description="drawing figures"):
        pictures[name] = picture(figures[name])
        pictures[name].save(directory / "figures", name)
    (directory / "report.html").write_text(render(report, pictures), encoding="utf-8")


def _sections(sections: Sequence[Section], pictures: Mapping[str, Picture]) -> list[dict[str, Any]]:
    """Return what the template needs of each section; figures and tables are numbered throughout."""
    out: list[dict[str, Any]] = []
    figure_number = table_number = 0
    for i, section in enumerate(sections, start=1):
        shown = []
        for name, caption in section.figures:
            if name not in pictures:
                known = ", ".join(pictures) or "none"
                raise ValueError(
                    f"section {section.title!r} names the figure {name!r}, which is not given ({known})"
                )
            figure_number += 1
            drawn = inline_picture(pictures[name], f"f{figure_number}", caption)
            shown.append({"number": figure_number, "caption": caption, "picture": drawn})
        tables = []
        for table in section.tables:
            table_number += 1
            tables.append({"number": table_number, **_table(table)})
        slug = re.sub(r"[^a-z0-9]+", "-", section.title.lower()).strip("-")
        out.append(
            {
                "id": f"{i}-{slug}",
                "title": section.title,
                "paragraphs": section.paragraphs,
                "figures": shown,
                "tables": tables,
            }
        )
    return out


def _table(table: Table) -> dict[str, Any]:
    """Return a table's cells as the template shows them, and which columns hold numbers."""
    rows = [[_cell(value) for value in row] for row in table.rows]
    numeric = [
        any(row[i]["number"] for row in rows)
        and all(row[i]["number"] or row[i]["text"] in ("", _NOTHING) for row in rows)
        for i in range(len(table.header))
    ]
    return {"caption": table.caption, "header": table.header, "rows": rows, "numeric": numeric}


def _cell(value: Value) -> dict[str, Any]:
    """Return a value's text, whether it is a number, and its verdict ("yes", "no" or "")."""
    match value:
        case bool():
            return _cell(Verdict(value, "yes" if value else "no"))
        case Verdict(holds, words):
            return {"text": words, "number": False, "verdict": "yes" if holds else "no"}
        case None:
            return {"text": _NOTHING, "number": False, "verdict": ""}
        case float():
            return {"text": f"{value:.4g}", "number": True, "verdict": ""}
        case _:
            text = str(value)
            return {"text": text, "number": _NUMBER.fullmatch(text) is not None, "verdict": ""}


def inline_picture(drawn: Picture, prefix: str, caption: str) -> Markup:
    """Return a figure as inline SVG or as a PNG in an `img`, whichever is shorter."""
    width = round(_PIXELS * drawn.width)
    svg = _inline_svg(drawn.svg, prefix, caption, width)
    png = Markup('<img alt="{}" width="{}" src="{}">').format(caption, width, _data_url(drawn.png))
    return min(svg, png, key=len)


def _inline_svg(svg: str, prefix: str, caption: str, width: int) -> Markup:
    """Return an SVG file's text fit to stand in a page, its ids made unique by `prefix`."""
    svg = re.sub(r"<!--.*?-->\s*", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    used = set(re.findall(r'(?:url\(#|href="#)([^")]+)', svg))
    svg = re.sub(r' id="([^"]+)"', lambda match: match[0] if match[1] in used else "", svg)
    svg = re.sub(r'( id="|url\(#|href="#)', rf"\g<1>{prefix}-", svg)
    svg = re.sub(r' (width|height)="[^"]*"', "", svg, count=2)  # the view box keeps the proportions
    label = escape(caption)
    # matplotlib wrote this markup from our figure and escaped its texts; the caption is escaped here.
    return Markup(svg.replace("<svg", f'<svg role="img" aria-label="{label}" width="{width}"', 1).strip())  # noqa: S704


def _replay(replay: Replay) -> dict[str, Any]:
    """Return a replay as the page's player reads it; a picture that comes twice is stored once."""
    places: dict[str, int] = {}
    steps = []
    for frame in replay.frames:
        overview = places.setdefault(_image_url(frame.overview), len(places))
        view = None if frame.view is None else places.setdefault(_image_url(frame.view), len(places))
        steps.append({"overview": overview, "view": view, "caption": list(frame.caption)})
    return {"title": replay.title, "data": {"images": list(places), "steps": steps}}


def _image_url(image: NDArray[np.uint8]) -> str:
    """Return an RGB image as a PNG data URL."""
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise ValueError(f"a replay needs uint8 images of shape (H, W, 3), not {image.dtype} {image.shape}")
    bgr = np.ascontiguousarray(image[..., ::-1])
    done, png = cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert done, "cv2 encodes any uint8 image of three channels"
    return _data_url(png.tobytes())


def _data_url(png: bytes) -> str:
    return "data:image/png;base64," + b64encode(png).decode("ascii")
