"""What every backend of perception takes and gives: views in, detections out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, Protocol, get_args, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from worlds import Size

Frame = NDArray[np.uint8]
"""A picture from the robot's camera, shape (pixels, pixels, 3), RGB."""
Label = Literal["none", "cube", "sphere"]
LABELS: Final[tuple[Label, ...]] = get_args(Label)
"""The labels, in the order of a confusion matrix's rows and columns."""
REACH: Final = 2
"""How many cells ahead an obstacle is looked for."""


@dataclass(frozen=True, slots=True)
class Detection:
    """What stands in the robot's way.

    Parameters
    ----------
    label
        "none", "cube" or "sphere".
    confidence
        How far the backend trusts the label, in [0, 1]; it grows with the evidence.
    distance
        Cells from the robot to the obstacle, 1 to `REACH`; 0 for "none".

    Raises
    ------
    ValueError
        If a field is out of its range, or label and distance contradict each other.

    Examples
    --------
    >>> Detection("cube", 0.9, 2)
    Detection(label='cube', confidence=0.9, distance=2)
    >>> Detection("none", 1.0, 1)
    Traceback (most recent call last):
        ...
    ValueError: a detection of 'none' has distance 0, not 1
    """

    label: Label
    confidence: float
    distance: int

    def __post_init__(self) -> None:
        if self.label not in LABELS:
            raise ValueError(f"unknown label {self.label!r}; use one of {', '.join(LABELS)}")
        if not 0.0 <= self.confidence <= 1.0:
            raise ValueError(f"confidence {self.confidence} is not in [0, 1]")
        if self.label == "none" and self.distance != 0:
            raise ValueError(f"a detection of 'none' has distance 0, not {self.distance}")
        if self.label != "none" and not 1 <= self.distance <= REACH:
            raise ValueError(
                f"a detection of {self.label!r} has distance 1 to {REACH} cells, not {self.distance}"
            )


NOTHING: Final = Detection("none", 1.0, 0)
"""The truth of a view with nothing in the way."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One look ahead, and what there really was.

    Parameters
    ----------
    frame
        What the camera saw, RGB, shape (pixels, pixels, 3); None where no backend asked for it.
    truth
        What stands in the way, with confidence 1.
    size
        The obstacle's size, by which figures of accuracy are broken down; None if nothing is in the way
        or the size is not known.
    """

    frame: Frame | None
    truth: Detection
    size: Size | None = None


@runtime_checkable
class Backend(Protocol):
    """A way of telling what stands in the robot's way.

    `needs_frames` says whether `detect` reads frames; where it does not, nobody need render them.
    """

    name: str
    needs_frames: bool

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Return one detection a view, in order."""
        ...


@runtime_checkable
class Explains(Protocol):
    """A backend that can show what it saw."""

    def sketch(self, frame: Frame) -> Frame:
        """Return the frame with what the backend found drawn upon it, uint8 RGB."""
        ...
