"""The command line: what a user's mistake looks like, and that nothing is left behind."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from os import getpid, kill
from pathlib import Path

import pytest
from command_line import affordant

from comparisons import maze_command

HEAVY = {"torch", "torchrl", "numba", "pybullet", "cv2", "matplotlib", "scipy"}
MAZE = """\
name small
grid
.  T1 .  |  .  .
.  .  .  :  D1 G1
.  .  .  |  .  .
start 2,0
trigger T1
goal G1
"""


def fail(capsys: pytest.CaptureFixture[str], *tokens: str) -> str:
    """Run a command that must end with status 2 and one message, and return the message."""
    status, out, err = affordant(capsys, *tokens)
    assert (status, out) == (2, "")
    assert err.startswith("affordant: ")
    return err


def spoil(old: str, new: str) -> str:
    """Return the small maze with one thing wrong."""
    assert old in MAZE
    return MAZE.replace(old, new, 1)


def test_an_existing_out_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A directory that is there is never written to, empty or not."""
    message = fail(capsys, "reproduce", "--out", str(tmp_path))
    assert f"--out {tmp_path}: it exists already" in message
    assert list(tmp_path.iterdir()) == []


def test_an_out_that_cannot_be_made_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A file in the way of the directory is named as the reason."""
    (tmp_path / "file").write_text("mine")
    message = fail(capsys, "reproduce", "--out", str(tmp_path / "file" / "out"))
    assert "it cannot be made" in message
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize(
    ("tokens", "expected"),
    [
        (("reproduce", "--sed", "3", "--out", "x"), "Did you mean --seed"),
        (("reproduc", "--out", "x"), 'Did you mean "reproduce"'),
        (("reproduce", "--seed", "many", "--out", "x"), "many"),
        (("reproduce",), "--out"),
        (("reproduce", "--out", "x", "--perception", "hugh"), "did you mean 'hough'?"),
        (("reproduce", "--out", "x", "--layout", "two_room"), "did you mean 'two_rooms'?"),
    ],
)
def test_unknown_words_get_a_suggestion(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    tokens: tuple[str, ...],
    expected: str,
) -> None:
    """Options, commands, backends and layouts that there are not name what was probably meant."""
    monkeypatch.chdir(tmp_path)
    assert expected in fail(capsys, *tokens)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (spoil("T1", "."), "line 2: missing mark: no trigger in the grid"),
        (spoil(".  .  .  |  .  .\nstart", ".  .  T1 |  .  .\nstart"), "line 5: doubled mark T1"),
        (spoil(".  .  .  |", ".  .  |"), "line 5: ragged rows"),
        (spoil(":", "|"), "line 4: D1 is not beside a door"),
        (spoil("start 2,0", "start 2,4"), "unreachable: T1"),
        (MAZE + "obstacles\nQ1 cupe 0,0 small #112233 at start\n", "unknown obstacle kind 'cupe'"),
    ],
)
def test_a_wrong_layout_is_named_by_file_and_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, expected: str
) -> None:
    """The message names the file, the line and the mend; no output is begun."""
    path = tmp_path / "mine.maze"
    path.write_text(text)
    message = fail(capsys, "reproduce", "--out", str(tmp_path / "out"), "--layout", str(path))
    assert f"{path}, " in message
    assert expected in message
    assert [entry.name for entry in tmp_path.iterdir()] == ["mine.maze"]


def test_a_layout_that_the_task_graph_does_not_fit_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A goal in the first room leaves GotoGoal nothing: the message lists the findings."""
    path = tmp_path / "one_room.maze"
    path.write_text(spoil(".  T1 .", "G2 T1 ."))
    message = fail(capsys, "reproduce", "--out", str(tmp_path / "out"), "--layout", str(path))
    assert "task graph small cannot run" in message
    assert "GotoGoal(G2)" in message
    path.write_text("name open\ngrid\n. T1 G1\nstart 0,0\ntrigger T1\ngoal G1\n")
    message = fail(capsys, "reproduce", "--out", str(tmp_path / "out"), "--layout", str(path))
    assert "layout open has no door" in message


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        ("import hierarchy", HEAVY),
        ("from comparisons.cli import app; app(['--help'])", HEAVY),
        ("from comparisons.cli import app; app(['learn', '--help'])", HEAVY),
        ("import planners", HEAVY - {"scipy"}),
    ],
)
def test_help_is_light(code: str, heavy: set[str]) -> None:
    """What is looked at first loads no heavy library."""
    program = f"import sys\ntry:\n    {code}\nexcept SystemExit:\n    pass\nprint(*sys.modules)"
    done = subprocess.run(  # noqa: S603 - our own code
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert not heavy & set(done.stdout.splitlines()[-1].split())


def test_a_reader_that_has_had_enough_ends_it_quietly() -> None:
    """As in `affordant maze ... | head -1`, or with a reader that is gone: the status is SIGPIPE's, 141."""
    code = "import sys; from comparisons.cli import main; sys.stdin.read(1); main()"
    words = [sys.executable, "-c", code, "maze", "--rows", "9", "--cols", "12"]
    pipe = subprocess.PIPE
    with subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=pipe) as command:  # noqa: S603 - ourselves
        assert command.stdin is not None
        assert command.stdout is not None
        assert command.stderr is not None
        command.stdout.close()
        command.stdin.write(b"!")
        command.stdin.close()
        told = command.stderr.read()
    assert (command.returncode, told) == (141, b"")


@pytest.fixture
def _in_the_foreground() -> Iterator[None]:
    """Let Ctrl-C through, which what a shell has started in the background ignores."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_in_the_foreground")
def test_a_command_that_is_stopped_ends_without_a_word(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C is status 130 and SIGTERM 143, wherever they break in; nothing is printed."""
    for number, status in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
        monkeypatch.setattr(maze_command, "draw_maze", lambda *_, number=number, **__: kill(getpid(), number))
        assert affordant(capsys, "maze", "--rows", "9", "--cols", "12") == (status, "", "")
