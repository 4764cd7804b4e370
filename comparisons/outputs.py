"""Where commands leave what they made: new folders that appear complete or not at all, and progress."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from worlds.errors import UserError

T = TypeVar("T")


class Track(Protocol):
    """Shows progress over items, such as `rich.progress.Progress.track`."""

    def __call__(self, items: Iterable[T], *, total: int, description: str) -> Iterable[T]:
        """Yield the items, counting them."""


def untracked(items: Iterable[T], *, total: int, description: str) -> Iterable[T]:
    """Yield the items and show nothing: a `Track` for tests and scripts.

    Examples
    --------
    >>> list(untracked("ab", total=2, description="letters"))
    ['a', 'b']
    """
    assert description, f"{total} items of what?"
    return items


def refuse_existing(out: Path) -> None:
    """Raise a `UserError` if there is anything at `out`."""
    if out.exists() or out.is_symlink():
        raise UserError(f"--out {out}: it exists already; name a new directory, or remove this one")


@contextmanager
def new_directory(out: Path, *, replace: bool = False) -> Iterator[Path]:
    """Yield a directory that takes the name `out` if all goes well, and vanishes if not.

    Parameters
    ----------
    out
        The name.
    replace
        Whether it takes the place of what has that name; it stays what it was until then.

    Raises
    ------
    UserError
        If `out` exists and is not to be replaced, or cannot be made.
    """
    if not replace:
        refuse_existing(out)
    try:
        parent = out.absolute().parent
        parent.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=parent))
    except OSError as error:
        raise UserError(f"--out {out}: it cannot be made ({error.strerror}); name another place") from error
    try:
        yield made
        made.chmod(0o755)
        if replace and (out.exists() or out.is_symlink()):
            _exchange(made, out)
        else:
            refuse_existing(out)
            made.rename(out)
    finally:
        shutil.rmtree(made, ignore_errors=True)


def _exchange(made: Path, out: Path) -> None:
    """Move a directory to where another one is, which is removed; it comes back if that fails."""
    aside = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=made.parent))
    try:
        out.rename(aside / "before")
        try:
            made.rename(out)
        except BaseException:
            (aside / "before").rename(out)
            raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def write_json(path: Path, content: Any) -> None:
    """Write plain data as indented JSON; a number that is none is refused."""
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    path.write_text(text, encoding="utf-8")


def progress_on(console: Console) -> Progress:
    """Return progress bars as every command shows them."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=console)


def track_with(progress: Progress) -> Track:
    """Return a `Track` that shows its items on a progress display."""

    def track(items: Iterable[T], *, total: int, description: str) -> Iterable[T]:
        return progress.track(items, total=total, description=description)

    return track
