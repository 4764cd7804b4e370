"""Rows of learning curves in TorchRL's loggers."""

import csv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from torchrl.record import loggers

from comparisons.cli import main
from comparisons.learn import logging_to as module
from comparisons.learn.logging_to import LOGGERS, logging_to, refuse_missing
from comparisons.learn.spec import Spec
from worlds import UserError

COLUMNS = ("steps", "share_optimal", "mean_return")
NAN = float("nan")
SLOWLY = ("--set", "num_envs=16", "horizon=16", "hidden=8", "max_steps=20", "entropy=1", "evaluate=2")
MAZE = "grid\n. . : D1 G1\nT1 . | . .\n. . : D2 .\nstart 0,0\ntrigger T1\ngoal G1\n"


class _Kept:
    """Stands for a logger: keeps what it is given."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self.opened, self.rows, self.told = (arguments, named), [], []
        self.experiment = self._running()

    @contextmanager
    def _running(self) -> Iterator[None]:
        yield
        self.told.append("run ended")

    def log_metrics(self, metrics: dict[str, float], step: int) -> None:
        """Keep a row."""
        self.rows.append((step, metrics))

    def shutdown(self) -> None:
        """Keep that it was closed."""
        self.told.append("closed")


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> list[_Kept]:
    """Let every logger but csv be one that keeps what it is given, as if its package were there."""
    made: list[_Kept] = []

    def get(*arguments: Any, **named: Any) -> _Kept:
        made.append(_Kept(*arguments, **named))
        return made[-1]

    monkeypatch.setattr(module, "find_spec", lambda _: object())
    monkeypatch.setattr(loggers, "get_logger", get)
    monkeypatch.setattr(loggers, "MLFlowLogger", get)
    return made


def _scalars(out: Path) -> dict[str, str]:
    return {file.stem: file.read_text() for file in (out / "log" / "scalars").iterdir()}


def test_each_column_is_a_file_of_the_csv_log(tmp_path: Path) -> None:
    """With step and value a row, all digits of it; what was not measured has none."""
    with logging_to("csv", tmp_path) as log:
        log.add(COLUMNS, (4096.0, 0.1, NAN))
        log.add(COLUMNS, (8192.0, 1 / 3, -7.5))
    assert [path.name for path in (tmp_path / "log").iterdir()] == ["scalars"]
    expected = {"share_optimal": f"4096,0.1\n8192,{1 / 3}\n", "mean_return": "8192,-7.5\n"}
    assert _scalars(tmp_path) == expected


def test_a_log_without_a_row_leaves_nothing(tmp_path: Path) -> None:
    """So that the folder of a run that came to nothing can be taken away."""
    with logging_to("csv", tmp_path):
        assert any(tmp_path.iterdir())
    assert not any(tmp_path.iterdir())


def test_a_csv_log_that_goes_on_has_no_row_twice(tmp_path: Path) -> None:
    """Rows after the checkpoint, which are learnt again, make place; other files stay."""
    rows = [(4096.0, 0.25, -9.0), (8192.0, 0.5, -8.0)]
    with logging_to("csv", tmp_path) as log:
        for row in (*rows, (12288.0, 0.75, -7.0)):
            log.add(COLUMNS, row)
    (tmp_path / "log" / "mine.csv").write_text("mine")
    with logging_to("csv", tmp_path, COLUMNS, rows) as log:
        log.add(COLUMNS, (12288.0, 1.0, -6.0))
    assert _scalars(tmp_path)["share_optimal"] == "4096,0.25\n8192,0.5\n12288,1.0\n"
    assert (tmp_path / "log" / "mine.csv").read_text() == "mine"


def test_a_tensorboard_log_goes_on_in_the_same_folder(tmp_path: Path, kept: list[_Kept]) -> None:
    """Its old event files make place for the rows that are known."""
    old = tmp_path / "log" / "events.out.tfevents.1"
    old.parent.mkdir()
    old.write_text("ahead")
    with logging_to("tensorboard", tmp_path, COLUMNS, [(4096.0, 0.5, NAN)]) as log:
        log.add(COLUMNS, (8192.0, 1.0, -6.0))
        assert not old.exists()
    (one,) = kept
    assert one.opened == (("tensorboard",), {"logger_name": str(tmp_path), "experiment_name": "log"})
    assert one.rows == [
        (4096, {"share_optimal": 0.5}),
        (8192, {"share_optimal": 1.0, "mean_return": -6.0}),
    ]
    assert one.told == ["closed"]


@pytest.mark.parametrize("name", ["wandb", "mlflow"])
def test_a_service_s_run_is_called_as_the_folder_is(name: str, tmp_path: Path, kept: list[_Kept]) -> None:
    """And keeps its files there; the run is ended, also where learning fails."""

    def learns() -> None:
        with logging_to(name, tmp_path / "mine") as log:
            log.add(COLUMNS, (4096.0, 0.5, NAN))
            assert (tmp_path / "mine" / "log").is_dir() == (name == "mlflow")  # its database is there
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        learns()
    (one,) = kept
    arguments, named = one.opened
    folder = tmp_path / "mine" / "log"
    if name == "wandb":
        assert arguments == ("wandb", str(folder), "mine")
        assert named == {"wandb_kwargs": {"project": "affordant"}}
    else:
        assert arguments == ("mine", f"sqlite:///{folder}/mlflow.db")
        assert named == {"artifact_location": f"file://{folder}/artifacts"}
    assert one.rows == [(4096, {"share_optimal": 0.5})]
    assert one.told[-1] == "closed"


def test_an_mlflow_run_ends_with_its_log(tmp_path: Path, kept: list[_Kept]) -> None:
    """TorchRL's logger leaves it open."""
    with logging_to("mlflow", tmp_path):
        assert kept[0].told == []
    assert kept[0].told == ["run ended", "closed"]


