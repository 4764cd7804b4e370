"""`affordant study`, run as a user runs it: what it prints, what it leaves, and how it ends."""

import csv
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from comparisons.cli import main
from comparisons.study.declaring.declaration import parse_study

TEXT = """\
study: sums
question: Does a longer sum come out larger?
kind: for-tests
seeds: 6
vary: {n: [3, 30]}
answer: {measure: sum, compare: n, against: 3}
"""
FAILING = """\
study: badly
question: What becomes of a run that fails?
kind: for-tests
seeds: 1
vary: {task: [draw, raise]}
"""


@pytest.fixture(autouse=True)
def an_empty_folder(kind_there: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: ARG001
    """Work in an empty folder, with the tests' kind there."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")


def affordant(capsys: pytest.CaptureFixture[str], *tokens: str) -> tuple[object, str, str]:
    """Run a command; return its exit status and what it printed."""
    with pytest.raises(SystemExit) as ended:
        main(["study", *tokens])
    return ended.value.code, *capsys.readouterr()


def there() -> list[str]:
    """Return what lies in the folder."""
    return sorted(path.name for path in Path().iterdir())


def write(text: str, name: str = "mine.yaml") -> str:
    """Write a study file; return its name."""
    Path(name).write_text(text)
    return name


def test_a_study_from_its_file_to_its_report(capsys: pytest.CaptureFixture[str]) -> None:
    """Check, run, status, report, export and diff agree about one study, and end with status 0."""
    file = write(TEXT)
    code, out, _ = affordant(capsys, "check", file)
    assert code == 0
    assert "12 runs of kind for-tests: 2 combinations with 6 seeds" in out
    assert there() == ["mine.yaml"]
    code, out, _ = affordant(capsys, "run", file, "--out", "store", "--workers", "1")
    assert code == 0
    assert out.splitlines() == ["12 of 12 runs have a result", "report: affordant study report store"]
    code, out, _ = affordant(capsys, "status", "store")
    assert code == 0
    assert [line.split() for line in out.splitlines()[2:]] == [
        ["n", "done", "failed", "damaged", "to", "do"],
        ["3", "6", "0", "0", "0"],
        ["30", "6", "0", "0", "0"],
        ["all", "12", "0", "0", "0"],
    ]
    code, out, _ = affordant(capsys, "report", "store")
    assert (code, out) == (0, "store/report/report.html\n")
    assert "p = " in Path("store/report/report.html").read_text()
    code, out, _ = affordant(capsys, "export", "store", "--out", "runs.csv")
    assert code == 0
    with Path("runs.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert len(rows) == 12
    assert {row["level.n"] for row in rows} == {"3", "30"}
    code, out, _ = affordant(capsys, "diff", "store", "store")
    assert code == 0
    assert "12 runs have the same results" in out


def test_a_first_look_goes_on_with_the_other_seeds(capsys: pytest.CaptureFixture[str]) -> None:
    """--quick runs two seeds of each combination; status counts the rest, and resume does it."""
    code, out, _ = affordant(capsys, "run", write(TEXT), "--out", "a b", "--quick", "--workers", "1")
    assert code == 0
    assert "4 of 4 runs have a result" in out
    assert "affordant study resume 'a b'" in out
    code, out, _ = affordant(capsys, "status", "a b")
    assert code == 1
    assert ["all", "4", "0", "0", "8"] in [line.split() for line in out.splitlines()]
    code, out, _ = affordant(capsys, "resume", "a b", "--workers", "1")
    assert code == 0
    assert "12 of 12 runs have a result" in out


def test_failures_end_with_status_one_and_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    """A run that fails makes run, status, resume and report end with 1; status tells why, the report, too."""
    code, out, _ = affordant(capsys, "run", write(FAILING), "--out", "store", "--workers", "1")
    assert code == 1
    assert out.startswith("1 of 2 runs have a result, 1 failed\n")
    assert "to try again: affordant study resume store" in out
    code, out, _ = affordant(capsys, "status", "store")
    assert code == 1
    assert "failed: task raise, seed 0: ZeroDivisionError: as asked (failures/" in out
    code, out, _ = affordant(capsys, "report", "store")
    assert code == 1
    page = Path("store/report/report.html").read_text()
    assert "1 of 2 runs failed" in page
    assert "ZeroDivisionError: as asked" in page
    code, out, _ = affordant(capsys, "resume", "store", "--workers", "1")
    assert code == 1
    assert out.startswith("1 of 2 runs have a result, 1 failed\n")


def test_an_export_of_a_part_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    """Runs without a result have no row, and the exit status tells it."""
    affordant(capsys, "run", write(FAILING), "--out", "store", "--workers", "1")
    code, out, err = affordant(capsys, "export", "store", "--out", "runs.csv")
    assert (code, out.splitlines()) == (1, ["runs.csv", "runs-curves.csv"])
    assert err == "1 of 2 runs have no result, and no row\n"
    with Path("runs.csv").open() as table:
        assert [row["level.task"] for row in csv.DictReader(table)] == ["draw"]


def test_results_that_a_study_asks_for_no_more_are_explained(capsys: pytest.CaptureFixture[str]) -> None:
    """Its file in the store may be changed: runs that stay are kept, and of others it is told why."""
    affordant(capsys, "run", write(TEXT), "--out", "store", "--quick", "--workers", "1")
    Path("store/study.yaml").write_text(TEXT.replace("30", "31"))
    _, out, _ = affordant(capsys, "status", "store")
    assert ["all", "2", "0", "0", "10"] in [line.split() for line in out.splitlines()]
    assert re.search(
        r"\n2 results are of no run of this study any more: \w{32} differs .* n \(30, now 3", out
    )
    code, out, _ = affordant(capsys, "resume", "store", "--workers", "1")
    assert code == 0
    assert "2 results in the store are of no run of this study any more: affordant study status store" in out


@pytest.mark.parametrize(
    "command", ["run", "resume", "status", "report", "export", "diff", "check", "schema"]
)
def test_a_command_s_help_explains_all_that_it_takes(
    capsys: pytest.CaptureFixture[str], command: str
) -> None:
    """Each argument and option has words of its own beside its form."""
    code, out, _ = affordant(capsys, command, "--help")
    assert code == 0
    taken = re.findall(r"^│ (?:\*  )? *(--[a-z-]+|[A-Z]+)\b(.*)│$", out, flags=re.MULTILINE)
    assert len(taken) >= (command != "schema")
    for name, words in taken:
        assert re.search(r" {2}[A-Z][a-z]* [a-z]", words), name


def test_results_that_differ_end_with_status_one(capsys: pytest.CaptureFixture[str]) -> None:
    """Stores of other seeds or other numbers are told apart run by run."""
    affordant(capsys, "run", write(TEXT), "--out", "one", "--quick", "--workers", "1")
    affordant(capsys, "run", write(TEXT.replace("seeds: 6", "seeds: 1")), "--out", "two", "--workers", "1")
    code, out, _ = affordant(capsys, "diff", "one", "two")
    assert code == 1
    assert "2 runs have the same results in one and in two" in out


@pytest.mark.parametrize(
    ("tokens", "expected"),
    [
        (("check", "none.yaml"), "there is no such file"),
        (("check", "wrong.yaml"), "did you mean 'sum'?"),
        (("check", "figures.yaml"), "did you mean 'learning'?"),
        (("run", "mine.yaml", "--out", "here"), "it exists already"),
        (("run", "figures.yaml", "--out", "new"), "did you mean 'learning'?"),
        (("run", "mine.yaml", "--out", "new", "--scheduler", "tcp://x:1"), "add --engine dask"),
        (("run", "mine.yaml", "--out", "new", "--workers", "0"), "--workers 0: give at least 1"),
        (("run", "mine.yaml", "--out", "new", "--limit", "-1"), "--limit -1: give seconds"),
        (("run", "mine.yaml", "--out", "new", "--engine", "desk"), "dask"),
        (("status", "here"), "no store of a study"),
        (("resume", "here"), "no store of a study"),
        (("report", "nowhere"), "no store of a study"),
        (("export", "here", "--out", "x.csv"), "no store of a study"),
        (("diff", "here", "here"), "no store of a study"),
        (("reprot", "here"), 'Did you mean "report"'),
    ],
)
def test_a_users_mistake_is_one_message(
    capsys: pytest.CaptureFixture[str], tokens: tuple[str, ...], expected: str
) -> None:
    """Whatever cannot be done ends with status 2, says how to mend it, and leaves nothing behind."""
    write(TEXT)
    write(TEXT.replace("measure: sum", "measure: summ"), "wrong.yaml")
    write(TEXT + "figures: [learnin]\n", "figures.yaml")
    Path("here").mkdir()
    before = there()
    code, out, err = affordant(capsys, *tokens)
    assert code == 2
    assert out == ""
    assert err.startswith("affordant: ")
    assert expected in err
    assert "Traceback" not in err
    assert there() == before


def test_the_schema_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    """What is printed is the JSON Schema of study files."""
    code, out, _ = affordant(capsys, "schema")
    assert code == 0
    assert {"study", "question", "kind", "seeds"} <= set(json.loads(out)["required"])


def test_the_readmes_study_is_changed_in_two_lines() -> None:
    """The README's study, and the same with its last two lines changed as it says, can be run."""
    readme = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")
    text, change = re.findall(r"```yaml\n(.*?)```", readme, flags=re.DOTALL)
    kept = text.splitlines()[: -len(change.splitlines())]
    assert len(change.splitlines()) == 2
    for shown, factor in ((text, "gamma"), ("\n".join([*kept, change]), "exploration_half")):
        study = parse_study(shown)
        assert [each.name for each in study.factors] == [factor]
        assert study.runs == 30


@pytest.mark.slow
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_study_that_is_stopped_says_how_to_go_on(
    capsys: pytest.CaptureFixture[str], number: signal.Signals, status: int
) -> None:
    """A signal ends it in order, with what has ended kept; the command that it tells does the rest."""
    file = write(TEXT.replace("seeds: 6", "seeds: 20") + "settings: {seconds: 0.2}\n")
    program = "import sys; from comparisons.cli import main; main(sys.argv[1:])"
    words = [sys.executable, "-c", program, "study", "run", file, "--out", "store", "--workers", "1"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as command:  # noqa: S603
        while not list(Path().glob("store/runs/*/*.json")):
            assert command.poll() is None
        command.send_signal(number)
        _, err = command.communicate(timeout=60)
    assert command.returncode == status
    assert "to go on: affordant study resume store" in err
    assert "Traceback" not in err
    kept = len(list(Path().glob("store/runs/*/*.json")))
    assert 0 < kept < 40
    code, out, _ = affordant(capsys, "status", "store")
    assert code == 1
    assert ["all", str(kept), "0", "0", str(40 - kept)] in [line.split() for line in out.splitlines()]
