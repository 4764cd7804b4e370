"""Distance fields, small fields, replanning and fields of models, side by side with their peers.

Run with ``python bench/bench_oracle.py``; it needs the extra `bench`, which has rustworkx and igraph.
CPU time of one thread, the best of repeats that take turns; single replannings, which last microseconds, by
the wall clock. A peer's graph is built beforehand and not counted; our figures count all
from the array of free cells on.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import igraph
import networkx as nx
import numpy as np
import rustworkx as rx
from numpy.typing import NDArray
from oracle_grids import Cell, Free, goal_of, grids, maze, uniform
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order
from side_by_side import machine

from planners.bitboards import passage_words, small_fields, words
from planners.fields import distance_field, plain_distance_field
from planners.grid import certify_grid, grid_field, grid_first_actions
from planners.repair import RepairableField
from worlds import Stream
from worlds.layout import DELTAS

SIDE = 1024
LARGE = 4096
TRIALS = 200
WAYS = [[a for a in range(4) if bits >> a & 1] for bits in range(16)]


def best(works: dict[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Return the least CPU time in milliseconds of each, measured in turns."""
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(repeats):
        for name, work in works.items():
            start = time.process_time()
            work()
            times[name].append(1e3 * (time.process_time() - start))
    return {name: min(taken) for name, taken in times.items()}


def line(name: str, goal: str, figure: str, peers: str = "") -> None:
    """Print one line of a table."""
    print(f"{name:42} {goal:>18} {figure:>18}  {peers}", flush=True)


def edges_of(free: Free) -> NDArray[np.int64]:
    """Return the pairs of adjacent free cells by number, shape (edges, 2)."""
    number = np.arange(free.size).reshape(free.shape)
    across, down = free[:, :-1] & free[:, 1:], free[:-1] & free[1:]
    one = np.concatenate([number[:, :-1][across], number[:-1][down]])
    return np.stack([one, np.concatenate([number[:, 1:][across], number[1:][down]])], axis=1)


def fields() -> None:
    """Measure fields of 1024 x 1024 cells beside peers', and their certificates."""
    for name, free, goal in (
        ("empty", np.ones((SIDE, SIDE), np.bool_), 4.0),
        ("30 % blocked", grids(SIDE)["30 %"], 8.0),
    ):
        target = goal_of(free)
        start = target[0] * SIDE + target[1]
        edges = edges_of(free)
        both = np.concatenate([edges, edges[:, ::-1]])
        matrix = csr_array(
            (np.ones(len(both), np.int8), (both[:, 0], both[:, 1])), shape=(free.size, free.size)
        )
        by_igraph = igraph.Graph(n=free.size, edges=edges)
        by_rx = rx.PyGraph(multigraph=False)
        by_rx.add_nodes_from(range(free.size))
        by_rx.extend_from_edge_list([(int(a), int(b)) for a, b in edges])
        found: NDArray[np.int32] = grid_field(free, [target])
        assert certify_grid(free, [target], found) == ()
        assert np.array_equal(np.where(np.isinf(d := by_igraph.distances(start)[0]), -1, d), found.ravel())
        ours = {
            "ours": lambda free=free, target=target: grid_field(free, [target]),
            "scipy": lambda matrix=matrix, start=start: breadth_first_order(matrix, start),
            "first actions": lambda found=found: grid_first_actions(found),
            "certificate": lambda free=free, target=target, found=found: certify_grid(free, [target], found),
        }
        times = best(ours, 25)
        peers = {
            "igraph": lambda by_igraph=by_igraph, start=start: by_igraph.distances(start),
            "rustworkx": lambda by_rx=by_rx, start=start: rx.bfs_layers(by_rx, [start]),
        }
        times |= best(peers, 3)
        del by_igraph, by_rx
        by_nx = nx.Graph()
        by_nx.add_edges_from(map(tuple, edges.tolist()))
        times |= best({"networkx": lambda g=by_nx, s=start: nx.single_source_shortest_path_length(g, s)}, 1)
        by = ", ".join(
            f"{times[peer] / times['ours']:.1f} x {peer}"
            for peer in ("scipy", "igraph", "rustworkx", "networkx")
        )
        line(f"field, {SIDE} x {SIDE}, {name}", f"<= {goal:.0f} ms", f"{times['ours']:.2f} ms", by)
        line("  optimal first actions from it", "", f"{times['first actions']:.2f} ms")
        line("  its certificate", "", f"{times['certificate']:.2f} ms")


