"""Labelled frames, as every learnt backend takes them: what they are, what is refused, what is held out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.percepts import checked_frames
from perception.protocol import LABELS, REACH, Frames
from worlds import UserError

PIXELS: Final = 64
"""Width and height at which learnt backends look; frames of other sizes are resized."""
_EVERY: Final = 10  # frames, of which one is kept for tuning


class Labelled(Protocol):
    """Frames and what stands ahead in each, such as `perception.data.PushedFrames`.

    `frames` are uint8, shape (frames, rows, columns, 3); `labels` places in `LABELS`, and `distances` cells
    from 1 to `REACH`, of which those of frames with nothing ahead are not read; both shape (frames,).
    """

    @property
    def frames(self) -> Frames:
        """The frames."""
        ...

    @property
    def labels(self) -> NDArray[np.int64]:
        """The label of each, by its place in `LABELS`."""
        ...

    @property
    def distances(self) -> NDArray[np.int64]:
        """The obstacle's distance in each, in cells."""
        ...


@dataclass(frozen=True, eq=False)
class Rows:
    """Some rows of labelled data; see `Labelled` for the fields."""

    frames: Frames
    labels: NDArray[np.int64]
    distances: NDArray[np.int64]

    @classmethod
    def of(cls, data: Labelled, rows: NDArray[np.int64] | slice = slice(None)) -> Rows:
        """Return some rows of data."""
        return cls(data.frames[rows], data.labels[rows], data.distances[rows])


def checked_data(data: Labelled) -> None:
    """Refuse data that are no frames with a label and a distance each.

    Raises
    ------
    UserError
        If they are not; the message says what came and what is wanted.

    Examples
    --------
    >>> checked_data(Rows(np.zeros((2, 8, 8, 3), np.uint8), np.array([0, 3]), np.ones(2, np.int64)))
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: labels are 0 to 2 (none, cube, sphere), not 0 to 3
    """
    count = len(checked_frames(data.frames))
    labels, distances = np.asarray(data.labels), np.asarray(data.distances)
    if labels.shape != (count,) or distances.shape != (count,):
        raise UserError(
            f"{count} frames need as many labels and distances, not {labels.shape} and {distances.shape}"
        )
    if labels.min() < 0 or labels.max() >= len(LABELS):
        raise UserError(
            f"labels are 0 to {len(LABELS) - 1} ({', '.join(LABELS)}), not {labels.min()} to {labels.max()}"
        )
    far = distances[labels > 0]
    if len(far) and (far.min() < 1 or far.max() > REACH):
        raise UserError(f"distances of obstacles are 1 to {REACH} cells, not {far.min()} to {far.max()}")


def held_out(data: Labelled) -> tuple[Rows, Rows]:
    """Return data to learn from, and every tenth frame to tune on; all for both where there are fewer.

    Examples
    --------
    >>> data = Rows(np.zeros((20, 8, 8, 3), np.uint8), np.zeros(20, np.int64), np.ones(20, np.int64))
    >>> [len(part.frames) for part in held_out(data)]
    [18, 2]
    """
    checked_data(data)
    numbers = np.arange(len(data.frames))
    kept = numbers % _EVERY == _EVERY - 1
    if not kept.any():
        return Rows.of(data), Rows.of(data)
    return Rows.of(data, numbers[~kept]), Rows.of(data, numbers[kept])


def resized(frames: Frames, pixels: int = PIXELS) -> Frames:
    """Return frames of `pixels` rows and columns, by the mean of the areas that fall together.

    Examples
    --------
    >>> resized(np.zeros((2, 96, 96, 3), np.uint8)).shape
    (2, 64, 64, 3)
    """
    if frames.shape[1:3] == (pixels, pixels):
        return frames
    shrinks = min(frames.shape[1:3]) >= pixels
    way = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    small = np.empty((len(frames), pixels, pixels, 3), np.uint8)
    for frame, out in zip(frames, small, strict=True):
        cv2.resize(np.ascontiguousarray(frame), (pixels, pixels), dst=out, interpolation=way)
    return small
