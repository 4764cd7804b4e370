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
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
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
    from distributed import Client, KilledWorker, LocalCluster, Reschedule, Status, get_worker
except ImportError as error:
    raise UserError(
        f'--engine dask: Dask is not installed ({error}); use: pip install "affordant[cluster]"'
    ) from error

_BREATH: Final = 0.1
"""Seconds after which it is looked whether to stop."""
_PATIENCE: Final = 30.0
"""Seconds to wait for a scheduler, and for workers where there are none."""
_AHEAD: Final = 2
"""Runs handed out for each thread of a worker, so that none waits for the next."""
_LOOK_ROUND: Final = 2.0
"""Seconds after which it is looked whether workers have come or gone."""
_ENDS: Final = {Status.closing, Status.closed, Status.failed}
"""Of a Dask worker that is told to end, or has lost its scheduler."""


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
        self._told = "--engine dask" if scheduler is None else f"--scheduler {scheduler}"
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
                    f"{self._told}: no scheduler with workers answers ({error}); start them "
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
            If the scheduler is lost, all workers are and none comes, or they cannot carry out runs at all.
        """
        client = self._client
        assert client is not None, "an engine works inside of its context only"
        coming = iter(jobs)
        under_way: dict[str, tuple[Any, RunSpec, datetime]] = {}
        ended: SimpleQueue[Any] = SimpleQueue()
        most, looked, there = 0, float("-inf"), time.monotonic()
        try:
            while not stop():
                if time.monotonic() - looked > _LOOK_ROUND:
                    with self._asking():
                        threads = sum(client.nthreads().values())
                    most, looked = max(1, _AHEAD * threads), time.monotonic()
                    there = looked if threads else there
                    if looked - there > _PATIENCE:
                        raise UserError(
                            f"{self._told}: no workers are left; start some, and resume the study"
                        )
                for spec in islice(coming, max(0, most - len(under_way))):
                    with self._asking():
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
            with suppress(Exception):  # a scheduler that is lost wants nothing
                client.cancel([future for future, _, _ in under_way.values()], force=True)

    @contextmanager
    def _asking(self) -> Iterator[None]:
        """Tell of a scheduler that does not answer, which distributed does by errors of any kind."""
        try:
            yield
        except Exception as error:
            raise self._lost(f"{type(error).__name__}: {error}") from error

    def _lost(self, how: str) -> UserError:
        return UserError(
            f"{self._told}: the scheduler has lost runs ({how}); is it still up? Start it again, and resume "
            "the study"
        )

    def _outcome(self, future: Any, spec: RunSpec, started: datetime) -> Finished:
        if future.status == "finished":
            with self._asking():
                finished: Finished = future.result()
            return finished
        if future.status != "error":
            raise self._lost(future.status)
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
    try:
        with interrupts_held():  # Ctrl-C is for us to obey
            return make(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                memory_limit=None,
                dashboard_address="127.0.0.1:0",  # any free port: another cluster may have the usual one
                silence_logs=logging.CRITICAL,
            )
    except (OSError, RuntimeError) as error:
        raise UserError(
            f"--engine dask: its workers cannot be started here ({error}); try fewer with --workers"
        ) from error


_IDLE: Final[deque[LocalEngine]] = deque()
"""In a Dask worker: engines of one process, with nothing to do. They end with the worker."""


def _new_engine(name: str) -> LocalEngine:
    engine = LocalEngine(1, name=name).__enter__()
    atexit.register(engine.__exit__, None, None, None)
    return engine


def run_there(spec: RunSpec, limit: float | None, engine: str) -> Finished:
    """Carry out a run in a Dask worker, for as long as somebody wants it."""
    # Dask's nanny makes workers daemons, which may start no process; ours ends with its parent all the same.
    multiprocessing.current_process().daemon = False
    worker: Any = get_worker()
    key = worker.get_current_task()

    def unwanted() -> bool:
        task = worker.state.tasks.get(key)
        return worker.status in _ENDS or task is None or task.state == "cancelled"

    try:
        local = _IDLE.pop()
    except IndexError:
        local = _new_engine(engine)
    try:
        finished = next(local.execute([spec], limit, unwanted), None)
    finally:
        _IDLE.append(local)
    if finished is None:
        raise Reschedule  # nobody wants it; should that have changed meanwhile, it is done again
    return finished
