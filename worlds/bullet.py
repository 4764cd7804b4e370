"""PyBullet clients that print nothing, and the obstacles that are put into them."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from worlds.camera import RADIUS
from worlds.geometry import Mesh, ball_mesh
from worlds.layout import Kind, Size


@contextmanager
def silent() -> Iterator[None]:
    """Throw away what C code writes to standard output and standard error meanwhile.

    PyBullet prints when it is imported and when it connects; a command must print only its own text.
    """
    libc = ctypes.CDLL(None)
    sys.stdout.flush()
    sys.stderr.flush()
    libc.fflush(None)
    kept = {stream: os.dup(stream) for stream in (1, 2)}
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for stream in kept:
            os.dup2(nowhere, stream)
        yield
    finally:
        libc.fflush(None)  # C keeps its own buffer, which would come out later otherwise
        for stream, copy in kept.items():
            os.dup2(copy, stream)
            os.close(copy)
        os.close(nowhere)


with silent():
    import pybullet
    from pybullet_utils.bullet_client import BulletClient


def connect() -> Any:
    """Return a new PyBullet client without a window; its `disconnect` ends it."""
    with silent():
        return BulletClient(pybullet.DIRECT)


def rgba(colour: str) -> tuple[float, float, float, float]:
    """Return '#rrggbb' as PyBullet's red, green, blue and opacity in 0 to 1.

    >>> rgba("#ff0033")
    (1.0, 0.0, 0.2, 1.0)
    """
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue, 1.0


def obstacle_shapes(client: Any, kind: Kind, size: Size) -> tuple[int, int]:
    """Return the collision shape and the visual shape of an obstacle.

    Make them once and use them again: PyBullet frees a shape only when the simulation is reset.
    """
    radius = RADIUS[size]
    if kind == "cube":
        half = (radius, radius, radius)
        return (
            client.createCollisionShape(client.GEOM_BOX, halfExtents=half),
            client.createVisualShape(client.GEOM_BOX, halfExtents=half, specularColor=(0, 0, 0)),
        )
    ball = _ball(size)
    return (
        client.createCollisionShape(client.GEOM_SPHERE, radius=radius),
        client.createVisualShape(
            client.GEOM_MESH,
            vertices=ball.vertices,
            normals=ball.normals,
            indices=ball.indices,
            specularColor=(0, 0, 0),
        ),
    )


@cache
def _ball(size: Size) -> Mesh:
    return ball_mesh(RADIUS[size])
