"""What the tests of batches share: mazes of any kind, and a batch held to its reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import strategies as st
from strategies import maze_layouts, obstacles_in

from worlds import Layout
from worlds.batch_reference import StreamedMazeEnv
from worlds.env import CUBE, OBSTACLES, SPHERE

Arguments = dict[str, Any]


@st.composite
def kinds_of_maze(draw: st.DrawFn, most: int = 5) -> Arguments:
    """Draw the arguments of a `MazeEnv`: any small maze, any obstacles, marks given or left open."""
    layout = draw(maze_layouts(most))
    layout = replace(layout, obstacles=draw(obstacles_in(layout)))
    room = len(layout.cells) - len(layout.solid) - 3
    obstacles = draw(st.sampled_from(OBSTACLES if room >= 1 else OBSTACLES[:2]))
    near = sorted(layout.room(layout.start) - set(layout.triggers.values()))
    return {
        "layout": layout,
        "obstacles": obstacles,
        "trigger": draw(st.sampled_from([None, *layout.triggers])),
        "goal": draw(st.sampled_from([None, *layout.goals])),
        "start": draw(st.sampled_from([None, *near])),
        "max_steps": draw(st.integers(1, 30)),
        "most_obstacles": draw(st.integers(1, max(1, min(6, room)))),
    }


def one_of(arguments: Arguments, number: int = 0) -> StreamedMazeEnv:
    """Return environment `number` of a batch."""
    return StreamedMazeEnv(number=number, **arguments)


def obstacles_of(env: StreamedMazeEnv) -> dict[str, Any]:
    """Return what stands in a reference's maze, and what waits, by place in the order of declaration."""
    episode = env.episode
    assert episode is not None
    names = list(episode.obstacles)
    return {
        "cubes": set(episode.state.cubes),
        "spheres": set(episode.state.spheres),
        "pending": [names.index(obstacle.name) for obstacle in episode._pending],
        "due": [names.index(obstacle.name) for obstacle in episode._due],
    }


def obstacles_in_arrays(grid: Sequence[int], due: Sequence[int]) -> dict[str, Any]:
    """Return the same of a row of a batch's arrays."""
    waiting = [k for k in range(len(due)) if due[k] >= 0]
    return {
        "cubes": {cell for cell in range(len(grid)) if grid[cell] == CUBE},
        "spheres": {cell for cell in range(len(grid)) if grid[cell] == SPHERE},
        "pending": [k for k in range(len(due)) if due[k] == -1],
        "due": sorted(waiting, key=lambda k: (due[k], k)),
    }


def random_actions(seed: int, steps: int, number: int) -> np.ndarray[Any, Any]:
    """Return actions for each step and environment."""
    return np.random.default_rng(seed).integers(0, 4, (steps, number))


def big(layout: Layout, obstacles: str = "random") -> Arguments:
    """Return arguments for a larger maze."""
    return {"layout": layout, "obstacles": obstacles, "max_steps": 60, "most_obstacles": 6}
