"""Combinations of levels made into complete settings, with the texts of the files that they name."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Final

from comparisons.study.declaring.factors import Chosen, Factor
from comparisons.study.kinds import Kind
from comparisons.study.spec import RunSpec, Value, canonical
from hierarchy.text_nodes import Document, Fault, Path
from worlds import UserError

FileText = Callable[[str], str]
"""Returns the text of a file by the name that a study gives it, or raises a `UserError`."""
_NAME: Final = re.compile(r"([\w.-]+): ")


@dataclass(frozen=True)
class Combination:
    """What the runs of a combination, one for each seed, have in common.

    Parameters
    ----------
    levels
        Labels by factors' names.
    settings
        All settings of the kind.
    files
        Texts of the files that settings name, by the names given.
    """

    levels: Mapping[str, str]
    settings: Mapping[str, Value]
    files: Mapping[str, str] = field(repr=False)


@dataclass(frozen=True)
class _Wrong:
    """What a setting is said to be wrong with."""

    path: Path
    problem: str
    mend: str


class Completion:
    """Completes the combinations of a study; `faults` tells what could not be.

    Parameters
    ----------
    document
        The study's file.
    kind
        What completes settings.
    settings
        What every run has.
    factors
        The factors.
    file_text
        Reads files.
    """

    def __init__(
        self,
        document: Document,
        kind: Kind,
        settings: Mapping[str, Value],
        factors: Sequence[Factor],
        file_text: FileText,
    ) -> None:
        self.document = document
        self.kind = kind
        self.settings = settings
        self.factors = factors
        self.file_text = file_text
        self.texts: dict[str, str] = {}
        self.faults: list[Fault] = []

    def complete(self, every: Sequence[Chosen]) -> tuple[Combination, ...]:
        """Return the combinations; none of them if anything is wrong."""
        found: list[Combination] = []
        wrong: defaultdict[_Wrong, list[Chosen]] = defaultdict(list)
        for chosen in every:
            try:
                found.append(self._completed(chosen))
            except _WrongError as error:
                wrong[error.wrong].append(chosen)
        for each, where in wrong.items():
            self._tell(each, where, every)
        if not self.faults:
            self._refuse_same(found, every)
        return () if self.faults else tuple(found)

    def _completed(self, chosen: Chosen) -> Combination:
        given = dict(self.settings)
        for level in chosen:
            given.update(level.settings)
        try:
            settings = dict(self.kind.complete(given))
            spec = RunSpec(self.kind.name, self.kind.version, settings, seed=0)
        except UserError as error:
            name, problem = _split(str(error), given)
            raise self._wrong(name, problem, chosen) from error
        files = {}
        for setting in self.kind.files(settings):
            name = str(settings[setting])
            try:
                files[name] = self._file(name)
            except UserError as error:
                raise self._wrong(setting, str(error), chosen) from error
        levels = {factor.name: level.label for factor, level in zip(self.factors, chosen, strict=True)}
        return Combination(levels, spec.settings, files)

    def _file(self, name: str) -> str:
        if name not in self.texts:
            path = PurePosixPath(name)
            if "\\" in name or "\0" in name or path.is_absolute() or ".." in path.parts:
                raise UserError(
                    f"the file {name} may lie elsewhere on another machine; name one in the study's folder"
                )
            if str(path) != name or not path.name:
                mend = f"write {path}" if path.name else "write its name"
                raise UserError(f"{name or 'nothing'} is no plain name of a file; {mend}")
            self.texts[name] = self.file_text(name)
        return self.texts[name]

    def _wrong(self, setting: str | None, message: str, chosen: Chosen) -> _WrongError:
        problem, _, mend = message.partition("; ")
        return _WrongError(_Wrong(self._place(setting, chosen), problem, mend or "give another value"))

    def _place(self, setting: str | None, chosen: Chosen) -> Path:
        """Return where in the file a combination has a setting from."""
        if setting is None:
            return ("settings",)
        for factor, level in zip(self.factors, chosen, strict=True):
            if setting in level.settings:
                return factor.place(level, setting)
        return ("settings", setting)

    def _tell(self, wrong: _Wrong, where: list[Chosen], every: Sequence[Chosen]) -> None:
        """Add a fault; where not every combination with the setting has it, say which ones do."""
        setting = str(wrong.path[-1]) if isinstance(wrong.path[-1], str) else str(wrong.path[1])
        concerned = every
        if len(wrong.path) > 1:
            concerned = [chosen for chosen in every if self._place(setting, chosen) == wrong.path]
        told = ""
        if len(where) < len(concerned):
            told = f" (where {self._common(wrong.path, where, concerned)})"
        self.faults.append(self.document.fault(wrong.path, wrong.problem + told, wrong.mend))

    def _common(self, path: Path, where: list[Chosen], concerned: Sequence[Chosen]) -> str:
        """Return what combinations have in common that others have not, or else the first of them."""
        others = [place for place, factor in enumerate(self.factors) if path[:2] != ("vary", factor.name)]
        first = where[0]
        shared = [place for place in others if all(chosen[place] is first[place] for chosen in where)]
        alike = sum(all(chosen[place] is first[place] for place in shared) for chosen in concerned)
        if alike == len(where):
            return self._labels(first, shared)
        more = len(where) - 1  # never 0: one combination alone has all its own labels in common
        return f"{self._labels(first, others)}, and in {more} more combination{'s' if more > 1 else ''}"

    def _labels(self, chosen: Chosen, places: Sequence[int]) -> str:
        return " and ".join(f"{self.factors[place].name} is {chosen[place].label}" for place in places)

    def _refuse_same(self, found: Sequence[Combination], every: Sequence[Chosen]) -> None:
        """Refuse combinations that come to the same runs, which would be counted twice."""
        firsts: dict[str, Chosen] = {}
        again: defaultdict[Path, list[tuple[Chosen, Chosen]]] = defaultdict(list)
        for combination, chosen in zip(found, every, strict=True):
            first = firsts.setdefault(canonical(dict(combination.settings)), chosen)
            if first is not chosen:
                again[self._difference(first, chosen)].append((first, chosen))
        for path, pairs in again.items():
            everywhere = range(len(self.factors))
            one, other = (self._labels(chosen, everywhere) for chosen in pairs[0])
            more = f", and {len(pairs) - 1} more like that" if len(pairs) > 1 else ""
            problem = f"where {other}, the runs are the same as where {one}{more}"
            self.faults.append(
                self.document.fault(path, problem, "remove one of the two, or name one under leave_out")
            )

    def _difference(self, first: Chosen, second: Chosen) -> Path:
        """Return where in the file a combination begins to differ from another one."""
        for factor, one, other in zip(self.factors, first, second, strict=True):
            if one is not other:
                place = factor.labels.index(other.label)
                return ("vary", factor.name, other.label if factor.bundled else place)
        raise AssertionError("a combination came twice")


class _WrongError(Exception):
    """Carries what is wrong to where it is gathered."""

    def __init__(self, wrong: _Wrong) -> None:
        super().__init__(wrong.problem)
        self.wrong = wrong


def _split(message: str, given: Iterable[str]) -> tuple[str | None, str]:
    """Return the setting that a message begins with, given or missing, and the rest."""
    name = next((name for name in given if message.startswith(f"{name}: ")), None)
    if name is None and (found := _NAME.match(message)):
        name = found[1]
    return (None, message) if name is None else (name, message.removeprefix(f"{name}: "))
