"""What cubes and spheres look like from the robot: their outlines in the frame, by distance and radius.

The robot stands at the centre of a cell and looks along an axis, and an obstacle rests on the floor at
the centre of a cell ahead. So its outline depends on few things: cube or sphere, how many cells ahead,
its radius (half the edge for a cube), and by how much a cube is turned about the upright.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from worlds.camera import Camera

Points = NDArray[np.float64]
"""Points of the frame as (column, row) in pixels, shape (..., 2)."""

LEFT_SIDE: Final = (0, 6)
RIGHT_SIDE: Final = (2, 3)
"""The corners (`cube_corners`) at the ends of a cube's sides, the lower one first."""
_AROUND = 48  # points on an outline


@dataclass(frozen=True, eq=False)
class Outlines:
    """The outlines of one kind of obstacle, one for each distance, radius and yaw.

    Parameters
    ----------
    distances, radii
        Cells ahead, and metres, shape (outlines,).
    points, normals
        Points along each outline and the unit normals there, shape (outlines, points, 2).
    marks
        For spheres the circle, as column, row and radius in pixels, shape (outlines, 3). For cubes the
        corners of the outline (`cube_corners`), shape (outlines, 7, 2).
    """

    distances: NDArray[np.int64]
    radii: NDArray[np.float64]
    points: Points
    normals: Points
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


def cube_corners(camera: Camera, distance: float, radius: float, yaw: float = 0.0) -> Points:
    """Return the corners of the outline of a cube that stands `distance` metres ahead, shape (7, 2).

    Along the floor from left to right: left, foremost, right; then along the top from right to left:
    right, back right, back left, left. Face on, nothing is foremost, and the middle of the lower edge
    stands for it; seen over a corner, the two at the back are one. A camera too low to see the cube's top
    sees the upper edges of its front instead.

    Parameters
    ----------
    camera
        The camera.
    distance
        From the robot to the cube's centre, in metres.
    radius
        Half the cube's edge, in metres.
    yaw
        By how many degrees the cube is turned about the upright.

    Examples
    --------
    >>> cube_corners(Camera(pixels=128), 1, 0.25).round().tolist()[:4]
    [[39.0, 110.0], [64.0, 110.0], [89.0, 110.0], [93.0, 68.0]]
    >>> cube_corners(Camera(pixels=128), 1, 0.25, 45).round().tolist()[:3]
    [[33.0, 94.0], [64.0, 118.0], [95.0, 94.0]]
    """
    turns = np.radians(yaw) + np.pi / 4 + np.arange(4) * np.pi / 2
    base = radius * np.sqrt(2) * np.column_stack([np.cos(turns), np.sin(turns)])
    base[:, 0] += distance  # ahead, and to the right
    bearing = np.arctan2(base[:, 1], base[:, 0] - camera.forward)
    order = np.argsort(bearing, kind="stable")
    left = min(order[:2], key=lambda i: (bearing[i].round(9), base[i, 0]))
    right = min(order[2:], key=lambda i: (-bearing[i].round(9), base[i, 0]))
    middle = (base[left] + base[right]) / 2
    others = [base[i] for i in range(4) if i not in (left, right)]
    away = np.array([1.0, -1.0]) * (base[right] - base[left])[::-1]  # from the camera
    near = [corner for corner in others if (corner - middle) @ away < 0]
    far = sorted((corner for corner in others if (corner - middle) @ away >= 0), key=lambda c: -c[1])
    front = near[0] if near else middle
    if camera.height > 2 * radius:
        back = [far[0], far[-1]]
    else:
        back = [front, front] if near else [base[right], base[left]]
    floor = [(*corner, 0.0) for corner in (base[left], front, base[right])]
    top = [(*corner, 2 * radius) for corner in (base[right], *back, base[left])]
    return np.array([camera.project(*corner) for corner in floor + top])


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
        marks=np.column_stack([centres, circles]),
    )


def cube_outlines(
    camera: Camera,
    distances: NDArray[np.int64],
    radii: NDArray[np.float64],
    yaws: NDArray[np.float64] | tuple[float, ...] = (0.0,),
) -> Outlines:
    """Return the outlines of cubes for every distance (cells), radius (half the edge, metres) and yaw.

    Examples
    --------
    >>> outlines = cube_outlines(Camera(), np.array([1, 2]), np.array([0.1, 0.2]), (0.0, 30.0, 60.0))
    >>> outlines.points.shape, outlines.marks.shape
    ((12, 48, 2), (12, 7, 2))
    """
    triples = [(d, r, yaw) for d in distances.tolist() for r in radii.tolist() for yaw in yaws]
    corners = np.array([cube_corners(camera, *triple) for triple in triples])
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(edges, axis=2)
    ends = lengths.cumsum(axis=1)
    along = (np.arange(_AROUND) + 0.5) / _AROUND * ends[:, -1:]  # way along the outline, in pixels
    edge = (along[:, :, None] >= ends[:, None]).sum(axis=2)
    start = np.take_along_axis(ends - lengths, edge, axis=1)
    share = (along - start) / np.take_along_axis(lengths, edge, axis=1)
    tangents = np.take_along_axis(edges, edge[:, :, None], axis=1)
    points = np.take_along_axis(corners, edge[:, :, None], axis=1) + share[:, :, None] * tangents
    return Outlines(
        *_columns([(d, r) for d, r, _ in triples]),
        points=points,
        normals=_across(tangents),
        marks=corners,
    )


def _columns(pairs: list[tuple[int, float]]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    return np.array([d for d, _ in pairs], dtype=np.int64), np.array([r for _, r in pairs])


def _across(along: Points) -> Points:
    """Return the unit normals of tangents; zero where a tangent is (an edge that is not in sight)."""
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    unit = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
    return np.stack([unit[..., 1], -unit[..., 0]], axis=-1)
