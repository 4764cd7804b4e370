"""Directories that commands make: complete or not at all, and what stood there before."""

from pathlib import Path

import pytest

from comparisons.outputs import new_directory
from worlds import UserError


def test_a_directory_takes_the_place_of_another(tmp_path: Path) -> None:
    """The new one has its own files only; nothing is left aside, and a link is replaced, not followed."""
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "old").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    for name in ("real", "link", "fresh"):
        with new_directory(tmp_path / name, replace=True) as made:
            (made / "new").write_text(name)
        assert [path.name for path in (tmp_path / name).iterdir()] == ["new"]
        assert (tmp_path / name / "new").read_text() == name
    assert (tmp_path / "real" / "new").read_text() == "real"
    assert {path.name for path in tmp_path.iterdir()} == {"real", "link", "fresh"}


@pytest.mark.parametrize("when", ["while it is made", "while it is moved"])
def test_what_stood_there_stays_if_anything_fails(
    when: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A failure, early or at the last step, leaves the old directory as it was and nothing beside it."""
    out = tmp_path / "report"
    out.mkdir()
    (out / "old").write_text("old")
    move = Path.rename

    def full(path: Path, target: Path) -> Path:
        if path.parent == tmp_path and target == out:
            raise OSError(28, "No space left on device")
        return move(path, target)

    if when == "while it is moved":
        monkeypatch.setattr(Path, "rename", full)

    def make() -> None:
        with new_directory(out, replace=True) as made:
            (made / "new").write_text("new")
            if when == "while it is made":
                raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        make()
    assert [path.read_text() for path in out.iterdir()] == ["old"]
    assert [path.name for path in tmp_path.iterdir()] == ["report"]


def test_an_existing_directory_is_refused(tmp_path: Path) -> None:
    """Without being told to replace it, what is there is never touched."""
    with pytest.raises(UserError, match="it exists already"), new_directory(tmp_path):
        pass
