"""Runs carried out by Dask workers, on this machine or on many.

Each thread of a Dask worker has a process of its own beside it that carries out runs, as on the local engine:
one thread, and an end when a run hangs or the worker is killed. So a Dask worker may have any settings.
"""

from __future__ import annotations

import atexit
import logging
import multiprocessing
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from contextlib import ExitStack, suppress
from datetime import datetime
from itertools import islice
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Final, Self

from comparisons.spread import checked_workers
from comparisons.study.running.engines import never
from comparisons.study.running.local import LocalEngine
from comparisons.study.running.processes import interrupts_held
from comparisons.study.running.provenance import utc_now
from comparisons.study.running.work import Finished, lost
from comparisons.study.spec import RunSpec
from worlds import UserError

try:
    from distributed import Client, KilledWorker, LocalCluster, get_worker
except ImportError as error:
    raise UserError(
        f'--engine dask: Dask is not installed ({error}); use: pip install "affordant[cluster]"'
    ) from error

_BREATH: Final = 0.1
"""Seconds after which it is looked whether to stop."""
_PATIENCE: Final = 30.0
"""Seconds to wait for a scheduler, and for its first worker."""
_AHEAD: Final = 2
"""Runs handed out for each thread of a worker, so that none waits for the next."""
_LOOK_ROUND: Final = 2.0
"""Seconds after which it is looked whether workers have come or gone."""


class DaskEngine:
    """Workers of Dask.

    Parameters
    ----------
    scheduler
        Address, such as ``tcp://10.0.0.1:8786``; by default a cluster on this machine, for as long as needed.
        Its workers must have the same affordant installed.
    workers
        How many, of a cluster of our own. Defaults to one for each core.

    Raises
    ------
    UserError
        If there is less than one worker, or their number is given for somebody else's cluster.
    """

    name: Final = "dask"

    def __init__(self, scheduler: str | None = None, workers: int | None = None) -> None:
        if scheduler is not None and workers is not None:
            raise UserError(
                f"--workers {workers}: the scheduler at {scheduler} has its own; leave one of the two out"
            )
        self._scheduler = scheduler
        self._most = checked_workers(workers)
        self._open = ExitStack()
        self._client: Any = None  # much of distributed has no types

    def __enter__(self) -> Self:
        """Connect to the scheduler, or start a cluster; raises a `UserError` if nobody answers."""
        with ExitStack() as stack:
            address: Any = self._scheduler
            if address is None:
                address = stack.enter_context(_cluster(self._most))
            try:
                client = stack.enter_context(_connect(address))
                client.wait_for_workers(1, timeout=_PATIENCE)
            except (OSError, ValueError) as error:  # a TimeoutError is an OSError
                raise UserError(
                    f"--scheduler {self._scheduler}: no scheduler with workers answers ({error}); start them "
                    "by `dask scheduler` and `dask worker ADDRESS`, and give the scheduler's address"
                ) from error
            self._client = client
            self._open = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let go of the scheduler, and end a cluster of our own."""
        self._client = None
        self._open.close()

    def execute(
        self,
        jobs: Iterable[RunSpec],
        limit: float | None = None,
        stop: Callable[[], bool] = never,
    ) -> Generator[Finished, None, None]:
        """Yield runs as they end, in no order; see `comparisons.study.running.engines.Engine`.

        A run whose Dask worker is killed is tried on another, as often as the scheduler allows.

        Raises
        ------
        UserError
            If the scheduler is lost, or workers cannot carry out runs at all.
        """
        client = self._client
        assert client is not None, "an engine works inside of its context only"
        coming = iter(jobs)
        under_way: dict[str, tuple[Any, RunSpec, datetime]] = {}
        ended: SimpleQueue[Any] = SimpleQueue()
        most, looked = 0, float("-inf")
        try:
            while not stop():
                if time.monotonic() - looked > _LOOK_ROUND:
                    most, looked = max(1, _AHEAD * sum(client.nthreads().values())), time.monotonic()
                for spec in islice(coming, max(0, most - len(under_way))):
                    future = client.submit(run_there, spec, limit, self.name, pure=False)
                    under_way[future.key] = (future, spec, utc_now())
                    future.add_done_callback(ended.put)
                if not under_way:
                    return
                with suppress(Empty):
                    future = ended.get(timeout=_BREATH)
                    _, spec, started = under_way.pop(future.key)
                    yield self._outcome(future, spec, started)
                    future.release()
        finally:
            # Workers look whether they are still wanted: see `run_there`.
            client.cancel([future for future, _, _ in under_way.values()], force=True)

    def _outcome(self, future: Any, spec: RunSpec, started: datetime) -> Finished:
        if future.status == "finished":
            finished: Finished = future.result()
            return finished
        if future.status != "error":
            raise UserError(
                f"--scheduler {self._scheduler}: it has lost a run ({future.status}); is it still up? "
                "Start it again, and resume the study"
            )
        error = future.exception()
        if isinstance(error, KilledWorker):
            return lost(spec, "died", f"its Dask workers died: {error}", self.name, started)
        raise UserError(
            f"--engine dask: a worker cannot carry out runs ({type(error).__name__}: {error}); install the "
            "same affordant there, and resume the study"
        ) from error


def _connect(address: Any) -> Any:
    connect: Any = Client
    return connect(address, timeout=_PATIENCE, set_as_default=False)


def _cluster(workers: int) -> Any:
    """Return a cluster on this machine, which nobody on another one can reach."""
    make: Any = LocalCluster
    with interrupts_held():  # Ctrl-C is for us to obey
        return make(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=None,
            dashboard_address="127.0.0.1:0",  # any free port: another cluster may have the usual one
            silence_logs=logging.CRITICAL,
        )


_IDLE: Final[deque[LocalEngine]] = deque()
"""In a Dask worker: engines of one process, with nothing to do. They end with the worker."""


def _new_engine(name: str) -> LocalEngine:
    engine = LocalEngine(1, name=name).__enter__()
    atexit.register(engine.__exit__, None, None, None)
    return engine


def run_there(spec: RunSpec, limit: float | None, engine: str) -> Finished | None:
    """Carry out a run in a Dask worker; return None if nobody wants it any more."""
    # Dask's nanny makes workers daemons, which may start no process; ours ends with its parent all the same.
    multiprocessing.current_process().daemon = False
    worker: Any = get_worker()
    key = worker.get_current_task()

    def unwanted() -> bool:
        task = worker.state.tasks.get(key)
        return task is None or task.state == "cancelled"

    local = _IDLE.pop() if _IDLE else _new_engine(engine)
    try:
        return next(local.execute([spec], limit, unwanted), None)
    finally:
        _IDLE.append(local)
