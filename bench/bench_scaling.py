"""How the pipeline grows with the maze: CPU seconds by side length, on generated mazes, one thread.

Run with ``python bench/bench_scaling.py``; a list of sides may follow, and ``--figure FILE.png`` draws the
figure of docs/scaling.md. A part that took over a minute at one size is not tried at the next. Each size
runs in a process of its own, so that its peak memory is its own.
"""

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy is loaded

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from side_by_side import machine

from comparisons.style import BLUE, GREEN, GREY, INK, ORANGE, PLUM, SKY, VERMILION, picture, styled
from hierarchy import GroundGraph, check, ground, prove_abstraction, two_rooms
from planners import Replanner, certify, flat_field, recursive_optimum, task_field
from planners.compiled import CompiledMaxQ
from planners.exploration import Exploration
from planners.learner import Settings
from planners.schedules import LearningRate
from worlds import Layout, MazeState, maze_model
from worlds.generate import generate_layout

SIDES = (8, 16, 32, 64, 128, 256)
SEED = 3
ROOM = 16  # cells to a room's side
LIMIT = 60.0
COLOURS = {
    "proof": VERMILION,
    "optimum": ORANGE,
    "check": PLUM,
    "learning": GREEN,
    "field": BLUE,
    "model": SKY,
    "replanning": INK,
}
WORDS = {
    "model": "model, all 16 pairs",
    "ground": "ground graph",
    "check": "check",
    "proof": "proof of abstraction",
    "optimum": "recursive optimum",
    "field": "distance field of the root",
    "certificate": "its certificate checked",
    "replanning": "replanning the whole task",
    "learning": "learning, one pair, to optimality",
}

T = TypeVar("T")


def timed(work: Callable[[], T], least: float = 1.0) -> tuple[T, float]:
    """Return what `work` returns and its best CPU time; short work is repeated for `least` seconds."""
    best = spent = float("inf")
    total = 0.0
    while total < least:
        start = time.process_time()
        result = work()
        spent = time.process_time() - start
        best, total = min(best, spent), total + max(spent, 1e-3)
    return result, best


