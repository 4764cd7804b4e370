"""The geometry of a maze in metres: cells, walls as boxes, boxes as one mesh, the painted floor.

A cell is 1 m wide; x grows with the column and y shrinks with the row, so North is +y.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import floor
from typing import Final

import numpy as np
from numpy.typing import NDArray

from worlds.layout import DELTAS, Cell, Edge, Layout

WALL_HEIGHT: Final = 1.3
"""Metres; above the camera, so that a wall hides what is behind it."""
_WALL = 0.05  # half the thickness of walls and doors, in metres
_TILE = 8  # pixels of the floor's picture that a cell is wide
_BLUE, _WHITE = (46, 92, 200), (240, 240, 240)

Heading = tuple[float, float]
Corner = tuple[float, float, float]
Box = tuple[Corner, Corner]
"""Its lowest and its highest corner."""


def centre(cell: Cell) -> tuple[float, float]:
    """Return the x and y of a cell's centre, in metres.

    >>> centre(Cell(2, 4))
    (4.5, -2.5)
    """
    return cell.col + 0.5, -(cell.row + 0.5)


def cell_at(x: float, y: float) -> Cell:
    """Return the cell that a point lies in, which may be outside the layout.

    >>> cell_at(4.9, -2.1)
    Cell(row=2, col=4)
    """
    return Cell(floor(-y), floor(x))


def heading(action: int) -> Heading:
    """Return the unit vector along which an action goes.

    >>> heading(0), heading(2)
    ((0.0, 1.0), (-1.0, 0.0))
    """
    dr, dc = DELTAS[action]
    return float(dc), float(-dr)


def wall_boxes(layout: Layout) -> Iterator[Box]:
    """Yield a box for each outer wall, thin wall and solid cell."""
    east, south = float(layout.cols), -float(layout.rows)
    for y in (0.0, south):
        yield (-_WALL, y - _WALL, 0.0), (east + _WALL, y + _WALL, WALL_HEIGHT)
    for x in (0.0, east):
        yield (x - _WALL, south - _WALL, 0.0), (x + _WALL, _WALL, WALL_HEIGHT)
    for wall in sorted(layout.walls):
        yield thin(wall)
    for row, col in sorted(layout.solid):
        yield (col, -row - 1.0, 0.0), (col + 1.0, -row, WALL_HEIGHT)


def thin(between: Edge) -> Box:
    """Return the box on the edge between two cells."""
    _, (row, col) = between  # the cell to the East or South
    if between[0].row == row:
        return (col - _WALL, -row - 1.0, 0.0), (col + _WALL, -row, WALL_HEIGHT)
    return (col, -row - _WALL, 0.0), (col + 1.0, -row + _WALL, WALL_HEIGHT)


def middle(box: Box) -> Corner:
    """Return the centre of a box."""
    (x0, y0, z0), (x1, y1, z1) = box
    return (x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2


@dataclass(frozen=True)
class Mesh:
    """Triangles, as the lists that PyBullet takes.

    Keep one and use it again: PyBullet never frees the lists that it is given.
    """

    vertices: list[list[float]]
    normals: list[list[float]]
    indices: list[int]


def box_mesh(boxes: Iterable[Box]) -> Mesh:
    """Return the faces of boxes, 24 vertices to a box.

    >>> cube = box_mesh([((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))])
    >>> len(cube.vertices), len(cube.indices) // 3
    (24, 12)
    """
    corners = np.array(list(boxes))  # (boxes, low or high, xyz)
    vertices: list[NDArray[np.float64]] = []
    normals: list[NDArray[np.float64]] = []
    for axis in range(3):
        across, along = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            ring = ((0, 0), (1, 0), (1, 1), (0, 1)) if side else ((0, 0), (0, 1), (1, 1), (1, 0))
            for a, b in ring:  # counterclockwise, seen from outside
                vertex = np.empty((len(corners), 3))
                vertex[:, axis] = corners[:, side, axis]
                vertex[:, across] = corners[:, a, across]
                vertex[:, along] = corners[:, b, along]
                vertices.append(vertex)
            normals += [np.tile(np.eye(3)[axis] * (2 * side - 1), (len(corners), 1))] * 4
    quads = np.arange(24 * len(corners)).reshape(-1, 4)
    return Mesh(
        np.stack(vertices, axis=1).reshape(-1, 3).tolist(),
        np.stack(normals, axis=1).reshape(-1, 3).tolist(),
        quads[:, [0, 1, 2, 0, 2, 3]].ravel().tolist(),
    )


def ball_mesh(radius: float, meridians: int = 24) -> Mesh:
    """Return a ball about the origin; PyBullet's own is an edgy one of 16 meridians.

    >>> len(ball_mesh(0.25).vertices)
    325
    """
    around = np.linspace(0, 2 * np.pi, meridians + 1)
    down = np.linspace(0, np.pi, meridians // 2 + 1)
    ring, height = np.sin(down)[:, None], np.cos(down)[:, None]
    normals = np.stack([ring * np.cos(around), ring * np.sin(around), height + 0 * around], axis=-1)
    top_left = (np.arange(meridians // 2)[:, None] * (meridians + 1) + np.arange(meridians)).ravel()
    below = top_left + meridians + 1
    triangles = np.stack([top_left, below, top_left + 1, top_left + 1, below, below + 1], axis=1)
    flat = normals.reshape(-1, 3)
    return Mesh((radius * flat).tolist(), flat.tolist(), triangles.ravel().tolist())


def floor_mesh(rows: int, cols: int) -> Mesh:
    """Return the floor as one quad about the origin: a tile for each cell would cost as much as 64."""
    east, north = cols / 2, rows / 2
    corners = [[-east, -north, 0.0], [east, -north, 0.0], [east, north, 0.0], [-east, north, 0.0]]
    return Mesh(corners, [[0.0, 0.0, 1.0]] * 4, [0, 1, 2, 0, 2, 3])


def checker(rows: int, cols: int) -> NDArray[np.uint8]:
    """Return the floor's picture: blue and white, such that adjacent cells differ (section 4)."""
    parity = np.indices((rows, cols)).sum(axis=0) % 2
    tiles: NDArray[np.uint8] = np.array([_WHITE, _BLUE], dtype=np.uint8)[parity]
    return tiles.repeat(_TILE, axis=0).repeat(_TILE, axis=1)


def tga(picture: NDArray[np.uint8]) -> bytes:
    """Return an RGB picture, shape (height, width, 3), as an uncompressed TGA file."""
    height, width, _ = picture.shape
    size = width.to_bytes(2, "little") + height.to_bytes(2, "little")
    header = bytes([0, 0, 2]) + bytes(9) + size + bytes([24, 0x20])  # 24 bits, first row on top
    return b"".join((header, picture[:, :, ::-1].tobytes()))
