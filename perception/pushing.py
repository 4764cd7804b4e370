"""Push trials: which obstacles roll (section 6.1 of the paper, free of any goal).

The robot pushes free obstacles over one cell each (`perception.push_range`), of all kinds and sizes, over
several frictions and at several speeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

from perception.push_range import CLEARANCE, DENSITY, LABELS, PushLabel, PushRange, PushResult, mass_of
from worlds.bullet import Form
from worlds.layout import KINDS, SIZES, Kind, Size
from worlds.randomness import Stream

__all__ = [
    "DENSITY",
    "FRICTIONS",
    "LABELS",
    "SPEEDS",
    "Agreement",
    "PushLabel",
    "PushRange",
    "PushResult",
    "agreement",
    "mass_of",
    "push_trial",
    "push_trials",
    "rollable",
]

FRICTIONS: Final = (0.02, 0.1, 0.3, 0.6, 0.9)
"""Coefficients of friction between obstacle and floor; the first is ice."""
SPEEDS: Final = (0.1, 0.25, 0.5, 1.0)
"""Speeds of the robot, in metres per second."""


def push_trial(
    kind: Form,
    size: Size,
    friction: float = 0.6,
    speed: float = 0.5,
    mass: float | None = None,
    *,
    offset: float = 0.0,
    clearance: float = CLEARANCE,
    yaw: float = 0.0,
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
    yaw
        Degrees by which the obstacle is turned about the vertical.

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
    with PushRange() as pushes:
        return pushes.push(kind, size, friction, speed, mass, offset=offset, clearance=clearance, yaw=yaw)


def push_trials(seed: int, n: int = 120) -> tuple[PushResult, ...]:
    """Push `n` obstacles of all kinds and sizes, over several frictions and at several speeds.

    The conditions are gone through in an order that `seed` shuffles, over and over if n is greater
    than their number (120); masses vary by a fifth and pushes miss the centre by up to 4 cm.
    """
    stream = Stream(seed, 61)  # 61: the paper's section, so that no other stream of this seed is met
    conditions = stream.shuffled(list(product(KINDS, SIZES, FRICTIONS, SPEEDS)))
    results = []
    with PushRange() as pushes:
        for i in range(n):
            kind, size, friction, speed = conditions[i % len(conditions)]
            mass = mass_of(kind, size) * stream.between(0.8, 1.2)
            offset = stream.between(-0.04, 0.04)
            results.append(pushes.push(kind, size, friction, speed, mass, offset=offset))
    return tuple(results)


def rollable(kind: Form) -> bool:
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
