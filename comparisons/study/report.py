"""A study's report: one HTML file that opens offline, its figures for a paper, and its tables."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined

from comparisons.outputs import Track, new_directory, untracked
from comparisons.report import inline_picture
from comparisons.study.declaring.declaration import Study
from comparisons.study.figures.choosing import plates_of
from comparisons.study.figures.grouping import About, parts_of, shown_measures
from comparisons.study.figures.plate import Plate, numbers_csv, numbers_table
from comparisons.study.figures.saving import save_three
from comparisons.study.gathering import Gathered, gather, study_in
from comparisons.study.kinds import kind
from comparisons.study.report_parts import (
    cpu_seconds,
    duration,
    factors_table,
    failure_details,
    provenance_sentences,
    provenance_tables,
    run_sentences,
    settings_table,
    unfinished_table,
    warnings,
)
from comparisons.study.results.answers import answers
from comparisons.study.results.summaries import comparisons_table, study_table
from comparisons.study.results.tables import Table
from comparisons.style import Picture, letters_missing
from worlds import UserError

PAGE: Final = "report.html"
_UNBROKEN: Final = re.compile(r"\([^()]{1,40}\)|^< .*")
_MEASURES: Final = 4  # that fit on the page's width
_SENTENCES: Final = 8
_FOLDED: Final = "parts"
_CONTENTS: Final = (
    ("answer", "Answer"),
    ("run", "What was run"),
    ("results", "Results"),
    ("figures", "Figures"),
    ("provenance", "How it was made"),
    ("change", "Change this study"),
)


def report_study(directory: Path, out: Path | None = None, track: Track = untracked) -> tuple[Path, bool]:
    """Write the report of what a store holds: ``report.html``, ``figures`` and ``tables``.

    Parameters
    ----------
    directory
        The store.
    out
        Directory to make, which must not exist. Defaults to ``report`` in the store, which is replaced.
    track
        Shows progress.

    Returns
    -------
    tuple
        The page, and whether every run has a result.

    Raises
    ------
    UserError
        If there is no store, its study cannot be read, or the report cannot be written.
    """
    found = gather(*study_in(directory))
    name = directory.resolve().name
    place = directory / "report" if out is None else out
    try:
        with new_directory(place, replace=out is None) as made:
            _write(found, name, made, track)
    except OSError as error:
        raise UserError(
            f"{place}: it cannot be written ({error.strerror}); make room, or give another place with --out"
        ) from error
    return place / PAGE, found.whole


def about_study(study: Study) -> About:
    """Return what figures need to know of a study."""
    asked, answer = kind(study.kind), study.answer
    factors = {factor.name: factor.labels for factor in study.factors}
    if answer is None:
        several = (name for name, labels in factors.items() if len(labels) > 1)
        compared = next(several, next(iter(factors), None))
        return About(asked, factors, asked.measures[0], compared)
    measure = asked.measure(answer.measure)
    return About(asked, factors, measure, answer.compare, answer.against, answer.statistic)


def _write(found: Gathered, name: str, out: Path, track: Track) -> None:
    """Write a report into an empty folder; `name` is what commands call the store."""
    about = about_study(found.study)
    plates, missing = plates_of(about, found.rows, found.study.figures) if found.rows else ([], ())
    (out / "figures").mkdir()
    pictures = {}
    for plate in track(plates, total=len(plates), description="drawing figures"):
        pictures[plate.name] = save_three(plate.figure, out / "figures", plate.name)
        if plate.numbers:
            _text(out / "figures" / f"{plate.name}.csv", numbers_csv(plate))
    sentences, folded, tables = _results(found, about)
    (out / "tables").mkdir()
    for title, table in tables.items():
        _text(out / "tables" / f"{title}.md", table.markdown())
        _text(out / "tables" / f"{title}.tex", table.latex(f"tab:{found.study.name}-{title}"))
    page = render(
        found,
        name,
        sentences=sentences,
        folded=folded,
        tables=tables,
        plates=plates,
        pictures=pictures,
        missing=missing,
    )
    _text(out / PAGE, page)


def _results(found: Gathered, about: About) -> tuple[list[str], list[str], dict[str, Table]]:
    """Return the answer's sentences, those folded away, and tables of results by their files' names."""
    study, absent = found.study, [*(run for run, _ in found.failures), *found.left]
    if not found.rows:
        return ["There is no answer yet: no run has a result."], [], {}
    measures = shown_measures(about, found.rows, _MEASURES)
    failed = [run for run, _ in found.failures]
    many: dict[str, Any] = {"statistic": about.statistic, "missing": absent, "failed": failed}
    tables = {"results": study_table(found.rows, measures, **many, caption="What was measured.")}
    parts = parts_of(about.measure, found.rows)
    if parts:
        each = [about.kind.measure(part) for part in parts]
        tables[_FOLDED] = study_table(found.rows, each, **many, caption="The same measure, part by part.")
    if study.answer is None:
        none = "The study file declares no answer; the table of results has all there is to compare."
        return [none], [], tables
    answered = answers(study.answer, about.measure, found.rows, absent)
    tables["comparisons"] = comparisons_table(answered.told, answered.measure, "How the levels compare.")
    first = [_sentence(words) for words in (*answered.caution, *answered.summary)]
    pairs = [_sentence(one.sentence) for one in answered.told]
    shown = 0 if answered.summary else _SENTENCES
    return [*first, *pairs[:shown]], pairs[shown:], tables


def render(
    found: Gathered,
    name: str,
    *,
    sentences: Sequence[str],
    folded: Sequence[str] = (),
    tables: Mapping[str, Table],
    plates: Sequence[Plate],
    pictures: Mapping[str, Picture],
    missing: Sequence[str] = (),
) -> str:
    """Return the page; whatever texts hold is shown, and never becomes markup.

    Parameters
    ----------
    found
        The study's runs.
    name
        What commands call the store.
    sentences, folded
        The answer: what is read first, and each comparison where they are many.
    tables
        Of results, by their files' names.
    plates, pictures
        The figures, and how they look by name.
    missing
        Figures that the study asks for and that cannot be drawn.
    """
    study, folder = found.study, shlex.quote(name)
    count = _Counter()
    told = warnings(found, f"affordant study resume {folder}")
    if missing:
        told.append(
            f"The study file asks for figures that these runs have nothing for: {', '.join(missing)}."
        )
    boxes = letters_missing("".join(label for factor in study.factors for label in factor.labels))
    if boxes and plates:
        told.append(f"Figures show boxes where labels hold letters that their font has not: {boxes}.")
    environment = Environment(
        loader=PackageLoader("comparisons"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    page = environment.get_template("study.html.j2").render(
        title=study.title,
        lead=study.question,
        summary=(),
        sections=(),
        replay=None,
        contents=_CONTENTS,
        answers=sentences,
        more_answers=folded,
        warnings=told,
        cards=_cards(found),
        ran=run_sentences(study),
        ran_tables=[count(table) for table in (factors_table(study), unfinished_table(found)) if table],
        settings="" if (fixed := settings_table(study)) is None else count(fixed),
        failures=failure_details(found),
        result_tables=[count(table) for name, table in tables.items() if name != _FOLDED],
        parts="" if _FOLDED not in tables else count(tables[_FOLDED]),
        figures=[
            {
                "number": i,
                "name": plate.name,
                "caption": plate.caption,
                "picture": inline_picture(pictures[plate.name], f"f{i}", plate.caption),
                "numbers": numbers_table(plate).html() if plate.numbers else "",
            }
            for i, plate in enumerate(plates, start=1)
        ],
        store=name,
        command=f"affordant study report {folder}",
        provenance=provenance_sentences(found),
        provenance_tables=[count(table) for table in provenance_tables(found)],
        change=_change(study),
        commands=_commands(folder),
        source=study.text,
    )
    return page.rstrip() + "\n"


class _Counter:
    """Numbers tables throughout a page."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self, table: Table) -> str:
        self.count += 1
        rows = tuple(tuple(_UNBROKEN.sub(_unbroken, cell) for cell in row) for row in table.rows)
        return replace(table, rows=rows, caption=f"Table {self.count}. {table.caption}").html()


