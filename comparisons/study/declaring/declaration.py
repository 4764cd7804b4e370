"""Studies, read from the files that declare them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from comparisons.study.declaring.checking import Checked, Checker
from comparisons.study.declaring.completion import Combination
from comparisons.study.declaring.factors import Factor
from comparisons.study.declaring.schema import Normalise, Statistic
from comparisons.study.kinds import ReadText
from comparisons.study.spec import RunSpec, Value
from hierarchy.text_files import file_text
from hierarchy.text_nodes import LARGEST, Fault, FaultyTextError, TaskGraphTextError, read_yaml
from worlds import UserError

_LISTED: Final = 12  # seeds that are told one by one


class StudyError(FaultyTextError):
    """A study file is wrong.

    Examples
    --------
    >>> fault = Fault(3, "answer.compare", "there is no factor 'gama'", "did you mean 'gamma'?")
    >>> str(StudyError("mine.yaml", [fault]))
    "mine.yaml, line 3, answer.compare: there is no factor 'gama'; did you mean 'gamma'?"
    """


@dataclass(frozen=True)
class Answer:
    """How a study's question is answered.

    Parameters
    ----------
    measure
        One of the kind's measures.
    compare
        The factor whose levels are compared.
    against
        The label of the level that the others are compared with.
    within
        Factors at each of whose levels the comparison is made by itself.
    statistic
        What sums up the runs that are compared: "iqm", "median" or "mean".
    normalise
        What numbers are divided by: "none", or "against", the median of that level's runs of the same task.
    """

    measure: str
    compare: str
    against: str
    within: tuple[str, ...] = ()
    statistic: Statistic = "iqm"
    normalise: Normalise = "none"


@dataclass(frozen=True)
class Planned:
    """A run of a study: what it is to do, and the label of its level of each factor."""

    spec: RunSpec
    levels: Mapping[str, str]


@dataclass(frozen=True)
class Study:
    """A study, checked: every run of it could begin.

    Parameters
    ----------
    name, title, question
        What the study is called, what its report is called, and what it asks.
    kind, version
        The kind of its runs, and that kind's version.
    seeds
        What each combination is run with; distinct.
    settings
        What every run has, as the file gives it.
    factors
        What varies, in the file's order.
    combinations
        Combinations of levels that are run, with their complete settings.
    answer
        How the question is answered; None leaves that to the reader of the tables.
    figures
        Names of the report's figures; None takes all that apply.
    source
        What errors call the file.
    text, files
        The file's text, and the texts of the files that its settings name, by these names:
        ``parse_study(text, source, files)`` reads the same study anywhere.
    """

    name: str
    title: str
    question: str
    kind: str
    version: int
    seeds: tuple[int, ...] = field(repr=False)
    settings: Mapping[str, Value]
    factors: tuple[Factor, ...]
    combinations: tuple[Combination, ...] = field(repr=False)
    answer: Answer | None
    figures: tuple[str, ...] | None
    source: str
    text: str = field(repr=False)
    files: Mapping[str, str] = field(repr=False)

    @property
    def runs(self) -> int:
        """The number of runs."""
        return len(self.combinations) * len(self.seeds)

    def expand(self) -> tuple[Planned, ...]:
        """Return every run: combinations in order, the last factor's levels first, each with every seed."""
        return tuple(
            Planned(RunSpec(self.kind, self.version, each.settings, seed, each.files), each.levels)
            for each in self.combinations
            for seed in self.seeds
        )

    def describe(self) -> str:
        """Return in a few lines what is run."""
        every = 1
        for factor in self.factors:
            every *= len(factor.levels)
        some = len(self.combinations)
        less = f" of {every:,}" if some < every else ""
        lines = [
            f"{self.name}: {self.question}",
            f"{self.runs:,} {_plural('run', self.runs)} of kind {self.kind}: "
            f"{some:,}{less} {_plural('combination', every)} with {self._seeds()}",
            *(f"{factor.name}: {_listed(factor.labels)}" for factor in self.factors),
        ]
        if (answer := self.answer) is not None:
            within = f", within {' and '.join(answer.within)}" if answer.within else ""
            counted = "" if answer.normalise == "none" else ", in medians of that level by task"
            lines.append(
                f"answered by {answer.measure} ({answer.statistic}) of each {answer.compare} "
                f"against {answer.against}{within}{counted}"
            )
        return "\n".join(lines)

    def _seeds(self) -> str:
        first, number = self.seeds[0], len(self.seeds)
        if number == 1:
            return f"seed {first}"
        if self.seeds == tuple(range(first, first + number)):
            return f"{number:,} seeds, {first} to {first + number - 1}"
        shown = ", ".join(map(str, self.seeds[:_LISTED]))
        return f"{number:,} seeds, {shown}{', ...' if number > _LISTED else ''}"


