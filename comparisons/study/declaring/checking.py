"""What makes the form of a study file a study: factors, seeds, combinations and the answer, checked."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import prod
from typing import Final, NamedTuple

from comparisons.study.declaring.completion import Combination, Completion
from comparisons.study.declaring.factors import MOST_COMBINATIONS, Chosen, Factor, combinations, factors_of
from comparisons.study.declaring.schema import AnswerText, SeedsText, StudyText, read_form
from comparisons.study.declaring.written import LAST_SEED, has_controls, is_nothing
from comparisons.study.kinds import Kind, ReadText, kind
from comparisons.study.results.sizes import has_ratio
from hierarchy.text_nodes import Document, Path, path_text
from worlds import UserError, suggest

MOST_RUNS: Final = 100_000
"""How many runs a study may have."""


class Checked(NamedTuple):
    """A file's form, and what was made of it."""

    text: StudyText
    kind: Kind
    factors: tuple[Factor, ...]
    seeds: tuple[int, ...]
    combinations: tuple[Combination, ...]


class Checker:
    """Checks a study file; `faults` tells all that is wrong with it.

    What depends on a part of the file that is wrong is not looked at, for one mistake is to be told once.

    Parameters
    ----------
    document
        The study's file.
    file_text
        Reads files that it names.
    figures
        Names of the figures there are; None lets any pass.
    """

    def __init__(self, document: Document, file_text: ReadText, figures: Collection[str] | None) -> None:
        self.document = document
        self.file_text = file_text
        self.known_figures = figures
        self.text, self.unsure, self.faults = read_form(document)

    def _fail(self, path: Path, problem: str, mend: str) -> None:
        self.faults.append(self.document.fault(path, problem, mend))

    def checked(self) -> Checked | None:
        """Return what the file declares, or None if anything is wrong."""
        asked = self._kind()
        factors = factors_of(self.text) if self._sure("vary") else ()
        seeds = self._seeds()
        self._check_last_seed(seeds, asked)
        before = len(self.faults)
        self._check_names(factors)
        self._check_settings(factors)
        self._check_left_out(factors)
        sound = len(self.faults) == before and self._sure("kind", "settings", "vary", "leave_out")
        chosen = self._combinations(factors, len(seeds)) if sound else ()
        self._check_answer(factors, asked, chosen)
        self._check_figures()
        completed: tuple[Combination, ...] = ()
        if asked is not None and chosen:
            settings = {name: each.value for name, each in self.text.settings.items()}
            completion = Completion(self.document, asked, settings, factors, self.file_text)
            completed = completion.complete(chosen)
            self.faults.extend(completion.faults)
        if self.faults or asked is None:
            return None
        return Checked(self.text, asked, factors, tuple(seeds), completed)

    def _sure(self, *keys: str) -> bool:
        return self.unsure.isdisjoint(keys)

    def _kind(self) -> Kind | None:
        if not self._sure("kind"):
            return None
        try:
            return kind(self.text.kind)
        except UserError as error:
            self._told(("kind",), error)
            return None

    def _told(self, path: Path, error: UserError) -> None:
        """Add a fault told by an error that begins with what is wrong and a colon."""
        what, _, rest = str(error).partition(": ")
        problem, _, mend = rest.partition("; ")
        self._fail(path, f"{what!r}: {problem}", mend)

    def _seeds(self) -> Sequence[int]:
        given = self.text.seeds
        if isinstance(given, SeedsText):
            if given.count > LAST_SEED + 1 - given.first:
                problem = f"{given.count} seeds from {given.first} on go beyond {LAST_SEED}"
                self._fail(("seeds",), problem, "begin with a smaller one")
            return range(given.first, given.first + given.count)
        if isinstance(given, int):
            return range(given)
        firsts: dict[int, int] = {}
        for place, seed in enumerate(given):
            if firsts.setdefault(seed, place) != place:
                at = path_text(("seeds", firsts[seed]))
                self._fail(("seeds", place), f"the seed {seed} is {at} already", "remove one of the two")
        return given

    def _check_last_seed(self, seeds: Sequence[int], asked: Kind | None) -> None:
        """Refuse seeds that a kind has no data for."""
        if asked is None or asked.last_seed is None:
            return
        largest = seeds[-1] if isinstance(seeds, range) else max(seeds)
        if largest > asked.last_seed:
            path = ("seeds",) if isinstance(seeds, range) else ("seeds", seeds.index(largest))
            problem = f"kind {asked.name} has seeds 0 to {asked.last_seed}, and none of {largest}"
            self._fail(path, problem, "give seeds among these")

    def _check_names(self, factors: Sequence[Factor]) -> None:
        """Refuse names and labels that nothing could be called by."""
        for factor in factors:
            path = ("vary", factor.name)
            if is_nothing(factor.name.strip()):
                self._fail(path, "a factor has no name", "write NAME: [FIRST, SECOND]")
            if any(map(has_controls, (factor.name, *factor.labels))):
                problem = "a control character, such as a line's end, cannot stand in a name or label"
                self._fail(("vary",), problem, "remove it")
            if factor.name in ("seed", "seeds"):
                mend = "give seeds: [FIRST, SECOND] instead"
                self._fail(path, "every combination is run with every seed, so this is no factor", mend)
            firsts: dict[str, int] = {}
            for place, label in enumerate(factor.labels):
                if is_nothing(label.strip()):
                    self._fail((*path, label), "a label is empty", "write LABEL: {SETTING: VALUE}")
                if firsts.setdefault(label, place) != place:
                    at = path_text((*path, firsts[label]))
                    self._fail((*path, place), f"the level {label} is {at} already", "remove one of the two")

    def _check_settings(self, factors: Sequence[Factor]) -> None:
        """Refuse a setting that two parts of the file give: which of them is meant, nobody could tell."""
        origins: dict[str, Path] = {name: ("settings", name) for name in self.text.settings}
        for factor in factors:
            places: dict[str, Path] = {}
            for level in factor.levels:
                for name in level.settings:
                    places.setdefault(name, factor.place(level, name))
            for name, path in places.items():
                if name in origins:
                    first = origins[name]
                    where = f"{path_text(first)} in line {self.document.lines[first]}"
                    self._fail(path, f"{name} is set by {where} as well", "remove one of the two")
                else:
                    origins[name] = path

    def _check_left_out(self, factors: Sequence[Factor]) -> None:
        if not self._sure("vary", "leave_out"):
            return
        by_name = {factor.name: factor for factor in factors}
        for place, labels in enumerate(self.text.leave_out):
            for name, label in labels.items():
                path = ("leave_out", place, name)
                if name not in by_name:
                    self._no_factor(path, name, factors)
                elif label not in by_name[name].labels:
                    self._no_level(path, label, by_name[name])

    def _no_factor(self, path: Path, name: str, factors: Sequence[Factor]) -> None:
        known = [factor.name for factor in factors]
        mend = suggest(name, known, "factors:") if known else "name it under vary"
        self._fail(path, f"there is no factor {name!r}", mend)

    def _no_level(self, path: Path, label: str, factor: Factor) -> None:
        mend = suggest(label, factor.labels, "levels:")
        self._fail(path, f"{factor.name} has no level {label!r}", mend)

    def _combinations(self, factors: Sequence[Factor], seeds: int) -> tuple[Chosen, ...]:
        """Return the combinations that are run; none if they are too many, or none is left."""
        found = combinations(factors, self.text.leave_out)
        if found == ():
            self._fail(("leave_out",), "every combination is left out", "leave out less")
            return ()
        number = prod(len(factor.levels) for factor in factors) if found is None else len(found)
        each = f"{number:,} combinations" if number > 1 else "1 combination"
        runs = f"{number * seeds:,} runs, {each} with {seeds:,} seeds"
        if found is None:
            mend = f"vary less: at most {MOST_COMBINATIONS:,} combinations are looked through"
            self._fail(("vary",), f"with none left out, this would be {runs}", mend)
            return ()
        if number * seeds > MOST_RUNS:
            mend = f"give fewer seeds or levels, or leave more out: {MOST_RUNS:,} runs are possible"
            self._fail(("seeds",) if number <= MOST_RUNS else ("vary",), f"this would be {runs}", mend)
            return ()
        return found

    def _check_answer(self, factors: Sequence[Factor], asked: Kind | None, chosen: Sequence[Chosen]) -> None:
        answer = self.text.answer
        if answer is None:
            return
        if asked is not None:
            try:
                measure = asked.measure(answer.measure)
            except UserError as error:
                self._told(("answer", "measure"), error)
            else:
                if answer.normalise != "none" and not has_ratio(measure):
                    problem = f"numbers of {answer.measure} have no ratios: it is a share, or more is better"
                    self._fail(("answer", "normalise"), problem, "leave it out, or answer by another measure")
        if self._sure("vary"):
            self._check_within(answer, factors)
            self._check_against(answer, factors, chosen)

    def _check_within(self, answer: AnswerText, factors: Sequence[Factor]) -> None:
        names = [factor.name for factor in factors]
        for place, name in enumerate(answer.within):
            path = ("answer", "within", place)
            if name not in names:
                self._no_factor(path, name, factors)
            elif name == answer.compare:
                self._fail(path, f"{name} is what is compared", "remove it here")
            elif name in answer.within[:place]:
                self._fail(path, f"{name} is given twice", "remove one of the two")

    def _check_against(self, answer: AnswerText, factors: Sequence[Factor], chosen: Sequence[Chosen]) -> None:
        factor = next((factor for factor in factors if factor.name == answer.compare), None)
        path = ("answer", "against")
        if factor is None:
            self._no_factor(("answer", "compare"), answer.compare, factors)
        elif answer.against not in factor.labels:
            self._no_level(path, answer.against, factor)
        elif len(factor.levels) == 1:
            problem = f"{factor.name} has no other level than {answer.against}"
            self._fail(path, problem, "give it more, or compare another factor")
        elif chosen:
            place = factors.index(factor)
            left = {levels[place].label for levels in chosen}
            if answer.against not in left:
                self._fail(path, f"the level {answer.against} is left out everywhere", "leave out less")
            elif len(left) == 1:
                self._fail(path, f"every level but {answer.against} is left out", "leave out less")

    def _check_figures(self) -> None:
        figures = self.text.figures or []
        for place, name in enumerate(figures):
            path = ("figures", place)
            if name in figures[:place]:
                self._fail(path, f"{name} is given twice", "remove one of the two")
            elif self.known_figures is not None and name not in self.known_figures:
                self._fail(path, f"there is no figure {name!r}", suggest(name, self.known_figures))
