"""Frames that the robot labels itself: it looks ahead, drives on, and pushes what it meets.

A frame's label is what the push did ("rolls" is a sphere, all else a cube, nothing met is none), its
distance what the robot's odometry says. What the scene really holds is kept beside it, to measure how far
the two agree, and for nothing else. Frame i is a function of seed, i and variation alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, fields
from math import ceil
from types import MappingProxyType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from perception.protocol import LABELS, REACH, Frame
from perception.push_range import PushRange
from perception.variation import PushScene, Variation, maze, push_scene
from worlds import Stream, UserError
from worlds.camera import RADIUS, Camera
from worlds.scene import ROBOT_RADIUS
from worlds.twin import Twin

PIXELS: Final = Camera().pixels
"""Width and height of a data set's frames."""
_HEADINGS: Final = (90.0, 270.0, 180.0, 0.0)  # of the actions, in degrees from East
_WRONG: Final = 9  # names the stream of wrong labels

COLUMNS: Final[Mapping[str, tuple[str, tuple[int, ...]]]] = MappingProxyType(
    {
        "frames": ("|u1", (PIXELS, PIXELS, 3)),
        "labels": ("<i8", ()),
        "distances": ("<i8", ()),
        "kinds": ("<U8", ()),
        "pushes": ("<U8", ()),
        "sizes": ("<U6", ()),
        "true_distances": ("<i8", ()),
        "colours": ("|u1", (3,)),
        "frictions": ("<f8", ()),
        "speeds": ("<f8", ()),
        "rotations": ("<f8", ()),
        "floors": ("|u1", (2, 3)),
        "walls": ("|u1", (3,)),
        "lights": ("<f8", (2,)),
        "mazes": ("<i8", ()),
        "distractors": ("<i8", ()),
    }
)
"""Type and shape of one row of each column."""


