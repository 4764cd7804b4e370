"""One driver at a time: whoever runs a study holds its store meanwhile."""

from __future__ import annotations

import fcntl
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from worlds import UserError

_LOCK: Final = ".lock"


@contextmanager
def held(directory: Path) -> Iterator[None]:
    """Hold a store; the kernel lets go of it with the process, however that ends.

    Parameters
    ----------
    directory
        The store's folder.

    Raises
    ------
    UserError
        If another process holds it, or the lock's file cannot be written.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder, held(Path(folder)):
    ...     with held(Path(folder)):
    ...         pass
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: ...: another affordant runs this study (process ... on ...); wait for its end
    """
    path = directory / _LOCK
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise UserError(f"{path}: it cannot be written ({error.strerror}); check the folder") from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            holder = os.read(descriptor, 500).decode(errors="replace") or "it has not said which"
            raise UserError(
                f"{directory}: another affordant runs this study ({holder}); wait for its end"
            ) from error
        except OSError as error:
            raise UserError(
                f"{directory}: this file system knows no locks ({error.strerror}); run the study on another"
            ) from error
        # Said for the message above; on a full disk the lock holds without it.
        _say(descriptor, f"process {os.getpid()} on {platform.node()}")
        yield
    finally:
        os.close(descriptor)


def _say(descriptor: int, text: str) -> None:
    try:
        os.ftruncate(descriptor, 0)
        os.write(descriptor, text.encode())
    except OSError:
        return
