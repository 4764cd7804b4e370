"""Studies run to their end, broken off in every way, and gone on with; with real workers."""

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

import pytest
from study_processes import alive, kill, under_way, wait_until

from comparisons.study.declaring.declaration import Study, parse_study
from comparisons.study.running.engines import Engine
from comparisons.study.running.index import index
from comparisons.study.running.local import LocalEngine
from comparisons.study.running.lock import held
from comparisons.study.running.on_dask import DaskEngine
from comparisons.study.running.store import Store
from comparisons.study.running.study_runs import Summary, resume_study, run_study, study_of
from worlds import UserError

DRIVER = """
import resource, sys
from pathlib import Path
from comparisons.study.declaring.declaration import parse_study
from comparisons.study.running.local import LocalEngine
from comparisons.study.running.study_runs import resume_study, run_study
from worlds import UserError

what, out, text, largest = sys.argv[1:]
if largest:
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(largest), int(largest)))
try:
    if what == "run":
        print(run_study(parse_study(text), Path(out), LocalEngine(2)))
    else:
        print(resume_study(Path(out), LocalEngine(2)))
except UserError as error:
    sys.exit(f"told: {error}")
"""


pytestmark = pytest.mark.usefixtures("kind_there")


def declared(seeds: int, levels: str = "{n: [1, 2]}", **settings: Any) -> str:
    """Return the text of a study."""
    return (
        f"study: trial\nquestion: Does it run?\nkind: for-tests\nseeds: {seeds}\nvary: {levels}\n"
        f"settings: {json.dumps(settings)}\n"
    )


def study(seeds: int, levels: str = "{n: [1, 2]}", **settings: Any) -> Study:
    """Return a study."""
    return parse_study(declared(seeds, levels, **settings))


def said(directory: Path) -> dict[str, bytes]:
    """Return what each run's file says, without where it is from, by the file's name."""
    found = {}
    for path in (directory / "runs").glob("*/*.json"):
        content = json.loads(path.read_bytes())
        del content["sha256"], content["provenance"]
        found[path.name] = json.dumps(content).encode()
    return found


def whole(directory: Path, runs: int) -> bool:
    """Return whether a store has so many good runs, and nothing that is half-written."""
    store = Store(directory)
    left = [path for path in directory.rglob(".*") if path.name != ".lock"]
    return (len(store.hashes()), store.damaged(), left) == (runs, (), [])


def drive(what: str, out: Path, text: str, largest: str = "") -> subprocess.Popen[str]:
    """Let another process run or resume a study."""
    return subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", DRIVER, what, str(out), text, largest],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def end(driver: subprocess.Popen[str]) -> None:
    """Kill a driver; its workers may still hold what it printed to, so nobody waits for that."""
    kill(driver.pid)
    driver.wait()
    assert driver.stdout is not None
    assert driver.stderr is not None
    driver.stdout.close()
    driver.stderr.close()


def test_a_study_from_beginning_to_end(tmp_path: Path) -> None:
    """Every run is kept; resumed, there is nothing to do; it does not begin twice."""
    out = tmp_path / "out"
    asked = study(3)
    assert run_study(asked, out, LocalEngine(2)) == Summary(planned=6, done=6, failed=0, skipped=0)
    assert whole(out, 6)
    assert (
        set(Store(out).hashes())
        == {planned.spec.hash for planned in asked.expand()}
        == set(index(Store(out)))
    )
    assert study_of(Store(out)).expand() == asked.expand()
    assert resume_study(out, LocalEngine(2)) == Summary(planned=6, done=0, failed=0, skipped=6)
    with pytest.raises(UserError, match="exists already"):
        run_study(asked, out, LocalEngine(2))
    with pytest.raises(UserError, match="no store of a study"):
        resume_study(tmp_path, LocalEngine(2))