def load_study(path: str | Path, figures: Collection[str] | None = None) -> Study:
    """Read a study from its file; files that its settings name are looked for in the same folder.

    Parameters
    ----------
    path
        A YAML file, in the form that docs/studies.md describes.
    figures
        Names of the figures that there are, of which the file may name some. None lets any pass: which there
        are is no affair of runs.

    Raises
    ------
    UserError
        If it cannot be read.
    StudyError
        If it is wrong; the message gives every mistake's line, path and mend.
    """
    path = Path(path)
    text = file_text(path, "there is no such file; check the path")

    def beside(name: str) -> str:
        missing = f"there is no such file; put it beside {path.name}, or mend its name"
        return file_text(path.parent / name, missing)

    return _parsed(text, str(path), beside, figures)


def parse_study(text: str, source: str = "the study", files: Mapping[str, str] | None = None) -> Study:
    r"""Read a study from its text.

    Parameters
    ----------
    text
        YAML, in the form that docs/studies.md describes.
    source
        What errors call the text.
    files
        Texts of the files that its settings name, by the names given.

    Raises
    ------
    StudyError
        If the text is wrong; the message gives every mistake's line, path and mend.

    Examples
    --------
    >>> text = '''
    ... study: gamma
    ... question: Does a discount below 1 slow MAXQ-0 down?
    ... kind: learn
    ... seeds: 20
    ... vary: {gamma: [1, 0.99]}
    ... answer: {measure: steps_to_optimal, compare: gama, against: 1}
    ... '''
    >>> parse_study(text, "mine.yaml")
    Traceback (most recent call last):
        ...
    comparisons.study.declaring.declaration.StudyError: ... no factor 'gama'; did you mean 'gamma'?
    """
    given = files or {}

    def among(name: str) -> str:
        if name not in given:
            raise UserError(f"the text of the file {name} is not given; give it with the study")
        return given[name]

    return _parsed(text, source, among)


def _parsed(text: str, source: str, read: ReadText, figures: Collection[str] | None = None) -> Study:
    lines = (line.partition("#")[0].strip() for line in text.splitlines())
    if not any(line and line != "---" for line in lines):
        raise StudyError(source, [Fault(1, "", "the text is empty", "begin it with study: NAME")])
    if len(text) > LARGEST:
        problem = f"the text has {len(text)} characters, more than {LARGEST}"
        raise StudyError(source, [Fault(1, "", problem, "declare several studies")])
    try:
        document = read_yaml(text, source)
    except TaskGraphTextError as error:
        raise StudyError(source, list(error.faults)) from error
    checker = Checker(document, read, figures)
    checked = checker.checked()
    if checked is None:
        raise StudyError(source, checker.faults)
    return _study(checked, source, text)


def _study(checked: Checked, source: str, text: str) -> Study:
    form = checked.text
    answer = None
    if (told := form.answer) is not None:
        answer = Answer(
            told.measure, told.compare, told.against, tuple(told.within), told.statistic, told.normalise
        )
    return Study(
        name=form.study,
        title=form.title or form.study,
        question=form.question,
        kind=checked.kind.name,
        version=checked.kind.version,
        seeds=checked.seeds,
        settings={name: each.value for name, each in form.settings.items()},
        factors=checked.factors,
        combinations=checked.combinations,
        answer=answer,
        figures=None if form.figures is None else tuple(form.figures),
        source=source,
        text=text,
        files={name: text for each in checked.combinations for name, text in each.files.items()},
    )


def _listed(labels: Sequence[str]) -> str:
    """Return labels with something between them that is in none of them, as a rule."""
    return ("; " if any("," in label for label in labels) else ", ").join(labels)


def _plural(word: str, number: int) -> str:
    return word if number == 1 else f"{word}s"
