"""Tasks of different sizes: how far apart they are, and numbers counted in their own task's size.

What is taken over several tasks mixes their numbers: of four mazes, each far larger than the one before, the
interquartile mean drops the smallest and the largest. Agarwal et al. (2021) normalise each task's scores by
reference scores of that task; here the reference is the median of the level that others are compared with.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from typing import Final

import numpy as np

from comparisons.study.kinds import Measure
from comparisons.study.results.samples import Samples

FAR: Final = 2.0
"""Tasks differ much in size if one is more than so many times another."""


def has_ratio(measure: Measure) -> bool:
    """Return whether one number of a measure by another tells anything, as of steps.

    A reward's zero is anywhere, and shares are compared by their difference.

    Examples
    --------
    >>> has_ratio(Measure("steps", "steps to the goal", "steps", "less"))
    True
    >>> has_ratio(Measure("mean_return", "mean return at the end", "reward", "more"))
    False
    """
    return bool(measure.unit) and measure.better != "more"


def sizes_of(samples: Samples) -> dict[str, float]:
    """Return each task's size, the median of its numbers; infinite if half of its runs never got there."""
    return {task: float(np.median([*numbers.values()])) for task, numbers in samples.tasks.items()}


def apart(samples: Samples) -> float:
    """Return how many times the smallest task's size the largest task's is; 1 for shares.

    Examples
    --------
    >>> steps = Measure("steps", "steps to the goal", "steps", "less")
    >>> apart(Samples(steps, {"small maze": {0: 10.0, 1: 20.0}, "large maze": {0: 100.0, 1: 80.0}}))
    6.0
    """
    sizes = [abs(size) for size in sizes_of(samples).values()] if samples.measure.unit else []
    least, most = min(sizes, default=1.0), max(sizes, default=1.0)
    if least == most:
        return 1.0
    return most / least if least > 0 else inf


def counted_in(samples: Samples, sizes: Mapping[str, float], of: str) -> Samples:
    """Return numbers as multiples of their task's size.

    Parameters
    ----------
    samples
        Numbers of a measure that has ratios.
    sizes
        Positive and finite, by task; numbers of other tasks are left out.
    of
        What the sizes are the medians of, for the measure's words.

    Examples
    --------
    >>> steps = Measure("steps", "steps to the goal", "steps", "less")
    >>> found = counted_in(Samples(steps, {"A": {0: 10.0, 1: 30.0}}), {"A": 20.0}, "gamma 1")
    >>> found.values.tolist(), found.measure.about
    ([0.5, 1.5], 'steps to the goal, in medians of gamma 1 by task')
    """
    divided = {
        task: {seed: value / sizes[task] for seed, value in numbers.items()}
        for task, numbers in samples.tasks.items()
        if task in sizes
    }
    return Samples(counted_measure(samples.measure, of), divided, samples.untold)


def counted_measure(measure: Measure, of: str) -> Measure:
    """Return a measure whose numbers are multiples of their task's size."""
    return replace(measure, about=f"{measure.about}, in medians of {of} by task", unit="medians")


def warning(found: float, measure: Measure) -> str:
    """Return what to know and to do where tasks differ much in size; "" where they do not."""
    if found <= FAR:
        return ""
    times = "much" if found == inf else f"up to {found:.0f}-fold"
    option = "give the answer normalise: against, or " if has_ratio(measure) else ""
    return (
        f"Tasks differ {times} in size, and their numbers are mixed as they are, so that some tasks decide "
        f"for all: {option}name the factor that makes them so under within."
    )