@dataclass(frozen=True, eq=False)
class PushedFrames:
    """Frames and what the robot found out about each.

    Where nothing stands in the way, the columns on it hold zero, "nothing" or the empty string.

    Parameters
    ----------
    frames
        RGB, uint8, shape (n, 96, 96, 3).
    labels, distances
        The robot's own: index into `LABELS` by what the push did, and cells ahead by odometry; (n,).
    kinds, true_distances
        The scene's: "none", "cube", "sphere" or another solid, and cells ahead; (n,). Not for training.
    pushes
        "rolls", "slides", "topples", "stays" or "nothing"; (n,).
    sizes, colours, rotations
        Of what is in the way: "small", "middle" or "large", (n,); RGB, (n, 3); degrees, (n,).
    frictions, speeds
        Of the push, (n,).
    floors, walls, lights
        The floor's two colours, (n, 2, 3); the walls' colour, (n, 3); ambient and diffuse light, (n, 2).
    mazes, distractors
        Number of the maze, and how many things stand elsewhere; (n,).
    """

    frames: NDArray[np.uint8]
    labels: NDArray[np.int64]
    distances: NDArray[np.int64]
    kinds: NDArray[np.str_]
    pushes: NDArray[np.str_]
    sizes: NDArray[np.str_]
    true_distances: NDArray[np.int64]
    colours: NDArray[np.uint8]
    frictions: NDArray[np.float64]
    speeds: NDArray[np.float64]
    rotations: NDArray[np.float64]
    floors: NDArray[np.uint8]
    walls: NDArray[np.uint8]
    lights: NDArray[np.float64]
    mazes: NDArray[np.int64]
    distractors: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, rows: slice | NDArray[Any]) -> Self:
        """Return some of the rows, by slice, mask or numbers."""
        return type(self)(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    @property
    def truth(self) -> NDArray[np.int64]:
        """The label that the scene's description gives: what is no sphere is unrollable, a "cube"; (n,)."""
        known = np.where(self.kinds == "sphere", LABELS.index("sphere"), LABELS.index("cube"))
        return np.where(self.kinds == "none", LABELS.index("none"), known).astype(np.int64)

    @property
    def agreement(self) -> float:
        """Share of the frames whose own label is the scene's, in [0, 1]; 1 of none."""
        return float((self.labels == self.truth).mean()) if len(self) else 1.0

    def as_described(self) -> Self:
        """Return the same frames with the scene's labels and distances: to measure by, not to learn from."""
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        return type(self)(**{**columns, "labels": self.truth, "distances": self.true_distances})

    def mislabelled(self, share: float, seed: int) -> Self:
        """Return the same frames with a share of the labels wrong, each made one of the other two.

        Raises
        ------
        UserError
            If the share is not from 0 to 1.
        """
        if not 0.0 <= share <= 1.0:
            raise UserError(f"the share of wrong labels is from 0 to 1, not {share}")
        stream = Stream(seed, _WRONG)
        chosen = np.argsort(stream.uniforms(len(self)), kind="stable")[: round(share * len(self))]
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        labels = self.labels.copy()
        by = 1 + (stream.uniforms(len(chosen)) * (len(LABELS) - 1)).astype(np.int64)
        labels[chosen] = (labels[chosen] + by) % len(LABELS)
        # A label without a distance, or a distance without a label, would be no mistake of a push.
        distances = np.where(labels == 0, 0, np.maximum(self.distances, 1))
        return type(self)(**{**columns, "labels": labels, "distances": distances})


def pushed_frames(numbers: range, seed: int, variation: Variation) -> PushedFrames:
    """Render frames of a seed and push what they show, without writing anything.

    Parameters
    ----------
    numbers
        Which frames.
    seed, variation
        Name the frames.

    Examples
    --------
    >>> data = pushed_frames(range(3), seed=0, variation=Variation())
    >>> data.frames.shape, sorted(data.kinds.tolist())
    ((3, 96, 96, 3), ['cube', 'none', 'sphere'])
    """
    rows = list(_rows(numbers, seed, variation))
    return PushedFrames(
        **{
            name: np.array([row[name] for row in rows], dtype=dtype).reshape(len(rows), *shape)
            for name, (dtype, shape) in COLUMNS.items()
        }
    )


def _rows(numbers: range, seed: int, variation: Variation) -> Iterator[dict[str, Any]]:
    with ExitStack() as stack:
        twins: dict[int, Twin] = {}
        pushes = stack.enter_context(PushRange())
        for number in numbers:
            scene = push_scene(seed, number, variation)
            if scene.maze not in twins:
                twins[scene.maze] = stack.enter_context(Twin(maze(scene.maze), Camera(pixels=PIXELS)))
            yield _row(scene, _frame(twins[scene.maze], scene), pushes)


def _frame(twin: Twin, scene: PushScene) -> Frame:
    twin.paint(scene.look)
    twin.stage(
        scene.robot,
        scene.action,
        scene.obstacles,
        doors_open=scene.doors_open,
        yaws=scene.yaws,
        forms=scene.forms,
    )
    return twin.frame()


def _row(scene: PushScene, frame: Frame, pushes: PushRange) -> dict[str, Any]:
    label, push, cells, size, colour, yaw = "none", "nothing", 0, "", "#000000", 0.0
    if scene.family is not None:
        ahead = scene.obstacles[0]
        size, colour, yaw = ahead.size, ahead.colour, scene.yaws[ahead.name]
        push = pushes.push(
            scene.family,
            ahead.size,
            scene.friction,
            scene.speed,
            scene.mass,
            offset=scene.offset,
            yaw=(yaw - _HEADINGS[scene.action]) % 360,  # as the robot meets it
        ).label
        label = "sphere" if push == "rolls" else "cube"
        cells = odometry(scene.distance - RADIUS[ahead.size] - ROBOT_RADIUS, scene.slip)
    return {
        "frames": frame,
        "labels": LABELS.index(label),
        "distances": cells,
        "kinds": scene.family or "none",
        "pushes": push,
        "sizes": size,
        "true_distances": scene.distance,
        "colours": _rgb(colour),
        "frictions": scene.friction if scene.family else 0.0,
        "speeds": scene.speed if scene.family else 0.0,
        "rotations": yaw,
        "floors": [_rgb(part) for part in scene.look.floor],
        "walls": _rgb(scene.look.walls),
        "lights": (scene.look.ambient, scene.look.diffuse),
        "mazes": scene.maze,
        "distractors": len(scene.obstacles) - (scene.family is not None),
    }


def odometry(driven: float, slip: float) -> int:
    """Return how many cells ahead an obstacle was, as the robot reckons it.

    Parameters
    ----------
    driven
        Metres from the centre of the robot's cell until it touched the obstacle.
    slip
        By how much the wheels count wrong, as a share.

    Examples
    --------
    >>> odometry(0.43, 0.0), odometry(1.63, 0.03)  # a large one near by, a small one at two cells
    (1, 2)
    """
    return min(max(ceil(driven * (1 + slip)), 1), REACH)


def _rgb(colour: str) -> list[int]:
    return list(bytes.fromhex(colour[1:]))
