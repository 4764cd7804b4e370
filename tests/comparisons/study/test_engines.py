"""Engines with real workers: what becomes of runs that end badly, and of the others beside them."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Barrier, Event, Thread

import pytest
from study_kinds import abort, spec
from study_processes import alive, kill, parent_of, under_way, wait_until

from comparisons.study.running.engines import Engine
from comparisons.study.running.local import LocalEngine
from comparisons.study.running.on_dask import DaskEngine
from comparisons.study.running.processes import Worker
from comparisons.study.running.work import Broke, Finished, Ran
from comparisons.study.spec import RunSpec
from worlds import UserError

BAD = ("raise", "nan", "die", "exit", "hang")


pytestmark = pytest.mark.usefixtures("kind_there")


def ended(engine: Engine, jobs: Iterable[RunSpec], limit: float | None = None) -> dict[int, Finished]:
    """Return runs by their seeds; each comes back exactly once."""
    found: dict[int, Finished] = {}
    for finished in engine.execute(jobs, limit):
        assert finished.spec.seed not in found
        found[finished.spec.seed] = finished
    return found


def check_bad_runs_beside_good_ones(engine: Engine) -> None:
    """Run good and bad ones in turn: each is told as what it is, and a good one is none the worse."""
    tasks = [task for bad in BAD for task in (bad, "draw")]
    found = ended(engine, (spec(seed, task=task) for seed, task in enumerate(tasks)), limit=2.0)
    assert sorted(found) == list(range(len(tasks)))
    told = {}
    for seed, task in enumerate(tasks):
        outcome = found[seed].outcome
        assert found[seed].spec == spec(seed, task=task)
        if task == "draw":
            assert isinstance(outcome, Ran)
            assert outcome.provenance["engine"] == engine.name
        else:
            assert isinstance(outcome, Broke)
            told[task] = (outcome.reason, outcome.message)
    assert told["raise"] == ("raised", "ZeroDivisionError: as asked")
    assert told["nan"][0] == "raised"
    assert "a bug of the kind of run" in told["nan"][1]
    assert told["die"][0] == "died"
    assert "2 times: it was ended by SIGKILL; was the memory used up?" in told["die"][1]
    assert told["exit"] == ("raised", "SystemExit: 3")
    assert told["hang"] == ("too long", "it took longer than 2 seconds")


def check_one_thread(engine: Engine) -> None:
    """Let a run tell how many threads it may have: sums of several would differ in their last bits."""
    outcome = ended(engine, [spec(1, task="threads")])[1].outcome
    assert isinstance(outcome, Ran)
    assert outcome.result.details == {"threads": "1"}


def test_bad_runs_beside_good_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """In processes of this machine."""
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with LocalEngine(2) as engine:
        check_one_thread(engine)
        check_bad_runs_beside_good_ones(engine)


def test_a_run_whose_worker_died_is_tried_once_more(marks: Path) -> None:
    """For it may not have been the run's fault."""
    with LocalEngine(1) as engine:
        found = ended(engine, [spec(5, task="die once", mark=str(marks)), spec(6)])
    assert all(isinstance(finished.outcome, Ran) for finished in found.values())
    assert len(under_way(marks)[5]) == 2


def test_a_worker_killed_from_outside_loses_nothing(marks: Path) -> None:
    """Its run is done by another; one killed while it has nothing to do is replaced."""
    with LocalEngine(2) as engine:
        jobs = [spec(seed, seconds=0.5, mark=str(marks)) for seed in range(4)]
        found = {}
        for finished in engine.execute(iter(jobs)):
            if not found:
                wait_until(lambda: len(under_way(marks)) >= 3, "a third run")
                kill(under_way(marks)[2][0])
            found[finished.spec.seed] = finished.outcome
        assert sorted(found) == [0, 1, 2, 3]
        assert all(isinstance(outcome, Ran) for outcome in found.values())
        assert len(under_way(marks)[2]) == 2
        for pid in engine.pids:
            kill(pid)
        wait_until(lambda: not any(alive(pid) for pid in engine.pids), "the ends of idle workers")
        assert isinstance(ended(engine, [spec(9)])[9].outcome, Ran)


def test_workers_that_die_as_they_start_are_a_users_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would go on for ever otherwise."""
    monkeypatch.setattr("comparisons.study.running.processes._serve", abort)
    with (
        LocalEngine(1) as engine,
        pytest.raises(UserError, match="worker processes die as they start: it was ended by SIGABRT"),
    ):
        list(engine.execute([spec()]))


def test_a_worker_that_cannot_be_started_is_a_users_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where there may be no more processes or open files."""

    def no_more(*_: object) -> None:
        raise OSError(24, "Too many open files")

    monkeypatch.setattr("comparisons.study.running.local.Worker", no_more)
    with (
        LocalEngine(1) as engine,
        pytest.raises(UserError, match=r"started \(Too many open files\); try fewer"),
    ):
        list(engine.execute([spec()]))


