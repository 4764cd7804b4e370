"""Reports of studies: what they say, in which order, and that nothing in a study becomes markup."""

import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from html_reader import Reader

from comparisons.study.declaring.declaration import Planned, Study, parse_study
from comparisons.study.kinds import Result
from comparisons.study.report import PAGE, report_study
from comparisons.study.running.store import Store
from comparisons.study.running.work import Broke, Finished, Ran
from worlds import UserError

EVIL = "<script>alert('&')</script>"
TEXT = f"""\
study: "gamma {EVIL}"
title: "Title {EVIL}"
question: "Does it slow <b>MAXQ-0</b> down?"
kind: learn
seeds: 6
settings: {{graph: two_rooms, learner: maxq-0}}
vary:
  discount:
    "1": {{gamma: 1}}
    "<img src=x onerror=alert(1)>": {{gamma: 0.9}}
answer: {{measure: steps_to_optimal, compare: discount, against: 1}}
"""


def provenance(**other: Any) -> Mapping[str, Any]:
    """Return where a result is from."""
    told = {"affordant": "0.1.0", "git": {"commit": "c0ffee", "dirty": False}, "python": "3.11.9"}
    told |= {"libraries": {"numpy": "2.4.6", "torch": None}, "platform": "here", "host": "alpha"}
    told |= {"engine": "local", "started": "2026-01-02T03:04:05.000+00:00"}
    return {**told, "cpu_seconds": 2.0, "wall_seconds": 2.5, **other}


def ran(run: Planned, **where: Any) -> Finished:
    """Return a made-up result of a run."""
    steps = (1000.0 + run.spec.seed) * (1.0 if run.levels["discount"] == "1" else 1.5)
    curve = {"steps": [0.0, steps], "share_optimal": [0.0, 1.0]}
    return Finished(
        run.spec, Ran(Result({"steps_to_optimal": steps}, {"learning": curve}), provenance(**where))
    )


