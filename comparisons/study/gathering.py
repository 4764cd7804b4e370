"""What a store holds of a study: results as rows, and what has become of the other runs."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from comparisons.study.declaring.declaration import Planned, Study
from comparisons.study.results.rows import Row
from comparisons.study.results.tables import Table
from comparisons.study.running.records import DamagedError
from comparisons.study.running.store import Damaged, Failure, Store
from comparisons.study.running.study_runs import study_of
from comparisons.study.spec import RunSpec

_STATES: Final = ("done", "failed", "damaged", "to do")
_TOLD: Final = 20


@dataclass(frozen=True)
class Gathered:
    """A study's runs by what has become of them.

    Parameters
    ----------
    study
        The study, as the store keeps it.
    rows
        Runs that have a result, in the study's order.
    provenance
        Where each row's result is from, in the same order.
    failures
        Runs that gave none, with their levels.
    damaged
        Files that do not say what was written to them.
    left
        Runs that are still to do, those of damaged files among them.
    others
        Number of results that the study does not ask for: of kinds or defaults that have changed since.
    why_others
        In what the first of them differs from the run of the study that is nearest to it; "" without others.
    """

    study: Study
    rows: Sequence[Row]
    provenance: Sequence[Mapping[str, Any]] = field(repr=False)
    failures: Sequence[tuple[Planned, Failure]]
    damaged: Sequence[Damaged]
    left: Sequence[Planned]
    others: int
    why_others: str = ""

    @property
    def whole(self) -> bool:
        """Whether every run has a result, and no file is damaged."""
        return not (self.failures or self.damaged or self.left)


def study_in(directory: Path) -> tuple[Study, Store]:
    """Return the study that a folder is the store of, and the store.

    Raises
    ------
    UserError
        If it is no store, or this affordant cannot read its study.
    """
    store = Store(directory)
    return study_of(store), store


def gather(study: Study, store: Store) -> Gathered:
    """Return what has become of a study's runs; every file of theirs is read and checked."""
    kept, failed = set(store.hashes()), {failure.spec.hash: failure for failure in store.failures()}
    rows, provenance, failures = list[Row](), list[Mapping[str, Any]](), list[tuple[Planned, Failure]]()
    damaged, left = list[Damaged](), list[Planned]()
    planned = study.expand()
    for run in planned:
        run_hash = run.spec.hash
        try:
            if run_hash in kept:
                stored = store.read(run_hash)
                rows.append(Row(run.levels, run.spec.seed, run_hash, stored.result))
                provenance.append(stored.provenance)
                continue
        except DamagedError as error:
            damaged.append(Damaged(error.path, error.problem))
        if run_hash in failed:
            failures.append((run, failed[run_hash]))
        else:
            left.append(run)
    others = sorted(kept - {run.spec.hash for run in planned})
    why = _why_other(store, others[0], planned) if others else ""
    return Gathered(study, rows, provenance, failures, damaged, left, len(others), why)


def _why_other(store: Store, run_hash: str, planned: Sequence[Planned]) -> str:
    """Return in what a result that no run asks for differs from the nearest run."""
    try:
        other = store.read(run_hash).spec
    except DamagedError as error:
        return error.problem
    found = min((differences(other, run.spec) for run in planned), key=len)
    return f"{run_hash} differs from the nearest run in {', '.join(found)}"


def differences(other: RunSpec, spec: RunSpec) -> list[str]:
    """Return in what a spec differs from another one, in words.

    Examples
    --------
    >>> was, now = {"gamma": 1}, {"gamma": 1.0, "lasting": 2}
    >>> differences(RunSpec("learn", 1, was, seed=7), RunSpec("learn", 1, now, seed=0))
    ['seed (7, now 0)', 'gamma (1, now 1.0)', 'lasting (none, now 2)']
    """
    was, now = _facts(other), _facts(spec)
    names = [name for name in {**was, **now} if was.get(name) != now.get(name)]
    told = [f"{name} ({was.get(name, 'none')}, now {now.get(name, 'none')})" for name in names]
    files = {**other.files, **spec.files}
    return told + [f"the file {name}" for name in files if other.files.get(name) != spec.files.get(name)]


def _facts(spec: RunSpec) -> dict[str, str]:
    """Return what a spec says but for its files, as text: 1 and 1.0 are not the same run."""
    facts = {"kind": spec.kind, "version": spec.version, "seed": spec.seed, **spec.settings}
    return {name: str(value) for name, value in facts.items()}


def state_table(found: Gathered) -> Table:
    """Return how many runs are done, failed, damaged and to do, by combination of levels."""
    damaged = {one.path.stem for one in found.damaged}
    factors = [factor.name for factor in found.study.factors]
    counts: dict[tuple[str, ...], dict[str, int]] = {
        tuple(each.levels[name] for name in factors): dict.fromkeys(_STATES, 0)
        for each in found.study.combinations
    }

    def count(levels: Mapping[str, str], state: str) -> None:
        counts[tuple(levels[name] for name in factors)][state] += 1

    for row in found.rows:
        count(row.levels, "done")
    for run, _ in found.failures:
        count(run.levels, "failed")
    for run in found.left:
        count(run.levels, "damaged" if run.spec.hash in damaged else "to do")
    totals = {state: sum(each[state] for each in counts.values()) for state in _STATES}
    rows = [(*levels, *(f"{number:,}" for number in each.values())) for levels, each in counts.items()]
    if factors:
        all_ = ("all", *[""] * (len(factors) - 1), *(f"{number:,}" for number in totals.values()))
        rows.append(all_)
    columns = (*factors, *_STATES)
    return Table(columns, tuple(rows), "Runs by what has become of them.", labels=len(factors))


def state_text(found: Gathered, directory: Path) -> str:
    """Return what has become of a study's runs, in plain text: counts, then each failure in a line."""
    folder = shlex.quote(str(directory))
    lines = [f"{found.study.name}: {found.study.question}", "", *aligned(state_table(found))]
    if found.failures:
        lines.append("")
    for run, failure in found.failures[:_TOLD]:
        message = " ".join(failure.message.split())
        where = ", ".join(
            [*(f"{name} {label}" for name, label in run.levels.items()), f"seed {run.spec.seed}"]
        )
        lines.append(f"failed: {where}: {message} (failures/{run.spec.hash}.json)")
    if len(found.failures) > _TOLD:
        lines.append(f"and {len(found.failures) - _TOLD:,} more in {folder}/failures")
    lines += [f"damaged: {one.path}: {one.problem}" for one in found.damaged]
    if found.others:
        lines.append(f"{found.others:,} results are of no run of this study any more: {found.why_others}")
    if not found.whole:
        lines += ["", f"to go on: affordant study resume {folder}"]
    return "\n".join(lines)


def aligned(table: Table) -> list[str]:
    r"""Return a table as lines of plain text, numbers to the right.

    Examples
    --------
    >>> print(*aligned(Table(("gamma", "done"), (("0.9", "5"), ("1", "20")), "", labels=1)), sep="\n")
    gamma  done
    0.9       5
    1        20
    """
    every = [table.columns, *table.rows]
    widths = [max(len(row[i]) for row in every) for i in range(len(table.columns))]
    return [
        "  ".join(
            cell.ljust(width) if i < table.labels else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in every
    ]
