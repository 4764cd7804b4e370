"""Exported results: read back they are what was kept, whatever text is in them."""

import csv
import sys
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from study_rows import Kept, Planned, Shelf

from comparisons.study.kinds import Result
from comparisons.study.results.exporting import (
    Columns,
    csv_bytes,
    curve_columns,
    export,
    parquet_bytes,
    run_columns,
)
from comparisons.study.spec import RunSpec
from worlds import UserError

texts = st.text(max_size=8) | st.text("\",;\r\n\t'=é\x00", max_size=8)
whole = st.integers(-(2**63), 2**63 - 1)
floats = st.floats(allow_nan=False, allow_infinity=False)
cells = st.none() | st.booleans() | whole | floats | texts
columns_of_cells = st.integers(1, 4).flatmap(
    lambda rows: st.dictionaries(texts, st.lists(cells, min_size=rows, max_size=rows), min_size=1, max_size=4)
)


def read_csv(content: bytes) -> list[list[Any]]:
    """Return the cells of CSV as text; None for what has no quotes and is empty."""
    # What stands in quotes is marked before it is read, for the reader does not tell.
    text = content.decode()
    found: list[list[Any]] = [[]]
    place = 0
    while place < len(text):
        if text[place] == '"':
            end, cell = place + 1, ""
            while text[end] != '"' or text[end + 1] == '"':
                cell += text[end]
                end += 2 if text[end] == '"' else 1
            found[-1].append(("text", cell))
            place = end + 1
        else:
            ends = [text.index(sign, place) for sign in (",", "\r\n") if sign in text[place:]]
            found[-1].append(text[place : min(ends)] or None)
            place = min(ends)
        if text[place] == ",":
            place += 1
        else:
            assert text[place : place + 2] == "\r\n"
            found.append([])
            place += 2
    assert not found.pop()
    return found


def parsed(cell: Any) -> Any:
    """Return what a cell means."""
    if isinstance(cell, tuple):
        return cell[1]
    if cell in ("true", "false"):
        return cell == "true"
    if cell is None:
        return None
    return int(cell) if cell.lstrip("-").isdigit() else float(cell)


@given(columns_of_cells)
def test_csv_reads_back_equal(columns: dict[str, list[Any]]) -> None:
    """Texts, numbers, truth values and nothing are told apart, and come back as they were."""
    head, *lines = read_csv(csv_bytes(columns))
    assert [parsed(cell) for cell in head] == list(columns)
    expected = list(map(list, zip(*columns.values(), strict=True)))
    # A row of one column that holds nothing is an empty line; with any other there is a comma.
    got = [[parsed(cell) for cell in line] or [None] for line in lines]
    assert [[(type(cell), cell) for cell in line] for line in got] == [
        [(type(cell), cell) for cell in line] for line in expected
    ]


@given(columns_of_cells)
def test_pythons_reader_reads_the_csv(columns: dict[str, list[Any]]) -> None:
    """The standard library's reader finds the same texts."""
    found = list(csv.reader(StringIO(csv_bytes(columns).decode(), newline=""), strict=True))
    assert found[0] == list(columns)
    for name, line in zip(columns, zip(*found[1:], strict=True), strict=True) if len(columns) > 1 else ():
        for text, cell in zip(line, columns[name], strict=True):
            if cell is None or isinstance(cell, str):
                assert text == (cell or "")


@given(columns_of_cells)
def test_parquet_reads_back_equal(columns: dict[str, list[Any]]) -> None:
    """A column comes back as it was, or as text if it mixes what does not mix."""
    parquet = pytest.importorskip("pyarrow.parquet")
    found = parquet.read_table(BytesIO(parquet_bytes(columns))).to_pydict()
    assert list(found) == list(columns)
    for name, given_cells in columns.items():
        kinds = {type(cell) for cell in given_cells if cell is not None}
        if len(kinds) <= 1:
            assert found[name] == given_cells
            assert {type(cell) for cell in found[name] if cell is not None} == kinds
        elif kinds == {int, float} and found[name] == given_cells:
            assert all(cell is None or isinstance(cell, float) for cell in found[name])
        else:
            as_text = [None if cell is None else str(cell) for cell in given_cells]
            assert [cell and cell.lower() for cell in found[name]] == [
                cell and cell.lower() for cell in as_text
            ]


