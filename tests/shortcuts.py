"""Backends that learn in one known way, and painted frames, for tests of what training is held to.

The backends are a package's own: `as_package` makes the registry find them, in worker processes as well.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest

from perception.labelled import Labelled, held_out
from perception.models import Card
from perception.percepts import Percepts, Sees, checked_frames
from perception.protocol import Frames
from perception.pushed import PushedFrames
from perception.variation import Variation
from worlds.camera import Camera

PAINTS = ((255, 0, 0), (255, 255, 0), (0, 255, 0), (0, 255, 255), (0, 0, 255), (255, 0, 255))
"""One of each hue, round the circle: cubes are red, green or blue, spheres what lies between."""
_GREY = 128
_SIDES = {"small": 4, "middle": 6, "large": 8}


def painted(numbers: range, seed: int) -> PushedFrames:
    """Return frames of 16 pixels with a square of a hue that gives its label away, or with nothing."""
    random = np.random.default_rng(seed)
    drawn = random.integers(0, (9, 3, 2), (numbers.stop, 3))[numbers.start :]
    frames = np.full((len(drawn), 16, 16, 3), _GREY, np.uint8)
    there = drawn[:, 0] < len(PAINTS)
    names = np.array(list(_SIDES))[drawn[:, 1]]
    for frame, (paint, _, far), name, seen in zip(frames, drawn, names, there, strict=True):
        if seen:
            frame[1 + far : 1 + far + _SIDES[name], 1 : 1 + _SIDES[name]] = PAINTS[paint]
    labels = np.where(there, 1 + drawn[:, 0] % 2, 0)
    cells = np.where(there, 1 + drawn[:, 2], 0)
    nothing, none = np.zeros(len(drawn)), np.zeros(len(drawn), np.int64)
    colours = np.array([*PAINTS, *[(0, 0, 0)] * 3], np.uint8)[drawn[:, 0]]
    kinds = np.array(["none", "cube", "sphere"])[labels]
    return PushedFrames(
        *(frames, labels, cells, kinds, kinds, np.where(there, names, ""), cells, colours),
        *(nothing, nothing, nothing, np.zeros((len(drawn), 2, 3)), np.zeros((len(drawn), 3)), nothing),
        *(none, none),
    )


def render_painted(frames: int, seed: int, _variation: Variation, _track: Any, _name: str) -> PushedFrames:
    """Stand in for rendering."""
    return painted(range(frames), seed)


class ByColour(Sees):
    """Goes by the mean colour of a frame alone: the commonest label of the nearest hue that it has met."""

    name = "by-colour"

    def __init__(self, camera: Camera | None = None) -> None:
        self.camera = camera
        self.learnt: Any = None
        self.fit(painted(range(90), 0), 0)

    def fit(
        self,
        data: Labelled,
        seed: int,
        *,
        tuning: Labelled | None = None,
        effort: float = 1.0,
        about: str | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Self:
        """Remember hues and labels."""
        assert (tuning, about, progress) == (None, None, None)
        assert effort > 0
        rows = held_out(data)[0]
        self.learnt = _hue(rows.frames), np.asarray(rows.labels)
        self.card = Card(self.name, f"{len(rows.labels)} frames", seed)
        return self

    def perceive(self, frames: Frames) -> Percepts:
        """Look for the nearest hue."""
        known, labels = self.learnt
        near = -((_hue(checked_frames(frames))[:, None] - known[None]) ** 2).sum(axis=2)
        nearest = near >= near.max(axis=1, keepdims=True) - 1e-3
        votes = np.stack([(nearest & (labels == label)).sum(axis=1) for label in range(3)], axis=1)
        chances = (votes + 0.01) / (votes + 0.01).sum(axis=1, keepdims=True)
        return Percepts(chances, np.ones(len(frames)), np.zeros(len(frames)))

    def save(self, path: Path | str) -> None:
        """Be a backend that could be saved."""
        raise NotImplementedError(path)

    @classmethod
    def load(cls, path: Path | str, camera: Camera | None = None) -> Self:
        """Be a backend that could be loaded."""
        raise NotImplementedError(path, camera)


class Fragile(ByColour):
    """Cannot bear fewer than ten frames."""

    name = "fragile"

    def fit(self, data: Labelled, seed: int, **options: Any) -> Self:
        """Fail, or learn."""
        if len(data.labels) < 10:
            raise ValueError("too few for me")
        return super().fit(data, seed, **options)


class Mortal(ByColour):
    """Takes its process with it."""

    name = "mortal"

    def fit(self, data: Labelled, seed: int, **options: Any) -> Self:
        """Die as for want of memory."""
        os.kill(os.getpid(), signal.SIGKILL)
        return super().fit(data, seed, **options)


def _hue(frames: Frames) -> np.ndarray:
    mean = frames.astype(float).mean(axis=(1, 2)) - _GREY
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    return np.concatenate([mean / np.maximum(size, 1e-9), 9.0 * (size > 0)], axis=1)  # grey is far off


def as_package(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install these backends as a package's, as far as Python's import system can tell."""
    info = folder / "shortcuts-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: shortcuts\nVersion: 1.0\n")
    lines = [f"{kind.name} = shortcuts:{kind.__name__}" for kind in (ByColour, Fragile, Mortal)]
    (info / "entry_points.txt").write_text("\n".join(["[affordant.perception]", *lines, ""]))
    monkeypatch.syspath_prepend(folder)


def sign_and_wait(path: Path) -> None:
    """Write down which process this is, and wait for longer than any test."""
    path.write_text(str(os.getpid()))
    time.sleep(600)


def threads(_: int) -> str | None:
    """Return how many threads numerical libraries are told to use."""
    return os.environ.get("OMP_NUM_THREADS")