def begun(folder: Path, text: str = TEXT) -> tuple[Study, Store]:
    """Return a study, and its store without any run."""
    study = parse_study(text)
    return study, Store.create(folder / "gamma", study.text, study.files)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the store of a study that has been run, with its report."""
    study, store = begun(tmp_path_factory.mktemp("whole"))
    for i, run in enumerate(study.expand()):
        store.save(ran(run, host=f"host-{i % 2}"))
    report_study(store.directory)
    return store.directory


@pytest.fixture(scope="module")
def page(made: Path) -> str:
    """Return its page."""
    return (made / "report" / PAGE).read_text()


def test_the_page_needs_nothing_but_itself(page: str) -> None:
    """The page is well-formed, its ids are unique, and every link stays inside of it."""
    read = Reader(page)
    assert read.open == []
    assert len(read.ids) == len(set(read.ids))
    for link in read.links:
        assert link.startswith(("#", "data:"))
        assert not link.startswith("#") or link[1:] in read.ids
    assert not re.search(r'(?:src|href)="(?!#|data:)', page)
    assert "url(http" not in page


def test_nothing_in_a_study_becomes_markup(page: str) -> None:
    """Title, name, question, levels and the file itself are shown as they are."""
    read = Reader(page)
    assert EVIL not in page
    assert f"Title {EVIL}" in read.texts
    assert "<img src=x" not in page
    assert "<b>MAXQ-0" not in page
    assert "Does it slow <b>MAXQ-0</b> down?" in read.texts


def test_the_answer_comes_first_and_says_what_it_rests_on(page: str) -> None:
    """The first sentences are the question and its answer, with ratio, interval, seeds and p."""
    texts = Reader(page).texts
    answer = texts[texts.index("Does it slow <b>MAXQ-0</b> down?") + 1]
    assert "needs 1.50 times (95 % 1.50 to 1.50)" in answer
    assert "6 seeds" in answer
    assert "p = 0.03" in answer
    assert page.index("needs 1.50 times") < page.index("What was run</h2>") < page.index("Results</h2>")


def test_every_figure_lies_beside_the_page_with_its_numbers(made: Path, page: str) -> None:
    """Each figure is there as SVG, PDF, PNG and CSV; the page shows it with caption, numbers and command."""
    folder = made / "report" / "figures"
    names = {path.stem for path in folder.iterdir()}
    assert {"estimates", "learning", "efficiency", "improvement"} <= names
    for name in names:
        assert {path.suffix for path in folder.glob(f"{name}.*")} == {".svg", ".pdf", ".png", ".csv"}
        assert f'id="figure-{name}"' in page
    assert page.count("<figcaption>") == len(names)
    assert page.count("<code>affordant study report gamma</code>") == len(names)
    assert (folder / "estimates.csv").read_text().splitlines()[1].split(",")[-4:] == [
        *("1002.5", "1000.25", "1004.75", "6"),
    ]


def test_tables_are_there_for_a_paper(made: Path, page: str) -> None:
    """Results and comparisons are written as Markdown and LaTeX, and shown in the page."""
    folder = made / "report" / "tables"
    assert sorted(path.name for path in folder.iterdir()) == [
        *("comparisons.md", "comparisons.tex", "results.md", "results.tex"),
    ]
    assert "steps to optimal" in (folder / "results.md").read_text()
    assert "\\begin{tabular}" in (folder / "results.tex").read_text()
    assert "<script>" not in (folder / "results.md").read_text()
    assert "What was measured." in page


def test_provenance_is_counted(page: str) -> None:
    """Versions, hosts and CPU time stand there, with the number of runs from each host."""
    read = Reader(page)
    for host in ("host-0", "host-1"):
        assert read.texts[read.texts.index(host) + 1] == "6"
    assert "c0ffee" in read.texts
    assert any("24 s of CPU time" in text for text in read.texts)
    assert any("2026-01-02 03:04" in text for text in read.texts)


def test_the_page_holds_the_study_to_change(page: str) -> None:
    """The study file stands at the end as it was given, with the commands that run it anew."""
    shown = "".join(Reader(page).texts[-3:])
    assert " ".join(TEXT.split()) in shown
    assert "affordant study diff gamma mine" in page


def test_the_same_store_gives_the_same_report(made: Path, tmp_path: Path) -> None:
    """Two reports of one store are equal file by file; the one in the store is made anew."""
    (made / "report" / "old.txt").write_text("old")
    report_study(made)
    assert not (made / "report" / "old.txt").exists()
    report_study(made, tmp_path / "other")
    one, other = (
        {path.relative_to(root): path.read_bytes() for path in root.rglob("*") if path.is_file()}
        for root in (made / "report", tmp_path / "other")
    )
    assert one == other
    assert not list(made.glob(".report*"))


def test_an_existing_out_is_refused(made: Path, tmp_path: Path) -> None:
    """A directory that is there is never written to."""
    with pytest.raises(UserError, match="it exists already"):
        report_study(made, tmp_path)


def test_what_is_no_store_is_refused(tmp_path: Path) -> None:
    """A folder without a study is told so."""
    with pytest.raises(UserError, match="no store of a study"):
        report_study(tmp_path)


def test_failures_damage_and_what_is_left_are_told_first(tmp_path: Path) -> None:
    """Failed runs are listed with message and traceback, damaged files and runs to do are counted."""
    study, store = begun(tmp_path)
    planned = study.expand()
    for run in planned[:8]:
        store.save(ran(run, affordant="0.1.0" if run.spec.seed else "0.2.0"))
    broke = Broke("raised", f"went wrong {EVIL}", f"Traceback: {EVIL}", provenance())
    store.save(Finished(planned[8].spec, broke))
    damaged = store.path(planned[0].spec.hash)
    damaged.write_text(damaged.read_text().replace("1000", "2000"))
    path, whole = report_study(store.directory)
    text = path.read_text()
    read = Reader(text)
    assert not whole
    assert EVIL not in text
    told = " ".join(read.texts)
    assert "1 of 12 runs failed" in told
    assert f"went wrong {EVIL}" in told
    assert f"Traceback: {EVIL}" in told
    assert "1 file damaged" in told
    assert damaged.name in told
    assert "4 of 12 runs are still to do: affordant study resume gamma." in told
    assert "Runs differ in what they were made with (affordant)" in told
    assert text.index("runs failed") < text.index("What was run</h2>")


def test_a_study_without_a_result_has_a_report(tmp_path: Path) -> None:
    """Nothing is drawn or compared where there is nothing, and the page says so."""
    _, store = begun(tmp_path)
    path, whole = report_study(store.directory)
    told = " ".join(Reader(path.read_text()).texts)
    assert not whole
    assert "no run has a result" in told
    assert "There is nothing to draw yet" in told


def test_one_seed_is_not_ranked(tmp_path: Path) -> None:
    """A study of one seed shows its numbers, and says that they rank nothing."""
    study, store = begun(tmp_path, TEXT.replace("seeds: 6", "seeds: 1"))
    for run in study.expand():
        store.save(ran(run))
    path, whole = report_study(store.directory)
    told = " ".join(Reader(path.read_text()).texts)
    assert whole
    assert "With 1 seed nothing is ranked" in told
    assert "Not ranked" in told
    assert not (path.parent / "figures" / "improvement.svg").exists()


def test_many_comparisons_are_summed_up_and_folded_away(tmp_path: Path) -> None:
    """What sums them up is read first; each of them is there to unfold."""
    text = TEXT.replace("vary:\n", "vary:\n  tie: [0.01, 0.02, 0.03, 0.04]\n").replace(
        "against: 1}", "against: 1, within: [tie]}"
    )
    study, store = begun(tmp_path, text)
    for run in study.expand():
        store.save(ran(run))
    path, _ = report_study(store.directory)
    page = path.read_text()
    folded = page.index("4 comparisons, one by one")
    assert (
        page.index("None of 4 comparisons with discount 1") < folded < page.index("Tie 0.01: no difference")
    )
    assert page.index("Tie 0.04: no difference") < page.index("</details>", folded)


def test_a_study_without_answer_shows_its_table(tmp_path: Path) -> None:
    """Without an answer in the file there is a table of results and no comparison."""
    text = "\n".join(line for line in TEXT.splitlines() if not line.startswith("answer"))
    study, store = begun(tmp_path, text + "\nfigures: [estimates, reliability]\n")
    for run in study.expand():
        store.save(ran(run))
    path, _ = report_study(store.directory)
    told = " ".join(Reader(path.read_text()).texts)
    assert "declares no answer" in told
    assert [each.name for each in sorted((path.parent / "tables").iterdir())] == ["results.md", "results.tex"]
    assert {each.stem for each in (path.parent / "figures").iterdir()} == {"estimates"}
    assert "asks for figures that these runs have nothing for: reliability" in told


def test_unfinished_combinations_are_listed_alone(tmp_path: Path) -> None:
    """Only combinations that lack results are listed as such, with what became of their runs."""
    study, store = begun(tmp_path)
    planned = study.expand()
    for run in planned:
        if run.levels["discount"] == "1" or run.spec.seed < 4:
            store.save(ran(run))
    path, _ = report_study(store.directory)
    texts = Reader(path.read_text()).texts
    at = texts.index("Table 2. Combinations of which not every run has a result.")
    heads = texts[at + 1 : at + 6]
    assert heads == ["discount", "done", "failed", "damaged", "to do"]
    assert texts[at + 6 : at + 11] == ["<img src=x onerror=alert(1)>", "4", "0", "0", "2"]


def test_a_letter_that_figures_lack_is_told_once(tmp_path: Path) -> None:
    """Labels may hold any letters: what the figures' font has not is named, and nothing else is said."""
    study, store = begun(tmp_path, TEXT.replace("<img src=x onerror=alert(1)>", "\u5b66 \u03b3"))
    for run in study.expand():
        store.save(ran(run))
    path, _ = report_study(store.directory)
    told = " ".join(Reader(path.read_text()).texts)
    assert "boxes where labels hold letters that their font has not: \u5b66." in told


