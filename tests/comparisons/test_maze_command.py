"""`affordant maze`: what it prints and writes."""

from pathlib import Path

import pytest
from command_line import affordant

from worlds import load_layout, parse_layout
from worlds.generate import generate_layout

SIZE = ("--rows", "6", "--cols", "8")


def run(capsys: pytest.CaptureFixture[str], *tokens: str) -> tuple[int, str, str]:
    """Run the command; return its exit status and what it printed."""
    return affordant(capsys, "maze", *tokens)


def test_a_maze_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    """The text is the layout's of the same arguments."""
    code, out, _ = run(capsys, *SIZE, "--seed", "5", "--rooms", "2", "3", "--goals", "2")
    assert code == 0
    assert parse_layout(out) == generate_layout(6, 8, 5, rooms=(2, 3), goals=2)


def test_a_maze_is_written_once(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The file is read as a layout; it is never replaced."""
    path = tmp_path / "mine.maze"
    assert run(capsys, *SIZE, "--out", str(path))[:2] == (0, f"{path}\n")
    assert load_layout(path) == generate_layout(6, 8, 0)
    code, _, message = run(capsys, *SIZE, "--seed", "1", "--out", str(path))
    assert code == 2
    assert message == f"affordant: --out {path}: it exists already; name another file, or remove it\n"
    assert load_layout(path) == generate_layout(6, 8, 0)


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (("--doors", "7"), "7 doors do not fit in a maze of 6 x 8 cells"),
        (("--out", "nowhere/at/all.maze"), "--out nowhere/at/all.maze: it cannot be written"),
        (("--room", "2", "2"), "--rooms"),
    ],
)
def test_a_mistake_is_one_message(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    tokens: tuple[str, ...],
    message: str,
) -> None:
    """Status 2, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *SIZE, *tokens)
    assert (code, out) == (2, "")
    assert message in err
    assert list(tmp_path.iterdir()) == []
