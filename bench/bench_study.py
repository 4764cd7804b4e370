"""What a study costs beyond its runs, and what more workers bring.

Run with ``python bench/bench_study.py``; ``--runs N`` sets the number of short runs, ``--quick`` tries it.
The speed-up is told beside the load of the machine, which should be near nothing as it begins.
"""

import os
import sys
import tempfile
import time
from argparse import ArgumentParser
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy is loaded
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from side_by_side import machine
from study_kinds import installed

from comparisons.study.declaring.declaration import parse_study
from comparisons.study.running.engines import Engine
from comparisons.study.running.index import index
from comparisons.study.running.local import LocalEngine
from comparisons.study.running.on_dask import DaskEngine
from comparisons.study.running.store import Store
from comparisons.study.running.study_runs import Summary, run_study
from comparisons.study.running.work import Ran

PAGE = os.sysconf("SC_PAGE_SIZE")


def megabytes() -> float:
    """Return the memory that this process holds."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE / 1e6


class Watch:
    """Notes the driver's memory and the runs' own seconds while runs end."""

    def __init__(self) -> None:
        self.sizes: list[float] = []
        self.own = 0.0
        self.begun = time.perf_counter()
        self.first = self.last = self.begun

    def __call__(self, items: Iterable[Any], *, total: int, description: str) -> Iterator[Any]:
        """Yield the items, named as `description`."""
        assert description
        at = {1, total // 2, total}
        for i, item in enumerate(items, 1):
            if isinstance(item.outcome, Ran):
                self.own += item.outcome.provenance["wall_seconds"]
            yield item
            self.last = time.perf_counter()
            if i == 1:
                self.first = self.last  # workers are up, libraries loaded
            if i in at:
                self.sizes.append(megabytes())


def timed(engine: Engine, runs: int, settings: str, out: Path) -> tuple[Watch, Summary]:
    """Run a study of the tests' kind; the watch is set as it begins."""
    text = f"study: bench\nquestion: How long?\nkind: for-tests\nseeds: {runs}\nsettings: {settings}\n"
    watch = Watch()
    summary = run_study(parse_study(text), out, engine, track=watch)
    return watch, summary


def short_runs(name: str, workers: int, engine: Engine, runs: int, out: Path) -> None:
    """Tell what a run costs beyond itself, where there is next to nothing to do in it."""
    watch, summary = timed(engine, runs, "{n: 20}", out)
    assert summary.done == runs
    seconds = watch.last - watch.first  # the workers' start left out
    cost = 1e3 * (seconds - watch.own / workers) / (runs - 1)
    sizes = ", ".join(f"{size:.0f}" for size in watch.sizes)
    print(
        f"{name}, workers {workers}: {runs} short runs in {seconds:.1f} s, {cost:.2f} ms each beyond itself, "
        f"its file written and flushed; driver {sizes} MB at the first, middle and last run"
    )
    if name == "local" and workers == 1:
        begun = time.perf_counter()
        assert Store(out).damaged() == ()
        checked = time.perf_counter()
        assert len(index(Store(out))) == runs
        told = (checked - begun, time.perf_counter() - checked)
        print(f"  all files checked in {told[0]:.1f} s; the index read in {told[1]:.2f} s")


def long_runs(engine: Engine, runs: int, out: Path) -> float:
    """Return the seconds that runs take which keep a core busy, the workers' start included."""
    watch, summary = timed(engine, runs, "{task: burn, n: 6000000}", out)
    assert summary.done == runs
    return watch.last - watch.begun


def main() -> None:
    """Measure, and print."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    runs, long = (200, 6) if given.quick else (given.runs, 12)
    print(machine())
    with tempfile.TemporaryDirectory() as made, installed(Path(made, "site")):
        folder = Path(made)
        short_runs("local", 1, LocalEngine(1), runs, folder / "local-1")
        short_runs("local", 2, LocalEngine(2), runs, folder / "local-2")
        short_runs("dask", 2, DaskEngine(workers=2), runs // 10, folder / "dask-2")
        for name, engines in {
            "local": (LocalEngine(1), LocalEngine(2)),
            "dask": (DaskEngine(workers=1), DaskEngine(workers=2)),
        }.items():
            load = os.getloadavg()[0]
            one, two = (
                long_runs(engine, long, folder / f"{name}-long-{i}") for i, engine in enumerate(engines)
            )
            print(
                f"{name}: {long} runs that keep a core busy: {one:.1f} s with one worker, {two:.1f} s with "
                f"two, {one / two:.2f} times as fast (load before: {load:.1f})"
            )


if __name__ == "__main__":
    main()
