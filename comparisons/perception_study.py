"""The comparison of perception backends: how often each is right, under what, and how sure it is of it.

One thing is changed at a time: scenes vary in one respect and then in all, and each corruption spoils the
clean frames. Every backend sees the very same frames, of seeds that train and tune none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from comparisons.intervals import wilson
from comparisons.learnt import frame_backend
from comparisons.outputs import Track
from perception.audit import confusion_of
from perception.calibration import Reliability, calibration_error
from perception.percepts import Percepts
from perception.protocol import LABELS, NOTHING, Backend, Detection, Frame, FrameBackend, View
from perception.pushed import PushedFrames, pushed_frames
from perception.registry import backend_names, load_backend
from perception.variation import CLEAN, FAMILIES, Variation
from worlds import KINDS
from worlds.camera import Camera
from worlds.errors import UserError

SCENES: Final[Mapping[str, Variation]] = MappingProxyType(
    {
        "clean": CLEAN,
        "turned": replace(CLEAN, rotation=True),
        "floor colours": replace(CLEAN, floor=True),
        "wall colours, mazes": replace(CLEAN, walls=True),
        "light": replace(CLEAN, light=True),
        "things beside the way": replace(CLEAN, distractors=True),
        "everything varied": Variation(),
    }
)
"""What varies in each set of scenes."""
VARIED: Final = "everything varied"
CAMOUFLAGE: Final = "colour like the floor"
UNKNOWN: Final = tuple(family for family in FAMILIES if family not in KINDS)
"""Families of solids that no backend has learnt."""
_CHUNK: Final = 100  # frames rendered, or looked at, at once


@dataclass(frozen=True)
class Score:
    """How one backend did on one set of frames.

    Parameters
    ----------
    backend, condition, severity
        Which; the severity of a set of scenes is 0.
    confusion
        Frames by true label (rows) and likeliest label (columns), in the order of `LABELS`.
    calibration_error
        Expected calibration error, in [0, 1].
    abstained, answered_right
        Frames on which it abstained, and the right ones among the others.
    distance_right, found
        Obstacles with the right distance, among those with the right label.
    """

    backend: str
    condition: str
    severity: int
    confusion: tuple[tuple[int, ...], ...]
    calibration_error: float
    abstained: int
    answered_right: int
    distance_right: int
    found: int

    @property
    def frames(self) -> int:
        """Number of frames."""
        return sum(map(sum, self.confusion))

    @property
    def right(self) -> int:
        """Frames whose likeliest label is the true one."""
        return sum(row[i] for i, row in enumerate(self.confusion))

    @property
    def accuracy(self) -> float:
        """Share of right frames."""
        return self.right / self.frames

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the accuracy."""
        return wilson(self.right, self.frames)


@dataclass(frozen=True)
class Group:
    """One group of the shortcut audit: ``right`` of ``frames`` obstacles alike in one respect."""

    backend: str
    by: str
    group: str
    frames: int
    right: int


@dataclass(frozen=True)
class Strangers:
    """What a backend makes of solids that it has never seen, and of the spheres that it should accept.

    Parameters
    ----------
    backend, family
        Which; family "sphere" is the known one.
    frames, rolled
        Frames, and those whose solid rolled when pushed.
    false_rollable
        Called sphere without abstaining, though the push showed that it does not roll.
    accepted
        Called sphere without abstaining, and it rolled.
    """

    backend: str
    family: str
    frames: int
    rolled: int
    false_rollable: int
    accepted: int


@dataclass(frozen=True, eq=False)
class Mistake:
    """A frame that a backend got wrong: the surest of its condition."""

    backend: str
    condition: str
    severity: int
    frame: Frame
    truth: str
    seen: str
    confidence: float


@dataclass(frozen=True, eq=False)
class Seen:
    """All that the comparison found out by frames.

    Parameters
    ----------
    backends
        Names, in the order of every table.
    scores, groups, strangers, mistakes
        The findings.
    reliability
        By backend, on every set of scenes, and on every corrupted frame.
    agreement
        Share of the varied frames whose own label, by pushing, is the scene's.
    latency
        By backend, milliseconds of each look at a single frame.
    """

    backends: tuple[str, ...]
    scores: tuple[Score, ...]
    groups: tuple[Group, ...]
    strangers: tuple[Strangers, ...]
    mistakes: tuple[Mistake, ...]
    reliability: Mapping[str, tuple[Reliability, Reliability]]
    agreement: float
    latency: Mapping[str, tuple[float, ...]]


def load_backends(names: Sequence[str], camera: Camera) -> dict[str, Backend]:
    """Return backends by name; () loads every one that reads frames.

    Raises
    ------
    UserError
        If a name is not known, comes twice, or its backend reads no frames.

    Examples
    --------
    >>> list(load_backends(["hough"], Camera()))
    ['hough']
    >>> load_backends(["truth"], Camera())
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: backend 'truth' reads no frames; name one that does, such as 'hough'
    """
    if not names:
        loaded = {name: load_backend(name, camera) for name in backend_names()}
        return {name: backend for name, backend in loaded.items() if backend.needs_frames}
    found: dict[str, Backend] = {}
    for name in names:
        if name in found:
            raise UserError(f"backend {name!r} is named twice; name it once")
        found[name] = frame_backend(name, camera)
    return found


def look(backend: Backend, frames: NDArray[np.uint8]) -> Percepts:
    """Return what a backend makes of frames, uint8, shape (frames, rows, columns, 3).

    A backend of views alone is given views; its confidence is spread over the labels.
    """
    parts = [frames[start : start + _CHUNK] for start in range(0, len(frames), _CHUNK)]
    if isinstance(backend, FrameBackend):
        seen = [backend.perceive(part) for part in parts]
    else:
        seen = [_percepts(backend.detect([View(f, NOTHING) for f in p])) for p in parts]
    return Percepts(
        np.concatenate([part.probabilities for part in seen]),
        np.concatenate([part.distances for part in seen]),
        np.concatenate([part.abstains for part in seen]),
    )


def _percepts(found: Sequence[Detection]) -> Percepts:
    return Percepts(
        np.array([detection.chances for detection in found]),
        np.array([max(detection.distance, 1) for detection in found]),
        np.array([detection.abstains for detection in found]),
    )


def score(backend: str, condition: str, severity: int, data: PushedFrames, seen: Percepts) -> Score:
    """Hold what a backend saw to the labels and distances of frames."""
    right = data.labels == seen.labels
    found = right & (data.labels != LABELS.index("none"))
    return Score(
        backend,
        condition,
        severity,
        confusion_of(data.labels, seen.labels),
        float(calibration_error(seen.probabilities, data.labels)),
        abstained=int(seen.abstains.sum()),
        answered_right=int((right & ~seen.abstains).sum()),
        distance_right=int((found & (data.distances == seen.distances)).sum()),
        found=int(found.sum()),
    )


def render_frames(frames: int, seed: int, variation: Variation, track: Track, name: str) -> PushedFrames:
    """Render a set of scenes, showing progress."""
    starts = range(0, frames, _CHUNK)
    parts = [
        pushed_frames(range(start, min(start + _CHUNK, frames)), seed, variation)
        for start in track(starts, total=len(starts), description=f"rendering: {name}")
    ]
    columns = vars(parts[0])
    return PushedFrames(**{key: np.concatenate([vars(part)[key] for part in parts]) for key in columns})
