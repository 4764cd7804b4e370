"""Sobel gradients of a frame, and how well outlines are borne out by them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.protocol import Frame
from perception.shapes import Outlines

Gradients = NDArray[np.float32]
"""Change across and down, shape (2, rows, columns)."""


def gradients(frame: Frame) -> Gradients:
    """Return each pixel's Sobel gradient, of the colour channel in which it is steepest.

    An edge between two colours of the same brightness is an edge in some channel.

    Examples
    --------
    >>> frame = np.zeros((5, 5, 3), np.uint8)
    >>> frame[:, 3:, 2] = 10  # a step of 10 in blue, four times that by Sobel's weights
    >>> gradients(frame)[:, 2, 2].tolist()
    [40.0, 0.0]
    """
    all_across, all_down = cv2.Sobel(frame, cv2.CV_32F, 1, 0), cv2.Sobel(frame, cv2.CV_32F, 0, 1)
    channels = zip(cv2.split(all_across), cv2.split(all_down), strict=True)
    best_across, best_down = next(channels)
    best = cv2.magnitude(best_across, best_down)
    for across, down in channels:
        steep = cv2.magnitude(across, down)
        steeper = steep > best
        best_across = np.where(steeper, across, best_across)
        best_down = np.where(steeper, down, best_down)
        best = np.maximum(best, steep)
    return np.stack([best_across, best_down])


def noise(found: Gradients) -> float:
    """Return the gradient of a frame where there is no edge: its median, for edges are few.

    Examples
    --------
    >>> noise(gradients(np.full((8, 8, 3), 7, np.uint8)))
    0.0
    """
    across, down = found[:, ::2, ::2]  # a quarter of the pixels will do
    return float(np.median(np.hypot(across, down)))


class OutlineReader:
    """Reads from gradients how well each of many outlines is borne out.

    Parameters
    ----------
    outlines
        The outlines.
    pixels
        Width and height of a frame.
    """

    def __init__(self, outlines: Outlines, pixels: int) -> None:
        # An outline may be off by one pixel along its normal; outside the frame nothing bears it out.
        steps = np.array([-1.0, 0.0, 1.0])[:, None, None, None]
        place = np.floor(outlines.points + steps * outlines.normals).astype(np.int64)
        self._inside = ((place >= 0) & (place < pixels)).all(axis=-1)
        col, row = np.moveaxis(place.clip(0, pixels - 1), -1, 0)
        self._flat = row * pixels + col
        self._across, self._down = np.moveaxis(outlines.normals, -1, 0).astype(np.float32)

    def evidence(self, found: Gradients, *, steep: float, alignment: float) -> NDArray[np.float64]:
        """Return the share of each outline that edges of its direction bear out, shape (outlines,).

        Parameters
        ----------
        found
            The frame's gradients.
        steep
            The gradient from which on a point is borne out in full.
        alignment
            Least cosine of the angle between gradient and normal.
        """
        across, down = found.reshape(2, -1)[:, self._flat]
        through = np.abs(across * self._across + down * self._down)
        aligned = self._inside & (through >= alignment * np.sqrt(across * across + down * down))
        borne_out = (np.minimum(through / steep, 1.0) * aligned).max(axis=0)
        share: NDArray[np.float64] = borne_out.mean(axis=1, dtype=np.float64)
        return share