def _unbroken(found: re.Match[str]) -> str:
    """Return an interval, or a p value, that stays on one line."""
    return found[0].replace(" ", "\N{NO-BREAK SPACE}")


def _cards(found: Gathered) -> list[tuple[str, str, str]]:
    study, done = found.study, len(found.rows)
    failed = f"{len(found.failures):,} failed" if found.failures else "none failed"
    to_do = f"; {len(found.left):,} to do" if found.left else ""
    return [
        ("runs with a result", f"{done:,} of {study.runs:,}", failed + to_do),
        ("seeds", f"{len(study.seeds):,}", "of each combination of levels"),
        ("combinations", f"{len(study.combinations):,}", ", ".join(f.name for f in study.factors)),
        ("CPU time", duration(cpu_seconds(found)), "of all runs that have a result"),
    ]


def _change(study: Study) -> list[str]:
    example = "seeds"
    if study.factors:
        example = f"a level more in the list {study.factors[0].name}, and the number of seeds"
    return [
        f"Copy the study file below, change what you like ({example}: two lines), and run it into a folder "
        "of its own. A run is named by what it is: results do not depend on engine, machine or order."
    ]


def _commands(folder: str) -> str:
    lines = (
        "affordant study check mine.yaml",
        "affordant study run mine.yaml --out mine",
        "affordant study resume mine",
        "affordant study report mine",
        "affordant study export mine --out mine.csv",
        f"affordant study diff {folder} mine",
    )
    return "\n".join(lines)


def _sentence(words: str) -> str:
    return (words[:1].upper() + words[1:]).replace(" %", "\N{NO-BREAK SPACE}%")


def _text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
