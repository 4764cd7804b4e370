"""Steps per second of single, vector and TorchRL environments, side by side with their peers.

Run with ``python bench/bench_worlds.py``; it needs the extra `bench`. CPU time of one thread; peers and ours
take turns in one process, and the median of the turns counts.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import statistics
import time
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium
import minigrid  # noqa: F401 - registers its environments
import numpy as np
import torch
from side_by_side import machine
from torchrl.envs import EnvBase, GymEnv

from worlds import registration  # noqa: F401 - registers ours
from worlds.torch_env import MazeTorchEnv
from worlds.vector_env import MazeVectorEnv

TURNS = 7
MANY = 1024
VERY_MANY = 1 << 16

Run = Callable[[], float]


class Line(NamedTuple):
    """A line of the table: what was measured, against which peer, and what was hoped for."""

    name: str
    peer: str
    ratio: float | None = None
    rate: float | None = None


def single(name: str, actions: int, steps: int, **arguments: Any) -> Run:
    """Return a run of an environment with its default wrappers, by random actions, resets counted."""
    env = gymnasium.make(name, **arguments)
    env.reset(seed=0)
    drawn = np.random.default_rng(0).integers(0, actions, steps).tolist()

    def run() -> float:
        start = time.process_time()
        for action in drawn:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return steps / (time.process_time() - start)

    return run


def vector(envs: gymnasium.vector.VectorEnv[Any, Any, Any], steps: int) -> Run:
    """Return a run of a vector environment by random actions."""
    envs.reset(seed=0)
    choices = int(envs.single_action_space.n)  # type: ignore[attr-defined]
    drawn = np.random.default_rng(0).integers(0, choices, (16, envs.num_envs))

    def run() -> float:
        start = time.process_time()
        for step in range(steps):
            envs.step(drawn[step % 16])
        return steps * envs.num_envs / (time.process_time() - start)

    return run


def rollout(env: EnvBase, steps: int) -> Run:
    """Return a rollout by TorchRL's random policy, episodes beginning anew as they end."""
    env.set_seed(0)

    def run() -> float:
        start = time.process_time()
        env.rollout(steps, break_when_any_done=False)
        return steps * env.batch_size.numel() / (time.process_time() - start)

    return run


def stepping(env: EnvBase, steps: int) -> Run:
    """Return a run of `step_and_maybe_reset` by actions drawn beforehand."""
    env.set_seed(0)
    drawn = [env.action_spec.rand() for _ in range(16)]

    def run() -> float:
        data = env.reset()
        start = time.process_time()
        for step in range(steps):
            data["action"] = drawn[step % 16]
            _, data = env.step_and_maybe_reset(data)
        return steps * env.batch_size.numel() / (time.process_time() - start)

    return run


def runs() -> dict[str, Run]:
    """Return what takes turns."""
    made = gymnasium.make_vec("CartPole-v1", num_envs=MANY, vectorization_mode="vector_entry_point")
    found: dict[str, Run] = {
        "FrozenLake": single("FrozenLake-v1", 4, 20_000),
        "DoorKey": single("MiniGrid-DoorKey-8x8-v0", 7, 2_000),
        "TwoRooms": single("affordant/TwoRooms-v0", 4, 20_000),
        "TwoRooms, layout": single("affordant/TwoRooms-v0", 4, 20_000, obstacles="layout"),
        "TwoRooms, random": single("affordant/TwoRoomsObstacles-v0", 4, 20_000),
        "CartPole vector": vector(made, 300),
        "FrozenLake rollout": rollout(GymEnv("FrozenLake-v1"), 500),
        "FrozenLake stepping": stepping(GymEnv("FrozenLake-v1"), 500),
    }
    for obstacles in ("none", "layout", "random"):
        for mode in ("SameStep", "NextStep"):
            envs = MazeVectorEnv(MANY, obstacles=obstacles, autoreset_mode=mode)
            found[f"vector, {obstacles}, {mode}"] = vector(envs, 300)
        for backend in ("numba", "torch"):
            env = MazeTorchEnv(MANY, obstacles=obstacles, backend=backend)
            found[f"rollout, {obstacles}, {backend}"] = rollout(env, 100)
            found[f"stepping, {obstacles}, {backend}"] = stepping(env, 100)
    masked = MazeVectorEnv(MANY, autoreset_mode="SameStep", action_masks=True)
    found["vector, none, SameStep, masks"] = vector(masked, 300)
    large = MazeVectorEnv(VERY_MANY, obstacles="random", autoreset_mode="SameStep")
    found[f"vector, random, SameStep, {VERY_MANY}"] = vector(large, 8)
    return found


def lines(names: list[str]) -> list[Line]:
    """Return the table's lines; goals stand where there are any."""
    found = [
        Line("TwoRooms", "FrozenLake", 1.5),
        Line("TwoRooms", "DoorKey", 25),
        Line("TwoRooms, layout", "FrozenLake"),
        Line("TwoRooms, random", "FrozenLake"),
        Line("TwoRooms, random", "DoorKey"),
    ]
    for name in names:
        goal = name in {"vector, none, SameStep", "vector, none, NextStep"}
        if name.startswith("vector"):
            found.append(Line(name, "CartPole vector", 2 if goal else None, 25e6 if goal else None))
        elif name.startswith(("rollout", "stepping")):
            peer = f"FrozenLake {name.partition(',')[0]}"
            found.append(Line(name, peer, 500 if name.endswith("none, numba") else None))
    return found


def main() -> None:
    """Measure in turns, and print one table."""
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    todo = runs()
    rates: dict[str, list[float]] = {name: [] for name in todo}
    for turn in range(TURNS + 1):
        for name, run in todo.items():
            rate = run()
            if turn:  # the first warms up
                rates[name].append(rate)
    median = {name: statistics.median(found) for name, found in rates.items()}
    print(f"{machine()}, one thread, CPU time, median of {TURNS} turns; M = million steps a second")
    print(f"{'ours':38} {'M':>8} {'goal':>5}   {'peer':20} {'M':>8} {'ratio':>7} {'goal':>5}")
    for line in lines(list(todo)):
        ours, peer = median[line.name] / 1e6, median[line.peer] / 1e6
        rate = f"{line.rate / 1e6:5.0f}" if line.rate else " " * 5
        ratio = f"{line.ratio:5g}" if line.ratio else ""
        print(f"{line.name:38} {ours:8.3f} {rate}   {line.peer:20} {peer:8.4f} {ours / peer:7.2f} {ratio:>5}")


if __name__ == "__main__":
    main()