class Shuffled:
    """An engine that is given the runs in another order."""

    def __init__(self, engine: Engine) -> None:
        self.engine, self.name = engine, engine.name

    def __enter__(self) -> Self:
        self.engine.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:  # noqa: PYI036
        self.engine.__exit__(*error)

    def execute(self, jobs: Any, limit: Any, stop: Any) -> Any:
        """Carry out runs in another order."""
        jobs = list(jobs)
        random.Random(3).shuffle(jobs)  # noqa: S311 - an order, no secret
        return self.engine.execute(jobs, limit, stop)


@pytest.mark.slow
def test_results_are_the_same_bytes_on_any_engine(tmp_path: Path) -> None:
    """Whatever the number of workers and the order."""
    (tmp_path / "a.txt").write_text("text\r\nü")
    asked = parse_study(declared(6, text="a.txt"), files={"a.txt": "text\r\nü"})
    engines = {
        "one": LocalEngine(1),
        "three": LocalEngine(3),
        "shuffled": Shuffled(LocalEngine(2)),
        "dask": DaskEngine(workers=2),
    }
    for name, engine in engines.items():
        assert run_study(asked, tmp_path / name, engine).done == 12
    one, *others = (said(tmp_path / name) for name in engines)
    assert len(one) == 12
    assert all(other == one for other in others)


@pytest.mark.slow
def test_failures_are_kept_and_tried_again(tmp_path: Path) -> None:
    """None is dropped; what is no failure any more is none in the store either."""
    out = tmp_path / "out"
    levels = "{task: [draw, raise, die, hang]}"
    summary = run_study(study(1, levels), out, LocalEngine(2), limit=1.5)
    assert summary == Summary(planned=4, done=1, failed=3, skipped=0)
    reasons = {(failure.spec.settings["task"], failure.reason) for failure in Store(out).failures()}
    assert reasons == {("raise", "raised"), ("die", "died"), ("hang", "too long")}
    assert "ZeroDivisionError" in "".join(failure.traceback for failure in Store(out).failures())
    assert resume_study(out, LocalEngine(2), limit=1.5) == Summary(planned=4, done=0, failed=3, skipped=1)
    with pytest.raises(UserError, match="--limit 0: give seconds, more than 0"):
        resume_study(out, LocalEngine(2), limit=0.0)


def test_a_failure_that_is_mended_is_forgotten(tmp_path: Path, marks: Path) -> None:
    """As where a run took too long on a slow machine."""
    out = tmp_path / "out"
    asked = study(1, "{n: [1]}", seconds=0.4, mark=str(marks))
    assert run_study(asked, out, LocalEngine(1), limit=0.1).failed == 1
    assert resume_study(out, LocalEngine(1)) == Summary(planned=1, done=1, failed=0, skipped=0)
    assert Store(out).failures() == ()


def test_damaged_runs_are_done_again(tmp_path: Path) -> None:
    """And come out as they were; the damaged files lie aside, and are named."""
    out = tmp_path / "out"
    run_study(study(3), out, LocalEngine(2))
    before = said(out)
    store = Store(out)
    cut, flipped, _, swapped, other, _ = (store.path(run_hash) for run_hash in store.hashes())
    cut.write_bytes(cut.read_bytes()[:100])
    flipped.write_bytes(flipped.read_bytes().replace(b"0.", b"1.", 1))
    shutil.copy(other, swapped)
    (cut.parent / ".half.json.1.new").write_bytes(b"{")
    summary = resume_study(out, LocalEngine(2))
    assert {damaged.path for damaged in summary.damaged} == {cut, flipped, swapped}
    assert (summary.done, summary.skipped) == (3, 3)
    assert whole(out, 6)
    assert said(out) == before
    assert {path.name for path in (out / "damaged").iterdir()} == {cut.name, flipped.name, swapped.name}


