"""Combinations of levels made into complete settings, with the texts of the files that they name."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Final

from comparisons.study.declaring.factors import Chosen, Factor
from comparisons.study.kinds import Kind, ReadText
from comparisons.study.spec import RunSpec, Value, canonical
from hierarchy.text_nodes import Document, Fault, Path
from worlds import UserError

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
        file_text: ReadText,
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
        refused = Counter[Path]()
        for each, where in wrong.items():
            refused[each.path] += len(where)
        concerned = self._concerned(wrong, every)
        for each, where in wrong.items():
            self._tell(each, where, concerned[each.path], refused[each.path])
        if not self.faults:
            self._refuse_same(found, every)
        return () if self.faults else tuple(found)

    def _completed(self, chosen: Chosen) -> Combination:
        given = dict(self.settings)
        for level in chosen:
            given.update(level.settings)
        try:
            complete = self.kind.complete(given)
            for setting in self.kind.files(complete):
                self._file_of(setting, complete)
            settings = dict(self.kind.settle(complete, self._file))
            files = {str(settings[name]): self._file_of(name, settings) for name in self.kind.files(settings)}
            spec = RunSpec(self.kind.name, self.kind.version, settings, 0, files)
        except UserError as error:
            name, problem = _split(str(error), given)
            raise self._wrong(name, problem, chosen) from error
        levels = {factor.name: level.label for factor, level in zip(self.factors, chosen, strict=True)}
        return Combination(levels, spec.settings, spec.files)

    def _file_of(self, setting: str, settings: Mapping[str, Value]) -> str:
        """Return the text of the file that a setting names."""
        try:
            return self._file(str(settings[setting]))
        except UserError as error:
            raise UserError(f"{setting}: {error}") from error

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

    def _concerned(self, wrong: Iterable[_Wrong], every: Sequence[Chosen]) -> Mapping[Path, Sequence[Chosen]]:
        """Return the combinations that have a setting from a place in the file where something is wrong."""
        found: defaultdict[Path, list[Chosen]] = defaultdict(list, {("settings",): list(every)})
        for setting in {_setting(each.path) for each in wrong if len(each.path) > 1}:
            for chosen in every:
                found[self._place(setting, chosen)].append(chosen)
        return found

    def _tell(self, wrong: _Wrong, where: list[Chosen], concerned: Sequence[Chosen], refused: int) -> None:
        """Add a fault; where not every combination with the setting has it, say which ones do.

        `refused` combinations have a fault in the same place; where the others have none, the setting is well
        meant, and only for them.
        """
        told, mend = "", wrong.mend
        if len(where) < len(concerned):
            told = f" (where {self._common(wrong.path, where, concerned)})"
        if refused < len(concerned) and len(wrong.path) > 1:
            levels = "give it to the levels under vary that it is for"
            mend = f"{levels if wrong.path[0] == 'settings' else 'name these under leave_out'}, or {mend}"
        self.faults.append(self.document.fault(wrong.path, wrong.problem + told, mend))

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
                return factor.place(other)
        raise AssertionError("a combination came twice")


class _WrongError(Exception):
    """Carries what is wrong to where it is gathered."""

    def __init__(self, wrong: _Wrong) -> None:
        super().__init__(wrong.problem)
        self.wrong = wrong


def _setting(path: Path) -> str:
    """Return the setting that a place in the file gives; a value of a factor's has the factor's name."""
    return str(path[-1]) if isinstance(path[-1], str) else str(path[1])


def _split(message: str, given: Iterable[str]) -> tuple[str | None, str]:
    """Return the setting that a message begins with, given or missing, and the rest."""
    name = next((name for name in given if message.startswith(f"{name}: ")), None)
    if name is None and (found := _NAME.match(message)):
        name = found[1]
    return (None, message) if name is None else (name, message.removeprefix(f"{name}: "))
