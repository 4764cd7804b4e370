"""PyBullet clients that print nothing, and the obstacles that are put into them."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import pairwise
from math import cos, hypot, pi, sin
from typing import Any, Final, Literal

from worlds.camera import RADIUS
from worlds.geometry import Corner, Mesh, ball_mesh
from worlds.layout import Size

Form = Literal["cube", "sphere", "cylinder", "cone", "pyramid", "dome", "block", "post"]
"""A solid that PyBullet can be given; the kinds of obstacles are the first two."""
UNKNOWN_FORMS: Final[tuple[Form, ...]] = ("cylinder", "cone", "pyramid", "dome", "block", "post")
"""Solids that no layout knows, all of which stand on a flat base: none of them rolls when pushed."""

_BOXES: Final = {"cube": (1.0, 1.0, 1.0), "block": (1.0, 0.7, 0.45), "post": (0.55, 0.55, 1.4)}
"""Half the edges of boxes, as multiples of the radius."""
_PROFILES: Final = {
    "cylinder": (((1.0, -1.0), (1.0, 1.0)), 24),
    "cone": (((1.0, -1.0), (0.0, 1.0)), 24),
    "pyramid": (((1.2, -0.8), (0.0, 0.8)), 4),
    "dome": (
        tuple((1.25 * (cos(k * pi / 12) if k < 6 else 0.0), 1.25 * sin(k * pi / 12) - 0.5) for k in range(7)),
        24,
    ),
}
"""Radius and height of the rings of solids of revolution, as multiples of the radius, and their sides."""


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


def height_of(form: Form, size: Size) -> float:
    """Return how far above the floor the origin of a solid that stands on it is, in metres.

    >>> height_of("cube", "middle"), height_of("dome", "middle")
    (0.25, 0.125)
    """
    if form in _PROFILES:
        return -_PROFILES[form][0][0][1] * RADIUS[size]
    return _BOXES.get(form, (1.0, 1.0, 1.0))[2] * RADIUS[size]


def obstacle_shapes(client: Any, form: Form, size: Size) -> tuple[int, int]:
    """Return the collision shape and the visual shape of an obstacle.

    Make them once and use them again: PyBullet frees a shape only when the simulation is reset.
    """
    radius = RADIUS[size]
    if form in _BOXES:
        half = [radius * share for share in _BOXES[form]]
        return (
            client.createCollisionShape(client.GEOM_BOX, halfExtents=half),
            client.createVisualShape(client.GEOM_BOX, halfExtents=half, specularColor=(0, 0, 0)),
        )
    mesh = _mesh(form, size)
    visual = client.createVisualShape(
        client.GEOM_MESH,
        vertices=mesh.vertices,
        normals=mesh.normals,
        indices=mesh.indices,
        specularColor=(0, 0, 0),
    )
    if form == "sphere":
        return client.createCollisionShape(client.GEOM_SPHERE, radius=radius), visual
    # Without indices PyBullet takes the vertices' convex hull.
    return client.createCollisionShape(client.GEOM_MESH, vertices=mesh.vertices), visual


@cache
def _mesh(form: Form, size: Size) -> Mesh:
    if form == "sphere":
        return ball_mesh(RADIUS[size])
    rings, sides = _PROFILES[form]
    return turned_mesh([(RADIUS[size] * across, RADIUS[size] * up) for across, up in rings], sides)


def turned_mesh(rings: Sequence[tuple[float, float]], sides: int) -> Mesh:
    """Return a solid of revolution about the vertical with flat facets, open neither above nor below.

    Parameters
    ----------
    rings
        Radius and height of each ring, from the lowest to the highest.
    sides
        Number of corners of a ring.

    Examples
    --------
    >>> len(turned_mesh([(1.0, 0.0), (0.0, 1.0)], 4).indices) // 3  # 4 sides and 4 of the base
    8
    """
    closed = [(0.0, rings[0][1]), *rings, (0.0, rings[-1][1])]
    out = Mesh([], [], [])
    for (r0, z0), (r1, z1) in pairwise(closed):
        if r0 == r1 == 0:  # the tip is the top
            continue
        for k in range(sides):
            a, b = (2 * pi * (k + j + 0.5) / sides for j in (0, 1))
            lower = [_at(r0, a, z0), _at(r0, b, z0)][: 2 if r0 else 1]
            upper = [_at(r1, b, z1), _at(r1, a, z1)][: 2 if r1 else 1]
            length = hypot(z1 - z0, r0 - r1)
            normal = _at((z1 - z0) / length, (a + b) / 2, (r0 - r1) / length)
            _facet(out, lower + upper, normal)
    return out


def _at(radius: float, angle: float, z: float) -> Corner:
    return radius * cos(angle), radius * sin(angle), z


def _facet(mesh: Mesh, corners: Sequence[Corner], normal: Corner) -> None:
    first = len(mesh.vertices)
    mesh.vertices.extend(list(corner) for corner in corners)
    mesh.normals.extend(list(normal) for _ in corners)
    for k in range(1, len(corners) - 1):
        mesh.indices.extend((first, first + k, first + k + 1))