def test_a_store_of_format_1_is_read(tmp_path: Path) -> None:
    """As it was written by the first affordant that had stores; it is not made anew when formats change."""
    out = tmp_path / "out"
    shutil.copytree(Path(__file__).parent / "store_of_format_1", out)
    store = Store(out)
    assert store.files() == {"words/old words.txt": "wörds\n"}
    asked = {planned.spec.hash: planned.spec for planned in study_of(store).expand()}
    one, two = (store.read(run_hash) for run_hash in store.hashes())
    assert (one.spec, two.spec) == (asked[one.spec.hash], asked[two.spec.hash])
    assert (one.spec.seed, one.result.measures) == (1, {"sum": 1.3570107442539157})
    assert list(one.result.curves["drawn"]) == ["i", "a"]
    assert (one.result.details, one.provenance["host"]) == ({"text": "wörds\n"}, "old")
    (failure,) = store.failures()
    assert (failure.reason, failure.message) == ("raised", "ZeroDivisionError: as asked")
    assert [entry.seconds for entry in index(store).values()] == [1.5, 1.5]
    before = said(out)
    assert resume_study(out, LocalEngine(1)) == Summary(planned=4, done=0, failed=2, skipped=2)
    assert said(out) == before


def test_results_that_are_no_longer_asked_for_are_told(tmp_path: Path) -> None:
    """As where a default has changed since; they stay."""
    out = tmp_path / "out"
    run_study(study(3), out, LocalEngine(2))
    (out / "study.yaml").write_text(declared(4, "{n: [2, 3]}"))
    assert resume_study(out, LocalEngine(2)) == Summary(planned=8, done=5, failed=0, skipped=3, others=3)


@pytest.mark.slow
def test_the_driver_killed_and_the_study_resumed(tmp_path: Path, marks: Path) -> None:
    """No worker stays behind, what had ended is kept, and the results are those of an unbroken study."""
    out, text = tmp_path / "out", declared(8, seconds=0.1, mark=str(marks))
    driver = drive("run", out, text)
    wait_until(lambda: len(list(out.glob("runs/*/*.json"))) >= 3, "three runs")
    end(driver)
    pids = {pid for pids in under_way(marks).values() for pid in pids}
    wait_until(lambda: not any(alive(pid) for pid in pids), "the workers' ends")
    kept = len(list(out.glob("runs/*/*.json")))
    assert 3 <= kept < 16
    summary = resume_study(out, LocalEngine(2))
    assert (summary.skipped, summary.done, summary.damaged) == (kept, 16 - kept, ())
    assert whole(out, 16)
    run_study(parse_study(text), tmp_path / "unbroken", LocalEngine(2))
    assert said(out) == said(tmp_path / "unbroken")


def test_runs_that_hang_end_with_a_driver_that_is_killed(tmp_path: Path, marks: Path) -> None:
    """They would burn a core for ever."""
    driver = drive("run", tmp_path / "out", declared(2, "{task: [hang]}", mark=str(marks)))
    wait_until(lambda: len(under_way(marks)) == 2, "two runs")
    end(driver)
    wait_until(lambda: not any(alive(pids[0]) for pids in under_way(marks).values()), "the runs' ends")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_told_to_stop_it_ends_at_once_and_in_order(
    tmp_path: Path, marks: Path, number: signal.Signals
) -> None:
    """What has ended is kept, what is under way is dropped, and the workers end; Ctrl-C goes to all."""
    out = tmp_path / "out"
    text = declared(4, "{seconds: [0, 1000]}", mark=str(marks))
    driver = drive("run", out, text)
    wait_until(lambda: len(list(out.glob("runs/*/*.json"))) == 4, "four runs")
    wait_until(lambda: len(list(marks.iterdir())) == 6, "two that take long")
    if number == signal.SIGINT:
        os.killpg(driver.pid, number)
    else:
        driver.send_signal(number)
    printed, errors = driver.communicate(timeout=30)
    assert printed == f"{Summary(planned=8, done=4, failed=0, skipped=0, stopped=int(number))}\n"
    assert errors == ""
    assert not any(alive(pid) for pids in under_way(marks).values() for pid in pids)
    assert whole(out, 4)


def test_a_study_that_is_run_cannot_be_resumed_meanwhile(tmp_path: Path) -> None:
    """Two drivers would do every run twice."""
    out = tmp_path / "out"
    run_study(study(1), out, LocalEngine(1))
    with held(out), pytest.raises(UserError, match="another affordant runs this study"):
        resume_study(out, LocalEngine(1))


