"""What the frames of a data set vary in, and the scenes drawn so.

Scene number i of a seed is a function of seed, i and variation alone, as in `perception.frames`; unlike
there, floor, walls, light and the obstacles' turn vary too, and things stand beside the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final, get_args

from perception.frames import Ways, ways_ahead
from perception.protocol import REACH
from perception.push_range import mass_of
from worlds import DELTAS, KINDS, SIZES, Cell, Layout, Obstacle, Size, Stream, UserError, load_layout
from worlds.bullet import Form
from worlds.generate import generate_layout
from worlds.scene import Look

FAMILIES: Final[tuple[Form, ...]] = get_args(Form)
"""The solids that can stand in the way; the first two are the kinds that layouts know."""
MAZES: Final = 4
"""Scenes of varied walls lie in so many mazes, the paper's and drawn ones."""
_MOST_BESIDE: Final = 3
_BEYOND: Final = 0.15  # probability that something stands just out of reach where the way is free
_PAPERS_FLOOR: Final = 0.25  # probability that a varied floor is the paper's blue and white
_NEAR: Final = (96, 64, 40, 20, 8)  # most that a camouflaged obstacle's red, green and blue are off


@dataclass(frozen=True)
class Variation:
    """What varies from frame to frame, besides place, distance, size and colour of what is in the way.

    Parameters
    ----------
    floor
        The two colours of the floor.
    walls
        The colour of the walls, and the maze (one of `MAZES`).
    light
        How strong it is, its colour, and where the lamp stands.
    rotation
        Obstacles are turned about the vertical.
    distractors
        Up to three obstacles beside the way, and at times one on it, farther than `REACH` cells.
    camouflage
        0, or how far the colour of what is in the way comes near that of the floor, 1 to 5.
    families
        What stands in the way, each as often; solids other than "cube" and "sphere" are for measuring
        what backends make of things they have never seen.

    Raises
    ------
    UserError
        If `camouflage` is out of range or a family is not known.

    Examples
    --------
    >>> Variation(floor=False) == Variation(), CLEAN.light
    (False, False)
    """

    floor: bool = True
    walls: bool = True
    light: bool = True
    rotation: bool = True
    distractors: bool = True
    camouflage: int = 0
    families: tuple[Form, ...] = KINDS

    def __post_init__(self) -> None:
        if not 0 <= self.camouflage <= len(_NEAR):
            raise UserError(
                f"camouflage is 0 (none) to {len(_NEAR)} (colour of the floor), not {self.camouflage}"
            )
        wrong = [family for family in self.families if family not in FAMILIES]
        if wrong or not self.families:
            raise UserError(f"families {list(self.families)}; use one or more of {', '.join(FAMILIES)}")


CLEAN: Final = Variation(floor=False, walls=False, light=False, rotation=False, distractors=False)
"""The paper's maze as it is painted, one obstacle at most, cubes square to the way."""


@dataclass(frozen=True)
class PushScene:
    """A robot somewhere in a maze, what stands around it, and how it is going to push what is in its way.

    Parameters
    ----------
    maze
        Number of the maze (`maze`).
    robot, action, doors_open
        The robot's cell, the action along which it faces, whether the doors are open.
    family, distance
        What stands at most `REACH` cells ahead, None if nothing does, and how many cells (0 if nothing).
    obstacles
        Every obstacle; the one in the way comes first.
    forms, yaws
        By obstacle's name: its solid, and its turn in degrees.
    look
        Paint and light.
    friction, speed, mass, offset
        Of the push: coefficient, m/s, kg, metres off the centre.
    slip
        By how much odometry is off, as a share of the way driven.
    """

    maze: int
    robot: Cell
    action: int
    doors_open: bool
    family: Form | None
    distance: int
    obstacles: tuple[Obstacle, ...]
    forms: dict[str, Form]
    yaws: dict[str, float]
    look: Look
    friction: float
    speed: float
    mass: float
    offset: float
    slip: float


@cache
def maze(number: int) -> Layout:
    """Return the maze of a number: 0 is the paper's, the others are drawn.

    Examples
    --------
    >>> maze(0).name, maze(1).rows
    ('two_rooms', 8)
    """
    if number == 0:
        return load_layout("two_rooms")
    return generate_layout(8, 8, number, rooms=(number, 2), obstacles=0)


@cache
def _ways_of(number: int) -> Ways:
    return ways_ahead(maze(number))


