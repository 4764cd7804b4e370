"""One run carried out: what a worker does, on whatever engine."""

from __future__ import annotations

import time
import traceback as tracebacks
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, Literal

from comparisons.spread import reason
from comparisons.study.kinds import Kind, Result, kind
from comparisons.study.running.provenance import provenance, utc_now
from comparisons.study.spec import RunSpec, Value, canonical
from worlds import UserError

Reason = Literal["raised", "died", "too long"]
"""Why a run gave no result: it raised an error, its worker died, or it took longer than it may."""
_INFINITE: Final = float("inf")
_LARGEST: Final = 2**63 - 1


@dataclass(frozen=True)
class Ran:
    """How a run ended that gave a result."""

    result: Result
    provenance: Mapping[str, Any] = field(repr=False)


@dataclass(frozen=True)
class Broke:
    """How a run ended that gave none.

    Parameters
    ----------
    reason
        What became of it.
    message
        The same in words.
    traceback
        Of the error that it raised; "" if it raised none.
    provenance
        Where and when that was.
    """

    reason: Reason
    message: str
    traceback: str = field(repr=False)
    provenance: Mapping[str, Any] = field(repr=False)


@dataclass(frozen=True)
class Finished:
    """A run that has ended, one way or the other."""

    spec: RunSpec
    outcome: Ran | Broke


def work(spec: RunSpec, engine: str, scratch: Path | None = None) -> Finished:
    """Carry out a run.

    Parameters
    ----------
    spec
        What to do.
    engine
        Name of the engine that asks for it, for the provenance.
    scratch
        A folder for the texts of the spec's files; the system's folder for temporary files by default.

    Returns
    -------
    Finished
        With the result, or with the error that the run raised. A kind whose result is not plain finite data
        has broken its promise, which is such an error, too.

    Examples
    --------
    >>> broke = work(RunSpec("lern", 1, {}, seed=0), "local").outcome
    >>> broke.reason, broke.message
    ('raised', "lern: there is no such kind of run; did you mean 'learn'?")
    """
    started, wall, cpu = utc_now(), time.perf_counter(), time.process_time()

    def where() -> dict[str, Any]:
        return provenance(
            seed=spec.seed,
            engine=engine,
            started=started,
            wall_seconds=time.perf_counter() - wall,
            cpu_seconds=time.process_time() - cpu,
        )

    try:
        result = _result(spec, scratch)
    except BaseException as error:  # noqa: BLE001 - the store keeps it; the other runs go on
        return Finished(spec, Broke("raised", _said(error), _writable(tracebacks.format_exc()), where()))
    return Finished(spec, Ran(result, where()))


def lost(
    spec: RunSpec, why: Literal["died", "too long"], message: str, engine: str, started: datetime
) -> Finished:
    """Return how a run ended whose worker can no longer say it."""
    seconds = (utc_now() - started).total_seconds()
    told = provenance(seed=spec.seed, engine=engine, started=started, wall_seconds=seconds, cpu_seconds=None)
    return Finished(spec, Broke(why, message, "", told))


def _said(error: BaseException) -> str:
    """Return what went wrong, in words, also where the error has none itself."""
    try:
        return _writable(reason(error))
    except Exception:  # noqa: BLE001 - it is the kind's own
        return f"{type(error).__name__}, whose message raises an error"


def _writable(text: str) -> str:
    """Return a text with what no file can hold spelt out, such as bytes of a name that is no UTF-8."""
    return text.encode(errors="backslashreplace").decode()


def _result(spec: RunSpec, scratch: Path | None) -> Result:
    asked = kind(spec.kind)
    if asked.version != spec.version:
        raise UserError(
            f"{spec.kind}: this affordant carries out version {asked.version} of this kind of run, and "
            f"version {spec.version} is asked for; use the same affordant everywhere"
        )
    named = asked.files(spec.settings)
    if not named:
        # A copy: what the kind does to it must not change what the run is called.
        return checked_result(asked, asked.run(dict(spec.settings), spec.seed))
    with TemporaryDirectory(prefix="affordant-", dir=scratch) as folder:
        result = checked_result(asked, asked.run(_laid(spec, named, Path(folder)), spec.seed))
        if folder in canonical([result.measures, result.curves, result.details]):
            raise _broken_promise(asked, f"the result holds the name of the temporary folder {folder}")
    return result


