"""A study run: what is still to do is done, and every run that ends is kept at once."""

from __future__ import annotations

import errno
import shlex
from collections.abc import Collection, Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from comparisons.outputs import Track, refuse_existing, untracked
from comparisons.stopping import Told, told_to_stop
from comparisons.study.declaring.declaration import Study, parse_study
from comparisons.study.running.engines import Engine
from comparisons.study.running.index import index
from comparisons.study.running.lock import held
from comparisons.study.running.store import Damaged, Store
from comparisons.study.running.work import Ran
from comparisons.study.spec import RunSpec
from worlds import UserError

_FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


@dataclass(frozen=True)
class Summary:
    """How running a study ended.

    Parameters
    ----------
    planned
        Runs that the study declares.
    done
        Runs that gave a result this time.
    failed
        Runs that gave none; the store keeps why.
    skipped
        Runs that had a result before.
    damaged
        Files that were found damaged. They lie in the store's folder ``damaged`` now; runs of them are done
        again.
    others
        Results in the store that the study does not ask for: of kinds or defaults that have changed since.
    stopped
        The signal that told it to stop; None if none did.
    """

    planned: int
    done: int
    failed: int
    skipped: int
    damaged: tuple[Damaged, ...] = ()
    others: int = 0
    stopped: int | None = None

    @property
    def left(self) -> int:
        """Runs that have not been tried.

        >>> Summary(planned=10, done=3, failed=1, skipped=2).left
        4
        """
        return self.planned - self.done - self.failed - self.skipped


def run_study(
    study: Study,
    directory: Path,
    engine: Engine,
    *,
    limit: float | None = None,
    track: Track = untracked,
) -> Summary:
    """Run a study from its beginning, into a new store.

    Parameters
    ----------
    study
        What to run.
    directory
        Where the store is to be; there must be nothing yet.
    engine
        What carries out runs; it is entered and left here.
    limit
        Seconds that a run may take.
    track
        Shows progress, as runs end.

    Returns
    -------
    Summary
        Also when it was told to stop, by Ctrl-C or SIGTERM, which takes no longer than saving what has ended.

    Raises
    ------
    UserError
        If the study is wrong, the store cannot be made or written, or the engine has no workers. Whatever had
        ended before is kept.
    """
    _check_limit(limit)
    refuse_existing(directory)
    specs = [planned.spec for planned in study.expand()]
    with told_to_stop() as told, engine:
        store = Store.create(directory, study.text, study.files)
        return _carry_out(store, specs, engine, limit=limit, track=track, told=told)


def resume_study(
    directory: Path,
    engine: Engine,
    *,
    limit: float | None = None,
    track: Track = untracked,
) -> Summary:
    """Go on with a study: do the runs that have no good file, failed ones among them.

    Parameters
    ----------
    directory
        The store.
    engine, limit, track
        See `run_study`.

    Raises
    ------
    UserError
        As of `run_study`, and if there is no store, or a newer affordant has written to it.
    """
    _check_limit(limit)
    store = Store(directory)
    specs = [planned.spec for planned in study_of(store).expand()]
    with told_to_stop() as told, engine:
        return _carry_out(store, specs, engine, limit=limit, track=track, told=told)


def study_of(store: Store) -> Study:
    """Return the study that a store is of, as its file and the files it names were when it began.

    Raises
    ------
    UserError
        If there is none, or this affordant cannot run it.
    """
    return parse_study(store.text(), str(store.study_file), store.files())


def _carry_out(
    store: Store,
    specs: Iterable[RunSpec],
    engine: Engine,
    *,
    limit: float | None,
    track: Track,
    told: Told,
) -> Summary:
    with held(store.directory):
        asked = {spec.hash: spec for spec in specs}
        damaged = _set_aside_damaged(store)
        kept = set(store.hashes())
        todo = [spec for run_hash, spec in asked.items() if run_hash not in kept]
        skipped = len(asked) - len(todo)
        done = failed = 0
        with closing(engine.execute(todo, limit, lambda: bool(told))) as ended:
            for finished in track(ended, total=len(todo), description="runs"):
                try:
                    store.save(finished)
                except OSError as error:
                    raise _unwritable(store, error, asked) from error
                if isinstance(finished.outcome, Ran):
                    done += 1
                else:
                    failed += 1
        index(store)
    others = len(kept - set(asked))
    return Summary(len(asked), done, failed, skipped, damaged, others, told.number)


def _set_aside_damaged(store: Store) -> tuple[Damaged, ...]:
    """Clear a store of what is half-written or damaged; return what was damaged."""
    try:
        store.tidy()
        damaged = store.damaged()
        for one in damaged:
            store.set_aside(one)
    except OSError as error:
        raise _unwritable(store, error) from error
    return damaged


def _unwritable(store: Store, error: OSError, asked: Collection[str] = ()) -> UserError:
    """Return what to say where the store cannot be written: how much is kept, and how to go on."""
    mend = "make room there" if error.errno in _FULL else "mend that"
    kept = len(set(asked).intersection(store.hashes()))  # counted anew: the folder itself may be gone
    told = f"; {kept} of {len(asked)} runs are kept" if asked else ""
    go_on = f"affordant study resume {shlex.quote(str(store.directory))}"
    return UserError(
        f"{store.directory}: it cannot be written ({error.strerror}){told}; {mend}, then: {go_on}"
    )


def _check_limit(limit: float | None) -> None:
    if limit is not None and not 0 < limit < float("inf"):
        raise UserError(f"--limit {limit:g}: give seconds, more than 0")
