"""The HOG backend: a linear classifier on histograms of oriented gradients, the sanity line of every table.

Dalal and Triggs, "Histograms of oriented gradients for human detection", CVPR 2005. What it learnt is kept as
arrays of factors and constants; no object of scikit-learn is ever written or read.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from skimage.feature import hog
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import LogisticRegression

from perception.calibration import softmax
from perception.cnn import ready_made, tuned
from perception.models import Card, Tensors, load_model, save_model
from perception.percepts import Percepts, Sees, checked_frames
from perception.protocol import LABELS, REACH, Frames
from perception.training import Labelled, Rows, held_out, resized
from worlds.camera import Camera

PIXELS: Final = 64
"""Width and height of what it looks at; frames of other sizes are resized."""
_ORIENTATIONS: Final = 9
_CELL: Final = 8  # pixels
_BLOCK: Final = 2  # cells
FEATURES: Final = (PIXELS // _CELL - _BLOCK + 1) ** 2 * _BLOCK**2 * _ORIENTATIONS
"""Numbers a frame."""
SHAPES: Final = {"factors": (len(LABELS) + REACH, FEATURES), "constants": (len(LABELS) + REACH,)}
READY_MADE: Final = "weights/hog.safetensors"
_STRENGTH: Final = 0.1  # inverse of the penalty on large factors


class Hog(Sees):
    """A linear classifier on HOG features as a backend.

    Parameters
    ----------
    camera
        The camera that takes the frames; they may be of any size, for they are resized.
    model
        Factors and constants (`SHAPES`), and their card. Defaults to the ready-made ones.

    Examples
    --------
    >>> grey = np.full((1, 96, 96, 3), 128, np.uint8)
    >>> Hog().perceive(grey).probabilities.shape
    (1, 3)
    """

    name = "hog"

    def __init__(self, camera: Camera | None = None, model: tuple[Tensors, Card] | None = None) -> None:
        self.camera = Camera() if camera is None else camera
        self._take(*(ready_made(READY_MADE, self.name, SHAPES) if model is None else model))

    def perceive(self, frames: Frames) -> Percepts:
        """Return what stands ahead in each frame, uint8, shape (frames, rows, columns, 3)."""
        found = self.scores(frames)
        probabilities = softmax(found[:, : len(LABELS)], self.card.temperature)
        return Percepts(
            probabilities,
            found[:, len(LABELS) :].argmax(axis=1).astype(np.int64) + 1,
            probabilities.max(axis=1) < self.card.threshold,
        )

    def scores(self, frames: Frames) -> NDArray[np.float64]:
        """Return scores of labels, then of distances, shape (frames, 5)."""
        # Frame by frame: sums over a batch may be ordered otherwise, and end in other bits.
        return np.stack([self._factors @ row + self._constants for row in features(frames)])

    def fit(
        self,
        data: Labelled,
        seed: int,
        *,
        tuning: Labelled | None = None,
        about: str | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Self:
        """Learn anew, and forget what was known.

        Parameters
        ----------
        data
            What to learn from.
        seed
            Goes onto the card; nothing is drawn, for the best linear classifier is one.
        tuning
            Frames to set the temperature by. Defaults to every tenth of `data`, not learnt from then.
        about
            What the card says of the data. Defaults to the number of frames.
        progress
            Called with the share of the work that is done.

        Returns
        -------
        Self
            This backend.

        Raises
        ------
        UserError
            If the data are no frames with labels and distances.
        """
        learnt, kept = (Rows.of(data), tuning) if tuning is not None else held_out(data)
        seen = features(learnt.frames)
        there = learnt.labels > 0
        heads = (
            _fitted(seen, learnt.labels, len(LABELS)),
            _fitted(seen[there], learnt.distances[there] - 1, REACH),
        )
        factors, constants = (np.concatenate(part) for part in zip(*heads, strict=True))
        model = {"factors": factors.astype(np.float32), "constants": constants.astype(np.float32)}
        plain = Card(self.name, about or f"{len(learnt.frames)} frames", seed)
        self._take(model, plain)
        found = self.scores(kept.frames)[:, : len(LABELS)]
        self._take(model, tuned(plain, found, kept.labels, ("numpy", "scikit-image", "scikit-learn")))
        if progress is not None:
            progress(1.0)
        return self

    def save(self, path: Path | str) -> None:
        """Write factors and constants, with their card beside them; see `perception.models.save_model`."""
        save_model(path, {"factors": self._factors, "constants": self._constants}, self.card)

    @classmethod
    def load(cls, path: Path | str, camera: Camera | None = None) -> Self:
        """Return the backend that `save` wrote.

        Raises
        ------
        UserError
            If there is no such file, or it is broken or of another kind.
        """
        return cls(camera, load_model(path, cls.name, SHAPES))

    def _take(self, tensors: Tensors, card: Card) -> None:
        self.card = card
        self._factors = np.array(tensors["factors"], dtype=np.float32)
        self._constants = np.array(tensors["constants"], dtype=np.float32)


def features(frames: Frames) -> NDArray[np.float32]:
    """Return the histograms of oriented gradients of frames, shape (frames, `FEATURES`).

    Of each pixel the colour channel with the steepest gradient counts.

    Examples
    --------
    >>> features(np.zeros((1, 96, 96, 3), np.uint8)).shape
    (1, 1764)
    """
    small = resized(checked_frames(frames), PIXELS)
    found: NDArray[np.float32] = np.empty((len(small), FEATURES), np.float32)
    for row, frame in zip(found, small, strict=True):
        row[:] = hog(
            frame,
            orientations=_ORIENTATIONS,
            pixels_per_cell=(_CELL, _CELL),
            cells_per_block=(_BLOCK, _BLOCK),
            block_norm="L2-Hys",
            channel_axis=-1,
        )
    return found


def _fitted(seen: NDArray[Any], labels: NDArray[np.int64], classes: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return factors and constants of `classes` scores; a class that the data lack scores lowest."""
    factors, constants = np.zeros((classes, FEATURES)), np.full(classes, -30.0)
    present = np.unique(labels)
    if len(present) < 2:
        constants[present] = 0.0
        return factors, constants
    found = LogisticRegression(C=_STRENGTH, max_iter=300, tol=1e-3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # close to the best is good enough here
        found.fit(seen, labels)
    if len(present) == 2:  # scikit-learn then keeps one row, the second class's lead over the first
        factors[present[1]], constants[present] = found.coef_[0], (0.0, found.intercept_[0])
    else:
        factors[present], constants[present] = found.coef_, found.intercept_
    return factors, constants
