"""The robot's camera as geometry: where a point in front of the robot falls in the frame.

The camera stands on a mast over the back of the robot and looks down at the two cells ahead. Set back
so, it keeps all of a large obstacle one cell ahead in the frame, and the robot's own body out of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import cos, radians, sin, tan
from typing import Final

import numpy as np
from numpy.typing import NDArray

from worlds.layout import Size

Matrix = NDArray[np.float64]

RADIUS: Final[Mapping[Size, float]] = {"small": 0.15, "middle": 0.25, "large": 0.35}
"""Radius of a sphere and half the edge of a cube, in metres; a cell is 1 m wide."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera fixed to the robot; square frames.

    Parameters
    ----------
    pixels
        Width and height of a frame.
    fov
        Angle of view, in degrees, the same across and down.
    height
        Of the lens above the floor, in metres.
    forward
        Of the lens from the robot's centre, in metres; negative is behind it. From -0.4 the lens
        stays clear of the walls of the robot's cell whichever way it turns.
    pitch
        How far below the horizon it looks, in degrees.
    near, far
        Nearest and farthest depth that is drawn, in metres.

    Examples
    --------
    >>> camera = Camera(pixels=128)
    >>> col, row = camera.project(1.0, 0.0, 0.25)  # the centre of a middle obstacle one cell ahead
    >>> round(col), round(row)
    (64, 76)
    """

    pixels: int = 96
    fov: float = 44.0
    height: float = 1.2
    forward: float = -0.4
    pitch: float = 30.0
    near: float = 0.1
    far: float = 20.0

    def __post_init__(self) -> None:
        if self.pixels < 1 or not 0 < self.fov < 180 or not 0 < self.near < self.far:
            raise ValueError("a camera needs pixels >= 1, 0 < fov < 180 and 0 < near < far")

    def view(self, x: float, y: float, heading: tuple[float, float]) -> Matrix:
        """Return the matrix from the world to the camera, shape (4, 4), for column vectors.

        Parameters
        ----------
        x, y
            The robot's centre, in metres.
        heading
            Unit vector along which it faces, in the plane.
        """
        ahead = np.array([heading[0], heading[1], 0.0])
        up = np.array([0.0, 0.0, 1.0])
        pitch = radians(self.pitch)
        look = cos(pitch) * ahead - sin(pitch) * up
        right = np.array([heading[1], -heading[0], 0.0])
        axes = np.stack([right, np.cross(right, look), -look])
        eye = np.array([x, y, self.height]) + self.forward * ahead
        matrix = np.eye(4)
        matrix[:3, :3] = axes
        matrix[:3, 3] = -axes @ eye
        return matrix

    @cached_property
    def projection(self) -> Matrix:
        """The matrix from the camera to clip coordinates, shape (4, 4), as OpenGL defines it."""
        focal = 1.0 / tan(radians(self.fov) / 2)
        depth = self.near - self.far
        return np.array(
            [
                [focal, 0.0, 0.0, 0.0],
                [0.0, focal, 0.0, 0.0],
                [0.0, 0.0, (self.far + self.near) / depth, 2 * self.far * self.near / depth],
                [0.0, 0.0, -1.0, 0.0],
            ]
        )

    @cached_property
    def _own(self) -> Matrix:
        """From the robot's frame (ahead, to its left, up) to clip coordinates."""
        return self.projection @ self.view(0.0, 0.0, (1.0, 0.0))

    def project(self, ahead: float, lateral: float, height: float) -> tuple[float, float]:
        """Return where a point in the robot's frame falls, as (column, row) in pixels.

        (0, 0) is the frame's top left corner and (pixels, pixels) its bottom right one, so pixel
        [r, c] covers rows r to r + 1 and columns c to c + 1. The point may lie outside the frame.

        Parameters
        ----------
        ahead, lateral, height
            Metres ahead of the robot's centre, to its right, and above the floor.

        Raises
        ------
        ValueError
            If the point is not in front of the lens.
        """
        x, y, _, w = self._own @ np.array([ahead, -lateral, height, 1.0])
        if w <= 0:
            raise ValueError(f"the point {ahead} m ahead, {height} m up is not in front of the lens")
        return float((x / w + 1) / 2 * self.pixels), float((1 - y / w) / 2 * self.pixels)
