"""Compiled learners beside the readable ones, in one run: primitive steps a second of CPU time, one thread.

Run with ``python bench/bench_learners.py``. Repeats are interleaved, and the best of each is told.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from side_by_side import machine

from comparisons.experiment import RUNS
from comparisons.learning import PairLearner
from hierarchy import GroundGraph, ground, two_rooms
from hierarchy.taxi import taxi_graph
from planners.compiled import Compiled, CompiledFlatQ, CompiledMaxQ
from planners.compiled.build import FOLDER
from worlds import load_layout, maze_model
from worlds.taxi import taxi_model

REPEATS = 5
MAZE = load_layout("two_rooms")


def maze_graph() -> GroundGraph:
    """Return the paper's graph on the paper's maze."""
    return ground(two_rooms(MAZE), maze_model(MAZE))


def rate(work: Callable[[], int]) -> float:
    """Return steps a second of CPU time of work that returns its steps."""
    start = time.process_time()
    steps = work()
    return steps / (time.process_time() - start)


def compare(
    what: str, kind: type[Compiled[Any]], grounded: GroundGraph, starts: list[int], asked: str
) -> None:
    """Print how fast a compiled learner and its reference are, and their ratio."""
    once = kind(grounded, [(0,)])  # compilation is measured apart
    root = once.grounded.root
    once.train(root, starts, 1200)
    fast = slow = 0.0
    for _ in range(REPEATS):
        runs = kind(grounded, [(seed,) for seed in range(300)], threads=1)
        fast = max(fast, rate(lambda: int(runs.train(root, starts, 1200).sum())))  # noqa: B023
        one = kind.reference(grounded, (0,))
        slow = max(slow, rate(lambda: sum(one.train(root, starts, 300))))  # noqa: B023
    print(f"{what:32} {fast / 1e6:8.1f} M {asked:>9} {slow / 1e6:8.2f} M {fast / slow:7.0f} x")


CALL = """
import time
import numpy as np
import numba
from hierarchy import ground, two_rooms
from planners.compiled import CompiledMaxQ
from worlds import load_layout, maze_model
maze = load_layout("two_rooms")
grounded = ground(two_rooms(maze), maze_model(maze))
starts = np.flatnonzero(grounded.model.starts).tolist()
begin = time.process_time()
CompiledMaxQ(grounded, [(0,)]).train(grounded.root, starts, 1)
print(time.process_time() - begin)
"""


def first_calls() -> None:
    """Print what the first call costs, with nothing on disk and with the kernel there."""
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, FOLDER: folder}
        command = [sys.executable, "-c", CALL]
        seconds = [float(subprocess.check_output(command, env=env)) for _ in range(2)]  # noqa: S603 - ours
    print(f"first call, nothing kept:  {seconds[0]:.2f} s of CPU time (asked < 5)")
    print(f"first call, kernel kept:   {seconds[1]:.2f} s of CPU time, numba imported before (asked < 0.3)")


def all_pairs() -> None:
    """Print what learning all pairs with many seeds takes, and how many runs are optimal."""
    grounded = maze_graph()
    cpu, wall = time.process_time(), time.perf_counter()
    optimal = 0
    for trigger in MAZE.triggers:
        for goal in MAZE.goals:
            pair = PairLearner(MAZE, grounded, trigger, goal, seed=0, runs=RUNS)
            pair.learn()
            optimal += int(((pair.wrong_grids() == 0) & (pair.wrong_starts() == 0)).sum())
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    runs = RUNS * len(MAZE.triggers) * len(MAZE.goals)
    print(f"{runs} runs, {RUNS} a pair: {optimal} optimal; {wall:.1f} s, {cpu:.1f} s of CPU time")


def main() -> None:
    """Print every figure."""
    print(f"{machine()}, one thread of {len(os.sched_getaffinity(0))} cores")
    print(
        f"{'learner, the root and all below':32} {'compiled':>10} {'asked':>9} {'readable':>10} {'ratio':>9}"
    )
    grounded = maze_graph()
    marks = MAZE.triggers["T4"], MAZE.goals["G2"]
    cells = sorted(MAZE.room(MAZE.start) - {marks[0]})
    starts = [grounded.model.index.number((cell, *marks, "closed")) for cell in cells]
    compare("MAXQ-0, the paper's maze", CompiledMaxQ, grounded, starts, ">= 50 M")
    compare("flat Q, the paper's maze", CompiledFlatQ, grounded, starts, "")
    model = taxi_model()
    taxi = ground(taxi_graph(model), model)
    compare("MAXQ-0, Taxi", CompiledMaxQ, taxi, np.flatnonzero(model.starts).tolist(), ">= 20 M")
    first_calls()
    all_pairs()


if __name__ == "__main__":
    main()
