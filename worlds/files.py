"""Files written whole or not at all, and read no further than they may be long."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from worlds.errors import UserError

UNFINISHED: Final = ".*.new"
"""Pattern of the names of files that are not yet in place."""


def read_bytes(path: Path, most: int, missing: str) -> bytes:
    """Return what an ordinary file holds.

    Parameters
    ----------
    path
        The file.
    most
        Bytes that it may have.
    missing
        What to say where there is none: the problem and a mend.

    Raises
    ------
    UserError
        If it is not there, no ordinary file, too large, or cannot be read.

    Examples
    --------
    >>> read_bytes(Path("none.maze"), 100, "there is no such file; write one")
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: none.maze: there is no such file; write one
    """
    try:
        if path.is_dir():
            raise UserError(f"{path}: this is a folder; name a file in it")
        if not path.exists():
            raise UserError(f"{path}: {missing}")
        if not path.is_file():
            raise UserError(f"{path}: this is no ordinary file; copy what it holds into one")
        with path.open("rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise UserError(
            f"{path}: it cannot be read ({error.strerror}); check the path and its rights"
        ) from error
    if len(content) > most:
        raise UserError(f"{path}: the file is larger than {most} bytes; is it the one that was meant?")
    return content


def replace_file(path: Path, content: bytes) -> None:
    """Write a file beside and move it into place, so that no reader ever sees half of it."""
    new = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        with new.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    finally:
        with suppress(FileNotFoundError):
            new.unlink()


def replace_files(contents: Mapping[Path, bytes]) -> None:
    """Write files of one folder, one after the other; the folder is made if it is missing.

    Raises
    ------
    UserError
        If nothing can be written there; a file is then as it was before.
    """
    for path, content in contents.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(path, content)
        except OSError as error:
            raise UserError(
                f"{path}: it cannot be written ({error.strerror}); name another folder"
            ) from error
