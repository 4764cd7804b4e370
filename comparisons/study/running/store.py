"""A study's store: a folder with one file for each run, named by the run's hash.

Every file appears whole or not at all, and carries the SHA-256 of what it says. The files are what counts;
``index.json`` only makes reading faster and is made anew from them whenever it is not up to date.

::

    study.yaml                          the study as it was given
    files/                              texts of the files that it names, under their names, with %2F for /
    runs/3f/3f0c...e1.json              results
    failures/9a7b...04.json             runs that gave none, and why
    damaged/                            files that were found damaged, out of the way
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote

from comparisons.outputs import new_directory
from comparisons.study.kinds import Result
from comparisons.study.running.records import DamagedError, read_record, record
from comparisons.study.running.work import Finished, Ran, Reason
from comparisons.study.spec import RunSpec
from worlds import UserError
from worlds.files import UNFINISHED, replace_file

_STUDY: Final = "study.yaml"
_RUNS: Final = "runs"
_FAILURES: Final = "failures"
_DAMAGED: Final = "damaged"


@dataclass(frozen=True)
class Stored:
    """A run that is kept, with its result."""

    spec: RunSpec
    result: Result
    provenance: Mapping[str, Any] = field(repr=False)


@dataclass(frozen=True)
class Failure:
    """A run that gave no result: what became of it, and the traceback of what it raised."""

    spec: RunSpec
    reason: Reason
    message: str
    traceback: str = field(repr=False)
    provenance: Mapping[str, Any] = field(repr=False)


@dataclass(frozen=True)
class Damaged:
    """A file that does not say what was once written to it, and why that is known."""

    path: Path
    problem: str


class Store:
    """The store in a folder.

    Parameters
    ----------
    directory
        The folder; it need not be there before something is read.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from comparisons.study.running.work import Ran
    >>> spec = RunSpec("learn", 1, {"gamma": 1.0}, seed=3)
    >>> with TemporaryDirectory() as folder:
    ...     store = Store.create(Path(folder, "mine"), "study: mine", {})
    ...     store.save(Finished(spec, Ran(Result({"steps": 1200.0}), {"host": "here"})))
    ...     store.hashes() == (spec.hash,), store.read(spec.hash).result.measures
    (True, {'steps': 1200.0})
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    @classmethod
    def create(cls, directory: Path, text: str, files: Mapping[str, str]) -> Store:
        """Begin a store: a new folder with the study's text, and those of files by their names in it.

        Raises
        ------
        UserError
            If there is something already, or it cannot be made.
        """
        try:
            with new_directory(directory) as made:
                _write(made / _STUDY, text)
                for name in (_RUNS, _FAILURES, "files"):
                    (made / name).mkdir()
                for name, content in files.items():
                    _write(made / "files" / _quoted(name), content)
        except OSError as error:
            raise UserError(f"{directory}: it cannot be written ({error.strerror}); name another") from error
        return cls(directory)

    @property
    def study_file(self) -> Path:
        """Where the study is kept as it was given."""
        return self.directory / _STUDY

    def text(self) -> str:
        """Return the study as it was given; raises a `UserError` if there is none."""
        try:
            return _read(self.study_file)
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(
                f"{self.directory}: this is no store of a study: {_STUDY} cannot be read; "
                "name a folder that `affordant study run` has made"
            ) from error

    def files(self) -> dict[str, str]:
        """Return texts of files by the names that the study gives them."""
        folder = self.directory / "files"
        try:
            return {unquote(path.name): _read(path) for path in sorted(folder.glob("*"))}
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(f"{folder}: its files cannot be read ({error}); copy the store anew") from error

    def save(self, finished: Finished) -> None:
        """Keep a run that has ended; a result takes the place of an earlier failure.

        Raises
        ------
        OSError
            If it cannot be written; nothing of it is left then.
        """
        spec, outcome = finished.spec, finished.outcome
        failure = self._failure(spec.hash)
        if isinstance(outcome, Ran):
            result = outcome.result
            content: dict[str, Any] = {
                "spec": spec.as_data(),
                "measures": result.measures,
                "curves": result.curves,
                "details": result.details,
                "provenance": outcome.provenance,
            }
            _place(self.path(spec.hash), record(content))
            failure.unlink(missing_ok=True)
        else:
            content = {
                "spec": spec.as_data(),
                "reason": outcome.reason,
                "message": outcome.message,
                "traceback": outcome.traceback,
                "provenance": outcome.provenance,
            }
            _place(failure, record(content))

    def path(self, run_hash: str) -> Path:
        """Return where a run's result is kept."""
        return self.directory / _RUNS / run_hash[:2] / f"{run_hash}.json"

    def read(self, run_hash: str) -> Stored:
        """Return a run.

        Raises
        ------
        UserError
            If there is none, its file is damaged, or a newer affordant wrote it.
        """
        return _stored(self.path(run_hash))

    def hashes(self) -> tuple[str, ...]:
        """Return the names of all runs that there are files of, in order, good or damaged."""
        return tuple(sorted(path.stem for path in self._run_files() if path == self.path(path.stem)))

    def failures(self) -> tuple[Failure, ...]:
        """Return the runs that gave no result, in the order of their hashes."""
        found = []
        for path in self._failure_files():
            with suppress(DamagedError):  # `damaged` tells of it
                found.append(_failed(path))
        return tuple(found)

    def damaged(self) -> tuple[Damaged, ...]:
        """Return all files that are damaged; every file is read and checked.

        Raises
        ------
        UserError
            If a newer affordant has written to the store.
        """
        found = []
        for path in self._run_files():
            try:
                _stored(path)
            except DamagedError as error:
                found.append(Damaged(path, error.problem))
            else:
                if path != self.path(path.stem):
                    found.append(Damaged(path, f"it belongs into the folder {path.stem[:2]}"))
        for path in self._failure_files():
            try:
                _failed(path)
            except DamagedError as error:
                found.append(Damaged(path, error.problem))
        return tuple(found)

    def set_aside(self, damaged: Damaged) -> Path:
        """Move a damaged file out of the way, to where somebody may look at it; return where."""
        folder = self.directory / _DAMAGED
        folder.mkdir(exist_ok=True)
        taken = {path.name for path in folder.iterdir()}
        names = (f"{damaged.path.name}.{i}" if i else damaged.path.name for i in range(len(taken) + 1))
        return damaged.path.rename(folder / next(name for name in names if name not in taken))

    def tidy(self) -> None:
        """Remove what a driver that was killed left half-done; only for whoever holds the store."""
        for path in self.directory.rglob(UNFINISHED):
            path.unlink(missing_ok=True)
        for path in self._failure_files():
            if self.path(path.stem).exists():  # see `save`
                path.unlink()

    def _run_files(self) -> list[Path]:
        return sorted((self.directory / _RUNS).glob("*/*.json"))

    def _failure_files(self) -> list[Path]:
        return sorted((self.directory / _FAILURES).glob("*.json"))

    def _failure(self, run_hash: str) -> Path:
        return self.directory / _FAILURES / f"{run_hash}.json"


