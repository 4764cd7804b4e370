"""What a backend makes of a batch of frames, as arrays; and the check that it is a batch of frames."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.protocol import LABELS, REACH, Detection, Frames, View
from worlds import UserError

LEAST_PIXELS: Final = 8
"""Fewer rows or columns than this hold no obstacle that anybody could tell."""
MOST_PIXELS: Final = 4096
"""A frame may have so many rows, and so many columns: larger ones are pictures of something else."""
_BATCH: Final = 256  # views stacked at once, so that a long sequence needs no second copy of all its frames
_SUM: Final = 1e-6


@dataclass(frozen=True, eq=False)
class Percepts:
    """What a backend makes of a batch of frames.

    Parameters
    ----------
    probabilities
        Of none, cube and sphere (`LABELS`), each row summing to 1, shape (frames, 3).
    distances
        Cells to the obstacle, 1 to `REACH`, shape (frames,); where nothing stands in the way, where it
        would most likely be.
    abstains
        Whether the backend would rather not tell the shape, shape (frames,).

    Raises
    ------
    ValueError
        If shapes do not fit each other, probabilities do not sum to 1, or a distance is out of reach.

    Examples
    --------
    >>> seen = Percepts(np.array([[0.75, 0.125, 0.125], [0.0, 0.25, 0.75]]), [1, 2], [False, True])
    >>> seen.labels, seen.confidence
    (array([0, 2]), array([0.75, 0.75]))
    >>> seen.detections()[1]
    Detection(label='sphere', confidence=0.75, distance=2, probabilities=(0.0, 0.25, 0.75), abstains=True)
    """

    probabilities: NDArray[np.float64]
    distances: NDArray[np.int64]
    abstains: NDArray[np.bool_]

    def __post_init__(self) -> None:
        probabilities = np.array(self.probabilities, dtype=np.float64)
        distances, abstains = (
            np.array(self.distances, dtype=np.int64),
            np.array(self.abstains, dtype=np.bool_),
        )
        count = len(probabilities)
        if probabilities.shape != (count, len(LABELS)):
            raise ValueError(f"probabilities need shape (frames, {len(LABELS)}), not {probabilities.shape}")
        if distances.shape != (count,) or abstains.shape != (count,):
            raise ValueError(
                f"{count} frames need as many distances and abstentions, "
                f"not shapes {distances.shape} and {abstains.shape}"
            )
        sound = (probabilities >= 0).all(axis=1) & (np.abs(probabilities.sum(axis=1) - 1) <= _SUM)
        if not sound.all():
            frame = int(np.argmin(sound))
            raise ValueError(
                f"frame {frame} has probabilities {probabilities[frame].tolist()}; they must sum to 1"
            )
        if ((distances < 1) | (distances > REACH)).any():
            raise ValueError(f"distances are 1 to {REACH} cells, not {distances.min()} to {distances.max()}")
        for name, values in (
            ("probabilities", probabilities),
            ("distances", distances),
            ("abstains", abstains),
        ):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        return len(self.probabilities)

    @property
    def labels(self) -> NDArray[np.int64]:
        """The likeliest label, by its place in `LABELS`, the first of equals; shape (frames,)."""
        likeliest: NDArray[np.int64] = self.probabilities.argmax(axis=1).astype(np.int64)
        return likeliest

    @property
    def confidence(self) -> NDArray[np.float64]:
        """The probability of the likeliest label, shape (frames,)."""
        most: NDArray[np.float64] = self.probabilities.max(axis=1)
        return most

    def detections(self) -> list[Detection]:
        """Return one detection a frame."""
        found = []
        columns = (self.labels, self.probabilities.clip(0.0, 1.0), self.distances, self.abstains)
        for label, chances, distance, abstains in zip(*(c.tolist() for c in columns), strict=True):
            none, cube, sphere = chances
            at = distance if label else 0
            found.append(Detection(LABELS[label], chances[label], at, (none, cube, sphere), abstains))
        return found


def checked_frames(frames: Any, pixels: int | None = None) -> Frames:
    """Return a batch of frames, or say what is wrong with it.

    Parameters
    ----------
    frames
        Should be uint8, RGB, shape (frames, rows, columns, 3).
    pixels
        The rows and columns that a backend insists on. Defaults to any from `LEAST_PIXELS` to
        `MOST_PIXELS`.

    Raises
    ------
    UserError
        If it is no such array, or empty; the message says what came and what is wanted.

    Examples
    --------
    >>> checked_frames(np.zeros((2, 96, 96, 3), np.uint8)).shape
    (2, 96, 96, 3)
    >>> checked_frames(np.zeros((96, 96, 3), np.uint8))
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: frames need uint8 of shape (frames, rows, columns, 3), not uint8 (96, 96, 3); \
give one frame as frame[None]
    """
    wanted = "frames need uint8 of shape (frames, rows, columns, 3)"
    if not isinstance(frames, np.ndarray):
        raise UserError(f"{wanted}, not {type(frames).__name__}; make a numpy array of it")
    came = f"{frames.dtype} {frames.shape}"
    if frames.ndim == 3 and frames.shape[-1] == 3:
        raise UserError(f"{wanted}, not {came}; give one frame as frame[None]")
    if frames.ndim != 4 or frames.shape[3] != 3:
        raise UserError(f"{wanted}, not {came}; give red, green and blue last, and nothing else")
    if frames.dtype != np.uint8:
        raise UserError(f"{wanted}, not {came}; give values from 0 to 255 as uint8")
    count, rows, cols, _ = frames.shape
    if count == 0:
        raise UserError(f"{wanted}, and at least one of them, not {came}; leave empty batches out")
    if pixels is not None and (rows, cols) != (pixels, pixels):
        raise UserError(
            f"the camera takes frames of {pixels} x {pixels} pixels, not {rows} x {cols}; resize them"
        )
    if not all(LEAST_PIXELS <= side <= MOST_PIXELS for side in (rows, cols)):
        raise UserError(
            f"frames are {LEAST_PIXELS} to {MOST_PIXELS} pixels high and wide, not {rows} x {cols}; "
            "resize them"
        )
    return frames


class Sees(ABC):
    """A backend that goes by frames alone: write `perceive`, and `detect` comes with it.

    Examples
    --------
    >>> class Blind(Sees):
    ...     name = "blind"
    ...
    ...     def perceive(self, frames):
    ...         n = len(checked_frames(frames))
    ...         return Percepts(np.full((n, 3), 1 / 3), np.ones(n), np.ones(n))
    >>> from perception.protocol import NOTHING
    >>> Blind().detect([View(np.zeros((8, 8, 3), np.uint8), NOTHING)])[0].abstains
    True
    """

    name: str
    needs_frames = True

    @abstractmethod
    def perceive(self, frames: Frames) -> Percepts:
        """Return what stands ahead in each frame, uint8, shape (frames, rows, columns, 3)."""

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Return one detection a view, in order; views of several sizes go frame by frame.

        Raises
        ------
        ValueError
            If a view has no frame.
        UserError
            If its frame is none that the backend can read.
        """
        found: list[Detection] = []
        for start in range(0, len(views), _BATCH):
            frames = [_frame(view) for view in views[start : start + _BATCH]]
            alike = len({(frame.shape, frame.dtype) for frame in frames}) == 1
            for batch in [np.stack(frames)] if alike else [frame[None] for frame in frames]:
                found += self.perceive(batch).detections()
        return found


def _frame(view: View) -> Frames:
    if view.frame is None:
        raise ValueError("the view has no frame; render one for backends whose needs_frames is True")
    return view.frame
