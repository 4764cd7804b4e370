"""The bodies of a maze in one PyBullet client: floor, walls, doors, robot, obstacles.

They are few: one body for the floor, one for all the walls, one for each door, one for the robot and
one for each obstacle. What rendering and physics cost goes by the number of bodies.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from worlds.bullet import Form, connect, height_of, obstacle_shapes, rgba
from worlds.camera import Matrix
from worlds.geometry import (
    WALL_HEIGHT,
    Corner,
    Heading,
    box_mesh,
    centre,
    checker,
    floor_mesh,
    middle,
    tga,
    thin,
    wall_boxes,
)
from worlds.layout import Cell, Edge, Layout, Obstacle, Size

TIME_STEP: Final = 1 / 30
"""Seconds that one physics step covers."""
ROBOT_RADIUS: Final = 0.22
ROBOT_HEIGHT: Final = 0.2
_ROBOT_Z = ROBOT_HEIGHT / 2 + 0.01  # clear of the floor
_ROBOT_FORCE = 5000.0  # newtons with which the robot is dragged, at most
_STIFFNESS = 0.8  # share of the robot's lag behind its grip that a physics step makes good
_FRICTION = 5.0  # between sphere and floor: enough for a sphere that is pushed hard to roll at once
_DOORS, _ROBOT, _NOSE = "#b5302a", "#3a3a44", "#20d0d0"
_CORNERS = [[0, 0], [1, 0], [1, 1], [0, 1]]  # of the texture, for the corners of the floor
_ROOT = 0.5**0.5
_QUATERNIONS = {  # that turn +x to a heading
    (1.0, 0.0): (0.0, 0.0, 0.0, 1.0),
    (0.0, 1.0): (0.0, 0.0, _ROOT, _ROOT),
    (-1.0, 0.0): (0.0, 0.0, 1.0, 0.0),
    (0.0, -1.0): (0.0, 0.0, -_ROOT, _ROOT),
}


@dataclass(frozen=True)
class Look:
    """How a maze is painted and lit; by default as in the paper.

    Parameters
    ----------
    floor
        The two colours of the floor's cells, ``#rrggbb``; the first is that of cell (0, 0).
    walls
        The colour of the walls.
    ambient, diffuse
        Share of the light that falls on every side alike, and on the sides that face the lamp.
    tint
        Red, green and blue of the light, from 0 to 1.
    lamp
        Where the light stands, seen from the robot: metres ahead, to its left, and up.

    Examples
    --------
    >>> Look(walls="#404040").floor
    ('#f0f0f0', '#2e5cc8')
    """

    floor: tuple[str, str] = ("#f0f0f0", "#2e5cc8")
    walls: str = "#8c7a66"
    ambient: float = 0.55
    diffuse: float = 0.45
    tint: Corner = (1.0, 1.0, 1.0)
    lamp: Corner = (-0.5, 0.35, 1.0)


def upright(yaw: float) -> tuple[float, float, float, float]:
    """Return the quaternion of a turn by `yaw` degrees about the vertical.

    >>> upright(0.0)
    (0.0, 0.0, 0.0, 1.0)
    """
    return 0.0, 0.0, sin(radians(yaw) / 2), cos(radians(yaw) / 2)


class Scene:
    """A layout's bodies in a client of their own.

    Parameters
    ----------
    layout
        The maze.
    folder
        Where the floor's texture may be written; it must last as long as the scene.

    Attributes
    ----------
    client
        The PyBullet client.
    robot, grip
        The robot's body, and the constraint that drags it.
    doors
        The doors' bodies.
    look
        How the maze is painted and lit; `paint` changes it.
    """

    def __init__(self, layout: Layout, folder: Path) -> None:
        self.layout = layout
        self.look = Look()
        self.client = connect()
        # Else a texture is read once and never again, whatever its file has come to hold.
        self.client.setPhysicsEngineParameter(enableFileCaching=0)
        self._floor = floor_mesh(layout.rows, layout.cols)
        self._walls = box_mesh(wall_boxes(layout))
        self._texture = folder / "floor.tga"
        self.paint(self.look)

    def paint(self, look: Look) -> None:
        """Paint and light the maze, and start afresh (`rebuild`)."""
        self.look = look
        picture = checker(self.layout.rows, self.layout.cols)
        even = (picture == picture[0, 0]).all(axis=-1, keepdims=True)
        first, second = (np.array(list(bytes.fromhex(colour[1:])), np.uint8) for colour in look.floor)
        self._texture.write_bytes(tga(np.where(even, first, second)))
        self.rebuild()

    def rebuild(self) -> None:
        """Start afresh, without obstacles and with doors shut, whatever the scene went through.

        Everything is built again, so nothing of the past (contacts, the order of bodies) is left.
        """
        client = self.client
        client.resetSimulation()
        client.setGravity(0, 0, -9.81)
        client.setTimeStep(TIME_STEP)
        client.setPhysicsEngineParameter(deterministicOverlappingPairs=1, erp=_STIFFNESS)
        self._obstacles: list[int] = []
        self._shapes: dict[tuple[Form, Size], tuple[int, int]] = {}
        self._add_floor()
        self._add_walls()
        self.doors = tuple(self._add_door(door) for door in sorted(self.layout.doors))
        self.robot, self.grip = self._add_robot()

    def add(self, obstacle: Obstacle, cell: Cell, yaw: float = 0.0, form: Form | None = None) -> int:
        """Put an obstacle at the centre of a cell and return its body.

        Parameters
        ----------
        obstacle, cell
            What is put where.
        yaw
            By how many degrees it is turned about the vertical.
        form
            The solid to show in place of its kind's.
        """
        key = form or obstacle.kind, obstacle.size
        if key not in self._shapes:
            self._shapes[key] = obstacle_shapes(self.client, *key)
        # A cube of mass 0 stays; a heavy one would creep when the robot nudges it.
        mass = 1.0 if obstacle.kind == "sphere" else 0.0
        body: int = self.client.createMultiBody(
            mass, *self._shapes[key], (*centre(cell), height_of(*key)), upright(yaw)
        )
        self.client.changeVisualShape(body, -1, rgbaColor=rgba(obstacle.colour))
        self.client.changeDynamics(body, -1, lateralFriction=_FRICTION, rollingFriction=0.002)
        self._obstacles.append(body)
        return body

    def clear(self) -> None:
        """Take every obstacle away."""
        while self._obstacles:
            self.client.removeBody(self._obstacles.pop())

    def set_doors(self, *, doors_open: bool) -> None:
        """Open the doors, which sink into the floor, or shut them."""
        for body, door in zip(self.doors, sorted(self.layout.doors), strict=True):
            at = middle(thin(door))
            z = -at[2] - 0.1 if doors_open else at[2]
            self.client.resetBasePositionAndOrientation(body, (*at[:2], z), (0, 0, 0, 1))

    def doors_open(self) -> bool:
        """Return whether every door's top is below the floor."""
        heights = [self.client.getBasePositionAndOrientation(door)[0][2] for door in self.doors]
        return all(height < -WALL_HEIGHT / 2 for height in heights)

    def put_robot(self, x: float, y: float, towards: Heading) -> None:
        """Put the robot at x, y at once, facing along a heading."""
        place, turn = (x, y, _ROBOT_Z), _QUATERNIONS[towards]
        self.client.resetBasePositionAndOrientation(self.robot, place, turn)
        self.drag_robot(x, y, towards)

    def drag_robot(self, x: float, y: float, towards: Heading) -> None:
        """Move the point that drags the robot; it follows in the next physics steps."""
        self.client.changeConstraint(
            self.grip, (x, y, _ROBOT_Z), _QUATERNIONS[towards], maxForce=_ROBOT_FORCE
        )

    def position(self, body: int) -> tuple[float, float]:
        """Return the x and y of a body's centre."""
        x, y, _ = self.client.getBasePositionAndOrientation(body)[0]
        return x, y

    def image(self, pixels: int, view: Matrix, projection: Matrix, light: Corner) -> NDArray[np.uint8]:
        """Render what a camera sees, as RGB, shape (pixels, pixels, 3)."""
        client = self.client
        _, _, colours, _, _ = client.getCameraImage(
            pixels,
            pixels,
            view.ravel(order="F").tolist(),
            projection.ravel(order="F").tolist(),
            lightDirection=light,
            lightColor=self.look.tint,
            lightAmbientCoeff=self.look.ambient,
            lightDiffuseCoeff=self.look.diffuse,
            lightSpecularCoeff=0.0,
            shadow=0,  # shadows paint moire stripes on floor and walls
            renderer=client.ER_TINY_RENDERER,
            flags=client.ER_NO_SEGMENTATION_MASK,
        )
        return np.ascontiguousarray(np.asarray(colours, dtype=np.uint8).reshape(pixels, pixels, 4)[:, :, :3])

    def _add_floor(self) -> None:
        client, layout = self.client, self.layout
        east, north = layout.cols / 2, layout.rows / 2
        collision = client.createCollisionShape(client.GEOM_BOX, halfExtents=(east, north, 0.5))
        visual = client.createVisualShape(
            client.GEOM_MESH,
            vertices=self._floor.vertices,
            normals=self._floor.normals,
            uvs=_CORNERS,
            indices=self._floor.indices,
            specularColor=(0, 0, 0),
            visualFramePosition=(0, 0, 0.5),
        )
        body = client.createMultiBody(0, collision, visual, (east, -north, -0.5))
        client.changeVisualShape(body, -1, textureUniqueId=client.loadTexture(str(self._texture)))

    def _add_walls(self) -> None:
        client = self.client
        walls = self._walls
        visual = client.createVisualShape(
            client.GEOM_MESH,
            vertices=walls.vertices,
            normals=walls.normals,
            indices=walls.indices,
            rgbaColor=rgba(self.look.walls),
            specularColor=(0, 0, 0),
        )
        collision = client.createCollisionShape(
            client.GEOM_MESH,
            vertices=walls.vertices,
            indices=walls.indices,
            flags=client.GEOM_FORCE_CONCAVE_TRIMESH,
        )
        client.createMultiBody(0, collision, visual)

    def _add_door(self, door: Edge) -> int:
        client = self.client
        low, high = thin(door)
        half = [(b - a) / 2 for a, b in zip(low, high, strict=True)]
        collision = client.createCollisionShape(client.GEOM_BOX, halfExtents=half)
        visual = client.createVisualShape(
            client.GEOM_BOX, halfExtents=half, rgbaColor=rgba(_DOORS), specularColor=(0, 0, 0)
        )
        body: int = client.createMultiBody(0, collision, visual, middle((low, high)))
        return body

    def _add_robot(self) -> tuple[int, int]:
        client = self.client
        collision = client.createCollisionShape(
            client.GEOM_CYLINDER, radius=ROBOT_RADIUS, height=ROBOT_HEIGHT
        )
        visual = client.createVisualShapeArray(
            shapeTypes=[client.GEOM_CYLINDER, client.GEOM_BOX],
            radii=[ROBOT_RADIUS, 0],
            lengths=[ROBOT_HEIGHT, 0],
            halfExtents=[[0, 0, 0], [0.08, 0.05, 0.02]],  # a nose, to tell where it faces
            visualFramePositions=[[0, 0, 0], [0.12, 0, ROBOT_HEIGHT / 2]],
            rgbaColors=[rgba(_ROBOT), rgba(_NOSE)],
        )
        place = (*centre(self.layout.start), _ROBOT_Z)
        robot = client.createMultiBody(20.0, collision, visual, place)
        client.changeDynamics(robot, -1, lateralFriction=0.0)
        grip = client.createConstraint(robot, -1, -1, -1, client.JOINT_FIXED, (0, 0, 0), (0, 0, 0), place)
        return robot, grip