def _stored(path: Path) -> Stored:
    content = read_record(path)
    spec = _spec_of(content, path)
    try:
        result = Result(content["measures"], content["curves"], content["details"])
        return Stored(spec, result, content["provenance"])
    except KeyError as error:
        raise DamagedError(path, f"it has no {error.args[0]}") from error


def _failed(path: Path) -> Failure:
    content = read_record(path)
    spec = _spec_of(content, path)
    try:
        told = (content["reason"], content["message"], content["traceback"], content["provenance"])
        return Failure(spec, *told)
    except KeyError as error:
        raise DamagedError(path, f"it has no {error.args[0]}") from error


def _spec_of(content: Mapping[str, Any], path: Path) -> RunSpec:
    """Return the spec of a file's content, which the file must be named by."""
    try:
        spec = RunSpec.of_data(content["spec"])
        named = spec.hash
    except (KeyError, TypeError, AttributeError) as error:
        raise DamagedError(path, "it has no spec") from error
    if path.stem != named:
        raise DamagedError(path, f"its name should be {named}.json")
    return spec


def _place(path: Path, content: bytes) -> None:
    path.parent.mkdir(exist_ok=True)
    replace_file(path, content)


# As in URLs, but for letters of other scripts: nine characters for one would soon make a name too long.
def _quoted(name: str) -> str:
    return name.replace("%", "%25").replace("/", "%2F")


# The newlines stay as they are: a file's text is part of the hash of runs.
def _read(path: Path) -> str:
    return path.read_bytes().decode("utf-8")


def _write(path: Path, text: str) -> None:
    path.write_bytes(text.encode("utf-8"))
