"""Check and proof of abstraction: CPU time and peak memory as functions of states and transitions.

Run with ``python bench/bench_abstraction.py``; ``--large`` adds the larger worlds.
"""

import sys
import time
import tracemalloc
from collections.abc import Callable
from typing import TypeVar

from hierarchy import TaskGraph, check, ground, prove_abstraction, two_rooms
from hierarchy.hdg import hdg_graph
from hierarchy.taxi import taxi_graph
from planners import recursive_optimum
from worlds import TransitionModel, load_layout, maze_model
from worlds.hdg import LandmarkMaze, landmark_model
from worlds.taxi import taxi_model

T = TypeVar("T")


def timed(work: Callable[[], T]) -> tuple[T, float, float]:
    """Return what `work` returns, its CPU time in seconds, and its peak memory in MB, measured apart."""
    start = time.process_time()
    result = work()
    seconds = time.process_time() - start
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    return result, seconds, peak


def measure(name: str, graph: TaskGraph, model: TransitionModel) -> None:
    """Print one line of the table."""
    grounded = ground(graph, model)
    _, check_s, check_mb = timed(lambda: check(graph, model))
    _, proof_s, proof_mb = timed(lambda: prove_abstraction(grounded))
    choice = recursive_optimum(grounded).choice
    report, both_s, both_mb = timed(lambda: prove_abstraction(grounded, choice))
    transitions = int((model.probabilities > 0).sum())
    print(
        f"{name:22} {model.index.size:7} {transitions:11} {len(grounded.nodes):6} {len(report.edges):6}"
        f" {check_s:8.2f} {check_mb:6.0f} {proof_s:8.2f} {proof_mb:6.0f} {both_s:8.2f} {both_mb:6.0f}"
    )


def main() -> None:
    """Measure worlds of growing size."""
    print(f"{'':56} {'check':^15} {'proof':^15} {'with a policy':^15}")
    print(
        f"{'world':22} {'states':>7} {'transitions':>11} {'nodes':>6} {'calls':>6}"
        + f" {'s':>8} {'MB':>6}" * 3
    )
    model = taxi_model()
    measure("taxi", taxi_graph(model), model)
    model = taxi_model(rain=0.2, fickle=0.3)
    measure("taxi, rain, fickle", taxi_graph(model), model)
    layout = load_layout("two_rooms")
    measure("two_rooms", two_rooms(layout), maze_model(layout))
    for side in (5, 6, 7, 8, 9, 10) if "--large" in sys.argv else (5, 6, 7):
        maze = LandmarkMaze(side=side)
        measure(f"hdg {side} x {side}", hdg_graph(maze), landmark_model(maze))
        slips = landmark_model(maze, slip=0.2)
        measure(f"hdg {side} x {side}, slips", hdg_graph(maze, may_leave=True), slips)


if __name__ == "__main__":
    main()