def test_a_service_that_does_not_open_is_told_of(
    tmp_path: Path, kept: list[_Kept], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In its own words, and with a way out."""

    def fails(*_arguments: Any, **_named: Any) -> None:
        raise RuntimeError("api_key not configured")

    monkeypatch.setattr(loggers, "get_logger", fails)
    message = r"--logger wandb: it does not open \(api_key not configured\); mend that, or use --logger csv"
    with pytest.raises(UserError, match=message), logging_to("wandb", tmp_path):
        pass
    assert not kept


@pytest.mark.parametrize("name", sorted(set(LOGGERS) - {"csv"}))
def test_a_missing_package_is_named(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the way to install it, and nothing is made."""
    monkeypatch.setattr(module, "find_spec", lambda _: None)
    needed = f"--logger {name}: it needs the package {name}, which is not installed; pip install {name}"
    with pytest.raises(UserError, match=needed), logging_to(name, tmp_path):
        pass
    assert not any(tmp_path.iterdir())


def test_an_unknown_logger_is_refused() -> None:
    """With the nearest name, or all of them; none is no mistake."""
    with pytest.raises(UserError, match="--logger wandbb: there is none; did you mean 'wandb'"):
        refuse_missing("wandbb")
    with pytest.raises(UserError, match="use one of csv, tensorboard, wandb, mlflow"):
        refuse_missing("")
    refuse_missing(None)


def test_without_a_logger_rows_are_let_go(tmp_path: Path) -> None:
    """Nothing is written."""
    with logging_to(None, tmp_path) as log:
        log.add(COLUMNS, (4096.0, 0.5, NAN))
    assert not any(tmp_path.iterdir())


def _learn(*tokens: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(["learn", "two_rooms", "--world", "small.maze", *tokens])
    assert isinstance(ended.value.code, int)
    return ended.value.code


def test_the_command_logs_its_curve(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each number of curve.csv, in full; gone on with, the log is what an unbroken run's is."""
    monkeypatch.chdir(tmp_path)
    Path("small.maze").write_text(MAZE)
    usual = ("--logger", "csv", *SLOWLY, "--steps")
    assert _learn(*usual, "1024", "--out", "broken") == 1
    ahead = Path("broken/log/scalars/share_optimal.csv")
    ahead.write_text(f"{ahead.read_text()}1536,0.5\n")
    assert _learn(*usual, "2560", "--out", "broken", "--resume") == 1
    assert _learn(*usual, "2560", "--out", "whole") == 1
    logged = _scalars(tmp_path / "broken")
    assert logged == _scalars(tmp_path / "whole")
    with Path("whole/curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["steps"]) for row in rows] == [512, 1024, 1536, 2048, 2560]
    for name in set(rows[0]) - {"steps"}:
        known = [(int(row["steps"]), float(row[name])) for row in rows if row[name]]
        found = [tuple(map(float, line.split(","))) for line in logged.get(name, "").splitlines()]
        np.testing.assert_allclose(found, known, rtol=1e-8)
    assert capsys.readouterr().out.count("optimal from") == 3


def test_the_command_refuses_a_logger_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before a folder is made."""
    monkeypatch.chdir(tmp_path)
    assert _learn("--logger", "tensorbord", "--out", "other") == 2
    assert "--logger tensorbord: there is none; did you mean 'tensorboard'?" in capsys.readouterr().err
    assert not Path("other").exists()


def test_the_command_that_goes_on_logs_on(tmp_path: Path) -> None:
    """It names the logger."""
    spec = Spec("taxi", tmp_path, logger="csv")
    assert "--logger csv" in spec.going_on()
