"""The three files that every figure of a study is saved as."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Final

from matplotlib import rc_context
from matplotlib.figure import Figure

from comparisons.style import Picture, house_style, picture

FORMATS: Final = ("svg", "pdf", "png")
"""Files of each figure."""


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