def test_a_file_that_may_not_grow_stops_the_study(tmp_path: Path) -> None:
    """What fits is kept; the message says how much, and how to go on; nothing is half-written."""
    out = tmp_path / "out"
    driver = drive("run", out, declared(2, "{n: [1, 1000]}"), largest="6000")
    _, errors = driver.communicate(timeout=60)
    assert driver.returncode == 1
    kept = len(Store(out).hashes())
    assert f"it cannot be written (File too large); {kept} of 4 runs are kept; make room there" in errors
    assert f"then: affordant study resume {out}" in errors
    assert kept < 4
    assert whole(out, kept)
    assert resume_study(out, LocalEngine(2)).done == 4 - kept
    assert whole(out, 4)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Return the folder of a file system that has room for 200 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if shutil.which("mount") is None or mount("-t", "tmpfs", "-o", "size=200k", "tmpfs", str(folder)):
        pytest.skip("a file system may not be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)  # noqa: S603, S607


def mount(*words: str) -> int:
    """Mount a file system; return the exit status."""
    command = ["mount", *words]
    return subprocess.run(command, check=False, capture_output=True).returncode  # noqa: S603


@pytest.mark.slow
def test_a_full_disk_stops_the_study(small_disk: Path) -> None:
    """Nothing is half-written; with room, it goes on."""
    out = small_disk / "out"
    with pytest.raises(
        UserError, match=r"No space left on device\); \d+ of 60 runs are kept; make room"
    ) as told:
        run_study(study(30, "{n: [100, 200]}"), out, LocalEngine(2))
    kept = len(Store(out).hashes())
    assert f"; {kept} of 60 runs" in str(told.value)
    assert 3 < kept < 60
    assert whole(out, kept)
    with pytest.raises(UserError, match="make room there, then: affordant study resume"):
        resume_study(out, LocalEngine(2))
    kept = len(Store(out).hashes())  # a small one may have found room meanwhile
    assert mount("-o", "remount,size=2m", str(small_disk)) == 0
    assert resume_study(out, LocalEngine(2)) == Summary(planned=60, done=60 - kept, failed=0, skipped=kept)


def test_a_store_that_is_removed_meanwhile(tmp_path: Path) -> None:
    """It holds nothing any more, which is what is told."""
    out = tmp_path / "out"

    def track(items: Any, *, total: int, description: str) -> Iterator[Any]:
        assert (total, description) == (4, "runs")
        for i, item in enumerate(items):
            yield item
            if i == 1:
                shutil.rmtree(out)

    with pytest.raises(UserError, match=r"No such file or directory\); 0 of 4 runs are kept; mend that"):
        run_study(study(2), out, LocalEngine(1), track=track)


def test_a_store_that_cannot_be_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing stays of it."""

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("comparisons.study.running.store._write", full)
    with pytest.raises(UserError, match=r"cannot be written .No space left on device.; name another"):
        run_study(study(1), tmp_path / "out", LocalEngine(1))
    assert not [path for path in tmp_path.iterdir() if "out" in path.name]


@pytest.mark.slow
def test_many_short_runs_do_not_grow_the_driver(tmp_path: Path) -> None:
    """Results are written and forgotten; a quarter of the runs already needs the memory that all do."""
    run_study(study(1), tmp_path / "before", LocalEngine(2))
    sizes = []

    def track(items: Any, *, total: int, description: str) -> Iterator[Any]:
        assert (total, description) == (1000, "runs")
        for i, item in enumerate(items):
            yield item
            if i in {250, 999}:
                sizes.append(int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize())

    asked = study(1000, "{n: [200]}")
    assert run_study(asked, tmp_path / "out", LocalEngine(2), track=track).done == 1000
    assert sizes[1] - sizes[0] < 3e6  # one result is some 10 kB
    assert threading.active_count() < 5