def push_scene(seed: int, number: int, variation: Variation) -> PushScene:
    """Draw one scene and one push.

    Of scenes 0 to 2, 3 to 5, ... one has nothing in the way; of the others each family has as many.
    Distance, size, colour, doors and place are drawn evenly; the
    friction evenly from 0.02 (ice) to 0.9, the speed from 0.1 to 1 m/s.

    Examples
    --------
    >>> [push_scene(1, i, CLEAN).family for i in range(3)].count(None)
    1
    """
    stream = Stream(seed, 2, number)  # 0 and 1 are those of `perception.frames`
    family = _family(seed, number, variation)
    place = stream.below(MAZES) if variation.walls else 0
    doors_open = stream.below(2) == 1
    distance = 0 if family is None else 1 + stream.below(REACH)
    here = _ways_of(place)[doors_open]
    robot, action, way = stream.choose([item for item in here if len(item[2]) >= distance])
    look = _look(Stream(seed, 3, number), variation)
    size, colour = stream.choose(SIZES), _colour(stream)
    if variation.camouflage:
        colour = _near(stream, stream.choose(look.floor), _NEAR[variation.camouflage - 1])
    obstacles, forms = [], {}
    if family is not None:
        obstacles.append(_obstacle("ahead", family, way[distance - 1], size, colour))
        forms["ahead"] = family
    if variation.distractors:
        free = {cell for cell, _, _ in here} - {robot, *way}
        beyond = way[REACH:] if family is None else ()
        for i, cell in enumerate(_elsewhere(Stream(seed, 4, number), robot, action, free, beyond)):
            own = Stream(seed, 5, number, i)
            name, other = f"other{i + 1}", own.choose(variation.families)
            obstacles.append(_obstacle(name, other, cell, own.choose(SIZES), _colour(own)))
            forms[name] = other
    turns = Stream(seed, 6, number)
    push = Stream(seed, 7, number)
    return PushScene(
        maze=place,
        robot=robot,
        action=action,
        doors_open=doors_open,
        family=family,
        distance=distance,
        obstacles=tuple(obstacles),
        forms=forms,
        yaws={o.name: turns.between(0.0, 360.0) if variation.rotation else 0.0 for o in obstacles},
        look=look,
        friction=push.between(0.02, 0.9),
        speed=push.between(0.1, 1.0),
        mass=mass_of(family or "cube", size) * push.between(0.8, 1.2),
        offset=push.between(-0.04, 0.04),
        slip=push.between(-0.03, 0.03),
    )


def _family(seed: int, number: int, variation: Variation) -> Form | None:
    """Return what stands in the way: nothing in one of each three scenes, families in turn in the others."""
    trio, turn = divmod(number, 3)
    slot = Stream(seed, 1, trio).shuffled((None, 0, 1))[turn]
    if slot is None:
        return None
    lot, place = divmod(2 * trio + slot, len(variation.families))
    return Stream(seed, 8, lot).shuffled(variation.families)[place]


def _elsewhere(
    stream: Stream, robot: Cell, action: int, free: set[Cell], beyond: Sequence[Cell]
) -> list[Cell]:
    """Return the cells of things that are not in the way: some beside it, at times one farther on."""
    (north, west), side = DELTAS[action], DELTAS[action][::-1]
    beside = [
        Cell(robot.row + k * north + j * side[0], robot.col + k * west + j * side[1])
        for k in range(4)
        for j in (-2, -1, 1, 2)
    ]
    cells = stream.shuffled([cell for cell in beside if cell in free])[: stream.below(_MOST_BESIDE + 1)]
    if beyond and stream.uniform() < _BEYOND:
        cells.append(stream.choose(beyond[:2]))
    return cells


def _look(stream: Stream, variation: Variation) -> Look:
    paint = Look()
    floor, walls = paint.floor, paint.walls
    if variation.floor and stream.uniform() >= _PAPERS_FLOOR:
        # Red, green and blue each differ by a quarter to three quarters of their range: cells stay apart.
        first = [stream.below(256) for _ in range(3)]
        floor = _hex(first), _hex([(value + 64 + stream.below(128)) % 256 for value in first])
    if variation.walls:
        walls = _colour(stream)
    if not variation.light:
        return Look(floor, walls)
    return Look(
        floor,
        walls,
        ambient=stream.between(0.3, 0.7),
        diffuse=stream.between(0.25, 0.6),
        tint=(stream.between(0.8, 1.0), stream.between(0.8, 1.0), stream.between(0.8, 1.0)),
        lamp=(stream.between(-1.0, 0.2), stream.between(-1.0, 1.0), 1.0),
    )


def _obstacle(name: str, family: Form, cell: Cell, size: Size, colour: str) -> Obstacle:
    return Obstacle(name, "sphere" if family == "sphere" else "cube", cell, size, colour)


def _colour(stream: Stream) -> str:
    return f"#{stream.below(1 << 24):06x}"


def _near(stream: Stream, colour: str, most: int) -> str:
    values = bytes.fromhex(colour[1:])
    return _hex([min(max(value - most + stream.below(2 * most + 1), 0), 255) for value in values])


def _hex(colour: Sequence[int]) -> str:
    return "#" + bytes(colour).hex()
