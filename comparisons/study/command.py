"""`affordant study`: commands that run studies and tell of them. Each loads what it needs, and no more."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, TypeVar

from cyclopts import App
from rich.console import Console

from worlds.errors import UserError

if TYPE_CHECKING:
    from comparisons.outputs import Track
    from comparisons.study.running.engines import Engine
    from comparisons.study.running.study_runs import Summary

study = App(
    name="study",
    help="Declare a study in one file; run it, stop it, go on, and tell what it found.",
    help_format="plaintext",
)
T = TypeVar("T")
_QUICK: Final = 2


@study.command
def run(
    file: Path,
    /,
    *,
    out: Path,
    engine: Literal["local", "dask"] = "local",
    scheduler: str | None = None,
    workers: int | None = None,
    limit: float | None = None,
    quick: bool = False,
) -> int:
    """Run a study into a new store, and keep every run as it ends.

    Exit status 0 says that every run has a result, 1 that some failed, which
    `affordant study status` tells, 2 that it could not begin or keep its results.
    Ctrl-C and SIGTERM stop it in order (130, 143); `affordant study resume` goes on.

    Parameters
    ----------
    file
        The study file, in YAML; `affordant study schema` prints its form.
    out
        Directory to make, the store; it must not exist.
    engine
        What carries out runs: local (processes on this machine) or dask (extra "cluster").
    scheduler
        Address of a Dask scheduler, such as tcp://10.0.0.1:8786. Defaults to a cluster on this machine.
    workers
        How many processes; their number changes nothing in the results. Defaults to one for each core.
    limit
        Seconds that a run may take; one that takes longer has failed. Defaults to no limit.
    quick
        Only the first two seeds of each combination, for a first look; resume does the others.
    """
    from comparisons.study.declaring.declaration import load_study
    from comparisons.study.figures.grouping import FIGURES
    from comparisons.study.running.study_runs import run_study

    declared = load_study(file, FIGURES)
    asked = replace(declared, seeds=declared.seeds[:_QUICK]) if quick else declared
    with _progress() as track:
        done = run_study(asked, out, _engine(engine, scheduler, workers), limit=limit, track=track)
    return _ended(done, out, more=len(declared.seeds) > len(asked.seeds))


@study.command
def resume(
    directory: Path,
    /,
    *,
    engine: Literal["local", "dask"] = "local",
    scheduler: str | None = None,
    workers: int | None = None,
    limit: float | None = None,
) -> int:
    """Go on with a study: do the runs that are missing, failed or damaged. Exit statuses are those of run.

    Parameters
    ----------
    directory
        The store that `affordant study run` made, on this machine or another.
    engine
        What carries out runs: local or dask; another one than before gives the same results.
    scheduler
        Address of a Dask scheduler. Defaults to a cluster on this machine.
    workers
        How many processes. Defaults to one for each core.
    limit
        Seconds that a run may take. Defaults to no limit.
    """
    from comparisons.study.running.study_runs import resume_study

    with _progress() as track:
        done = resume_study(directory, _engine(engine, scheduler, workers), limit=limit, track=track)
    return _ended(done, directory)


@study.command
def status(directory: Path, /) -> int:
    """Tell how many runs of a study are done, failed, damaged and to do, and what became of failed ones.

    Exit status 0 says that every run has a result, 1 that some have none.

    Parameters
    ----------
    directory
        The store.
    """
    from comparisons.study.gathering import gather, state_text, study_in

    found = gather(*study_in(directory))
    print(state_text(found, directory))
    return 0 if found.whole else 1


@study.command
def report(directory: Path, /, *, out: Path | None = None) -> int:
    """Write a study's report: one page that opens offline, figures (SVG, PDF, PNG), tables (Markdown, LaTeX).

    Exit status 0 says that every run has a result, 1 that some have none: the report says so, too.

    Parameters
    ----------
    directory
        The store.
    out
        Directory to make; it must not exist. Defaults to report in the store, which is made anew.
    """
    from comparisons.study.report import report_study

    with _progress() as track:
        page, whole = report_study(directory, out, track)
    print(page)
    return 0 if whole else 1


@study.command
def export(directory: Path, /, *, out: Path) -> int:
    """Write a study's results as a table, one row a run, and their curves as another one beside it.

    Exit status 0 says that every run has a result, 1 that some have none, and no row.

    Parameters
    ----------
    directory
        The store.
    out
        The file: .csv, or .parquet (extra "parquet"). It is replaced, and so is NAME-curves beside it.
    """
    from comparisons.study.gathering import study_in
    from comparisons.study.results.exporting import export as write

    declared, store = study_in(directory)
    planned, kept = declared.expand(), set(store.hashes())
    for path in write(planned, store, out):
        print(path)
    missing = sum(run.spec.hash not in kept for run in planned)
    if missing:
        print(f"{missing:,} of {len(planned):,} runs have no result, and no row", file=sys.stderr)
    return 1 if missing else 0


@study.command
def diff(first: Path, second: Path, /) -> int:
    """Tell how the results of two stores differ, run by run; timings are no difference.

    Exit status 0 says that both hold the same results, 1 that they do not.

    Parameters
    ----------
    first
        A store.
    second
        Another one.
    """
    from comparisons.study.results.differences import diff as compare
    from comparisons.study.running.store import Store

    stores = Store(first), Store(second)
    for store in stores:
        store.text()  # refuses what is no store, of which an empty one would seem the same
    found = compare(*stores)
    print(found.text(str(first), str(second)))
    return found.status


@study.command
def check(file: Path, /) -> int:
    """Check a study file and tell what it would run, without running anything.

    Exit status 0 says that it could be run, 2 that it is wrong, and every mistake in it is told.

    Parameters
    ----------
    file
        The study file.
    """
    from comparisons.study.declaring.declaration import load_study
    from comparisons.study.figures.grouping import FIGURES

    print(load_study(file, FIGURES).describe())
    return 0


@study.command
def schema() -> int:
    """Print the JSON Schema of study files, for editors and other programs."""
    from comparisons.study.declaring.schema import shipped_schema

    print(shipped_schema(), end="")
    return 0


@contextmanager
def _progress() -> Iterator[Track]:
    """Yield what shows progress on standard error, from when there is any."""
    from comparisons.outputs import progress_on

    with ExitStack() as shown:

        def track(items: Iterable[T], *, total: int, description: str) -> Iterable[T]:
            bars = shown.enter_context(progress_on(Console(stderr=True)))
            return bars.track(items, total=total, description=description)

        yield track


def _engine(name: Literal["local", "dask"], scheduler: str | None, workers: int | None) -> Engine:
    """Return the engine that is asked for."""
    if name == "dask":
        from comparisons.study.running.on_dask import DaskEngine

        return DaskEngine(scheduler, workers)
    if scheduler is not None:
        raise UserError(f"--scheduler {scheduler}: only the engine dask has one; add --engine dask")
    from comparisons.study.running.local import LocalEngine

    return LocalEngine(workers)


def _ended(done: Summary, directory: Path, *, more: bool = False) -> int:
    """Tell how running ended, and return the exit status."""
    folder = shlex.quote(str(directory))
    for one in done.damaged:
        print(f"damaged, moved aside and done again: {one.path.name}: {one.problem}", file=sys.stderr)
    kept = done.done + done.skipped
    words = [f"{kept:,} of {done.planned:,} runs have a result"]
    words += [f"{done.failed:,} failed"] if done.failed else []
    if done.stopped is not None:
        words.append(f"{done.left:,} are to do")
        told = f"affordant: stopped; {', '.join(words)}; to go on: affordant study resume {folder}"
        print(told, file=sys.stderr)
        return 128 + done.stopped
    print(", ".join(words))
    if done.others:
        told = f"{done.others:,} results in the store are of no run of this study any more"
        print(f"{told}: affordant study status {folder} tells why")
    if done.failed:
        print(f"why: affordant study status {folder}; to try again: affordant study resume {folder}")
    if more:
        print(f"the other seeds: affordant study resume {folder}")
    print(f"report: affordant study report {folder}")
    return 1 if done.failed else 0
