"""`affordant perceive` and `affordant train-perception`, run as a user runs them."""

import csv
import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import affordant
from PIL import Image

from comparisons import learnt
from comparisons.learnt import frame_backend
from comparisons.pictures import read_picture
from perception.percepts import Percepts, Sees, checked_frames
from perception.protocol import Frames
from worlds import UserError
from worlds.camera import Camera


class Bright(Sees):
    """Calls a bright frame a sphere, a dark one none; it remembers how many frames it was fitted on."""

    name = "bright"

    def __init__(self, camera: Camera | None = None) -> None:
        self.camera = camera
        self.card: Any = None

    def perceive(self, frames: Frames) -> Percepts:
        """Go by the mean brightness."""
        share = checked_frames(frames).mean(axis=(1, 2, 3)) / 255
        chances = np.column_stack([1 - share, np.zeros(len(share)), share])
        return Percepts(chances, np.ones(len(share)), np.abs(share - 0.5) < 0.2)

    def fit(
        self,
        data: Any,
        seed: int,
        *,
        tuning: Any = None,
        about: str | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> "Bright":
        """Remember what was given."""
        self.card = f"{len(data)} {len(tuning)} {seed} {about}"
        assert progress is not None
        progress(1.0)
        return self

    def save(self, path: Path | str) -> None:
        """Write what was remembered."""
        Path(path).write_text(self.card)

    @classmethod
    def load(cls, path: Path | str, camera: Camera | None = None) -> "Bright":
        """Read what was remembered."""
        made = cls(camera)
        made.card = Path(path).read_text()
        return made


@pytest.fixture(autouse=True)
def _bright(monkeypatch: pytest.MonkeyPatch) -> None:
    """Add the backend "bright" to those that there are."""
    load = learnt.load_backend
    monkeypatch.setattr(learnt, "load_backend", lambda n, c: Bright(c) if n == "bright" else load(n, c))


def perceive(capsys: pytest.CaptureFixture[str], *tokens: str) -> tuple[int, str, str]:
    """Run `affordant perceive` with the backend of this file."""
    return affordant(capsys, "perceive", *tokens, "--perception", "bright")


def paint(path: Path, grey: int = 255, size: tuple[int, int] = (120, 96)) -> Path:
    """Write a picture of one grey."""
    Image.new("RGB", size, (grey, grey, grey)).save(path)
    return path


def bomb(path: Path) -> Path:
    """Write a PNG of a few bytes that claims 50,000 by 50,000 pixels."""
    head = struct.pack(">IIBBBBB", 50_000, 50_000, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(b"")), (b"IEND", b""))
    parts = [struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))
    return path


def test_one_picture_is_a_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Label, distance, probabilities, and nothing else."""
    path = paint(tmp_path / "white.png")
    expected = f"{path}: sphere, 1 cell ahead (none 0.000, cube 0.000, sphere 1.000)\n"
    assert perceive(capsys, str(path)) == (0, expected, "")


def test_a_backend_that_is_unsure_abstains(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The line says so."""
    path = paint(tmp_path / "grey.png", grey=102)
    expected = f"{path}: none (none 0.600, cube 0.000, sphere 0.400), abstains\n"
    assert perceive(capsys, str(path)) == (0, expected, "")


