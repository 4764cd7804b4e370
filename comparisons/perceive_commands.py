"""`affordant perceive`: a backend on the user's own pictures."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from comparisons.learnt import frame_backend
from comparisons.outputs import new_directory
from comparisons.pictures import numbered, picture_paths, read_picture, shown
from perception.protocol import LABELS, NOTHING, Backend, Detection, Explains, Frame, View
from worlds.camera import Camera
from worlds.errors import UserError

COLUMNS: Final = ("file", "label", *LABELS, "distance", "abstains", "picture", "problem")
"""The columns of percepts.csv; the three labels' columns hold their probabilities."""
_DRAWN: Final = 288  # pixels of an annotated picture, without its caption
_CAPTION: Final = 44


@dataclass(frozen=True, eq=False)
class Perceived:
    """What became of one file: a detection, or a problem.

    Parameters
    ----------
    path
        The file.
    frame
        It as the backend saw it, None if it could not be read.
    detection
        What the backend says, None if it could not be read.
    problem
        Why it could not be read, in one line; "" if all is well.
    """

    path: Path
    frame: Frame | None = None
    detection: Detection | None = None
    problem: str = ""

    def __str__(self) -> str:
        return self.problem if self.detection is None else f"{shown(self.path)}: {words(self.detection)}"


def words(detection: Detection) -> str:
    """Return a detection in words.

    Examples
    --------
    >>> words(Detection("cube", 0.75, 2, probabilities=(0.05, 0.75, 0.2)))
    'cube, 2 cells ahead (none 0.050, cube 0.750, sphere 0.200)'
    >>> words(Detection("none", 0.5, 0, probabilities=(0.5, 0.25, 0.25), abstains=True))
    'none (none 0.500, cube 0.250, sphere 0.250), abstains'
    """
    cells = "1 cell" if detection.distance == 1 else f"{detection.distance} cells"
    where = f", {cells} ahead" if detection.distance else ""
    chances = ", ".join(f"{label} {p:.3f}" for label, p in zip(LABELS, detection.chances, strict=True))
    return f"{detection.label}{where} ({chances}){', abstains' if detection.abstains else ''}"


def perceive(
    path: Path,
    perception: str,
    out: Path | None,
    tell: Callable[[Perceived], None] = lambda _: None,
) -> list[Perceived]:
    """Look at a picture, or at every picture of a folder; a file that will not do does not stop the rest.

    Parameters
    ----------
    path
        A file or a folder.
    perception
        Name of the backend, or ``name=FILE`` for weights of one's own.
    out
        A new directory for percepts.csv and the annotated pictures; None writes nothing.
    tell
        Told of every file as soon as it has been looked at.

    Raises
    ------
    UserError
        If there is no such path or backend, the backend reads no frames, or `out` exists.
    """
    camera = Camera()
    backend = frame_backend(perception, camera)
    paths = picture_paths(path)
    drawings = list(numbered([p.name for p in paths]))
    with _maybe_directory(out) as directory:
        done = []
        for one in _perceive_each(paths, backend, camera.pixels):
            tell(one)
            done.append(Perceived(one.path, None, one.detection, one.problem))  # frames are let go
            if directory is not None and one.frame is not None and one.detection is not None:
                drawing = annotated(one.frame, one.detection, backend)
                _write_png(directory / drawings[len(done) - 1], drawing)
        if directory is not None:
            text = as_csv(done, drawings)
            (directory / "percepts.csv").write_text(text, encoding="utf-8", newline="")
    return done


def _perceive_each(paths: Sequence[Path], backend: Backend, pixels: int) -> Iterator[Perceived]:
    for path in paths:
        try:
            frame = read_picture(path, pixels)
        except UserError as error:
            yield Perceived(path, problem=str(error))
            continue
        yield Perceived(path, frame, backend.detect([View(frame, NOTHING)])[0])


@contextmanager
def _maybe_directory(out: Path | None) -> Iterator[Path | None]:
    if out is None:
        yield None
        return
    with new_directory(out) as directory:
        yield directory


def as_csv(found: Sequence[Perceived], drawings: Sequence[str]) -> str:
    r"""Return the content of percepts.csv: a line for every file, read or not.

    Parameters
    ----------
    found
        What became of the files.
    drawings
        Name of each file's annotated picture.

    Examples
    --------
    >>> seen = Perceived(Path("a.png"), None, Detection("cube", 0.75, 2, (0.05, 0.75, 0.2)))
    >>> print(as_csv([seen], ["0001_a.png"]).replace("\r", ""), end="")
    file,label,none,cube,sphere,distance,abstains,picture,problem
    a.png,cube,0.050000,0.750000,0.200000,2,no,0001_a.png,
    """
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for one, drawing in zip(found, drawings, strict=True):
        seen = one.detection
        if seen is None:
            writer.writerow([shown(one.path), *[""] * (len(COLUMNS) - 2), one.problem])
            continue
        chances = [f"{p:.6f}" for p in seen.chances]
        abstains = "yes" if seen.abstains else "no"
        writer.writerow([shown(one.path), seen.label, *chances, seen.distance or "", abstains, drawing, ""])
    return text.getvalue()


def annotated(frame: Frame, detection: Detection, backend: Backend) -> Frame:
    """Return a frame with what the backend found drawn upon it, if it can, above what it says.

    Examples
    --------
    >>> from perception.truth import Truth
    >>> annotated(np.zeros((96, 96, 3), np.uint8), NOTHING, Truth()).shape
    (332, 288, 3)
    """
    picture = backend.sketch(frame) if isinstance(backend, Explains) else frame
    enlarged = cv2.resize(picture, (_DRAWN, _DRAWN), interpolation=cv2.INTER_NEAREST)
    caption = np.full((_CAPTION, _DRAWN, 3), 255, dtype=np.uint8)
    first, _, second = words(detection).partition(" (")
    ahead = first + (", abstains" if detection.abstains else "")
    for row, line in ((17, ahead), (35, second.partition(")")[0])):
        cv2.putText(caption, line, (6, row), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (31, 41, 51), 1, cv2.LINE_AA)
    return np.concatenate([np.asarray(enlarged, dtype=np.uint8), caption])


def _write_png(path: Path, picture: Frame) -> None:
    done, content = cv2.imencode(".png", np.ascontiguousarray(picture[..., ::-1]))
    assert done, "cv2 encodes any uint8 image of three channels"
    path.write_bytes(content.tobytes())
