"""Processes on this machine that carry out runs.

Each worker has a pipe of its own and shares no lock with anybody: wherever it is killed, and were it half-way
through telling a result, the other workers and the driver notice no more than the end of its pipe.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import islice
from multiprocessing.connection import wait
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Final, Literal, Self

from comparisons.spread import checked_workers
from comparisons.study.running.engines import never
from comparisons.study.running.processes import Gone, Worker
from comparisons.study.running.provenance import utc_now
from comparisons.study.running.work import Finished, lost
from comparisons.study.spec import RunSpec
from worlds import UserError

_BREATH: Final = 0.1
"""Seconds after which it is looked whether to stop."""
_ATTEMPTS: Final = 2
"""How often a run is tried whose worker dies."""
_STARTS: Final = 3
"""Of so many workers in a row one must come up."""
_NEVER: Final = float("inf")


@dataclass(frozen=True)
class _Task:
    """A run that is to be done, or that a worker is at."""

    spec: RunSpec
    attempt: int = 1
    started: datetime | None = None
    deadline: float = _NEVER


class _Queue:
    """What is still to be handed out: jobs as they come, and those to be tried again."""

    def __init__(self, jobs: Iterable[RunSpec]) -> None:
        self._jobs = iter(jobs)
        self._waiting: deque[_Task] = deque()

    def ahead(self, most: int) -> int:
        """Return how many wait, if no more than `most`; no more jobs than that are drawn."""
        self._waiting.extend(_Task(spec) for spec in islice(self._jobs, max(0, most - len(self._waiting))))
        return min(len(self._waiting), most)

    def take(self) -> _Task:
        """Return what is next; there must be something ahead."""
        return self._waiting.popleft()

    def put_back(self, task: _Task) -> None:
        """Let a run wait again."""
        self._waiting.append(task)


class LocalEngine:
    """Processes on this machine, each on one thread.

    Parameters
    ----------
    workers
        How many. Defaults to one for each core.
    name
        What the provenance calls it.

    Raises
    ------
    UserError
        If there is less than one worker.

    Examples
    --------
    >>> with LocalEngine(workers=1) as engine:
    ...     for finished in engine.execute([RunSpec("lern", 1, {}, seed=0)]):
    ...         print(finished.outcome.message)
    lern: there is no such kind of run; did you mean 'learn'?
    """

    def __init__(self, workers: int | None = None, name: str = "local") -> None:
        self.name = name
        self._most = checked_workers(workers)
        self._workers: list[Worker[_Task]] = []
        self._scratch: TemporaryDirectory[str] | None = None
        self._failed_starts = 0
        self._last_end = ""

    def __enter__(self) -> Self:
        """Make ready; workers start when there are runs for them."""
        # The driver's to remove: a worker that is killed leaves its files behind.
        self._scratch = TemporaryDirectory(prefix="affordant-study-")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all workers, and what they are at."""
        for worker in self._workers:
            worker.let_go()
        for worker in self._workers:
            worker.end()
        self._workers.clear()
        if self._scratch is not None:
            self._scratch.cleanup()
            self._scratch = None

    @property
    def pids(self) -> tuple[int, ...]:
        """Ids of the worker processes there are."""
        return tuple(worker.pid for worker in self._workers)

    def execute(
        self,
        jobs: Iterable[RunSpec],
        limit: float | None = None,
        stop: Callable[[], bool] = never,
    ) -> Generator[Finished, None, None]:
        """Yield runs as they end, in no order; see `comparisons.study.running.engines.Engine`.

        A run is measured against its limit from when an idle worker gets it.

        Raises
        ------
        UserError
            If workers cannot be started.
        """
        queue = _Queue(jobs)
        self._failed_starts = 0
        try:
            while not stop():
                self._hand_out(queue, limit)
                if not self._busy and not queue.ahead(1):
                    return
                ended = self._look(queue, limit)
                self._hand_out(queue, limit)  # first: the caller may take a while over what has ended
                yield from ended
                if self._failed_starts >= _STARTS:
                    raise UserError(
                        f"worker processes die as they start: {self._last_end}; look for what they printed, "
                        "and try fewer with --workers if memory is short"
                    )
        finally:
            # Whatever made an end of it: nobody waits for what is under way.
            for worker in self._busy:
                self._remove(worker)

    @property
    def _busy(self) -> list[Worker[_Task]]:
        return [worker for worker in self._workers if worker.task is not None]

    def _hand_out(self, queue: _Queue, limit: float | None) -> None:
        """Give every idle worker a run, and start workers for runs that wait still."""
        for worker in self._workers:
            if worker.idle and queue.ahead(1):
                task = queue.take()
                deadline = _NEVER if limit is None else time.monotonic() + limit
                try:
                    worker.hand(replace(task, started=utc_now(), deadline=deadline), task.spec)
                except Gone:  # it died while it had nothing to do
                    queue.put_back(task)
        starting = sum(not worker.up for worker in self._workers)
        free = self._most - len(self._workers)
        for _ in range(min(free, queue.ahead(self._most) - starting)):
            assert self._scratch is not None, "an engine works inside of its context only"
            try:
                self._workers.append(Worker(self.name, Path(self._scratch.name)))
            except OSError as error:  # of processes, memory or open files
                raise UserError(
                    f"a worker process cannot be started ({error.strerror}); try fewer with --workers"
                ) from error

    def _look(self, queue: _Queue, limit: float | None) -> list[Finished]:
        """Wait until something happens, but not for long; return the runs that have ended."""
        now = time.monotonic()
        nearest = min((worker.task.deadline for worker in self._workers if worker.task), default=_NEVER)
        sources = [source for worker in self._workers for source in worker.sources]
        wait(sources, timeout=max(0.0, min(_BREATH, nearest - now)))
        ended: list[Finished] = []
        for worker in tuple(self._workers):
            task = worker.task
            try:
                finished = worker.news()
            except Gone as gone:
                ended += self._bury(worker, str(gone), queue)
                continue
            if finished is not None:
                self._failed_starts = 0
                ended.append(finished)
            elif task is not None and time.monotonic() > task.deadline:
                self._remove(worker)
                ended.append(self._lost(task, "too long", f"it took longer than {limit:g} seconds"))
        return ended

    def _bury(self, worker: Worker[_Task], how: str, queue: _Queue) -> list[Finished]:
        """Remove a worker that has died; its run is tried again, or has ended with it."""
        task = worker.task
        self._remove(worker)
        if not worker.up:
            self._failed_starts, self._last_end = self._failed_starts + 1, how
        if task is None:
            return []
        if task.attempt < _ATTEMPTS or not worker.begun:
            queue.put_back(replace(task, attempt=task.attempt + worker.begun))
            return []
        return [self._lost(task, "died", f"its worker process died, {_ATTEMPTS} times: {how}")]

    def _lost(self, task: _Task, why: Literal["died", "too long"], message: str) -> Finished:
        assert task.started is not None, "a worker was at it"
        return lost(task.spec, why, message, self.name, task.started)

    def _remove(self, worker: Worker[_Task]) -> None:
        worker.end()
        self._workers.remove(worker)
