"""A kind of run for tests of running: it does as its settings say, well or badly.

`installed` makes it one that this process and the workers find as they find those of other packages: by the
entry points of a distribution.
"""

import math
import os
import signal
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from multiprocessing.util import Finalize
from pathlib import Path

from comparisons.study.kinds import Kind, Measure, Result, kind
from comparisons.study.spec import RunSpec, Value
from worlds import Stream, UserError

HERE = Path(__file__).parent
DEFAULTS: Mapping[str, Value] = {"task": "draw", "n": 3, "mark": "", "seconds": 0.0, "text": ""}


def complete(given: Mapping[str, Value]) -> Mapping[str, Value]:
    """Return all settings."""
    for name in given:
        if name not in DEFAULTS:
            raise UserError(f"{name}: there is no such setting")
    return {**DEFAULTS, **given}


def files(settings: Mapping[str, Value]) -> Sequence[str]:
    """Return the settings that name files."""
    return ["text"] if settings["text"] else []


def run(settings: Mapping[str, Value], seed: int) -> Result:
    """Do as the settings say."""
    marks, n = Path(str(settings["mark"])), int(settings["n"])
    if settings["mark"]:  # tell a test that watches that the run is under way, and in which process
        (marks / f"{seed}-{os.getpid()}-{time.monotonic_ns()}").touch()
    time.sleep(float(settings["seconds"]))
    match settings["task"]:
        case "hang":
            time.sleep(1000)
        case "hold":  # something of the system, which is given back by a process that ends by itself
            Finalize(None, (marks / "given back").touch, exitpriority=1)
        case "threads":
            return Result({}, details={"threads": os.environ.get("OMP_NUM_THREADS")})
        case "burn":
            return Result({"sum": math.fsum(math.sin(i + seed) for i in range(n))})
        case "draw":
            drawn = Stream(seed).uniforms(n).tolist()
            text = Path(str(settings["text"])).read_text() if settings["text"] else ""
            return Result(
                {"sum": math.fsum(drawn)}, {"drawn": {"i": list(range(n)), "a": drawn}}, {"text": text}
            )
    return _badly(str(settings["task"]), seed, marks, str(settings["text"]))


def _badly(task: str, seed: int, marks: Path, text: str) -> Result:
    match task:
        case "raise":
            raise ZeroDivisionError("as asked")
        case "exit":
            sys.exit(3)
        case "words":
            raise WordlessError
        case "no bytes":
            raise ValueError("\udcff.maze")
        case "die":
            os.kill(os.getpid(), signal.SIGKILL)
        case "die once":
            first = marks / f"died-{seed}"
            if not first.exists():
                first.touch()
                os.kill(os.getpid(), signal.SIGKILL)
        case "nan":
            return Result({"sum": math.nan})
    return Result({"sum": 0.0}, details={"file": text})


class WordlessError(Exception):
    """An error that cannot be told in words."""

    def __str__(self) -> str:
        raise ValueError


def abort(*_: object) -> None:
    """Be a worker that dies as it starts."""
    os.abort()


KIND = Kind("for-tests", 1, (Measure("sum", "the sum of what was drawn", "", "less"),), complete, files, run)


def spec(seed: int = 0, files: Mapping[str, str] | None = None, **given: Value) -> RunSpec:
    """Return a run of the kind."""
    return RunSpec("for-tests", 1, complete(given), seed, files or {})


@contextmanager
def installed(folder: Path) -> Iterator[dict[str, str]]:
    """Let the kind be found; yield the environment that lets other processes find it."""
    about = folder / "study_kinds-0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: study-kinds\nVersion: 0\n")
    (about / "entry_points.txt").write_text("[affordant.runs]\nfor-tests = study_kinds:KIND\n")
    before, path = os.environ.get("PYTHONPATH"), sys.path.copy()
    paths = [str(folder), str(HERE)]
    sys.path[:0] = paths
    os.environ["PYTHONPATH"] = os.pathsep.join([*paths, *([before] if before else [])])
    kind.cache_clear()
    try:
        yield dict(os.environ)
    finally:
        sys.path[:] = path
        kind.cache_clear()
        if before is None:
            del os.environ["PYTHONPATH"]
        else:
            os.environ["PYTHONPATH"] = before