def test_a_run_that_ends_in_time_counts_whenever_it_is_looked_at() -> None:
    """As where the driver waits for a slow disk meanwhile."""
    with LocalEngine(1) as engine:
        running = engine.execute([spec(seed) for seed in range(2)], limit=1.0)
        assert isinstance(next(running).outcome, Ran)
        time.sleep(1.2)  # the other one has been handed out
        assert isinstance(next(running).outcome, Ran)


def test_workers_started_by_many_threads_have_one_thread_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a Dask worker of many threads, whose own environment stays as it was."""
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    ready = Barrier(6)
    told = []

    def run(seed: int) -> None:
        with LocalEngine(1) as engine:
            ready.wait()
            told.extend(engine.execute([spec(seed, task="threads")]))

    threads = [Thread(target=run, args=(seed,)) for seed in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [finished.outcome.result.details for finished in told] == [{"threads": "1"}] * 6
    assert "OMP_NUM_THREADS" not in os.environ


def test_jobs_are_drawn_as_workers_become_free() -> None:
    """However many there are, and however long the caller takes."""
    drawn = []

    def jobs() -> Iterator[RunSpec]:
        for seed in range(10_000):
            drawn.append(seed)
            yield spec(seed)

    with LocalEngine(2) as engine:
        running = engine.execute(jobs())
        for _ in range(20):
            next(running)
        assert len(drawn) <= 20 + 3 * 2
        running.close()


def test_few_runs_start_few_workers() -> None:
    """And no run starts none."""
    with LocalEngine(8) as engine:
        assert list(engine.execute([])) == []
        assert engine.pids == ()
        assert len(ended(engine, [spec(1)])) == 1
        assert len(engine.pids) == 1


@pytest.mark.parametrize("how", ["told", "closed", "left"])
def test_what_is_under_way_ends_with_the_engine(marks: Path, how: str) -> None:
    """Told to stop, closed or left: no process stays, and nobody waits for a run that hangs."""
    stop = Event()
    jobs = [spec(0), spec(1, task="hang", mark=str(marks))]
    with LocalEngine(2) as engine:
        running = engine.execute(jobs, stop=stop.is_set)
        assert next(running).spec.seed == 0
        wait_until(lambda: under_way(marks), "the run that hangs")
        pids = (*engine.pids, *under_way(marks)[1])
        begun = time.monotonic()
        if how == "told":
            stop.set()
            assert next(running, None) is None
        elif how == "closed":
            running.close()
        if how != "left":
            assert not alive(under_way(marks)[1][0])
    assert time.monotonic() - begun < 20
    assert not any(alive(pid) for pid in pids)


def test_a_worker_that_waits_may_give_back_what_it_holds(marks: Path) -> None:
    """Such as semaphores of replay buffers, of which Python warns where a process is killed with them."""
    with LocalEngine(1) as engine:
        ended(engine, [spec(1, task="hold", mark=str(marks))])
        assert not (marks / "given back").exists()
    assert (marks / "given back").exists()


def test_a_worker_knows_nothing_of_an_interrupt(tmp_path: Path) -> None:
    """Ctrl-C reaches every process of a terminal; what is to end then is the driver's to say."""
    worker: Worker[int] = Worker("local", tmp_path)
    try:
        for _ in range(5):  # from its first instruction on
            os.kill(worker.pid, signal.SIGINT)
            time.sleep(0.02)
        wait_until(lambda: worker.news() is not None or worker.up, "the worker")
        os.kill(worker.pid, signal.SIGINT)
        worker.hand(1, spec(4))
        wait_until(lambda: worker.news() is not None, "the run")
    finally:
        worker.end()


