"""A worker process as its driver sees it: it comes up, is handed run after run, and tells how each ended."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Lock
from typing import Final, Generic, TypeVar

from comparisons.spread import begin_worker, one_thread_each
from comparisons.study.running.work import Finished, work
from comparisons.study.spec import RunSpec

T = TypeVar("T")

_CONTEXT: Final = get_context("spawn")
_LAST_SECONDS: Final = 5.0
"""A process whose pipe has ended may take so long to end itself."""
_INTERRUPT: Final = {signal.SIGINT}
_ONE_AT_A_TIME: Final = Lock()
"""Processes are started and ended by one thread at a time, where there are many, as in a Dask worker: threads
share the environment that a process starts in, and multiprocessing's list of processes."""


class Gone(Exception):  # noqa: N818 - an event, not a mistake
    """The worker process has died; the message tells how."""


class Worker(Generic[T]):
    """A process that carries out one run after the other, on one thread.

    Parameters
    ----------
    engine
        Name of the engine, for the provenance.
    scratch
        An existing folder for files of runs.

    Attributes
    ----------
    task
        What it is at, in the driver's terms; None if nothing.
    up
        Whether it has ever come up, its libraries loaded.
    begun
        Whether it has begun what it is at; if it has not, its death is not the run's fault.
    """

    def __init__(self, engine: str, scratch: Path) -> None:
        self._pipe, theirs = _CONTEXT.Pipe()
        # As a daemon it is ended even by a driver that forgets it; its runs can spread no processes then.
        self._process = _CONTEXT.Process(
            target=_serve, args=(theirs, engine, scratch), name="affordant-worker", daemon=True
        )
        with _ONE_AT_A_TIME, one_thread_each(), interrupts_held():
            self._process.start()
        theirs.close()  # now the pipe ends when the worker does
        self.task: T | None = None
        self.up = self.begun = False
        self._gone = self._free = False

    @property
    def pid(self) -> int:
        """The process's id."""
        assert self._process.pid is not None, "it was started"
        return self._process.pid

    @property
    def idle(self) -> bool:
        """Whether it waits for a run."""
        return self.up and self.task is None and not self._gone

    @property
    def sources(self) -> tuple[Connection, int]:
        """What `multiprocessing.connection.wait` may wait for: something to read, or the process's end."""
        return self._pipe, self._process.sentinel

    def hand(self, task: T, spec: RunSpec) -> None:
        """Let it carry out a run; raises `Gone` if it cannot any more."""
        try:
            self._pipe.send(spec)
        except OSError:
            raise self._departure() from None
        self.task, self.begun = task, False

    def news(self) -> Finished | None:
        """Return the run that it has ended, None if it has ended none; raises `Gone` if it has died."""
        alive = self._process.is_alive()  # asked first: what it told just before its end is still read
        while self._pipe.poll():
            try:
                told: Finished | None = self._pipe.recv()
            except (EOFError, OSError):
                raise self._departure() from None
            if told is not None:
                self.task = None
                return told
            # Its first word says that it is up, each other one that it has begun.
            self.up, self.begun = True, self.up
        if alive:
            return None
        raise self._departure()

    def let_go(self) -> None:
        """Let it end by itself if it waits for a run, and so give back what it holds, such as semaphores."""
        self._free = self.idle
        if self._free:
            self._pipe.close()

    def end(self) -> None:
        """End it, whatever it is at."""
        if self._free:
            self._process.join(_LAST_SECONDS)
        with _ONE_AT_A_TIME:
            self._process.kill()
            self._process.join()
            self._process.close()
        self._pipe.close()

    def _departure(self) -> Gone:
        """Return how the process ended, in words, and remember that it has."""
        self._gone = True
        self._process.join(_LAST_SECONDS)
        code = self._process.exitcode
        if code is None:
            return Gone("it closed its pipe to the driver")
        if code >= 0:
            return Gone(f"it ended with exit status {code}")
        number = -code
        name = signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
        hint = "; was the memory used up?" if number == signal.SIGKILL else ""
        return Gone(f"it was ended by {name}{hint}")


def _serve(pipe: Connection, engine: str, scratch: Path) -> None:
    """Be a worker, until the driver is gone."""
    begin_worker()
    with suppress(EOFError, BrokenPipeError):
        pipe.send(None)  # it is up
        while True:
            spec = pipe.recv()
            pipe.send(None)  # it has begun
            pipe.send(work(spec, engine, scratch))


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Let processes that start meanwhile know nothing of Ctrl-C, from their very first instruction."""
    resource_tracker.ensure_running()  # it would let interrupts through again, the first time
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _INTERRUPT)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
