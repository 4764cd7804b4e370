"""Kinds of runs: what a run may be asked, and what it measures.

A package adds one by an entry point of the group ``affordant.runs``, whose value is a `Kind`. In its
pyproject.toml::

    [project.entry-points."affordant.runs"]
    mine = "my_package.my_module:MINE"
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any, Final, Literal

from comparisons.study.spec import Value
from worlds import UserError, suggest
from worlds.entry_points import entry_points

GROUP: Final = "affordant.runs"
"""The entry points' group."""
# Reached by name, so that only the kind that is asked for loads its libraries.
_OURS: Final = {
    "learn": "comparisons.study.runs.learn:LEARN",
    "episodes": "comparisons.study.runs.episodes:EPISODES",
    "perceive": "comparisons.study.runs.perceive:PERCEIVE",
}


@dataclass(frozen=True)
class Measure:
    """A number that each run of a kind ends with.

    Parameters
    ----------
    name
        Such as ``steps_to_optimal``.
    about
        What it is, as part of a sentence: "environment steps until every start is optimal".
    unit
        Such as "steps"; "" for a share, which is shown in per cent.
    better
        Whether less or more of it is better; None if neither.
    parts
        Names of its parts, such as "GotoDoor", if runs measure ``optimal.GotoDoor`` besides ``optimal``.
    """

    name: str
    about: str
    unit: str = ""
    better: Literal["less", "more"] | None = None
    parts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Result:
    """What a run found. Timings are no part of it: it is the same on every machine and engine.

    Parameters
    ----------
    measures
        Numbers by name; None where there is nothing to tell: never reached, or never asked. What the run has
        not got at all is left out. Names with a dot, such as ``optimal.GotoDoor``, are parts of a measure.
    curves
        Tables by name: columns of equal length by name, the first one the abscissa.
    details
        Plain data of the kind's own, such as a counter-example to draw.
    """

    measures: Mapping[str, float | None]
    curves: Mapping[str, Mapping[str, Sequence[float | None]]] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)


ReadText = Callable[[str], str]
"""Returns the text of a file by the name that a study gives it, or raises a `UserError`."""


def as_it_is(settings: Mapping[str, Value], _: ReadText) -> Mapping[str, Value]:
    """Return complete settings: files have nothing to say about them before a run begins."""
    return settings


@dataclass(frozen=True)
class Kind:
    """A kind of run.

    Parameters
    ----------
    name
        Such as "learn".
    version
        Raised whenever the same settings and seed give another result; old results then count as others.
    measures
        What its runs measure, what matters most first.
    complete
        Makes settings as they were given into all settings, checked; raises a `UserError` that begins with
        the name of the wrong setting and a colon.
    files
        Which of the complete settings name files of the user's own.
    run
        Carries out a run, of complete settings and a seed. Names of files stand as paths then, to where the
        spec's texts have been laid on this machine; no path may find its way into the result.
    settle
        Makes complete settings into those that are run, once the texts of files can be read: fills in what
        these say, such as the world that a task graph names, and refuses what could not run, as `complete`
        does. What it fills in may name more files, for `files` to tell.
    last_seed
        The largest seed that there are data for; None if there are for any.
    """

    name: str
    version: int
    measures: tuple[Measure, ...]
    complete: Callable[[Mapping[str, Value]], Mapping[str, Value]]
    files: Callable[[Mapping[str, Value]], Sequence[str]]
    run: Callable[[Mapping[str, Value], int], Result]
    settle: Callable[[Mapping[str, Value], ReadText], Mapping[str, Value]] = as_it_is
    last_seed: int | None = None

    def measure(self, name: str) -> Measure:
        """Return a measure by its name, or the one that a dotted name is a part of.

        Raises
        ------
        UserError
            If there is none.
        """
        whole, dot, part = name.partition(".")
        measure = next((measure for measure in self.measures if measure.name == whole), None)
        if measure is None:
            names = [measure.name for measure in self.measures]
            mend = suggest(whole, names)
            raise UserError(f"{name}: runs of kind {self.name} measure no such thing; {mend}")
        if not dot:
            return measure
        if part not in measure.parts:
            mend = suggest(part, measure.parts, "its parts:") if measure.parts else f"use {whole}"
            raise UserError(f"{name}: {whole} has no such part; {mend}")
        return replace(measure, name=name, about=f"{measure.about}, {part}", parts=())


def kind_names() -> tuple[str, ...]:
    """Return the names of the kinds there are, ours first.

    Examples
    --------
    >>> kind_names()[:3]
    ('learn', 'episodes', 'perceive')
    """
    return tuple(_points())


@cache
def kind(name: str) -> Kind:
    """Return a kind of runs by its name.

    Raises
    ------
    UserError
        If there is none, or what it is made of cannot be loaded.
    """
    points = _points()
    if name not in points:
        raise UserError(f"{name}: there is no such kind of run; {suggest(name, points)}")
    try:
        found: Kind = points[name].load()
    except (ImportError, AttributeError) as error:
        raise UserError(
            f"{name}: this kind of run ({points[name].value}) cannot be loaded: {error}; "
            "install what it needs, or mend its entry point"
        ) from error
    return found


def _points() -> dict[str, EntryPoint]:
    """Return entry points by name; a name of ours cannot be taken."""
    ours = {name: EntryPoint(name, value, GROUP) for name, value in _OURS.items()}
    others = sorted(entry_points(group=GROUP), key=lambda point: point.name)
    return {**ours, **{point.name: point for point in others if point.name not in ours}}
