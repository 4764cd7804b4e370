"""An index of a store: what its runs measured, read without opening a file for each.

It is a cache. An entry counts only while its file's size and time of change are what they were; all else is
read anew from the files. `Store.read` and `Store.damaged` never look at it.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from comparisons.study.running.records import DamagedError, checked_record, record
from comparisons.study.running.store import Store
from worlds import UserError
from worlds.files import replace_file

_INDEX: Final = "index.json"


@dataclass(frozen=True)
class Entry:
    """A run in short: its kind, seed and measures, and the seconds that it took."""

    kind: str
    seed: int
    measures: Mapping[str, float | None]
    seconds: float


def index(store: Store) -> dict[str, Entry]:
    """Return a store's good runs by hash, in order; what the index did not know, it knows from now on.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from comparisons.study.kinds import Result
    >>> from comparisons.study.spec import RunSpec
    >>> from comparisons.study.running.work import Finished, Ran
    >>> spec = RunSpec("learn", 1, {"gamma": 1.0}, seed=3)
    >>> with TemporaryDirectory() as folder:
    ...     store = Store.create(Path(folder, "mine"), "study: mine", {})
    ...     store.save(Finished(spec, Ran(Result({"steps": 1200.0}), {"wall_seconds": 2.0})))
    ...     list(index(store).values())
    [Entry(kind='learn', seed=3, measures={'steps': 1200.0}, seconds=2.0)]
    """
    before = _kept(store)
    now: dict[str, dict[str, Any]] = {}
    for run_hash in store.hashes():
        stamp = _stamp(store.path(run_hash))
        known = before.get(run_hash)
        if known is not None and known["stamp"] == stamp:
            now[run_hash] = known
            continue
        with suppress(DamagedError):
            stored = store.read(run_hash)
            seconds = float(stored.provenance.get("wall_seconds", 0.0))
            entry = Entry(stored.spec.kind, stored.spec.seed, stored.result.measures, seconds)
            now[run_hash] = {"stamp": stamp, **asdict(entry)}
    if now != before:
        with suppress(OSError):  # a full disk, or a store that one may only read: it can be made again
            replace_file(store.directory / _INDEX, record({"runs": now}))
    return {
        run_hash: Entry(known["kind"], known["seed"], known["measures"], known["seconds"])
        for run_hash, known in now.items()
    }


def _kept(store: Store) -> dict[str, dict[str, Any]]:
    """Return what the index's file says; nothing if it is missing, damaged or of another format."""
    path = store.directory / _INDEX
    try:
        runs: dict[str, dict[str, Any]] = checked_record(path.read_bytes(), path)["runs"]
    except (OSError, UserError, KeyError):
        return {}
    return runs


def _stamp(path: Path) -> list[int]:
    stat = path.stat()
    return [stat.st_size, stat.st_mtime_ns, stat.st_ino]
