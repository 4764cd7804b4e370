"""Two stores compared, run by run: what changed between two versions, two machines, or two engines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from comparisons.study.results.exporting import flat
from comparisons.study.results.rows import KeptRuns
from comparisons.study.spec import RunSpec, canonical, digest

MOST_TOLD: Final = 20
"""Runs of each sort that the text tells of one by one."""
_OF_THE_MOMENT: Final = ("started", "wall_seconds", "cpu_seconds", "pid", "seed")
"""Fields of the provenance that tell nothing of why results differ."""
_ABSENT: Final = "nothing"


@dataclass(frozen=True)
class Differing:
    """A run whose results differ.

    Parameters
    ----------
    hash, spec
        The run.
    measures
        The two numbers by measure, those that differ; None where one says nothing.
    others
        What else differs, such as "curves.learning" or "details.heat".
    provenance
        The two values by field, those that differ, such as "libraries.torch".
    """

    hash: str
    spec: RunSpec
    measures: Mapping[str, tuple[float | None, float | None]]
    others: tuple[str, ...]
    provenance: Mapping[str, tuple[Any, Any]]


@dataclass(frozen=True)
class Difference:
    """How two stores differ.

    Parameters
    ----------
    only_first, only_second
        Runs that only one of them has a result of, by hash.
    differing
        Runs whose results differ.
    same
        Number of runs whose results are the same.
    """

    only_first: Mapping[str, RunSpec]
    only_second: Mapping[str, RunSpec]
    differing: tuple[Differing, ...]
    same: int

    @property
    def status(self) -> int:
        """Exit status: 0 if both have the same results, 1 if not."""
        return int(bool(self.only_first or self.only_second or self.differing))

    def text(self, first: str = "the first", second: str = "the second") -> str:
        """Return it in words, the stores by their names.

        Examples
        --------
        >>> print(Difference({}, {}, (), 40).text())
        40 runs have the same results in the first and in the second.
        """
        lines = [f"{_runs(self.same)} the same results in {first} and in {second}."]
        specs = [
            *self.only_first.values(),
            *self.only_second.values(),
            *(each.spec for each in self.differing),
        ]
        varying = _varying(specs)
        for name, only in ((first, self.only_first), (second, self.only_second)):
            if only:
                lines.append(f"{_runs(len(only))} a result only in {name}:")
                lines += _some([f"  {run_hash}  {_spec(spec, varying)}" for run_hash, spec in only.items()])
        if self.differing:
            lines.append(f"{_runs(len(self.differing))} other results in {second} than in {first}:")
            lines += _some([_differing(each, varying) for each in self.differing])
            lines += _blamed(self.differing)
        return "\n".join(lines)


def diff(first: KeptRuns, second: KeptRuns) -> Difference:
    """Return how the results of two stores differ.

    Timings and provenance make no difference; where results differ, the provenance that does is told.

    Raises
    ------
    UserError
        If a file of one of them is damaged.
    """
    one, other = set(first.hashes()), set(second.hashes())
    differing = []
    for run_hash in sorted(one & other):
        found = _difference(run_hash, first, second)
        if found is not None:
            differing.append(found)
    return Difference(
        {run_hash: first.read(run_hash).spec for run_hash in sorted(one - other)},
        {run_hash: second.read(run_hash).spec for run_hash in sorted(other - one)},
        tuple(differing),
        len(one & other) - len(differing),
    )


def _difference(run_hash: str, first: KeptRuns, second: KeptRuns) -> Differing | None:
    one, other = first.read(run_hash), second.read(run_hash)
    measures = {
        name: (one.result.measures.get(name), other.result.measures.get(name))
        for name in {**one.result.measures, **other.result.measures}
        # A measure that is left out counts as None.
        if one.result.measures.get(name) != other.result.measures.get(name)
    }
    others = (
        *_changed("curves", one.result.curves, other.result.curves),
        *_changed("details", one.result.details, other.result.details),
    )
    if not measures and not others:
        return None
    where, there = flat(one.provenance), flat(other.provenance)
    provenance = {
        name: (where.get(name), there.get(name))
        for name in {**where, **there}
        if name not in _OF_THE_MOMENT and where.get(name) != there.get(name)
    }
    return Differing(run_hash, one.spec, measures, others, provenance)


def _changed(what: str, one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Return the names under which two mappings hold different data."""
    return [
        f"{what}.{name}"
        for name in {**one, **other}
        if name not in one or name not in other or canonical(one[name]) != canonical(other[name])
    ]


def _differing(each: Differing, varying: Sequence[str]) -> str:
    parts = [f"{name} {_change(*values)}" for name, values in each.measures.items()]
    told = ", ".join([*parts, *(f"{name} differs" for name in each.others)])
    return f"  {each.hash}  {_spec(each.spec, varying)}: {told}"


def _change(one: float | None, other: float | None) -> str:
    """Return two numbers, and by how much they differ.

    >>> _change(1000.0, 1020.5), _change(None, 3.0)
    ('1000.0 -> 1020.5 (+20.5)', 'nothing -> 3.0')
    """
    shown = " -> ".join(_ABSENT if value is None else repr(value) for value in (one, other))
    return shown if one is None or other is None else f"{shown} ({other - one:+.6g})"


def _blamed(differing: Sequence[Differing]) -> list[str]:
    """Return which provenance differs, and of how many of the differing runs."""
    counts: dict[str, int] = {}
    for each in differing:
        for name, (one, other) in each.provenance.items():
            line = f"  {name}: {_value(one)} -> {_value(other)}"
            counts[line] = counts.get(line, 0) + 1
    if not counts:
        return ["Their provenance is the same: a kind of run may not be repeatable."]
    lines = [f"{line} ({count} of {len(differing)})" for line, count in counts.items()]
    return ["What differs in their provenance:", *_some(lines)]


def _value(value: object) -> str:
    return _ABSENT if value is None else str(value)


def _traits(spec: RunSpec) -> dict[str, object]:
    """Return what makes a spec what it is, but for its seed; the texts of files by their digests."""
    texts = {f"text of {name}": digest(text)[:8] for name, text in spec.files.items()}
    return {"kind": spec.kind, "version": spec.version, **spec.settings, **texts}


def _varying(specs: Sequence[RunSpec]) -> list[str]:
    """Return the traits that tell some specs apart."""
    every = [_traits(spec) for spec in specs]
    names = dict.fromkeys(name for traits in every for name in traits)
    return [name for name in names if len({repr(traits.get(name)) for traits in every}) > 1]


def _spec(spec: RunSpec, varying: Sequence[str]) -> str:
    """Return what tells a spec from others."""
    traits = _traits(spec)
    told = [f"{name} {traits[name]}" for name in varying if name in traits]
    return ", ".join([f"seed {spec.seed}", *told])


def _some(lines: Sequence[str]) -> Iterable[str]:
    more = len(lines) - MOST_TOLD
    return [*lines[:MOST_TOLD], f"  and {more} more"] if more > 0 else lines


def _runs(count: int) -> str:
    return f"{count:,} run{'s have' if count != 1 else ' has'}"