@pytest.mark.slow
def test_a_cluster_of_our_own(marks: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bad runs beside good ones; told to stop, the run under way ends though the worker stays."""
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    with DaskEngine(workers=2) as engine:
        check_one_thread(engine)
        check_bad_runs_beside_good_ones(engine)
        running = engine.execute([spec(0), spec(1, task="hang", mark=str(marks))])
        assert next(running).spec.seed == 0
        wait_until(lambda: under_way(marks), "the run that hangs")
        running.close()
        (pid,) = under_way(marks)[1]
        wait_until(lambda: not alive(pid), "the end of the run that hangs")
        assert isinstance(ended(engine, [spec(2)])[2].outcome, Ran)


@contextmanager
def dask(*words: str, cwd: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command of Dask in a folder of its own."""
    cwd.mkdir()
    command = [sys.executable, "-m", "dask", *words]
    with (cwd / "log").open("wb") as log:
        process = subprocess.Popen(command, cwd=cwd, stdout=log, stderr=log)  # noqa: S603
        try:
            yield process
        finally:
            process.terminate()
            process.wait(30)


@contextmanager
def two_machines(tmp_path: Path, *words: str) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Yield a scheduler's address, and two workers, which share no folder, and the scheduler."""
    here = tmp_path / "scheduler"
    with ExitStack() as stack:
        file = here / "scheduler.json"
        local = ("--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0")
        scheduler = stack.enter_context(
            dask("scheduler", *local, "--port", "0", "--scheduler-file", str(file), cwd=here)
        )
        wait_until(lambda: file.exists() and b'"address"' in file.read_bytes(), "the scheduler")
        address = json.loads(file.read_bytes())["address"]
        workers = [
            stack.enter_context(
                dask(
                    *("worker", address, *local, "--nthreads", "1", *words),
                    *("--local-directory", str(tmp_path / name / "space")),
                    cwd=tmp_path / name,
                )
            )
            for name in ("one", "two")
        ]
        yield address, [*workers, scheduler]


def _just_begun(marks: Path, parent: int) -> bool:
    """Return whether a process has begun a run within the last moment."""
    now = time.time()
    return any(
        now - path.stat().st_mtime < 0.4 and parent_of(int(path.name.split("-")[1])) == parent
        for path in marks.iterdir()
    )


@pytest.mark.slow
def test_dask_workers_elsewhere_and_one_of_them_killed(tmp_path: Path, marks: Path) -> None:
    """Runs go to both, their files with them; a killed worker's run is done by the other one."""
    (tmp_path / "text").write_text("not this one")
    with two_machines(tmp_path, "--no-nanny") as (address, workers), DaskEngine(address) as engine:
        jobs = [
            spec(seed, seconds=0.5, mark=str(marks), text="text", files={"text": "this one"})
            for seed in range(12)
        ]

        def kill_the_first_worker() -> None:
            wait_until(lambda: _just_begun(marks, workers[0].pid), "a run of the first worker")
            kill(workers[0].pid)

        watching = Thread(target=kill_the_first_worker)
        watching.start()
        found = {seed: finished.outcome for seed, finished in ended(engine, jobs).items()}
        watching.join()
        assert sorted(found) == list(range(12))
        assert {outcome.result.details["text"] for outcome in found.values()} == {"this one"}
        assert any(len(pids) == 2 for pids in under_way(marks).values())  # the one that was lost
    wait_until(lambda: not any(alive(pid) for pids in under_way(marks).values() for pid in pids), "all ends")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lost", "told"),
    [(slice(2), "no workers are left; start some, and resume"), (slice(2, 3), "is it still up.* resume")],
)
def test_a_cluster_that_is_lost_is_told(
    tmp_path: Path, marks: Path, monkeypatch: pytest.MonkeyPatch, lost: slice, told: str
) -> None:
    """All its workers or its scheduler: nobody waits for ever."""
    with two_machines(tmp_path, "--no-nanny") as (address, processes), DaskEngine(address) as engine:
        monkeypatch.setattr("comparisons.study.running.on_dask._PATIENCE", 1.0)
        running = engine.execute([spec(0), spec(1, task="hang", mark=str(marks))])
        assert next(running).spec.seed == 0
        wait_until(lambda: under_way(marks), "the run that hangs")
        for process in processes[lost]:
            kill(process.pid)
        with pytest.raises(UserError, match=told):
            next(running)


def test_a_cluster_of_our_own_that_does_not_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where memory is short; Dask tells of it by errors of its own."""

    def fail(**_: object) -> None:
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr("comparisons.study.running.on_dask.LocalCluster", fail)
    with pytest.raises(UserError, match=r"Nanny failed to start.\); try fewer"), DaskEngine(workers=2):
        pass


def test_a_scheduler_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Told before anything is made, with how to start one."""
    monkeypatch.setattr("comparisons.study.running.on_dask._PATIENCE", 0.5)
    with (
        pytest.raises(UserError, match=r"tcp://127.0.0.1:9: no scheduler .* `dask scheduler`"),
        DaskEngine("tcp://127.0.0.1:9"),
    ):
        pass
    with pytest.raises(UserError, match="--workers 2: the scheduler at"):
        DaskEngine("tcp://127.0.0.1:9", workers=2)
