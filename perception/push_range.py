"""One push: the robot goes against a free obstacle in PyBullet, and tells what the obstacle did.

What it did is told by how far it turned over its path, not by how far it came: on ice a cube comes as far
as a sphere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import acos, cos, degrees, hypot, pi, radians, sin
from types import TracebackType
from typing import Any, Final, Literal, Self

import numpy as np

from worlds.bullet import Form, connect, height_of, obstacle_shapes
from worlds.camera import RADIUS
from worlds.layout import Size
from worlds.scene import ROBOT_HEIGHT, ROBOT_RADIUS, upright

PushLabel = Literal["rolls", "slides", "topples", "stays"]
LABELS: Final[tuple[PushLabel, ...]] = ("rolls", "slides", "topples", "stays")
DENSITY: Final = 400.0
"""Of a full obstacle, in kg per cubic metre: light wood."""

CLEARANCE: Final = 0.01
"""Metres between floor and robot."""

_STEP = 1 / 120  # seconds
_STRENGTH = 120.0  # newtons: a large cube is too heavy for the robot, except on ice
_STIFFNESS = 0.8  # share of the robot's lag that a physics step makes good
_PUSH = 1.0  # metres that the robot goes on after it touches the obstacle
_COAST = 0.5  # seconds that the obstacle is watched for after the push
_GAP = 0.02  # metres between robot and obstacle at the start
_STAYS = 0.1  # metres of path up to which an obstacle counts as not moved
_ROLLS = 0.5  # rotation over path from which it counts as rolling
_TURNED = 2 / 3 * pi  # radians that it must have turned besides
_TOPPLES = 45.0  # degrees of tilt
_STILL = 0.2  # radians per second


@dataclass(frozen=True)
class PushResult:
    """What one push did.

    Parameters
    ----------
    kind, size, friction, speed, mass
        The trial: the obstacle (a cube, a sphere or another solid), its friction with the floor, the
        robot's speed in m/s, kg.
    label
        What the obstacle did.
    ratio
        Rotation over path: the integral of |omega_xy| times the radius, over the path; 1 for a sphere
        that rolls without slipping, 0 for one that only slides.
    path, displacement
        Metres that the centre travelled, and from its first to its last place.
    turned
        Integral of |omega_xy|, in radians.
    tilt
        Greatest angle between the obstacle's own up axis and the vertical, in degrees.
    """

    kind: Form
    size: Size
    friction: float
    speed: float
    mass: float
    label: PushLabel
    ratio: float
    path: float
    displacement: float
    turned: float
    tilt: float

    @property
    def rolled(self) -> bool:
        """Whether the label is "rolls"."""
        return self.label == "rolls"


def mass_of(kind: Form, size: Size) -> float:
    """Return the mass of a full obstacle, in kg; solids that are no sphere weigh what a cube does.

    >>> mass_of("cube", "middle")
    50.0
    """
    radius = RADIUS[size]
    return DENSITY * (4 / 3 * pi if kind == "sphere" else 8.0) * radius**3


class PushRange:
    """A bare floor on which one obstacle after the other is pushed; a context manager.

    No push depends on those before it.

    Examples
    --------
    >>> with PushRange() as pushes:
    ...     [pushes.push(kind, "small", 0.5, 0.5).label for kind in ("sphere", "cube")]
    ['rolls', 'slides']
    """

    def __init__(self) -> None:
        self._client = connect()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.disconnect()

    def push(
        self,
        kind: Form,
        size: Size,
        friction: float,
        speed: float,
        mass: float | None = None,
        *,
        offset: float = 0.0,
        clearance: float = CLEARANCE,
        yaw: float = 0.0,
    ) -> PushResult:
        """Push one obstacle and tell what it did; see `perception.pushing.push_trial`."""
        mass = mass_of(kind, size) if mass is None else mass
        return _push(self._client, _Trial(kind, size, friction, speed, mass, offset, clearance, yaw))


@dataclass(frozen=True)
class _Trial:
    """The conditions of a trial; see `perception.pushing.push_trial`."""

    kind: Form
    size: Size
    friction: float
    speed: float
    mass: float
    offset: float
    clearance: float
    yaw: float

    def __post_init__(self) -> None:
        if self.friction < 0 or self.mass < 0 or self.speed <= 0:
            raise ValueError(
                f"a push needs friction >= 0, mass >= 0 and speed > 0, "
                f"not {self.friction}, {self.mass} and {self.speed}"
            )


def _push(client: Any, trial: _Trial) -> PushResult:
    radius, height = RADIUS[trial.size], trial.clearance + ROBOT_HEIGHT / 2
    _lay_floor(client)
    shapes = obstacle_shapes(client, trial.kind, trial.size)
    at = (0, 0, height_of(trial.kind, trial.size))
    body = client.createMultiBody(trial.mass, *shapes, at, upright(trial.yaw))
    client.changeDynamics(body, -1, lateralFriction=trial.friction, linearDamping=0, angularDamping=0)
    robot, grip = _add_robot(client, (-(_extent(trial) + _GAP + ROBOT_RADIUS), trial.offset, height))
    places, spins, tilt = [(0.0, 0.0)], [], 0.0
    pushing = int((_PUSH + _GAP) / trial.speed / _STEP)
    for k in range(pushing + int(_COAST / _STEP)):
        x = client.getBasePositionAndOrientation(robot)[0][0]
        # The grip is always a step ahead of the robot, so a robot that is stopped gathers no swing.
        lead = trial.speed * _STEP / _STIFFNESS if k < pushing else 0.0
        client.changeConstraint(grip, (x + lead, trial.offset, height), maxForce=_STRENGTH)
        client.stepSimulation()
        now, turn = client.getBasePositionAndOrientation(body)
        spin_x, spin_y, _ = client.getBaseVelocity(body)[1]
        places.append(now[:2])
        spins.append(hypot(spin_x, spin_y))
        tilt = max(tilt, _tilt(turn))
    steps = np.diff(np.array(places), axis=0)
    path = float(np.hypot(steps[:, 0], steps[:, 1]).sum())
    turned = sum(spins) * _STEP
    ratio = turned * radius / path if path > 0 else 0.0
    return PushResult(
        kind=trial.kind,
        size=trial.size,
        friction=trial.friction,
        speed=trial.speed,
        mass=trial.mass,
        label=_label(path, ratio, turned, tilt, spins[-1]),
        ratio=ratio,
        path=path,
        displacement=hypot(*places[-1]),
        turned=turned,
        tilt=tilt,
    )


def _extent(trial: _Trial) -> float:
    """Return how far an obstacle may reach towards the robot from its centre, in metres."""
    radius = RADIUS[trial.size]
    if trial.kind == "sphere":
        return radius
    turn = radians(trial.yaw)
    # Turned, a cube shows the robot an edge; the other solids fit into a box a quarter wider.
    wide = 1.0 if trial.kind == "cube" else 1.25
    return radius * wide * (abs(cos(turn)) + abs(sin(turn)))


def _label(path: float, ratio: float, turned: float, tilt: float, spin: float) -> PushLabel:
    """Return what an obstacle did; `spin` is how fast it turns at the end, in rad/s."""
    if path <= _STAYS and tilt <= _TOPPLES:
        return "stays"
    # A cube that falls over turns by a right angle over a short path, and that is all.
    if ratio > _ROLLS and turned > _TURNED:
        return "rolls"
    # What is tilted and still turns is no fallen cube but a sphere that skids.
    return "topples" if tilt > _TOPPLES and spin < _STILL else "slides"


def _tilt(turn: Sequence[float]) -> float:
    """Return the angle between a body's up axis and the vertical, in degrees."""
    x, y, _, _ = turn
    return degrees(acos(min(max(1 - 2 * (x * x + y * y), -1.0), 1.0)))


def _lay_floor(client: Any) -> None:
    client.resetSimulation()
    client.setGravity(0, 0, -9.81)
    client.setTimeStep(_STEP)
    client.setPhysicsEngineParameter(deterministicOverlappingPairs=1, erp=_STIFFNESS)
    floor = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_BOX, halfExtents=(10, 10, 0.5)), -1, (0, 0, -0.5)
    )
    client.changeDynamics(floor, -1, lateralFriction=1.0)  # friction is the product of two bodies'


def _add_robot(client: Any, place: tuple[float, float, float]) -> tuple[int, int]:
    """Add a robot, and the grip that drags it with limited force."""
    shape = client.createCollisionShape(client.GEOM_CYLINDER, radius=ROBOT_RADIUS, height=ROBOT_HEIGHT)
    robot = client.createMultiBody(20.0, shape, -1, place)
    client.changeDynamics(robot, -1, lateralFriction=0.1)
    grip = client.createConstraint(robot, -1, -1, -1, client.JOINT_FIXED, (0, 0, 0), (0, 0, 0), place)
    return robot, grip
