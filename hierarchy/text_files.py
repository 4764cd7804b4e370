"""Reading a text from its file, or saying what keeps it from being read."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from hierarchy.text_nodes import LARGEST
from worlds import UserError
from worlds.files import read_bytes

_MARKS: Final = {b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16", b"\x89PNG": "a picture"}
"""How files begin that are no UTF-8 text, and what they are."""
_MOST: Final = 4 * LARGEST  # bytes that the characters of a document may take


def file_text(path: Path, missing: str) -> str:
    """Return the text of a UTF-8 file, with or without a byte order mark.

    Parameters
    ----------
    path
        The file.
    missing
        What to say where there is none: the problem and a mend.

    Raises
    ------
    UserError
        If it is not there, no file, too large, or no such text; the message says where, and how to mend it.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "mine.yaml")
    ...     _ = path.write_text("graph: mine", encoding="utf-8-sig")
    ...     file_text(path, "there is no such file; write one")
    'graph: mine'
    """
    content = read_bytes(path, _MOST, missing)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        kind = next((what for mark, what in _MARKS.items() if content.startswith(mark)), "")
        told = f" (it looks like {kind})" if kind else ""
        problem = f"byte 0x{content[error.start]:02x} cannot be read as UTF-8 text{told}"
        raise UserError(f"{path}, line {line}: {problem}; save it as UTF-8, or name another file") from error
