"""What every backend of perception takes and gives: views or frames in, detections or percepts out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Final, Literal, Protocol, get_args, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from worlds import Size

if TYPE_CHECKING:
    from perception.percepts import Percepts

Frame = NDArray[np.uint8]
"""A picture from the robot's camera, shape (pixels, pixels, 3), RGB."""
Frames = NDArray[np.uint8]
"""A batch of pictures, shape (frames, rows, columns, 3), RGB."""
Label = Literal["none", "cube", "sphere"]
LABELS: Final[tuple[Label, ...]] = get_args(Label)
"""The labels, in the order of a confusion matrix's rows and columns, and of probabilities."""
Chances = tuple[float, float, float]
"""Probabilities of none, cube and sphere, in the order of `LABELS`."""
REACH: Final = 2
"""How many cells ahead an obstacle is looked for."""
_ROUNDING: Final = 1e-6  # probabilities may miss a sum of 1 by so much
_LEAST: Final = 0.4  # more than a third: what a label's probability is taken for where confidence is lower


@dataclass(frozen=True, slots=True, repr=False)
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
    probabilities
        Of none, cube and sphere, summing to 1. The label is the likeliest of them and the confidence its
        probability, unless the backend abstains. None where the backend gives a confidence only; `chances`
        then spreads what is left of it.
    abstains
        Whether the backend would rather not tell the shape: the label is then its best guess, and the
        robot finds out by pushing.

    Raises
    ------
    ValueError
        If a field is out of its range, or two fields contradict each other.

    Examples
    --------
    >>> Detection("cube", 0.9, 2)
    Detection(label='cube', confidence=0.9, distance=2)
    >>> Detection("cube", 0.75, 2, probabilities=(0.05, 0.75, 0.2)).chances
    (0.05, 0.75, 0.2)
    >>> Detection("none", 1.0, 1)
    Traceback (most recent call last):
        ...
    ValueError: a detection of 'none' has distance 0, not 1
    """

    label: Label
    confidence: float
    distance: int
    probabilities: Chances | None = None
    abstains: bool = False

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
        if self.probabilities is not None:
            self._check(self.probabilities)

    def _check(self, chances: Chances) -> None:
        """Refuse probabilities that are none, or that say something else than label and confidence."""
        possible = len(chances) == len(LABELS) and all(isfinite(p) and 0 <= p <= 1 for p in chances)
        if not possible or abs(sum(chances) - 1) > _ROUNDING:
            raise ValueError(
                f"probabilities {chances} must be {len(LABELS)} numbers from 0 to 1 that sum to 1"
            )
        own = chances[LABELS.index(self.label)]
        if abs(own - self.confidence) > _ROUNDING:
            raise ValueError(f"confidence {self.confidence} is not the probability of {self.label!r}, {own}")
        if not self.abstains and own < max(chances) - _ROUNDING:
            raise ValueError(f"{self.label!r} is not the likeliest label by the probabilities {chances}")

    @property
    def chances(self) -> Chances:
        """The probabilities of none, cube and sphere; where none are given, from label and confidence.

        What the confidence leaves over is shared evenly by the other two labels. However low a confidence
        is, the label stays the likeliest.

        Examples
        --------
        >>> Detection("sphere", 0.5, 1).chances
        (0.25, 0.25, 0.5)
        """
        if self.probabilities is not None:
            return self.probabilities
        own = max(self.confidence, _LEAST)
        rest = (1.0 - own) / 2
        none, cube, sphere = (own if label == self.label else rest for label in LABELS)
        return none, cube, sphere

    def __repr__(self) -> str:
        said = f"label={self.label!r}, confidence={self.confidence!r}, distance={self.distance!r}"
        if self.probabilities is not None:
            said += f", probabilities={self.probabilities!r}"
        return f"Detection({said}{', abstains=True' if self.abstains else ''})"


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
class FrameBackend(Backend, Protocol):
    """A backend that goes by frames alone. `perception.percepts.Sees` gives it `detect`."""

    def perceive(self, frames: Frames) -> Percepts:
        """Return what stands ahead in each frame of a batch, uint8, shape (frames, rows, columns, 3).

        Raises
        ------
        UserError
            If the batch is empty or no batch of frames (`perception.percepts.checked_frames`).
        """
        ...


@runtime_checkable
class Explains(Protocol):
    """A backend that can show what it saw."""

    def sketch(self, frame: Frame) -> Frame:
        """Return the frame with what the backend found drawn upon it, uint8 RGB."""
        ...
