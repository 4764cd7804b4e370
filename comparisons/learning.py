"""Subtask learning (section 6.2): MAXQ-0 on a (trigger, goal) pair, held to the oracle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundGraph
from planners import MaxQ, flat_field, task_field
from planners.compiled import CompiledMaxQ
from worlds import Cell, Layout

EPISODES: Final = 1200
"""Episodes of each phase of a subtask's learning, as in figure 12."""
ROOT_EPISODES: Final = 400
"""Episodes of the root: it has two doors to choose between, and its subtasks are learnt by then."""

Table = list[list[int | None]]
"""Steps to a subgoal, row by row of a room; None where the greedy policy does not arrive."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One panel of figure 12, of all runs.

    Parameters
    ----------
    start
        The grid that `greedy` is measured from.
    optimum
        The oracle's steps from there.
    training
        Steps of each episode of learning, shape (runs, episodes).
    greedy
        Steps of the greedy policy from `start` after each episode, shape (runs, episodes); -1 where it does
        not arrive.
    """

    start: Cell
    optimum: int
    training: NDArray[np.int32]
    greedy: NDArray[np.int64]


class PairLearner:
    """Learns one (trigger, goal) pair, the subtasks first and the root last.

    Each subtask learns from random grids of its room. If figure 12's curves are asked for, it learns
    before that from the grid that the figure measures it from: GotoTrigger from the start, GotoDoor from
    the trigger, GotoGoal from D1 and then from D2. From one grid alone, those far off the way are visited
    too seldom for figure 13 to come out.

    Parameters
    ----------
    layout, grounded
        The maze and its ground graph.
    trigger, goal
        Names of the pair's marks.
    seed
        Every pair has a random stream of its own.
    runs
        How many runs learn at once: with `seed`, with the seed after it, and so on.
    """

    def __init__(
        self, layout: Layout, grounded: GroundGraph, trigger: str, goal: str, *, seed: int, runs: int = 1
    ) -> None:
        self.layout = layout
        self.grounded = grounded
        self.trigger = trigger
        self.goal = goal
        pair = (list(layout.triggers).index(trigger), list(layout.goals).index(goal))
        self.runs = CompiledMaxQ(grounded, [(seed + run, *pair) for run in range(runs)])
        self.first = layout.room(layout.start)
        self.second = frozenset(layout.cells) - layout.solid - self.first

    @cached_property
    def learner(self) -> MaxQ:
        """The first run, as a learner that can be read and asked."""
        return self.runs.run(0)

    def state(self, cell: Cell, doors: str) -> int:
        """Return the number of the pair's state with the robot in a cell."""
        marks = self.layout.triggers[self.trigger], self.layout.goals[self.goal]
        return self.grounded.model.index.number((cell, *marks, doors))

    def learn(self, *, curves: bool = False) -> dict[str, Curve]:
        """Carry out every phase of learning; return figure 12's curves if they are asked for."""
        found = self._learn_curves() if curves else {}
        for phase in self.phases():
            self.runs.train(*phase)
        self.__dict__.pop("learner", None)  # the first run has learnt more since it was last asked for
        return found

    def phases(self) -> list[tuple[int, list[int], int]]:
        """Return the task, the starts and the episodes of each phase of learning, in order."""
        parts = [(self.grounded.place(task), self._starts(task), EPISODES) for task in self.subtasks()]
        return [*parts, (self.grounded.root, self._starts(self.subtasks()[0]), ROOT_EPISODES)]

    def step_table(self, task: str) -> Table:
        """Return the greedy policy's steps from every grid of a subtask's room (figure 13)."""
        place, room = self.grounded.place(task), self.room(task)
        rows = sorted({cell.row for cell in room})
        cols = sorted({cell.col for cell in room})
        doors = self._doors(task)
        return [
            [
                self.learner.greedy_steps(place, self.state(Cell(r, c), doors))
                if Cell(r, c) in room
                else None
                for c in cols
            ]
            for r in rows
        ]

    def subtasks(self) -> tuple[str, ...]:
        """Return the pair's ground subtasks, in order."""
        doors = (f"GotoDoor({name})" for name in self.layout.thresholds)
        return (f"GotoTrigger({self.trigger})", *doors, f"GotoGoal({self.goal})")

    def wrong_grids(self) -> NDArray[np.int64]:
        """Count grids from which a subtask's greedy policy takes other than the oracle's steps, by run."""
        wrong = np.zeros(len(self.runs.seeds), dtype=np.int64)
        for task in self.subtasks():
            place = self.grounded.place(task)
            distance = task_field(self.grounded.model, self.grounded.nodes[place]).distance
            starts = self._starts(task)
            wrong += (self.runs.greedy_steps(place, starts) != distance[starts]).sum(axis=1)
        return wrong

    def wrong_starts(self) -> NDArray[np.int64]:
        """Count starts from which the whole task takes other than the fewest steps possible, by run."""
        root = self.grounded.root
        best = flat_field(self.grounded.model, self.grounded.nodes[root].terminal).distance
        starts = self._starts(f"GotoTrigger({self.trigger})")
        wrong: NDArray[np.int64] = (self.runs.greedy_steps(root, starts) != best[starts]).sum(axis=1)
        return wrong

    def room(self, task: str) -> frozenset[Cell]:
        """Return the room that a subtask works in."""
        return self.second if task.startswith("GotoGoal") else self.first

    def _learn_curves(self) -> dict[str, Curve]:
        """Learn each subtask from the grid that figure 12 measures it from."""
        layout = self.layout
        trigger, doors = layout.triggers[self.trigger], layout.thresholds
        begin = layout.start if layout.start != trigger else min(self.first - {trigger})
        to_trigger, *to_doors, to_goal = self.subtasks()
        phases = [(to_trigger, "", begin), *((to_door, "", trigger) for to_door in to_doors)]
        phases += [(to_goal, f" from {name}", cell) for name, cell in doors.items()]
        return {task + suffix: self._learn_from(task, start) for task, suffix, start in phases}

    def _learn_from(self, task: str, start: Cell) -> Curve:
        """Learn a subtask from one grid, taking the greedy policies' steps after each episode."""
        place, at = self.grounded.place(task), self.state(start, self._doors(task))
        greedy: list[NDArray[np.int64]] = []
        far = len(self.layout.cells)
        training = self.runs.train(
            place, [at], EPISODES, lambda: greedy.append(self.runs.greedy_steps(place, [at], limit=far)[:, 0])
        )
        optimum = int(task_field(self.grounded.model, self.grounded.nodes[place]).distance[at])
        return Curve(start, optimum, training, np.stack(greedy, axis=1))

    def _starts(self, task: str) -> list[int]:
        """Return the states in which a subtask runs and can end, grid by grid of its room."""
        place, doors = self.grounded.place(task), self._doors(task)
        distance = task_field(self.grounded.model, self.grounded.nodes[place]).distance
        states = (self.state(cell, doors) for cell in sorted(self.room(task)))
        return [at for at in states if distance[at] > 0]

    def _doors(self, task: str) -> str:
        return "closed" if task.startswith("GotoTrigger") else "open"