def test_parquet_rounds_no_whole_number() -> None:
    """Whole numbers among floats become floats only if these are as exact; or else all become text."""
    parquet = pytest.importorskip("pyarrow.parquet")
    columns: Columns = {"exact": [2**53, 0.5], "not": [2**53 + 1, 0.5], "large": [2**63 + 1, 1]}
    found = parquet.read_table(BytesIO(parquet_bytes(columns))).to_pydict()
    assert found == {
        "exact": [2.0**53, 0.5],
        "not": ["9007199254740993", "0.5"],
        "large": ["9223372036854775809", "1"],
    }


def kept_run(seed: int, **settings: Any) -> Kept:
    """Return a run with its result."""
    result = Result(
        {"steps": 10 * seed, "never": None}, {"learning": {"steps": [1, 2], "optimal": [None, 0.5]}}
    )
    told = {"wall_seconds": 1.5, "git": {"dirty": True}, "hosts": ["a", "b"], "affordant": "0.1.0"}
    return Kept(RunSpec("learn", 1, {"gamma": 1.0, **settings}, seed), result, told)


def plan(*runs: Kept) -> list[Planned]:
    """Return the runs as planned ones."""
    return [Planned(run.spec, {"learner": "maxq-0"}) for run in runs]


def test_a_row_of_a_run() -> None:
    """A run's row holds all that is known of it, each name saying what it is of."""
    first, second = kept_run(1), kept_run(2, alpha="high")
    columns = run_columns([({"learner": "maxq-0"}, first), ({"learner": "maxq-0"}, second)])
    assert dict(columns) == {
        "hash": [first.spec.hash, second.spec.hash],
        "level.learner": ["maxq-0", "maxq-0"],
        "seed": [1, 2],
        "setting.gamma": [1.0, 1.0],
        "setting.alpha": [None, "high"],
        "measure.steps": [10.0, 20.0],
        "measure.never": [None, None],
        "seconds": [1.5, 1.5],
        "provenance.git.dirty": [True, True],
        "provenance.hosts": ['["a", "b"]'] * 2,
        "provenance.affordant": ["0.1.0"] * 2,
    }
    assert list(columns).index("setting.alpha") == 4


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_export_writes_runs_and_curves(tmp_path: Path, suffix: str) -> None:
    """Runs that are kept go into one file in the plan's order, and their curves into one beside."""
    runs = [kept_run(seed) for seed in range(3)]
    path, beside = export(
        plan(*runs), Shelf(runs[2], kept_run(9), runs[0]), tmp_path / "new" / f"all{suffix}"
    )
    assert sorted(each.name for each in path.parent.iterdir()) == [f"all-curves{suffix}", f"all{suffix}"]
    there = [({"learner": "maxq-0"}, runs[i]) for i in (0, 2)]
    for file, columns in ((path, run_columns(there)), (beside, curve_columns(there))):
        assert read_back(file) == {name: list(cells) for name, cells in columns.items()}
    assert read_back(beside)["value"] == [1.0, 2.0, None, 0.5] * 2


def read_back(path: Path) -> Columns:
    """Return the columns of an exported file."""
    if path.suffix == ".csv":
        head, *lines = read_csv(path.read_bytes())
        values = zip(*([parsed(cell) for cell in line] for line in lines), strict=True)
        return {name: list(cells) for (_, name), cells in zip(head, values, strict=True)}
    table = pytest.importorskip("pyarrow.parquet").read_table(path)
    return dict(table.to_pydict())


def test_what_cannot_be_exported_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another ending, no result, a missing library and a wrong place each have their mend."""
    run = kept_run(1)
    with pytest.raises(UserError, match=r"runs.xlsx: results are exported as .csv or .parquet"):
        export(plan(run), Shelf(run), tmp_path / "runs.xlsx")
    with pytest.raises(UserError, match=r"runs.csv: there is no result to export; run the study first"):
        export(plan(run), Shelf(), tmp_path / "runs.csv")
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="it cannot be written"):
        export(plan(run), Shelf(run), tmp_path / "file" / "runs.csv")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(UserError, match=r'pip install "affordant\[parquet\]", or export as .csv'):
        export(plan(run), Shelf(run), tmp_path / "runs.parquet")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
