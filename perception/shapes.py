"""What cubes and spheres look like from the robot: their outlines in the frame, by distance and radius.

The robot stands at the centre of a cell and looks along an axis, and an obstacle rests on the floor at
the centre of a cell ahead. So its outline depends on three things alone: cube or sphere, how many cells
ahead, and its radius (half the edge for a cube).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from worlds.camera import Camera

Points = NDArray[np.float64]
"""Points of the frame as (column, row) in pixels, shape (..., 2)."""

LEFT_SIDE: Final = (0, 5)
RIGHT_SIDE: Final = (1, 2)
"""The corners (`cube_corners`) at the ends of a cube's sides, the lower one first."""
_AROUND = 48  # points on a sphere's outline
# Edges of a cube's outline: the corners at their ends, points on them, and their weight. The receding
# edges of the top are short, so the two count as one.
_EDGES = ((0, 5, 12, 1.0), (1, 2, 12, 1.0), (0, 1, 12, 1.0), (5, 4, 5, 0.5), (2, 3, 5, 0.5), (4, 3, 10, 1.0))


@dataclass(frozen=True, eq=False)
class Outlines:
    """The outlines of one kind of obstacle, one for each distance and radius.

    Parameters
    ----------
    distances, radii
        Cells ahead, and metres, shape (outlines,).
    points, normals
        Points along each outline and the unit normals there, shape (outlines, points, 2).
    weights
        Share of each point in the whole outline, shape (points,); they sum to 1.
    marks
        For spheres the circle, as column, row and radius in pixels, shape (outlines, 3). For cubes the
        corners of the front face and the top: bottom left, bottom right, top right, back right, back
        left, top left, shape (outlines, 6, 2).
    """

    distances: NDArray[np.int64]
    radii: NDArray[np.float64]
    points: Points
    normals: Points
    weights: NDArray[np.float64]
    marks: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.radii)


def sphere_outline(camera: Camera, distance: float, radius: float) -> Points:
    """Return points along the outline of a sphere that rests `distance` metres ahead, shape (48, 2).

    The outline is where the cone of sight lines touches the sphere: a circle, nearer to the lens than
    the sphere's centre, seen at a slant.

    Examples
    --------
    >>> points = sphere_outline(Camera(pixels=128), 1, 0.25)
    >>> points.min(axis=0).round().tolist(), points.max(axis=0).round().tolist()
    ([40.0, 52.0], [88.0, 100.0])
    """
    to_lens = np.array([camera.forward - distance, 0.0, camera.height - radius])
    far = float(np.linalg.norm(to_lens))
    towards = to_lens / far
    middle = np.array([distance, 0.0, radius]) + towards * radius**2 / far
    across = np.array([0.0, 1.0, 0.0])
    along = np.cross(towards, across)
    turn = np.arange(_AROUND)[:, None] * (2 * np.pi / _AROUND)
    ring = middle + radius * np.sqrt(1 - (radius / far) ** 2) * (np.cos(turn) * across + np.sin(turn) * along)
    return np.array([camera.project(*point) for point in ring])


def cube_corners(camera: Camera, distance: float, radius: float) -> Points:
    """Return the corners of a cube that stands `distance` metres ahead, face on, shape (6, 2).

    Bottom left, bottom right, top right, back right, back left, top left. Where the camera is too low to
    see the cube's top, the back corners are the top ones.

    Examples
    --------
    >>> cube_corners(Camera(pixels=128), 1, 0.25).round().tolist()[:3]
    [[39.0, 110.0], [89.0, 110.0], [93.0, 68.0]]
    """
    front, top = distance - radius, 2 * radius
    back = distance + radius if camera.height > top else front
    corners = (
        (front, -radius, 0.0),
        (front, radius, 0.0),
        (front, radius, top),
        (back, radius, top),
        (back, -radius, top),
        (front, -radius, top),
    )
    return np.array([camera.project(*corner) for corner in corners])


def sphere_outlines(camera: Camera, distances: NDArray[np.int64], radii: NDArray[np.float64]) -> Outlines:
    """Return the outlines of spheres for every distance (cells) and radius (metres)."""
    pairs = [(d, r) for d in distances.tolist() for r in radii.tolist()]
    points = np.array([sphere_outline(camera, d, r) for d, r in pairs])
    along = np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1)
    centres = points.mean(axis=1)
    circles = np.linalg.norm(points - centres[:, None], axis=2).mean(axis=1)
    return Outlines(
        *_columns(pairs),
        points=points,
        normals=_across(along),
        weights=np.full(_AROUND, 1 / _AROUND),
        marks=np.column_stack([centres, circles]),
    )


def cube_outlines(camera: Camera, distances: NDArray[np.int64], radii: NDArray[np.float64]) -> Outlines:
    """Return the outlines of cubes for every distance (cells) and radius (half the edge, metres)."""
    pairs = [(d, r) for d in distances.tolist() for r in radii.tolist()]
    corners = np.array([cube_corners(camera, d, r) for d, r in pairs])
    points, along, weights = [], [], []
    for one, other, count, weight in _EDGES:
        start, edge = corners[:, one, None], (corners[:, other] - corners[:, one])[:, None]
        points.append(start + (np.arange(count)[:, None] + 0.5) / count * edge)
        along.append(np.repeat(edge, count, axis=1))
        weights.append(np.full(count, weight / count))
    return Outlines(
        *_columns(pairs),
        points=np.concatenate(points, axis=1),
        normals=_across(np.concatenate(along, axis=1)),
        weights=np.concatenate(weights) / sum(weight for *_, weight in _EDGES),
        marks=corners,
    )


def _columns(pairs: list[tuple[int, float]]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    return np.array([d for d, _ in pairs], dtype=np.int64), np.array([r for _, r in pairs])


def _across(along: Points) -> Points:
    """Return the unit normals of tangents; zero where a tangent is (an edge that is not in sight)."""
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    unit = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
    return np.stack([unit[..., 1], -unit[..., 0]], axis=-1)
