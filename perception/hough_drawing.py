"""What the Hough recogniser saw in a frame, and its picture, as in the paper's figure 11."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from perception.proposals import agree, cover
from perception.protocol import Detection, Frame
from perception.shapes import LEFT_SIDE, RIGHT_SIDE

Circle = tuple[float, float, float]
"""Column and row of the centre, and radius, in pixels."""
Line = tuple[float, float, float, float]
"""Column and row of one end, then of the other, in pixels."""


@dataclass(frozen=True)
class Evidence:
    """What the recogniser saw in a frame.

    Parameters
    ----------
    detection
        What it makes of it.
    cube, sphere
        Share of the best cube's and the best sphere's outline that edges bear out, in [0, 1], in the cell
        where the obstacle most likely is.
    circles, lines
        What the Hough transforms found and geometry let through: circles that a sphere at 1 or 2 cells
        could look like, and upright lines that could be a side of a cube there.
    circle
        The best sphere's outline there, as a circle; None if no sphere was proposed or reported.
    box
        The best cube's corners there (`perception.shapes.cube_corners`) as (column, row); empty if no cube
        was proposed or reported.
    """

    detection: Detection
    cube: float
    sphere: float
    circles: tuple[Circle, ...]
    lines: tuple[Line, ...]
    circle: Circle | None
    box: tuple[tuple[float, float], ...]


def draw(frame: Frame, evidence: Evidence, zoom: int = 3) -> Frame:
    """Return the frame, enlarged, with the evidence drawn on it, as in the paper's figure 11.

    Thick is the outline of the shape that was recognised: yellow for a sphere, magenta for a cube. Thin
    are the Hough circles that agree with the sphere, or the Hough lines along the cube's sides; where
    nothing is in the way, every circle and line that was looked into and refused.

    Returns
    -------
    Frame
        Shape (zoom * pixels, zoom * pixels, 3).
    """
    size = (frame.shape[1] * zoom, frame.shape[0] * zoom)
    picture = cv2.resize(frame, size, interpolation=cv2.INTER_NEAREST).astype(np.uint8)
    label = evidence.detection.label
    rings, lines = np.array(evidence.circles).reshape(-1, 3), np.array(evidence.lines).reshape(-1, 4)
    if label == "sphere":
        rings, lines = rings[agree(rings, np.array([evidence.circle]))[:, 0]], lines[:0]
    elif label == "cube":
        sides = np.array(evidence.box)[[LEFT_SIDE, RIGHT_SIDE]]
        rings, lines = rings[:0], lines[(cover(lines, sides) > 0).any(axis=0)]
    for col, row, radius in rings.tolist():
        _draw_circle(picture, (col, row, radius), zoom, (120, 255, 120), 1)
    for x1, y1, x2, y2 in lines.tolist():
        cv2.line(picture, _pixel(x1, y1, zoom), _pixel(x2, y2, zoom), (255, 160, 40), 1, cv2.LINE_AA)
    if label == "sphere" and evidence.circle is not None:
        _draw_circle(picture, evidence.circle, zoom, (255, 230, 0), 2)
    if label == "cube":
        corners = np.array([_pixel(col, row, zoom) for col, row in evidence.box], dtype=np.int32)
        left, front, right = corners[:3].astype(np.float64)
        # Square-on, its front has an upper edge as straight as the lower one.
        square = abs((left[1] + right[1]) / 2 - front[1]) < zoom
        cv2.polylines(picture, [corners, corners[[3, 6]]][: 1 + square], True, (255, 0, 255), 2, cv2.LINE_AA)
    return picture


def _draw_circle(picture: Frame, circle: Circle, zoom: int, colour: tuple[int, int, int], width: int) -> None:
    col, row, radius = circle
    cv2.circle(picture, _pixel(col, row, zoom), round(radius * zoom), colour, width, cv2.LINE_AA)


def _pixel(col: float, row: float, zoom: int) -> tuple[int, int]:
    return round(col * zoom), round(row * zoom)
