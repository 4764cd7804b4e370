"""What a study's report tells besides its results: what was run, what failed, and where it all is from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from comparisons.study.declaring.declaration import Study
from comparisons.study.gathering import Gathered, state_table
from comparisons.study.results.tables import Table
from comparisons.study.results.wording import counted

_FEW: Final = 5  # seeds, below which nothing is ranked
_SHOWN: Final = 50  # failures that a page tells one by one
_REASONS: Final = {"raised": "raised an error", "died": "its worker died", "too long": "took too long"}


def run_sentences(study: Study) -> list[str]:
    """Return what was run, in sentences."""
    first, number = study.seeds[0], len(study.seeds)
    in_a_row = study.seeds == tuple(range(first, first + number))
    which = (
        f"{first} to {first + number - 1}" if in_a_row and number > 1 else ", ".join(map(str, study.seeds))
    )
    combinations = counted(len(study.combinations), "combination")
    return [
        f"{counted(study.runs, 'run')} of kind {study.kind} (version {study.version}): {combinations} of "
        f"levels, each with {counted(number, 'seed')} ({which})."
    ]


def factors_table(study: Study) -> Table | None:
    """Return what varies; None if nothing does."""
    rows = tuple((factor.name, _listed(factor.labels)) for factor in study.factors)
    return Table(("factor", "levels"), rows, "What varies.", labels=2) if rows else None


def _listed(labels: Sequence[str]) -> str:
    """Return labels in a row, apart from each other even where some hold commas."""
    return ("; " if any("," in label for label in labels) else ", ").join(labels)


def unfinished_table(found: Gathered) -> Table | None:
    """Return where runs have no result, and why; None if all have one."""
    table = state_table(found)
    rows = tuple(row for row in table.rows if any(cell != "0" for cell in row[table.labels + 1 :]))
    caption = "Combinations of which not every run has a result."
    return replace(table, rows=rows, caption=caption) if rows else None


def settings_table(study: Study) -> Table | None:
    """Return the settings that all runs have in common, and where they are from; None if there are none."""
    every = [each.settings for each in study.combinations]
    fixed = [name for name, value in every[0].items() if all(one.get(name) == value for one in every)]
    rows = tuple(
        (
            name,
            str(every[0][name]) or "\N{EN DASH}",
            "the study file" if name in study.settings else "default",
        )
        for name in sorted(fixed, key=lambda name: name not in study.settings)
    )
    caption = "Settings that all runs have in common."
    return Table(("setting", "value", "from"), rows, caption, labels=3) if rows else None


def warnings(found: Gathered, command: str) -> list[str]:
    """Return what a reader must know before any number.

    Parameters
    ----------
    found
        The study's runs.
    command
        The command that goes on with the study.
    """
    planned = found.study.runs
    told = []
    if found.failures:
        told.append(
            f"{len(found.failures):,} of {planned:,} runs failed. No number here counts them; what became of "
            "them is told under What was run."
        )
    if found.damaged:
        names = ", ".join(one.path.name for one in found.damaged[:3])
        more = f" and {len(found.damaged) - 3} more" if len(found.damaged) > 3 else ""
        told.append(f"{counted(len(found.damaged), 'file')} damaged, and left out: {names}{more}.")
    if found.left:
        told.append(f"{len(found.left):,} of {planned:,} runs are still to do: {command}.")
    if found.others:
        told.append(
            f"{counted(found.others, 'result')} in the store belong to no run of this study any more, for "
            "the kind of run or its defaults have changed since; no number here counts them."
        )
    if len(found.study.seeds) < _FEW:
        told.append(
            f"With {counted(len(found.study.seeds), 'seed')} nothing is ranked; {_FEW} are needed. "
            "More seeds: the line seeds of the study file."
        )
    mixed = [
        name for name, values in _origins(found.provenance).items() if name in _DECISIVE and len(values) > 1
    ]
    if mixed:
        told.append(f"Runs differ in what they were made with ({', '.join(mixed)}); see How it was made.")
    return told


def failure_details(found: Gathered) -> list[dict[str, str]]:
    """Return title, message and traceback of the runs that failed."""
    details = []
    for run, failure in found.failures[:_SHOWN]:
        where = ", ".join(
            [*(f"{name} {label}" for name, label in run.levels.items()), f"seed {run.spec.seed}"]
        )
        title = f"Failed: {where} ({_REASONS[failure.reason]})"
        details.append({"title": title, "message": failure.message, "traceback": failure.traceback})
    if len(found.failures) > _SHOWN:
        more = f"and {len(found.failures) - _SHOWN:,} more"
        details.append({"title": more, "message": "in the store's folder failures", "traceback": ""})
    return details


_DECISIVE: Final = ("affordant", "git commit", "python", "numpy", "numba", "torch")
"""What may change a result."""


def provenance_tables(found: Gathered) -> list[Table]:
    """Return where the results are from, and how many of them from each."""
    rows = [
        (name, value, f"{number:,}")
        for name, values in _origins(found.provenance).items()
        for value, number in values.most_common()
    ]
    return [Table(("what", "which", "runs"), tuple(rows), "What the results were made with.", labels=2)]


def provenance_sentences(found: Gathered) -> list[str]:
    """Return when the results were made, and how long it took."""
    if not found.provenance:
        return ["No run has a result yet."]
    started = sorted(str(one.get("started", "")) for one in found.provenance)
    cpu = [one.get("cpu_seconds") for one in found.provenance]
    untold = cpu.count(None)
    return [
        f"Runs began from {_minute(started[0])} to {_minute(started[-1])} (UTC). Together they took "
        f"{duration(sum(float(seconds or 0) for seconds in cpu))} of CPU time"
        + (f"; {counted(untold, 'run')} could not tell." if untold else ".")
    ]


def cpu_seconds(found: Gathered) -> float:
    """Return what all runs with a result took, in CPU seconds."""
    return sum(float(one.get("cpu_seconds") or 0) for one in found.provenance)


def duration(seconds: float) -> str:
    """Return a time for people.

    Examples
    --------
    >>> [duration(seconds) for seconds in (0.31, 42, 754, 9000, 400000)]
    ['0.3 s', '42 s', '13 min', '2.5 h', '4.6 days']
    """
    for size, unit in ((86400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 1.5 * size:
            number = seconds / size
            return f"{number:.0f} {unit}" if number >= 10 else f"{number:.1f} {unit}"
    return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.1f} s"


def _origins(provenance: Sequence[Mapping[str, Any]]) -> dict[str, Counter[str]]:
    """Return how many results are from each version, commit, machine and engine."""
    found: dict[str, Counter[str]] = {}
    for one in provenance:
        for name, value in _parts(one):
            found.setdefault(name, Counter())[value] += 1
    return found


def _parts(one: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    yield "affordant", str(one.get("affordant") or "unknown")
    git = one.get("git")
    if git:
        yield "git commit", f"{git.get('commit')}{', with changes' if git.get('dirty') else ''}"
    yield "python", str(one.get("python") or "unknown")
    for name, value in (one.get("libraries") or {}).items():
        yield str(name), str(value or "not installed")
    for name in ("platform", "host", "engine"):
        yield name, str(one.get(name) or "unknown")


def _minute(started: str) -> str:
    return started[:16].replace("T", " ") or "unknown"
