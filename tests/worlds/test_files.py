"""Files are read with care, and replaced whole."""

import errno
import os
from pathlib import Path

import pytest

from worlds import UserError
from worlds.files import UNFINISHED, read_bytes, replace_file, replace_files


def test_a_file_may_be_as_long_as_said(tmp_path: Path) -> None:
    """And not a byte longer."""
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_bytes(path, 5, "missing") == b"12345"
    with pytest.raises(UserError, match="a: the file is larger than 4 bytes; is it the one that was meant"):
        read_bytes(path, 4, "missing")


def test_what_is_no_file_is_named(tmp_path: Path) -> None:
    """A pipe is not waited for."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    for name, message in {
        ".": "this is a folder; name a file in it",
        "none": "missing",
        "pipe": "this is no ordinary file; copy what it holds into one",
        "loop": "missing|cannot be read",
    }.items():
        with pytest.raises(UserError, match=message):
            read_bytes(tmp_path / name, 5, "missing")


def test_a_folder_is_made_for_new_files(tmp_path: Path) -> None:
    """And nothing unfinished is left in it."""
    folder = tmp_path / "a" / "b"
    replace_files({folder / "x": b"1", folder / "y": b"2"})
    replace_files({folder / "x": b"3"})
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {"x": b"3", "y": b"2"}


def test_a_full_disk_leaves_a_file_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is unfinished when flushing fails is taken away, and was under a name of its own."""
    path = tmp_path / "x"
    replace_file(path, b"old")
    seen: list[str] = []

    def full(_: int) -> None:
        seen.extend(found.name for found in tmp_path.glob(UNFINISHED))
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(UserError, match="x: it cannot be written \\(No space left on device\\)"):
        replace_files({path: b"new"})
    assert len(seen) == 1
    assert [(found.name, found.read_bytes()) for found in tmp_path.iterdir()] == [("x", b"old")]
