"""Files of plain data that know whether they are whole."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from worlds import UserError

FORMAT: Final = 1
"""Of the files that are written. The way of the checksum stays, so that a newer format is known as such."""
Content = dict[str, Any]
# What makes the content of an older format into that of the next; there is none yet.
_RENEWED: Final[Mapping[int, Callable[[Content], Content]]] = {}


class DamagedError(UserError):
    """A file does not say what was once written to it."""

    def __init__(self, path: Path, problem: str) -> None:
        super().__init__(
            f"{path}: this file is damaged: {problem}; `affordant study resume` moves it aside and does the "
            "run again"
        )
        self.path = path
        self.problem = problem


def record(content: Mapping[str, Any]) -> bytes:
    """Return a file's bytes: a line of JSON with the format, the SHA-256 of all the rest, and the content.

    Keys stay in their order, for a table's first column is its abscissa.

    Examples
    --------
    >>> record({"b": 1, "a": 2}).decode().strip()
    '{"format":1,"sha256":"...","b":1,"a":2}'
    """
    return _line({"format": FORMAT, **content})


def _line(rest: Mapping[str, Any]) -> bytes:
    """Return the line of a format and a content, with the SHA-256 of their JSON between the two."""
    form, *others = rest
    whole = {form: rest[form], "sha256": hashlib.sha256(_json(rest)).hexdigest()}
    return _json({**whole, **{name: rest[name] for name in others}}) + b"\n"


def _json(data: Mapping[str, Any]) -> bytes:
    return json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def read_record(path: Path) -> Content:
    """Return what a file that `record` gave the bytes of says.

    Raises
    ------
    DamagedError
        If even one byte is another.
    UserError
        If there is no such file, it cannot be read, or a newer affordant wrote it.
    """
    try:
        text = path.read_bytes()
    except FileNotFoundError as error:
        raise UserError(
            f"{path}: there is no such run; `affordant study status` tells which there are"
        ) from error
    except OSError as error:
        raise UserError(f"{path}: it cannot be read ({error.strerror}); check its rights") from error
    return checked_record(text, path)


def checked_record(text: bytes, path: Path) -> Content:
    """Return what a record's bytes say; see `read_record`."""
    if not text:
        raise DamagedError(path, "it is empty")
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DamagedError(path, f"it is no JSON ({error})") from error
    if (
        not isinstance(data, dict)
        or list(data)[:2] != ["format", "sha256"]
        or type(data["format"]) is not int
    ):
        raise DamagedError(path, "it is none of the store's")
    del data["sha256"]
    try:
        # Byte for byte: what reads the same, such as 1E5 for 1e5, was still not written like this.
        whole = _line(data) == text
    except (ValueError, RecursionError):
        whole = False
    if not whole:
        raise DamagedError(path, "its checksum is wrong")
    return _renewed(data, path)


def _renewed(data: Content, path: Path) -> Content:
    """Return a whole file's content in today's format."""
    form = data.pop("format")
    if form > FORMAT:
        raise UserError(f"{path}: it is of format {form}; this affordant reads format {FORMAT}: update it")
    while form < FORMAT:
        if form not in _RENEWED:
            raise UserError(f"{path}: it is of format {form}, which no affordant has ever written")
        data, form = _RENEWED[form](data), form + 1
    return data