def maze(side: int, pairs: int) -> Layout:
    """Return the maze of a size, with `pairs` triggers and as many goals; the walls are the same."""
    across = max(2, side // ROOM)
    return generate_layout(
        side, side, SEED, rooms=(max(1, side // ROOM), across), triggers=pairs, goals=pairs
    )


def measure(side: int, skipped: set[str]) -> dict[str, float]:
    """Return CPU seconds by part, and peak memory in GB."""
    found: dict[str, float] = {}
    layout = maze(side, 4)
    model, found["model"] = timed(lambda: maze_model(layout))
    graph = two_rooms(layout)
    grounded, found["ground"] = timed(lambda: ground(graph, model))
    ends = grounded.nodes[grounded.root].terminal
    field, found["field"] = timed(lambda: flat_field(model, ends))
    faults, found["certificate"] = timed(lambda: certify(field))
    oracle = Replanner(layout, grounded)
    marks = layout.triggers[layout.trigger], layout.goals[layout.goal]
    belief = MazeState(*map(layout.number, (layout.start, *marks)))
    oracle.plan(grounded.root, belief)  # the first plan of a pair also lays out where its tasks run
    plan, found["replanning"] = timed(lambda: oracle.plan(grounded.root, belief))
    state = model.index.number((layout.start, *marks, "closed"))
    if faults or plan is None or len(plan.actions) != field.distance[state]:
        raise RuntimeError("the two oracles disagree")
    heavy: dict[str, Callable[[], object]] = {
        "check": lambda: check(graph, model),
        "optimum": lambda: recursive_optimum(grounded),
        "proof": lambda: prove_abstraction(grounded),
    }
    for part, work in heavy.items():
        if part not in skipped:
            found[part] = timed(work)[1]
    if "learning" not in skipped:
        found.update(learnt(maze(side, 1)))
    found["states"] = model.index.size
    found["memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return found


def learnt(layout: Layout) -> dict[str, float]:
    """Learn the subtasks of one pair until the greedy policy is shortest from 500 starts of each."""
    grounded: GroundGraph = ground(two_rooms(layout), maze_model(layout))
    # A deterministic world is learnt at rate 1. Values begin at 0, above the truth: greedy choices explore.
    settings = Settings(rate=LearningRate(1.0, 1.0), exploration=Exploration(half=1), max_steps=10**8)
    first = int(np.flatnonzero(_asked(grounded, "GotoGoal(G1)"))[0])
    CompiledMaxQ(grounded, [(SEED,)], settings).train(grounded.place("GotoGoal(G1)"), [first], 1)  # compiles
    learner = CompiledMaxQ(grounded, [(SEED,)], settings, threads=1)
    seconds = steps = 0.0
    for task in ("GotoTrigger(T1)", "GotoDoor(D1)", "GotoDoor(D2)", "GotoGoal(G1)"):
        place = grounded.place(task)
        starts = np.flatnonzero(_asked(grounded, task))
        asked = starts[:: max(1, starts.size // 500)]
        best = task_field(grounded.model, grounded.nodes[place]).distance[asked]
        while True:
            begin = time.process_time()
            steps += int(learner.train(place, starts.tolist(), starts.size // 4 + 1).sum())
            seconds += time.process_time() - begin
            if seconds > LIMIT or (learner.greedy_steps(place, asked, 10**5)[0] == best).all():
                break
    return {"learning": seconds, "steps": steps}


def _asked(grounded: GroundGraph, task: str) -> np.ndarray:
    """Return the states in which a task runs: with the doors shut for the trigger, else open."""
    doors = grounded.model.index.column("doors") == (not task.startswith("GotoTrigger"))
    return grounded.node(task).live & doors


@styled
def scaling_figure(found: dict[int, dict[str, float]]) -> Figure:
    """Draw CPU seconds by side, both logarithmic, each line named at its end; dashed: as the cells."""
    figure = Figure((6.4, 4.2), layout="constrained")
    axes = figure.add_subplot()
    ends = []
    for part, colour in COLOURS.items():
        points = [(side, row[part]) for side, row in found.items() if part in row]
        axes.plot(*zip(*points, strict=True), color=colour, marker="o", markersize=3.5)
        ends.append((points[-1][1], points[-1][0], part))
    sides = list(found)
    cells = np.array([sides[0], sides[-1]], dtype=float)
    axes.plot(cells, 2e-3 * (cells / cells[0]) ** 2, color=GREY, linestyle=(0, (2, 2)), linewidth=0.9)
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda seconds, _: f"{seconds:g}"))
    axes.set_xticks(sides, [str(side) for side in sides])
    axes.minorticks_off()
    lowest = 0.0
    for seconds, side, part in sorted(ends):
        height = max(seconds, lowest * 1.8)  # names keep apart
        lowest = height
        axes.annotate(WORDS[part], (side, height), (6, 0), textcoords="offset points", va="center",
                      color=COLOURS[part], annotation_clip=False)  # fmt: skip
    axes.set_xlim(sides[0] * 0.9, sides[-1] * 12)
    axes.set_xlabel("side of the maze, cells")
    axes.set_ylabel("CPU time, s")
    return figure


def main(arguments: list[str]) -> None:
    """Measure every size, print the table, and draw the figure if it is asked for."""
    if arguments[:1] == ["--one"]:
        print(json.dumps(measure(int(arguments[1]), set(arguments[2:]))))
        return
    out = Path(arguments[arguments.index("--figure") + 1]) if "--figure" in arguments else None
    sides = [int(word) for word in arguments if word.isdigit()] or list(SIDES)
    found: dict[int, dict[str, float]] = {}
    skipped: set[str] = set()
    for side in sides:
        command = [sys.executable, __file__, "--one", str(side), *sorted(skipped)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 - this file
        found[side] = json.loads(done.stdout)
        skipped |= {part for part in WORDS if found[side].get(part, 0.0) > LIMIT}
        print(f"{side} x {side}: done", file=sys.stderr)
    print(f"{machine()}, one thread\n")
    print(f"| CPU seconds | {' | '.join(f'{side}' for side in found)} |\n|---|{'---|' * len(found)}")
    rows = {"states": "states", **WORDS, "steps": "primitive steps of learning", "memory": "peak memory, GB"}
    for part, words in rows.items():
        cells = [_cell(part, row.get(part)) for row in found.values()]
        print(f"| {words} | {' | '.join(cells)} |")
    if out is not None:
        out.write_bytes(picture(scaling_figure(found)).png)


def _cell(part: str, value: float | None) -> str:
    if value is None:
        return "\N{EN DASH}"
    if part in {"states", "steps"}:
        return f"{int(value):,}"
    return f"{value:.2g}" if value < 10 else f"{value:.0f}"


if __name__ == "__main__":
    main(sys.argv[1:])