def memory(what: str) -> float:
    """Return the process's memory in MB: VmRSS for now, VmHWM for its peak."""
    rows = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(row.split()[1]) for row in rows if row.startswith(what)) * 1024 / 1e6


def large(name: str) -> None:
    """Print the time and memory of a field of 4096 x 4096 cells, in a process of its own."""
    free = np.ones((LARGE, LARGE), np.bool_)
    for row in range(0, LARGE if name != "empty" else 0, 64):  # in parts, for the sake of the peak of memory
        free[row : row + 64] = uniform(row, 64, LARGE) >= 0.3
    free[LARGE // 3, LARGE // 3] = True
    goals = [(LARGE // 3, LARGE // 3)]
    grid_field(free[:64, :64], [(0, 0)])
    before = memory("VmRSS")
    taken = best({"ours": lambda: grid_field(free, goals)}, 3)["ours"]
    more = memory("VmHWM") - before + free.nbytes / 1e6
    line(
        f"field, {LARGE} x {LARGE}, {name}",
        "< 300 ms, 160 MB",
        f"{taken:.0f} ms, {more:.0f} MB",
        "the grid itself counted",
    )


def small() -> None:
    """Measure batches of 8 x 8 grids."""
    many = 20000
    for blocked in (0.0, 0.15, 0.3):
        free = uniform(3, many, 8, 8) >= blocked
        goals = np.zeros((many, 64), np.bool_)
        goals[np.arange(many), np.argmax(free.reshape(many, 64) * (1 + uniform(4, many, 64)), axis=1)] = True
        ways = passage_words(np.full((8, 8), 15))
        grids_, targets = words(free), words(goals.reshape(free.shape))
        one = np.argwhere(goals.reshape(free.shape))[:, 1:].tolist()
        works = {
            "words": lambda g=grids_, t=targets, w=ways: small_fields(g, t, w, 8),
            "one by one": lambda f=free, o=one: [grid_field(f[i], [o[i]]) for i in range(0, many, 20)],
        }
        times = best(works, 15)
        line(
            f"8 x 8, {blocked:.0%} blocked, {many} at once",
            "< 100 ns",
            f"{1e6 * times['words'] / many:.0f} ns",
            f"{20 * times['one by one'] / times['words']:.0f} x grid_field one by one",
        )


def routes(field: RepairableField, free: Free, goal: Cell) -> Iterator[Cell]:
    """Yield cells on random routes, and at last those next to the goal."""
    stream, distance = Stream(5), field.distance
    sets = grid_first_actions(distance).tobytes()
    cells = np.argwhere(distance > 2)
    rows, cols = free.shape
    for _ in range(TRIALS):
        row, col = map(int, cells[stream.below(len(cells))])
        at, steps = row * cols + col, 1 + stream.below(int(distance[row, col]) - 2)
        for _ in range(steps):
            ways = WAYS[sets[at]]
            down, right = DELTAS[ways[0] if len(ways) == 1 else stream.choose(ways)]
            at += down * cols + right
        yield divmod(at, cols)
    for down, right in DELTAS:
        beside = (goal[0] + down, goal[1] + right)
        if 0 <= beside[0] < rows and 0 <= beside[1] < cols and free[beside]:
            yield beside


def in_sequence(field: RepairableField, cells: list[Cell]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the seconds of blocking some cells, each once and all staying, and of freeing them again."""
    found = []
    for work in (field.block, field.free):
        taken = []
        for cell in cells:
            start = time.perf_counter()
            work(cell)
            taken.append(time.perf_counter() - start)
        found.append(np.array(taken))
    return found[0], found[1]


def in_turns(field: RepairableField, cell: Cell, repeats: int) -> NDArray[np.float64]:
    """Return the seconds of blocking, searching anew, freeing, searching anew, shape (repeats, 4).

    Each change comes right after a search, which has put other things into the cache.
    """
    works = (lambda: field.block(cell), field.recompute, lambda: field.free(cell), field.recompute)
    taken = np.empty((repeats, len(works)))
    for repeat in range(repeats):
        for number, work in enumerate(works):
            start = time.perf_counter()
            work()
            taken[repeat, number] = time.perf_counter() - start
    return taken


def replanning() -> None:
    """Measure obstacles put on routes and taken off again, against searching anew."""
    print(
        f"\nreplanning, {SIDE} x {SIDE}, {TRIALS} obstacles on the route; ratios to searching anew in place"
    )
    print("one after another: each once, all of them staying; cold: right after a search, median of 4")
    medians = f"{'median':>11} {'ratio':>6} {'goal':>7} {'mean':>9} {'ratio':>6} {'goal':>5}"
    head = f"{medians} {'cold':>8} {'ratio':>6}"
    print(f"{'':16} {'':8} | {'an obstacle appears':^{len(head)}} | {'it goes':^{len(head)}} |")
    print(f"{'':16} {'anew':>8} | {head} | {head} | {'worst':>5} {'goal':>6}")
    for name, free in grids(SIDE).items():
        goal = goal_of(free)
        field = RepairableField(free, [goal])
        cells = list(routes(field, free, goal))
        in_sequence(field, cells[:1])
        blocks, frees = in_sequence(field, cells[:TRIALS])
        rows, worst = [], 0.0
        for number, cell in enumerate(cells):
            turns = in_turns(field, cell, 4)
            least = turns.min(axis=0)
            if max(least[0] / least[1], least[2] / least[3]) > 1.25:  # disturbed, or a bad case: look closer
                least = in_turns(field, cell, 25).min(axis=0)
            worst = max(worst, least[0] / least[1], least[2] / least[3])
            if number < TRIALS:
                rows.append(np.median(turns, axis=0))
        cold = np.array(rows)
        goals = (">= 1000" if name in {"open", "30 %"} else "", ">= 10" if name == "30 %" else "")
        print(
            f"{name:16} {cold[:, 1].mean() * 1e3:5.2f} ms"
            f" | {ratios(blocks, cold[:, 0], cold[:, 1], *goals)}"
            f" | {ratios(frees, cold[:, 2], cold[:, 3], '', '')} | {worst:5.2f} {'<= 1.5':>6}",
            flush=True,
        )


def ratios(
    once: NDArray[np.float64], cold: NDArray[np.float64], anew: NDArray[np.float64], middle: str, mean: str
) -> str:
    """Return median and mean of replannings, their ratios to searching anew, the goals, and cold ones."""
    search = float(np.median(anew))
    return (
        f"{np.median(once) * 1e6:8.1f} us {search / np.median(once):6.0f} {middle:>7}"
        f" {once.mean() * 1e6:6.0f} us {anew.mean() / once.mean():6.1f} {mean:>5}"
        f" {np.median(cold) * 1e6:5.1f} us {search / np.median(cold):6.0f}"
    )


def models() -> None:
    """Measure fields of any table of successors against the plain search."""
    print()
    for side in (64, 256):
        for name, free in (("open", np.ones((side, side), np.bool_)), ("maze", maze(side))):
            number = np.arange(free.size).reshape(free.shape)
            wide, numbers = np.pad(free, 1), np.pad(number, 1)
            beside = [(slice(1 + r, side + 1 + r), slice(1 + c, side + 1 + c)) for r, c in DELTAS]
            after = np.stack(
                [np.where(free & wide[at], numbers[at], number).ravel() for at in beside], axis=1
            )
            goal = number.ravel() == np.flatnonzero(free)[0]
            allowed = np.ones(after.shape, np.bool_)
            times = best(
                {
                    "ours": lambda a=after, g=goal, m=allowed: distance_field(a, g, m),
                    "plain": lambda a=after, g=goal, m=allowed: plain_distance_field(a, g, m),
                },
                7,
            )
            line(
                f"distance_field, {side} x {side}, {name}",
                "",
                f"{times['ours']:.2f} ms",
                f"{times['plain'] / times['ours']:.1f} x the plain search",
            )


def main() -> None:
    """Print every goal beside its figure."""
    if sys.argv[1:2] == ["--large"]:
        large(sys.argv[2])
        return
    print(machine())
    line("", "goal", "figure", "ratio to peers")
    fields()
    for name in ("empty", "30 % blocked"):
        subprocess.run([sys.executable, __file__, "--large", name], check=True)  # noqa: S603 - itself
    small()
    replanning()
    models()


if __name__ == "__main__":
    main()
