"""What OpenCV's Hough transforms find in a frame: circles, and upright lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, floor

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.edges import Gradients
from perception.protocol import Frame
from perception.shapes import Outlines

_NEAR = 2.2  # pixels that a line may lie beside the side of a cube that it covers


@dataclass(frozen=True)
class Window:
    """The part of a frame in which spheres at one distance can be, and how large they look there.

    Parameters
    ----------
    rows, cols
        The part.
    smallest, largest
        Radii of the spheres' outlines, in pixels.
    zoom
        How many times the part is enlarged first: circles of a few pixels gather too few votes.
    """

    rows: slice
    cols: slice
    smallest: float
    largest: float
    zoom: int


def window(spheres: Outlines, distance: int, pixels: int) -> Window:
    """Return where spheres at a distance (cells) can be seen in a frame, with a small margin."""
    chosen = spheres.distances == distance
    low = spheres.points[chosen].min(axis=(0, 1)) - 3
    high = spheres.points[chosen].max(axis=(0, 1)) + 3
    radii = spheres.marks[chosen, 2]
    return Window(
        rows=slice(max(0, floor(low[1])), min(pixels, ceil(high[1]))),
        cols=slice(max(0, floor(low[0])), min(pixels, ceil(high[0]))),
        smallest=float(radii.min()),
        largest=float(radii.max()),
        zoom=1 if radii.min() > 8 else 2,
    )


def circles(frame: Frame, windows: Sequence[Window], *, gradient: float, votes: float) -> NDArray[np.float64]:
    """Return the circles in every colour channel of every window.

    Parameters
    ----------
    frame
        Shape (pixels, pixels, 3).
    windows
        Where to look.
    gradient
        Canny's upper threshold.
    votes
        Edge pixels that must point to a centre.

    Returns
    -------
    NDArray[np.float64]
        Column and row of the centre, and radius, in pixels of the frame, shape (circles, 3).

    Examples
    --------
    >>> frame = np.full((64, 64, 3), 90, np.uint8)
    >>> _ = cv2.circle(frame, (30, 34), 12, (200, 30, 30), -1)
    >>> everywhere = Window(slice(0, 64), slice(0, 64), 8, 20, 1)
    >>> circles(frame, [everywhere], gradient=40, votes=12)[0].round(1).tolist()
    [30.5, 34.5, 11.4]
    """
    found = [np.zeros((0, 3))]
    for place in windows:
        for channel in range(3):
            part = np.ascontiguousarray(frame[place.rows, place.cols, channel])
            if not part.size:  # the camera does not look there
                continue
            if place.zoom > 1:
                part = cv2.resize(part, None, fx=place.zoom, fy=place.zoom).astype(np.uint8)
            raw = cv2.HoughCircles(
                part,
                cv2.HOUGH_GRADIENT,
                dp=1,
                minDist=3 * place.zoom,
                param1=gradient,
                param2=votes,
                minRadius=floor(place.smallest * place.zoom),
                maxRadius=ceil(place.largest * place.zoom),
            )
            if raw is not None:
                seen = raw.reshape(-1, raw.shape[-1])[:, :3].astype(np.float64)
                found.append(seen / place.zoom + (place.cols.start, place.rows.start, 0))
    return np.concatenate(found)


def upright_lines(found: Gradients, *, gradient: float, votes: int, gap: int) -> NDArray[np.float64]:
    """Return the lines that run more or less up the frame.

    Parameters
    ----------
    found
        The frame's gradients.
    gradient
        The least change across of an edge.
    votes
        Pixels that a line must pass through.
    gap
        Pixels in a row that it may miss.

    Returns
    -------
    NDArray[np.float64]
        Column and row of one end, then of the other, in pixels, shape (lines, 4).
    """
    across, down = np.abs(found)
    upright = ((across > gradient) & (across > 2 * down)).astype(np.uint8)
    shortest = max(3, found.shape[1] // 24)
    raw = cv2.HoughLinesP(upright, 1, np.pi / 180, votes, minLineLength=shortest, maxLineGap=gap)
    return np.zeros((0, 4)) if raw is None else raw.reshape(-1, 4) + 0.5


def cover(lines: NDArray[np.float64], sides: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the share of each side that each line covers: what the line runs along, side by side.

    Parameters
    ----------
    lines
        Shape (lines, 4).
    sides
        Ends of each side as (column, row), the lower end first, shape (sides, 2, 2).

    Returns
    -------
    NDArray[np.float64]
        Shape (sides, lines).

    Examples
    --------
    >>> side = np.array([[[10.0, 50.0], [10.0, 30.0]]])
    >>> cover(np.array([[11.0, 60.0, 11.0, 45.0], [20.0, 50.0, 20.0, 30.0]]), side).tolist()
    [[0.25, 0.0]]
    """
    (x0, y0), (x1, y1) = np.moveaxis(sides, 0, -1)[..., None]
    lean = (x1 - x0) / (y1 - y0)
    beside = np.maximum(
        np.abs(x0 + lean * (lines[:, 1] - y0) - lines[:, 0]),
        np.abs(x0 + lean * (lines[:, 3] - y0) - lines[:, 2]),
    )
    top, bottom = np.minimum(lines[:, 1], lines[:, 3]), np.maximum(lines[:, 1], lines[:, 3])
    shared = (np.minimum(bottom, y0) - np.maximum(top, y1)).clip(0) / (y0 - y1)
    return np.where(beside < _NEAR, shared, 0.0)


def agree(found: NDArray[np.float64], expected: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which circles found could be which expected, shape (found, expected).

    Parameters
    ----------
    found, expected
        Column and row of the centre, and radius, in pixels, shape (circles, 3).

    Examples
    --------
    >>> agree(np.array([[50.0, 50.0, 10.0]]), np.array([[51.0, 52.0, 9.0], [60.0, 50.0, 10.0]])).tolist()
    [[True, False]]
    """
    off = np.abs(found[:, None] - expected).max(axis=2)
    near: NDArray[np.bool_] = off < 1.5 + 0.1 * expected[:, 2]  # pixels, and the more the larger it is
    return near
