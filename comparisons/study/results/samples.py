"""One measure of many runs, by task and seed: what every statistic of a study is computed from.

A task is what runs are alike in but for their seed: one combination of the factors that a statistic neither
compares nor keeps apart. With none such there is one task.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from comparisons.study.kinds import Measure
from comparisons.study.results.rows import Row, by_levels, level_words
from worlds import UserError

FEWEST_SEEDS: Final = 5
"""Nothing is ranked on fewer."""


@dataclass(frozen=True)
class Samples:
    """Numbers of one measure.

    Parameters
    ----------
    measure
        What was measured.
    tasks
        Numbers by task and, within it, by seed; infinite for a run that never got there.
    untold
        Number of runs that are left out since they had nothing to tell (see `counted`).
    """

    measure: Measure
    tasks: Mapping[str, Mapping[int, float]]
    untold: int = 0

    @cached_property
    def arrays(self) -> list[NDArray[np.float64]]:
        """Each task's numbers, ordered by task and seed: the order of the rows has no say."""
        return [
            np.array([numbers[seed] for seed in sorted(numbers)])
            for _, numbers in sorted(self.tasks.items())
            if numbers
        ]

    @property
    def values(self) -> NDArray[np.float64]:
        """All numbers, shape (runs,)."""
        return np.concatenate([*self.arrays, np.empty(0)])

    @property
    def runs(self) -> int:
        """How many numbers there are."""
        return sum(map(len, self.arrays))

    @property
    def reached(self) -> int:
        """How many of them are finite."""
        return int(np.isfinite(self.values).sum())

    @property
    def seeds(self) -> int:
        """The number of seeds of the task that has fewest."""
        return min(map(len, self.arrays), default=0)

    def keep(self, pairs: Mapping[str, Iterable[int]]) -> Samples:
        """Return the numbers of some seeds of each task."""
        kept = {task: {seed: self.tasks[task][seed] for seed in seeds} for task, seeds in pairs.items()}
        return Samples(self.measure, kept, self.untold)


def worst(measure: Measure) -> float | None:
    """Return what a run counts as that never got there; None if such a run is left out.

    Steps that were never reached are infinitely many, and an infinite reward was never lost. A share without
    a whole, such as that of optimal affordances where none was asked for, says nothing, good or bad, and so
    does a measure of which neither less nor more is better.

    Examples
    --------
    >>> worst(Measure("steps", "steps to the goal", "steps", "less"))
    inf
    >>> worst(Measure("optimal", "share of optimal affordances", "", "more")) is None
    True
    """
    if not measure.unit or measure.better is None:
        return None
    return inf if measure.better == "less" else -inf


def samples_of(rows: Iterable[Row], measure: Measure, tasks: Sequence[str] = ()) -> Samples:
    """Return a measure's numbers of some runs.

    Parameters
    ----------
    rows
        Runs with their results.
    measure
        What to take of them.
    tasks
        Factors whose combinations are the tasks.

    Raises
    ------
    UserError
        If two rows are of the same task and seed: the factors that keep them apart are neither tasks nor
        compared.

    Examples
    --------
    >>> from comparisons.study.kinds import Result
    >>> steps = Measure("steps", "steps to the goal", "steps", "less")
    >>> found = {0: 12.0, 1: None, 2: 10.0}
    >>> rows = [Row({"gamma": "1"}, seed, "", Result({"steps": value})) for seed, value in found.items()]
    >>> samples = samples_of(rows, steps)
    >>> samples.values.tolist(), samples.reached, samples.seeds
    ([12.0, inf, 10.0], 2, 3)
    """
    instead = worst(measure)
    found: dict[str, dict[int, float]] = {}
    untold = 0
    for levels, alike in by_levels(rows, tasks).items():
        task = level_words(dict(zip(tasks, levels, strict=True)))
        numbers = found.setdefault(task, {})
        seen: dict[int, Row] = {}
        for row in alike:
            if row.seed in seen:
                one, other = level_words(seen[row.seed].levels), level_words(row.levels)
                raise UserError(
                    f"{measure.name}: seed {row.seed} was run twice, with {one} and with {other}; "
                    "name the factor that tells them apart"
                )
            seen[row.seed] = row
            value = row.result.measures.get(measure.name)
            number = instead if value is None and measure.name in row.result.measures else value
            if number is None:
                untold += 1
            else:
                numbers[row.seed] = float(number)
    return Samples(measure, {task: numbers for task, numbers in found.items() if numbers}, untold)