def _laid(spec: RunSpec, named: Sequence[str], folder: Path) -> dict[str, Value]:
    """Write the texts of files that settings name; return the settings with the paths in their place."""
    settings = dict(spec.settings)
    for i, setting in enumerate(named):
        given = str(settings[setting])
        # Each in a folder of its own: two may have the same name, and a name may mean something to the kind.
        path = folder / str(i) / Path(given).name
        path.parent.mkdir()
        path.write_text(spec.files[given], encoding="utf-8", newline="")
        settings[setting] = str(path)
    return settings


def checked_result(of: Kind, result: Result) -> Result:
    """Return a kind's result as plain data: dicts, lists, text, bool, integers, finite floats and None.

    Raises
    ------
    TypeError
        If that cannot be, a curve's columns differ in length, or there is no such measure: a bug of the kind.

    Examples
    --------
    >>> from comparisons.study.kinds import Measure
    >>> mine = Kind("mine", 1, (Measure("steps", "steps taken"),), dict, lambda _: (), lambda *_: Result({}))
    >>> checked_result(mine, Result({"steps": 3.0}, {"way": {"x": (0, 1), "y": (2, None)}}))
    Result(measures={'steps': 3.0}, curves={'way': {'x': [0, 1], 'y': [2, None]}}, details={})
    >>> checked_result(mine, Result({"steps": float("nan")}))
    Traceback (most recent call last):
        ...
    TypeError: a bug of the kind of run 'mine': measures.steps is nan, which is no finite number
    """
    if not isinstance(result, Result):
        raise _broken_promise(of, f"it returned {type(result).__name__} in place of a Result")
    try:
        measures = _plain(result.measures, "measures")
        curves = _plain(result.curves, "curves")
        details = _plain(result.details, "details")
        for name, value in measures.items():
            of.measure(name)
            _number(value, f"measures.{name}")
        for name, columns in curves.items():
            _check_columns(columns, f"curves.{name}")
    except (TypeError, ValueError) as error:
        raise _broken_promise(of, str(error)) from error
    return Result(measures, curves, details)


def _broken_promise(of: Kind, what: str) -> TypeError:
    return TypeError(f"a bug of the kind of run {of.name!r}: {what}")


def _check_columns(columns: Any, where: str) -> None:
    if not isinstance(columns, dict) or not all(isinstance(column, list) for column in columns.values()):
        raise TypeError(f"{where} is no table of columns by name")
    if len({len(column) for column in columns.values()}) > 1:
        raise TypeError(f"{where} has columns of different lengths")
    for name, column in columns.items():
        for value in column:
            _number(value, f"{where}.{name}")


def _number(value: Any, where: str) -> None:
    if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise TypeError(f"{where} holds {value!r}, which is no number")


def _plain(value: Any, where: str) -> Any:
    """Return a copy of plain data, of Python's own types; floats of numpy are floats."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        value.encode()  # half a surrogate pair cannot be written down
        return str(value)
    if isinstance(value, int | float):
        return _plain_number(value, where)
    if isinstance(value, Mapping):
        for key in value:
            if type(key) is not str:
                raise TypeError(f"{where} has the key {key!r}, which is no text")
            key.encode()
        return {key: _plain(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item, f"{where}[{i}]") for i, item in enumerate(value)]
    raise TypeError(f"{where} is of type {type(value).__name__}, which is no plain data")


def _plain_number(value: float, where: str) -> float:
    if isinstance(value, int):
        if not -_LARGEST <= value <= _LARGEST:
            raise TypeError(f"{where} is an integer of more than 64 bits")
        return int(value)
    if not abs(value) < _INFINITE:
        raise TypeError(f"{where} is {float(value)}, which is no finite number")
    return float(value)