def test_a_bad_file_does_not_stop_the_rest(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Each has its line on standard error; the good ones are looked at; the status says that some failed."""
    good = paint(tmp_path / "m.png")
    jpeg = paint(tmp_path / "z.jpg", grey=0)
    whole = paint(tmp_path / "whole.bmp").read_bytes()
    (tmp_path / "whole.bmp").unlink()
    (tmp_path / "cut.bmp").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "empty.png").touch()
    (tmp_path / "notes.txt").write_text("no picture")
    (tmp_path / "gif.gif").write_bytes(b"GIF89a" + bytes(40))
    (tmp_path / ".hidden").write_text("left out")
    (tmp_path / "folder").mkdir()
    bomb(tmp_path / "bomb.png")
    paint(tmp_path / "tiny.png", size=(3, 90))
    Image.fromarray(np.zeros((20, 20), np.uint16)).save(tmp_path / "deep.png")
    os.mkfifo(tmp_path / "pipe.png")
    code, out, err = perceive(capsys, str(tmp_path))
    assert code == 1
    assert [line.split(":")[0] for line in out.splitlines()] == [str(good), str(jpeg)]
    told = dict(line.split(": ", 1) for line in err.splitlines())
    said = {Path(name).name: problem for name, problem in told.items()}
    assert said["bomb.png"] == "more than 64,000,000 pixels; make it smaller"
    assert said["empty.png"] == "the file is empty"
    assert said["pipe.png"] == "not a plain file"
    assert said["notes.txt"] == "not a picture that can be read; give PNG, JPEG, BMP, WEBP"
    assert said["gif.gif"] == said["notes.txt"]
    assert said["tiny.png"] == "3 x 90 pixels show nothing; give at least 8 each way"
    assert said["deep.png"].endswith("convert it to 8 bits a channel")
    assert said["cut.bmp"].startswith("the picture is broken (")
    assert len(said) == 8


def test_out_holds_a_table_and_pictures(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A row for every file, and a drawing for each that could be read."""
    inside = tmp_path / "in"
    inside.mkdir()
    paint(inside / "a.png")
    paint(inside / "A.png", grey=0)
    (inside / "b.png").write_text("no picture")
    assert perceive(capsys, str(inside), "--out", str(tmp_path / "out"))[0] == 1
    with (tmp_path / "out" / "percepts.csv").open(newline="") as file:
        rows = {Path(row["file"]).name: row for row in csv.DictReader(file)}
    assert (rows["A.png"]["label"], rows["a.png"]["label"], rows["b.png"]["label"]) == ("none", "sphere", "")
    assert (rows["a.png"]["sphere"], rows["a.png"]["distance"], rows["a.png"]["abstains"]) == (
        "1.000000",
        "1",
        "no",
    )
    assert "not a picture" in rows["b.png"]["problem"]
    drawn = {row["picture"] for row in rows.values() if row["picture"]}
    assert {path.name for path in (tmp_path / "out").iterdir()} == drawn | {"percepts.csv"}
    assert len(drawn) == 2
    with Image.open(tmp_path / "out" / rows["a.png"]["picture"]) as picture:
        assert picture.size == (288, 332)
    code, _, err = perceive(capsys, str(inside), "--out", str(tmp_path / "out"))
    assert (code, "exists already" in err) == (2, True)


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (("nowhere.png",), "nowhere.png: there is no such file or folder"),
        (("empty",), "empty: the folder holds no file"),
        (("a.png", "--perception", "truth"), "backend 'truth' reads no frames"),
        (("a.png", "--perception", "huogh"), "did you mean 'hough'?"),
        (("a.png", "--perception", "hough=a.png"), "backend 'hough' does not learn"),
        (("a.png\x1b[2J",), r"'a.png\x1b[2J': there is no such file"),
    ],
)
def test_a_mistake_is_one_message(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    tokens: tuple[str, ...],
    message: str,
) -> None:
    """Status 2, one line, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    paint(tmp_path / "a.png")
    code, out, err = affordant(capsys, "perceive", *tokens, "--out", "out")
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "empty"]


def test_a_picture_becomes_its_middle_square(tmp_path: Path) -> None:
    """Channels stay red, green, blue; an EXIF turn is undone before the cut."""
    pixels = np.zeros((40, 80, 3), np.uint8)
    pixels[:, 20:60, 0] = 200  # red in the middle square
    pixels[:20, :, 2] = 100  # blue above
    Image.fromarray(pixels).save(tmp_path / "a.png")
    frame = read_picture(tmp_path / "a.png", 20)
    assert frame.shape == (20, 20, 3)
    assert (frame[..., 0] == 200).all()
    assert (frame[:10, :, 2] == 100).all()
    assert (frame[10:, :, 2] == 0).all()
    exif = Image.Exif()
    exif[0x0112] = 3  # turned by half
    Image.fromarray(pixels).save(tmp_path / "b.png", exif=exif)
    assert np.array_equal(read_picture(tmp_path / "b.png", 20), frame[::-1, ::-1])


def test_weights_of_one_s_own_are_loaded(tmp_path: Path) -> None:
    """The name says which backend, and the file which weights."""
    (tmp_path / "mine.safetensors").write_text("learnt")
    backend = frame_backend(f"bright={tmp_path / 'mine.safetensors'}", Camera())
    assert isinstance(backend, Bright)
    assert backend.card == "learnt"


def test_training_makes_frames_and_weights(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The frames of a broken run are taken up again; weights are never replaced."""
    tokens = (
        "train-perception",
        "--backend",
        "bright",
        "--out",
        str(tmp_path),
        "--frames",
        "33",
        "--seed",
        "7",
    )
    code, out, _ = affordant(capsys, *tokens)
    weights = tmp_path / "bright.safetensors"
    assert (code, out.splitlines()[0]) == (0, str(weights))
    assert weights.read_text() == "33 30 7 33 frames of seed 7, everything varied, labelled by pushing"
    shards = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.npz")}
    code, _, err = affordant(capsys, *tokens)
    assert (code, "bright.safetensors exists there already" in err) == (2, True)
    weights.unlink()
    assert affordant(capsys, *tokens)[0] == 0
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.npz")} == shards


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (("--backend", "hough"), "--backend hough: it does not learn"),
        (("--backend", "bright", "--seed", "200"), "training takes 0 to 99"),
        (("--backend", "bright", "--frames", "2"), "give at least 30"),
    ],
)
def test_training_refuses(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, tokens: tuple[str, ...], message: str
) -> None:
    """Status 2, and nothing is written."""
    code, out, err = affordant(capsys, "train-perception", "--out", str(tmp_path / "out"), *tokens)
    assert (code, out) == (2, "")
    assert message in err
    assert not (tmp_path / "out").exists()


def test_pictures_that_cannot_be_read_say_why(tmp_path: Path) -> None:
    """Bytes of every sort end in a `UserError`, whatever the decoder makes of them."""
    whole = paint(tmp_path / "a.png", size=(32, 32)).read_bytes()
    ends = []
    for i in range(len(whole)):
        (tmp_path / "b.png").write_bytes(whole[:i] + bytes([whole[i] ^ 0x55]) + whole[i + 1 :])
        try:
            ends.append(str(read_picture(tmp_path / "b.png", 16).shape))
        except UserError as error:
            ends.append(str(error))
    read = [end for end in ends if end == "(16, 16, 3)"]
    refused = [end for end in ends if end.startswith(f"{tmp_path / 'b.png'}: ") and "\n" not in end]
    assert refused
    assert len(read) + len(refused) == len(ends)