def test_the_command_names_the_folder(made: Path, page: str, tmp_path: Path) -> None:
    """However the store is written, the command has its name, and the page tells where to paste it."""
    report_study(made / "runs" / "..", tmp_path / "other")
    assert (tmp_path / "other" / PAGE).read_text() == page
    assert "in the folder that holds gamma." in " ".join(Reader(page).texts)


@pytest.mark.slow
def test_neither_place_nor_settings_of_the_user_show(made: Path, tmp_path: Path) -> None:
    """Another time zone, another locale and other settings of matplotlib give the same bytes."""
    (tmp_path / "matplotlibrc").write_text("lines.linewidth: 9\nfont.size: 30\naxes.facecolor: black\n")
    strange = {
        "MATPLOTLIBRC": str(tmp_path),
        "TZ": "Pacific/Kiritimati",
        "LC_ALL": "C",
        "PYTHONHASHSEED": "7",
    }
    out = tmp_path / "out"
    code = "import sys; from comparisons.cli import main; sys.argv[0] = 'affordant'; main()"
    command = [sys.executable, "-c", code, "study", "report", str(made), "--out", str(out)]
    subprocess.run(command, check=True, env={**os.environ, **strange}, capture_output=True)  # noqa: S603
    report_study(made)
    for path in (made / "report").rglob("*.*"):
        assert path.read_bytes() == (out / path.relative_to(made / "report")).read_bytes(), path.name
