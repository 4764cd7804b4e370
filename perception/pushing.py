"""Push trials: which obstacles roll (section 6.1 of the paper, free of any goal).

The robot pushes a free obstacle over one cell in PyBullet. What the obstacle then did is told by how
far it turned over its path, not by how far it came: on ice a cube comes as far as a sphere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from math import acos, degrees, hypot, pi
from typing import Any, Final, Literal

import numpy as np

from worlds.bullet import connect, obstacle_shapes
from worlds.camera import RADIUS
from worlds.layout import KINDS, SIZES, Kind, Size
from worlds.randomness import Stream
from worlds.scene import ROBOT_HEIGHT, ROBOT_RADIUS

PushLabel = Literal["rolls", "slides", "topples", "stays"]
LABELS: Final[tuple[PushLabel, ...]] = ("rolls", "slides", "topples", "stays")

FRICTIONS: Final = (0.02, 0.1, 0.3, 0.6, 0.9)
"""Coefficients of friction between obstacle and floor; the first is ice."""
SPEEDS: Final = (0.1, 0.25, 0.5, 1.0)
"""Speeds of the robot, in metres per second."""
DENSITY: Final = 400.0
"""Of a full obstacle, in kg per cubic metre: light wood."""

_STEP = 1 / 120  # seconds
_STRENGTH = 120.0  # newtons: a large cube is too heavy for the robot, except on ice
_STIFFNESS = 0.8  # share of the robot's lag that a physics step makes good
_PUSH = 1.0  # metres that the robot goes on after it touches the obstacle
_COAST = 0.5  # seconds that the obstacle is watched for after the push
_GAP = 0.02  # metres between robot and obstacle at the start
_CLEARANCE = 0.01  # metres between robot and floor
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
        The trial: the obstacle, its friction with the floor, the robot's speed in m/s, kg.
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

    kind: Kind
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


def mass_of(kind: Kind, size: Size) -> float:
    """Return the mass of a full obstacle, in kg.

    >>> mass_of("cube", "middle")
    50.0
    """
    radius = RADIUS[size]
    return DENSITY * (8.0 if kind == "cube" else 4 / 3 * pi) * radius**3


def push_trial(
    kind: Kind,
    size: Size,
    friction: float = 0.6,
    speed: float = 0.5,
    mass: float | None = None,
    *,
    offset: float = 0.0,
    clearance: float = _CLEARANCE,
) -> PushResult:
    """Push one obstacle and tell what it did.

    Parameters
    ----------
    kind, size
        The obstacle.
    friction
        Coefficient between obstacle and floor.
    speed
        Of the robot, in m/s. Its force is limited: what is too heavy stays.
    mass
        In kg; 0 fixes the obstacle to the floor. By default that of light wood.
    offset
        Metres by which the push misses the obstacle's centre, to the side.
    clearance
        Metres between the floor and the robot's body, which is 0.2 m high: a push from high up can
        topple a cube.

    Raises
    ------
    ValueError
        If friction or mass is negative, or speed is not positive.

    Examples
    --------
    >>> push_trial("sphere", "middle").label, push_trial("cube", "middle", mass=0).label
    ('rolls', 'stays')
    """
    mass = mass_of(kind, size) if mass is None else mass
    trial = _Trial(kind, size, friction, speed, mass, offset, clearance)
    with _range() as client:
        return _push(client, trial)


def push_trials(seed: int, n: int = 120) -> tuple[PushResult, ...]:
    """Push `n` obstacles of all kinds and sizes, over several frictions and at several speeds.

    The conditions are gone through in an order that `seed` shuffles, over and over if n is greater
    than their number (120); masses vary by a fifth and pushes miss the centre by up to 4 cm.
    """
    stream = Stream(seed, 61)  # 61: the paper's section, so that no other stream of this seed is met
    conditions = stream.shuffled(list(product(KINDS, SIZES, FRICTIONS, SPEEDS)))
    results = []
    with _range() as client:
        for i in range(n):
            kind, size, friction, speed = conditions[i % len(conditions)]
            mass = mass_of(kind, size) * stream.between(0.8, 1.2)
            offset = stream.between(-0.04, 0.04)
            results.append(_push(client, _Trial(kind, size, friction, speed, mass, offset)))
    return tuple(results)


def rollable(kind: Kind) -> bool:
    """Return what the paper's rule says of an obstacle's kind (eq. 8): a sphere is rollable.

    >>> rollable("sphere"), rollable("cube")
    (True, False)
    """
    return kind == "sphere"


@dataclass(frozen=True)
class Agreement:
    """How often the rule of eq. 8 held, by two ways to tell what rolled.

    Parameters
    ----------
    trials
        How many trials there were.
    rotation
        In how many "sphere <=> rolls" held, rolling told by rotation over path.
    displacement
        In how many it would have held, had all that came half a cell or more counted as rolling.
    counts
        Number of trials by kind and label.
    """

    trials: int
    rotation: int
    displacement: int
    counts: dict[Kind, dict[PushLabel, int]]


def agreement(results: Sequence[PushResult]) -> Agreement:
    """Count how often a trial's obstacle rolled exactly if the rule says so.

    Examples
    --------
    >>> on_ice = [push_trial(kind, "middle", friction=0.02) for kind in ("cube", "sphere")]
    >>> measured = agreement(on_ice)
    >>> measured.rotation, measured.displacement  # the cube slides as far as the sphere rolls
    (2, 1)
    """
    return Agreement(
        trials=len(results),
        rotation=sum(result.rolled == rollable(result.kind) for result in results),
        displacement=sum((result.displacement >= 0.5) == rollable(result.kind) for result in results),
        counts={
            kind: {
                label: sum(result.kind == kind and result.label == label for result in results)
                for label in LABELS
            }
            for kind in KINDS
        },
    )


@contextmanager
def _range() -> Iterator[Any]:
    """Yield a client for trials."""
    client = connect()
    try:
        yield client
    finally:
        client.disconnect()


@dataclass(frozen=True)
class _Trial:
    """The conditions of a trial; see `push_trial`."""

    kind: Kind
    size: Size
    friction: float
    speed: float
    mass: float
    offset: float
    clearance: float = _CLEARANCE

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
    body = client.createMultiBody(trial.mass, *shapes, (0, 0, radius))
    client.changeDynamics(body, -1, lateralFriction=trial.friction, linearDamping=0, angularDamping=0)
    robot, grip = _add_robot(client, (-(radius + _GAP + ROBOT_RADIUS), trial.offset, height))
    places, spins, tilt = [(0.0, 0.0)], [], 0.0
    pushing = int((_PUSH + _GAP) / trial.speed / _STEP)
    for k in range(pushing + int(_COAST / _STEP)):
        x = client.getBasePositionAndOrientation(robot)[0][0]
        # The grip is always a step ahead of the robot, so a robot that is stopped gathers no swing.
        lead = trial.speed * _STEP / _STIFFNESS if k < pushing else 0.0
        client.changeConstraint(grip, (x + lead, trial.offset, height), maxForce=_STRENGTH)
        client.stepSimulation()
        at, turn = client.getBasePositionAndOrientation(body)
        spin_x, spin_y, _ = client.getBaseVelocity(body)[1]
        places.append(at[:2])
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
