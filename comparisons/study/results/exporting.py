"""A study's results as files for other programs: one row a run, and its curves beside, as CSV or Parquet."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any, Final

from comparisons.study.results.rows import Kept, KeptRuns, Levels, Planned
from worlds import UserError
from worlds.files import replace_files

Cell = bool | int | float | str | None
Columns = Mapping[str, Sequence[Cell]]
"""A table: columns of equal length by name."""
_SECONDS: Final = "wall_seconds"  # of the provenance: told once, as `seconds`


def export(planned: Iterable[Planned], store: KeptRuns, path: Path) -> tuple[Path, Path]:
    """Write the results of a study, and their curves beside.

    Parameters
    ----------
    planned
        The study's runs; those without a result are left out.
    store
        Where results are kept.
    path
        A file that ends in ".csv" or ".parquet". Curves go to ``NAME-curves`` with the same ending. Files of
        these names are replaced, each at once.

    Returns
    -------
    tuple
        The two paths.

    Raises
    ------
    UserError
        If the ending is another one, there is no result, a file cannot be written, or pyarrow is missing.
    """
    if path.suffix not in _WRITERS:
        raise UserError(f"{path}: results are exported as .csv or .parquet; end the name in one of them")
    kept = set(store.hashes())
    runs = [(run.levels, store.read(run.spec.hash)) for run in planned if run.spec.hash in kept]
    if not runs:
        raise UserError(f"{path}: there is no result to export; run the study first")
    beside = path.with_name(f"{path.stem}-curves{path.suffix}")
    write = _WRITERS[path.suffix]
    replace_files({beside: write(curve_columns(runs)), path: write(run_columns(runs))})
    return path, beside


def run_columns(runs: Sequence[tuple[Levels, Kept]]) -> Columns:
    """Return a row for each run: its hash, levels, seed, settings, measures, seconds and provenance.

    Names begin with what they are of: ``level.gamma``, ``setting.gamma``, ``measure.steps_to_optimal``,
    ``provenance.libraries.numpy``. What a run does not have is None.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from comparisons.study.kinds import Result
    >>> from comparisons.study.spec import RunSpec
    >>> spec = RunSpec("learn", 1, {"gamma": 1.0}, seed=3)
    >>> kept = SimpleNamespace(spec=spec, result=Result({"steps": 8.0}), provenance={"git": {"dirty": False}})
    >>> for name, cells in run_columns([({"gamma": "1"}, kept)]).items():
    ...     print(name, cells)
    hash ['...']
    level.gamma ['1']
    seed [3]
    setting.gamma [1.0]
    measure.steps [8.0]
    seconds [None]
    provenance.git.dirty [False]
    """
    rows: list[dict[str, Cell]] = []
    for levels, kept in runs:
        told = dict(kept.provenance)
        seconds = told.pop(_SECONDS, None)
        rows.append(
            {
                "hash": kept.spec.hash,
                **_named("level", levels),
                "seed": kept.spec.seed,
                **_named("setting", kept.spec.settings),
                **_named("measure", {name: _float(value) for name, value in kept.result.measures.items()}),
                "seconds": _float(seconds),
                **_named("provenance", flat(told)),
            }
        )
    order = ("hash", "level.", "seed", "setting.", "measure.", "seconds", "provenance.")
    names = list(dict.fromkeys(name for row in rows for name in row))
    # A name that only a later run has would stand last, apart from its like.
    names.sort(key=lambda name: next(i for i, start in enumerate(order) if name.startswith(start)))
    return {name: [row.get(name) for row in rows] for name in names}


def curve_columns(runs: Sequence[tuple[Levels, Kept]]) -> Columns:
    """Return a row for each number of each curve: of which run, curve, row and column of the curve it is.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from comparisons.study.kinds import Result
    >>> from comparisons.study.spec import RunSpec
    >>> result = Result({}, {"learning": {"steps": [10, 20], "optimal": [None, 0.5]}})
    >>> kept = SimpleNamespace(spec=RunSpec("learn", 1, {}, seed=3), result=result, provenance={})
    >>> columns = curve_columns([({"gamma": "1"}, kept)])
    >>> columns["column"], columns["row"], columns["value"]
    (['steps', 'steps', 'optimal', 'optimal'], [0, 1, 0, 1], [10.0, 20.0, None, 0.5])
    """
    factors = list(dict.fromkeys(factor for levels, _ in runs for factor in levels))
    names = ("hash", *(f"level.{factor}" for factor in factors), "seed", "curve", "row", "column", "value")
    found: dict[str, list[Cell]] = {name: [] for name in names}
    for levels, kept in runs:
        told = (kept.spec.hash, *(levels.get(factor) for factor in factors), kept.spec.seed)
        for curve, table in kept.result.curves.items():
            for column, numbers in table.items():
                for row, number in enumerate(numbers):
                    cells = (*told, curve, row, column, _float(number))
                    for name, cell in zip(names, cells, strict=True):
                        found[name].append(cell)
    return found


def csv_bytes(columns: Columns) -> bytes:
    """Return a table as CSV (RFC 4180, in UTF-8): text in quotes, numbers without, nothing for None.

    So an empty text is told from None, and a text that looks like a number from that number. Line breaks in
    texts stay as they are.

    Examples
    --------
    >>> for line in csv_bytes({"name": ['say "b" twice', "", None], "share": [0.1, 2, True]}).splitlines():
    ...     print(line.decode())
    "name","share"
    "say ""b"" twice",0.1
    "",2
    ,true
    """
    lines = [list(columns), *map(list, zip(*columns.values(), strict=True))]
    return "".join(f"{','.join(map(_csv_cell, line))}\r\n" for line in lines).encode()


def parquet_bytes(columns: Columns) -> bytes:
    """Return a table as Parquet: columns of truth values, whole numbers, floats, or else text.

    Raises
    ------
    UserError
        If pyarrow is not installed.
    """
    try:
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as error:
        raise UserError(
            f"Parquet files are written by pyarrow, which is missing ({error}); "
            'pip install "affordant[parquet]", or export as .csv'
        ) from error
    kinds = {bool: arrow.bool_(), int: arrow.int64(), float: arrow.float64(), str: arrow.string()}
    arrays = {}
    for name, cells in columns.items():
        kind = _kind(cells)
        arrays[name] = arrow.array([_as(kind, cell) for cell in cells], kinds[kind])
    file = BytesIO()
    parquet.write_table(arrow.table(arrays), file)
    return file.getvalue()


_WRITERS: Final[Mapping[str, Callable[[Columns], bytes]]] = {".csv": csv_bytes, ".parquet": parquet_bytes}


def _csv_cell(cell: Cell) -> str:
    if cell is None:
        return ""
    if isinstance(cell, str):
        doubled = cell.replace('"', '""')
        return f'"{doubled}"'
    return str(cell).lower() if isinstance(cell, bool) else repr(cell)


def _kind(cells: Sequence[Cell]) -> type[bool | int | float | str]:
    """Return the narrowest type of a column that changes none of its cells."""
    kinds = {type(cell) for cell in cells if cell is not None}
    if kinds == {bool}:
        return bool
    if kinds == {int} and all(cell is None or -(2**63) <= int(cell) < 2**63 for cell in cells):
        return int
    # A whole number beyond 2 ** 53 may be none of the floats.
    if kinds and kinds <= {int, float} and all(cell is None or float(cell) == cell for cell in cells):
        return float
    return str


def _as(kind: type[bool | int | float | str], cell: Cell) -> Cell:
    if cell is None or isinstance(cell, kind):
        return cell
    if kind is float:
        return float(cell)
    return str(cell).lower() if isinstance(cell, bool) else str(cell)


def _named(of: str, values: Mapping[str, Cell]) -> dict[str, Cell]:
    return {f"{of}.{name}": value for name, value in values.items()}


def flat(data: Mapping[str, Any], before: str = "") -> dict[str, Cell]:
    """Return nested data as cells, their names joined by dots; lists become JSON."""
    found: dict[str, Cell] = {}
    for name, value in data.items():
        if isinstance(value, Mapping):
            found.update(flat(value, f"{before}{name}."))
        elif isinstance(value, Cell):
            found[f"{before}{name}"] = value
        else:
            found[f"{before}{name}"] = json.dumps(value, ensure_ascii=False)
    return found


def _float(value: float | None) -> float | None:
    return None if value is None else float(value)
