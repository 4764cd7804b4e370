"""How much of an obstacle a patch before the lens leaves to be seen, and how much the CNN makes of it.

Run with ``python bench/occlusion_ceiling.py [--frames N] [--seed SEED] [--clean] [--weights FILE]``. Each
scene is rendered with and without what stands in the way: where the two differ the obstacle shows. The patch
of `perception.corruptions` is held before both. The ceiling is the accuracy of an observer who knows the
label wherever at least a tenth of the obstacle and 20 pixels of it show; where less shows, who knows that
something stands there and guesses between cube and sphere; and where nothing shows, who says "none", the
best guess.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.calibration import calibration_error
from perception.cnn import Cnn
from perception.corruptions import SEVERITIES, corrupt
from perception.protocol import LABELS
from perception.variation import CLEAN, PushScene, Variation, maze, push_scene
from worlds import Obstacle
from worlds.camera import Camera
from worlds.twin import Twin

SHARE, PIXELS = 0.1, 20  # of the obstacle, both of which must show
BANDS = ((0.0, 0.1), (0.1, 0.25), (0.25, 0.5), (0.5, 0.999))


@dataclass(frozen=True, eq=False)
class Scenes:
    """Frames, the scene's labels, and where the obstacle shows: (n, 96, 96, 3), (n,), (n, 96, 96)."""

    frames: NDArray[np.uint8]
    labels: NDArray[np.int64]
    shows: NDArray[np.bool_]


def rendered(count: int, seed: int, variation: Variation) -> Scenes:
    """Render scenes with and without what stands in the way."""
    frames, labels, shows = [], [], []
    with ExitStack() as stack:
        twins: dict[int, Twin] = {}
        for number in range(count):
            scene = push_scene(seed, number, variation)
            if scene.maze not in twins:
                twins[scene.maze] = stack.enter_context(Twin(maze(scene.maze), Camera()))
            twin, there = twins[scene.maze], int(scene.family is not None)
            whole = shot(twin, scene, scene.obstacles)
            frames.append(whole)
            shows.append((whole != shot(twin, scene, scene.obstacles[there:])).any(axis=-1))
            labels.append(LABELS.index("sphere" if scene.family == "sphere" else "cube") if there else 0)
    return Scenes(np.array(frames), np.array(labels), np.array(shows))


def shot(twin: Twin, scene: PushScene, obstacles: tuple[Obstacle, ...]) -> NDArray[np.uint8]:
    """Return the frame of a scene with some of its obstacles."""
    twin.paint(scene.look)
    doors, yaws, forms = scene.doors_open, scene.yaws, scene.forms
    twin.stage(scene.robot, scene.action, obstacles, doors_open=doors, yaws=yaws, forms=forms)
    return twin.frame()


def left(scenes: Scenes, severity: int, seed: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return how many of each obstacle's pixels the patch leaves, and which share of them, shape (n,)."""
    # The patch's place and colour go by seed and number alone: it is where black and white become the same.
    black = np.zeros_like(scenes.frames)
    one, other = (corrupt("occlusion", plain, severity, seed) for plain in (black, ~black))
    patch = (one == other).all(axis=-1)
    pixels = (scenes.shows & ~patch).sum(axis=(1, 2))
    return pixels, pixels / np.maximum(scenes.shows.sum(axis=(1, 2)), 1)


def main() -> None:
    """Print a line for each severity."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=230, help="of the test part")
    parser.add_argument("--clean", action="store_true", help="the paper's maze as it is painted")
    parser.add_argument("--weights", help="of a CNN; the ready-made ones if left out")
    wanted = parser.parse_args()
    scenes = rendered(wanted.frames, wanted.seed, CLEAN if wanted.clean else Variation())
    cnn = Cnn.load(wanted.weights) if wanted.weights else Cnn()
    there = scenes.labels > 0
    print("severity  right %  ceiling %  ECE    right / frames where this share of the obstacle shows")
    for severity in SEVERITIES:
        found = cnn.perceive(corrupt("occlusion", scenes.frames, severity, wanted.seed))
        right = found.labels == scenes.labels
        pixels, share = left(scenes, severity, wanted.seed)
        known = ~there | ((share >= SHARE) & (pixels >= PIXELS))
        ceiling = (known.sum() + (there & ~known & (pixels > 0)).sum() / 2) / len(right)
        groups = {"no obstacle": ~there, "0": there & (pixels == 0)}
        for least, most in BANDS:
            groups[f"{100 * least:.0f}-{100 * most:.0f} %"] = there & (share > least) & (share <= most)
        groups["all"] = there & (share > BANDS[-1][1])
        told = ", ".join(f"{name}: {right[rows].sum()}/{rows.sum()}" for name, rows in groups.items())
        error = calibration_error(found.probabilities, scenes.labels)
        print(f"{severity:8}  {100 * right.mean():7.1f}  {100 * ceiling:9.1f}  {error:.3f}  {told}")


if __name__ == "__main__":
    main()
