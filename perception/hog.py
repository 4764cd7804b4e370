"""The HOG backend: a linear classifier on histograms of oriented gradients, the sanity line of every table.

Dalal and Triggs, "Histograms of oriented gradients for human detection", CVPR 2005. What it learnt is kept as
arrays of factors and constants; no object of scikit-learn is ever written or read.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from skimage.feature import hog
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import LogisticRegression
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped, unused-ignore]  # no types

from perception.labelled import PIXELS, Labelled, Rows, resized
from perception.learnt import SCORES, Learnt, checked_effort
from perception.models import Tensors
from perception.percepts import checked_frames
from perception.protocol import LABELS, REACH, Frames

_ORIENTATIONS: Final = 9
_CELL: Final = 8  # pixels
_BLOCK: Final = 2  # cells
FEATURES: Final = (PIXELS // _CELL - _BLOCK + 1) ** 2 * _BLOCK**2 * _ORIENTATIONS
"""Numbers a frame."""
SHAPES: Final = {"factors": (SCORES, FEATURES), "constants": (SCORES,)}
"""What is learnt: factors of the features, and constants, of every score."""
_STRENGTH: Final = 0.1  # inverse of the penalty on large factors


class Hog(Learnt):
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
    shapes = SHAPES
    packages = ("numpy", "scikit-image", "scikit-learn")

    def scores(self, frames: Frames) -> NDArray[np.float64]:
        """Return scores of labels, then of distances, shape (frames, 5)."""
        factors, constants = self.tensors["factors"], self.tensors["constants"]
        # Frame by frame: sums over a batch may be ordered otherwise, and end in other bits.
        return np.stack([factors @ row + constants for row in features(frames)])

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
        """Learn anew, and forget what was known; see `perception.learnt.Learnt.fit` for what is not here.

        Parameters
        ----------
        seed
            Goes onto the card; nothing is drawn, for the best linear classifier is one.
        effort
            Checked, and then ignored: the search for the best classifier ends by itself.
        """
        checked_effort(effort)
        self._fitted(data, seed, tuning, about, _learnt)
        if progress is not None:
            progress(1.0)
        return self


def features(frames: Frames) -> NDArray[np.float32]:
    """Return the histograms of oriented gradients of frames, shape (frames, `FEATURES`).

    Of each pixel the colour channel with the steepest gradient counts.

    Examples
    --------
    >>> features(np.zeros((1, 96, 96, 3), np.uint8)).shape
    (1, 1764)
    """
    small = resized(checked_frames(frames))
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


def _learnt(data: Rows) -> Tensors:
    """Return the factors and constants of the labels' classifier and, below, the distances'."""
    seen, there = features(data.frames), data.labels > 0
    heads = (
        _classifier(seen, data.labels, len(LABELS)),
        _classifier(seen[there], data.distances[there] - 1, REACH),
    )
    factors, constants = (np.concatenate(part) for part in zip(*heads, strict=True))
    return {"factors": factors, "constants": constants}


def _classifier(
    seen: NDArray[Any], labels: NDArray[np.int64], classes: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return factors and constants of `classes` scores; a class that the data lack scores lowest."""
    factors, constants = np.zeros((classes, FEATURES)), np.full(classes, -30.0)
    present = np.unique(labels)
    if len(present) < 2:
        constants[present] = 0.0
        return factors, constants
    found = LogisticRegression(C=_STRENGTH, max_iter=300, tol=1e-3)
    # One thread: the order of sums, and so their last bits, then stay the same.
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # close to the best is good enough here
        found.fit(seen, labels)
    if len(present) == 2:  # scikit-learn then keeps one row, the second class's lead over the first
        factors[present[1]], constants[present] = found.coef_[0], (0.0, found.intercept_[0])
    else:
        factors[present], constants[present] = found.coef_, found.intercept_
    return factors, constants
