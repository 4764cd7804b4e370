"""Work spread over processes: each on one thread, so that results are the same whatever their number."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from threading import Thread
from typing import Any, Final, TypeVar

from comparisons.outputs import Track, untracked
from worlds.errors import UserError

J = TypeVar("J")
R = TypeVar("R")

_ONE_THREAD: Final = (
    *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"),
    "OPENCV_FOR_THREADS_NUM",
)
"""Libraries read these when they load, that is, as a worker starts."""
_HANDED: list[Any] = []
"""What this process was handed at its start, if it is a worker."""


def cores() -> int:
    """Return how many cores this process may use.

    Examples
    --------
    >>> cores() >= 1
    True
    """
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def checked_workers(workers: int | None) -> int:
    """Return the number of worker processes, every core's if None.

    Raises
    ------
    UserError
        If it is less than 1.

    Examples
    --------
    >>> checked_workers(3)
    3
    """
    if workers is not None and workers < 1:
        raise UserError(f"--workers {workers}: give at least 1")
    return cores() if workers is None else workers


def spread(
    work: Callable[..., R],
    jobs: Sequence[J],
    given: tuple[Any, ...] = (),
    *,
    workers: int | None = None,
    track: Track = untracked,
    description: str = "working",
) -> list[R]:
    """Return what `work` makes of each job, in the jobs' order, done in worker processes.

    Parameters
    ----------
    work
        A function of a module, called as ``work(job, *given)``.
    jobs
        What to do; errors name a job by its ``str``.
    given
        What every job needs. Each worker is handed it once, at its start.
    workers
        Number of processes. Defaults to one for each core.
    track
        Shows progress, as jobs end.
    description
        What the work is called in progress and in errors.

    Raises
    ------
    UserError
        If a job fails, or a worker dies. What is still to do is dropped, and the workers are stopped.

    Examples
    --------
    >>> spread(pow, [2, 3], (3,), workers=2)
    [8, 27]
    """
    workers = min(checked_workers(workers), max(len(jobs), 1))
    ours = set(active_children())
    with (
        one_thread_each(),
        ProcessPoolExecutor(workers, get_context("spawn"), initializer=_start, initargs=given) as pool,
    ):
        found: dict[int, R] = {}
        try:
            futures = {pool.submit(_run, work, job, description): i for i, job in enumerate(jobs)}
            for future in track(as_completed(futures), total=len(futures), description=description):
                found[futures[future]] = future.result()
        except BrokenProcessPool as error:
            open_ones = [str(job) for i, job in enumerate(jobs) if i not in found][:workers]
            raise UserError(
                f"{description}: a worker process died (killed, or out of memory) at one of: "
                f"{'; '.join(open_ones)}; try fewer with --workers"
            ) from error
        finally:
            # After a failure, and when the user stops the program, nobody waits for what is under way.
            if len(found) < len(jobs):
                pool.shutdown(wait=False, cancel_futures=True)
                for child in set(active_children()) - ours:
                    child.terminate()
    return [found[i] for i in range(len(jobs))]


def reason(error: BaseException) -> str:
    """Return what went wrong, in words for a user.

    Examples
    --------
    >>> reason(UserError("no such name")), reason(ValueError("2"))
    ('no such name', 'ValueError: 2')
    """
    return str(error) if isinstance(error, UserError) else f"{type(error).__name__}: {error}"


def _run(work: Callable[..., R], job: Any, description: str) -> R:
    try:
        return work(job, *_HANDED)
    except Exception as error:
        raise UserError(f"{description}: {job}: {reason(error)}") from error


def begin_worker() -> None:
    """Begin a worker process: it leaves Ctrl-C to its parent, and ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _start(*given: Any) -> None:
    begin_worker()
    _HANDED[:] = given


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None, "a worker is started by another process"
    wait([parent.sentinel])
    os._exit(1)


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Let processes that start meanwhile use one thread each: sums of several differ in their last bits."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
