"""The learners that are compiled, each with its reference and where their values are the same."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundGraph
from planners.compiled.runs import Compiled, L
from planners.flat import FlatQ, flattened
from planners.maxq import MaxQ
from planners.maxq_q import MaxQQ


class CompiledMaxQ(Compiled[MaxQ]):
    """Compiled `MaxQ`: see `Compiled`.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> goto = grounded.place("GotoTrigger(T4)")
    >>> start = grounded.model.index.number((maze.start, maze.triggers["T4"], maze.goals["G2"], "closed"))
    >>> learner = CompiledMaxQ(grounded, seeds=[(seed,) for seed in range(100)])
    >>> steps = learner.train(goto, [start], episodes=300)
    >>> steps.shape, (learner.greedy_steps(goto, [start]) == 6).all()
    ((100, 300), np.True_)
    >>> steps[1].tolist() == MaxQ(grounded, seed=(1,)).train(goto, [start], episodes=300)
    True
    """

    reference = MaxQ
    kind = "maxq-0"

    def _fill(self, learner: MaxQ, values: NDArray[np.float64]) -> None:
        _fill_maxq(self, learner, values)


class CompiledMaxQQ(Compiled[MaxQQ]):
    """Compiled `MaxQQ`: see `Compiled`."""

    reference = MaxQQ
    kind = "maxq-q"

    def _fill(self, learner: MaxQQ, values: NDArray[np.float64]) -> None:
        outer, inner = np.split(values, 2)
        _fill_maxq(self, learner, outer)
        for task, k, rows in _places(learner.inner_completion):
            learner.inner_completion[task][k] = self.tables.table(inner, task, k, rows).tolist()


class CompiledFlatQ(Compiled[FlatQ]):
    """Compiled `FlatQ`: see `Compiled`."""

    reference = FlatQ
    kind = "flat-q"

    @staticmethod
    def _ground(grounded: GroundGraph) -> GroundGraph:
        return flattened(grounded)

    def _fill(self, learner: FlatQ, values: NDArray[np.float64]) -> None:
        for task, k, rows in _places(learner.table):
            learner.table[task][k] = self.tables.table(values, task, k, rows).tolist()


def _fill_maxq(compiled: Compiled[L], learner: MaxQ, values: NDArray[np.float64]) -> None:
    for task, k, rows in _places(learner.completion):
        learner.completion[task][k] = compiled.tables.table(values, task, k, rows).tolist()
    for action, column in enumerate(compiled.tables.columns):
        learner.reward[action] = values[column.base : column.base + column.count].tolist()


def _places(table: Sequence[Sequence[Sequence[float]]]) -> list[tuple[int, int, int]]:
    """Return task, call and number of rows of every table."""
    return [(task, k, len(rows)) for task, calls in enumerate(table) for k, rows in enumerate(calls)]
