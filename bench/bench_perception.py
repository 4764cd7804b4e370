"""Milliseconds a frame of every backend at batch 1, and the CPU time in which the CNN learns.

Run with ``python bench/bench_perception.py [--train FRAMES]``. CPU time of one thread; backends take turns,
and the median of the turns counts. The goals are 0.7 ms a frame for the CNN and 120 s for 5,000 frames.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import statistics
import time

from side_by_side import machine

from perception import load_backend
from perception.cnn import Cnn
from perception.protocol import FrameBackend
from perception.pushed import pushed_frames
from perception.training import train
from perception.variation import Variation

NAMES = ("cnn", "hog", "hough", "ensemble")
TURNS = 9
FRAMES = 60
SEED = 201  # of the test part


def latencies(backends: dict[str, FrameBackend]) -> dict[str, float]:
    """Return each backend's milliseconds a frame, one frame a call."""
    frames = pushed_frames(range(FRAMES), SEED, Variation()).frames
    turns: dict[str, list[float]] = {name: [] for name in backends}
    for turn in range(TURNS + 1):
        for name, backend in backends.items():
            start = time.process_time()
            for frame in frames:
                backend.perceive(frame[None])
            if turn:  # the first turn warms up
                turns[name].append((time.process_time() - start) / FRAMES * 1000)
    return {name: statistics.median(times) for name, times in turns.items()}


def learning(frames: int) -> float:
    """Return the seconds of CPU time in which the CNN learns from so many frames."""
    data = pushed_frames(range(frames), 0, Variation())
    start = time.process_time()
    train(data, seed=0)
    return time.process_time() - start


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--train", type=int, metavar="FRAMES", help="time a training as well")
    wanted = parser.parse_args().train
    print(machine())
    loaded = {name: load_backend(name) for name in NAMES}
    found = latencies(
        {name: backend for name, backend in loaded.items() if isinstance(backend, FrameBackend)}
    )
    for name, figure in found.items():
        print(f"{name:10} {figure:6.2f} ms a frame" + ("   goal 0.70" if name == Cnn.name else ""))
    if wanted:
        print(f"{'training':10} {learning(wanted):6.1f} s of CPU time for {wanted} frames   goal 120")


if __name__ == "__main__":
    main()
