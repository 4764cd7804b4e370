"""One run carried out, in this process: what is told of it, and what a kind may not do."""

import json
import os
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from study_kinds import KIND, spec

from comparisons.study.kinds import Result
from comparisons.study.running.provenance import git_state
from comparisons.study.running.store import Store
from comparisons.study.running.work import Broke, Ran, checked_result, work
from comparisons.study.spec import RunSpec

pytestmark = pytest.mark.usefixtures("kind_there")


def ran(asked: RunSpec, scratch: Path | None = None) -> Ran:
    """Carry out a run that must go well."""
    outcome = work(asked, "local", scratch).outcome
    assert isinstance(outcome, Ran)
    return outcome


def broke(asked: RunSpec) -> Broke:
    """Carry out a run that must not."""
    outcome = work(asked, "local").outcome
    assert isinstance(outcome, Broke)
    assert outcome.reason == "raised"
    return outcome


def test_a_run_has_a_result_and_a_provenance() -> None:
    """The result is the kind's; the provenance says where, when, with what and how long, as plain data."""
    outcome = ran(spec(seed=7, seconds=0.05))
    assert outcome.result == KIND.run(spec(7).settings, 7)
    told: Any = outcome.provenance
    assert json.loads(json.dumps(told)) == told
    assert (told["seed"], told["engine"], told["pid"]) == (7, "local", os.getpid())
    assert told["libraries"]["numpy"] == np.__version__
    assert 0.05 <= told["wall_seconds"] < 5
    assert 0 <= told["cpu_seconds"] < 5
    assert told["started"].endswith("+00:00")


def test_files_are_laid_out_for_the_run_and_taken_away(tmp_path: Path) -> None:
    """A run reads a file's text by a path, wherever the file was; nothing of it stays."""
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    outcome = ran(spec(text="../far/away.txt", files={"../far/away.txt": "one\r\ntwo ü"}), scratch)
    assert outcome.result.details == {"text": "one\ntwo ü"}  # read as text; it was laid byte by byte
    assert list(scratch.iterdir()) == []


def test_an_error_is_told_with_its_traceback() -> None:
    """So that it can be mended without running it again."""
    outcome = broke(spec(task="raise"))
    assert outcome.message == "ZeroDivisionError: as asked"
    assert "study_kinds.py" in outcome.traceback
    assert outcome.provenance["wall_seconds"] >= 0


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ("words", "WordlessError, whose message raises an error"),
        ("no bytes", r"ValueError: \udcff.maze"),
        ("exit", "SystemExit: 3"),
    ],
)
def test_an_error_of_any_kind_can_be_kept(tmp_path: Path, task: str, message: str) -> None:
    """One run's error is its own failure, and never the driver's end."""
    finished = work(spec(task=task), "local")
    Store.create(tmp_path / "store", "study: s", {}).save(finished)
    (failure,) = Store(tmp_path / "store").failures()
    assert (failure.reason, failure.message) == ("raised", message)
    assert "study_kinds.py" in failure.traceback


def test_a_kind_that_changes_its_settings_changes_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """The result would be kept as that of another run."""

    def changing(settings: Any, _: int) -> Result:
        settings["n"] = 99
        return Result({})

    monkeypatch.setattr("comparisons.study.running.work.kind", lambda _: replace(KIND, run=changing))
    asked = spec(n=3)
    assert work(asked, "local").spec.hash == asked.hash == spec(n=3).hash


def test_a_path_in_a_result_is_a_bug() -> None:
    """It would be another one on every machine."""
    assert "temporary folder" in broke(spec(task="path", text="a", files={"a": ""})).message


def test_another_version_of_the_kind_is_refused() -> None:
    """Its results would count as those that were asked for."""
    asked = spec()
    message = broke(RunSpec(asked.kind, 2, asked.settings, 0)).message
    assert "carries out version 1 of this kind of run, and version 2 is asked for" in message


@pytest.mark.parametrize(
    ("result", "problem"),
    [
        (None, "it returned NoneType"),
        (Result({"sum": float("inf")}), "measures.sum is inf, which is no finite number"),
        (Result({"sum": np.int64(3)}), "measures.sum is of type int64"),
        (Result({"sum": 10**5000}), "measures.sum is an integer of more than 64 bits"),
        (Result({}, {}, {"at": [-(2**64)]}), "details.at[0] is an integer of more than 64 bits"),
        (Result({}, {}, {"\ud800": 1}), "surrogates not allowed"),
        (Result({"sum": True}), "measures.sum holds True, which is no number"),
        (Result({"sum": "3"}), "measures.sum holds '3', which is no number"),
        (Result({"some": 1.0}), "measure no such thing; use one of sum"),
        (Result({}, {"way": {"x": [1, 2], "y": [1]}}), "curves.way has columns of different lengths"),
        (Result({}, {"way": [1, 2]}), "curves.way is no table"),
        (Result({}, {"way": {"x": [1, "2"]}}), "curves.way.x holds '2'"),
        (Result({}, {}, {"at": {1: 2}}), "details.at has the key 1"),
        (Result({}, {}, {"at": [{"x": {3}}]}), "details.at[0].x is of type set"),
        (Result({}, {}, {"at": "\ud800"}), "surrogates not allowed"),
    ],
)
def test_a_result_that_is_not_plain_is_a_bug_of_the_kind(result: Any, problem: str) -> None:
    """It is told as one, with where it stands."""
    with pytest.raises(TypeError, match=r"a bug of the kind of run 'for-tests'") as told:
        checked_result(KIND, result)
    assert problem in str(told.value)


def test_numbers_of_numpy_become_plain() -> None:
    """Its floats are floats; tuples are lists, as JSON would give them back."""
    checked = checked_result(KIND, Result({"sum": np.float64(0.5)}, {}, {"at": (1, (2, None))}))
    assert type(checked.measures["sum"]) is float
    assert checked.details == {"at": [1, [2, None]]}


def test_the_state_of_a_checkout(tmp_path: Path) -> None:
    """Its commit, and whether files of it were changed; a folder inside is none."""
    assert git_state(tmp_path) is None

    def git(*words: str) -> None:
        who = ("-c", "user.name=a", "-c", "user.email=a@example.org")
        subprocess.run(["git", "-C", str(tmp_path), *who, *words], check=True)  # noqa: S603, S607

    git("init", "--quiet")
    assert git_state(tmp_path) is None  # it has no commit yet
    (tmp_path / "file").write_text("1")
    git("add", "file")
    git("commit", "--quiet", "-m", "one")
    state = git_state(tmp_path)
    assert state is not None
    assert (len(state["commit"]), state["dirty"]) == (40, False)
    (tmp_path / "file").write_text("2")
    assert git_state(tmp_path) == {**state, "dirty": True}
    (tmp_path / "inside").mkdir()
    assert git_state(tmp_path / "inside") is None
