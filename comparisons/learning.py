"""Subtask learning (section 6.2): MAXQ-0 on a (trigger, goal) pair, held to the oracle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from hierarchy import GroundGraph
from planners import UNREACHED, MaxQ, flat_field, task_field
from worlds import Cell, Layout

EPISODES: Final = 1200
"""Episodes of each phase of learning, as in figure 12."""

Table = list[list[int | None]]
"""Steps to a subgoal, row by row of a room; None where the greedy policy does not arrive."""


@dataclass(frozen=True)
class Curve:
    """One panel of figure 12.

    Parameters
    ----------
    start
        The grid that `greedy` is measured from.
    optimum
        The oracle's steps from there.
    training
        Steps of each episode of learning.
    greedy
        Steps of the greedy policy from `start` after each episode; None where it does not arrive.
    """

    start: Cell
    optimum: int
    training: tuple[int, ...]
    greedy: tuple[int | None, ...]


class PairLearner:
    """Learns one (trigger, goal) pair, the subtasks first and the root last.

    GotoTrigger and each GotoDoor learn from random grids of their room. GotoGoal learns from D1 and then
    from D2, as figure 12 (d) and (e) do, and at last from random grids of its room: from the doors alone
    the far grids of the room are visited too seldom for figure 13 (d) to come out.

    Parameters
    ----------
    layout, grounded
        The maze and its ground graph.
    trigger, goal
        Names of the pair's marks.
    seed
        Every pair has a random stream of its own.
    """

    def __init__(self, layout: Layout, grounded: GroundGraph, trigger: str, goal: str, seed: int) -> None:
        self.layout = layout
        self.grounded = grounded
        self.trigger = trigger
        self.goal = goal
        pair = (list(layout.triggers).index(trigger), list(layout.goals).index(goal))
        self.learner = MaxQ(grounded, (seed, *pair))
        self.first = layout.room(layout.start)
        self.second = frozenset(layout.cells) - layout.solid - self.first

    def state(self, cell: Cell, doors: str) -> int:
        """Return the number of the pair's state with the robot in a cell."""
        marks = self.layout.triggers[self.trigger], self.layout.goals[self.goal]
        return self.grounded.model.index.number((cell, *marks, doors))

    def learn(self, *, measure: bool = False) -> dict[str, Curve]:
        """Carry out every phase of learning; return figure 12's curves if `measure`."""
        layout = self.layout
        trigger, goal = layout.triggers[self.trigger], layout.goals[self.goal]
        starts_a = self._states(self.first - {trigger}, "closed")
        phases: list[tuple[str, str, list[int], Cell, str]] = [
            (f"GotoTrigger({self.trigger})", "", starts_a, layout.start, "closed")
        ]
        doors = layout.thresholds
        phases += [(f"GotoDoor({d})", "", self._states(self.first, "open"), trigger, "open") for d in doors]
        to_goal = f"GotoGoal({self.goal})"
        phases += [
            (to_goal, f" from {d}", [self.state(cell, "open")], cell, "open") for d, cell in doors.items()
        ]
        curves = {}
        for task, suffix, starts, start, state in phases:
            place, at = self.grounded.place(task), self.state(start, state)
            greedy: list[int | None] = []
            after_each = self._measure(place, at, greedy) if measure else None
            training = self.learner.train(place, starts, EPISODES, after_each)
            if measure:
                optimum = int(task_field(self.grounded.model, self.grounded.nodes[place]).distance[at])
                curves[task + suffix] = Curve(start, optimum, tuple(training), tuple(greedy))
        self.learner.train(self.grounded.place(to_goal), self._states(self.second - {goal}, "open"), EPISODES)
        self.learner.train(self.grounded.root, starts_a, EPISODES)
        return curves

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

    def wrong_grids(self) -> int:
        """Count grids from which a subtask's greedy policy takes other than the oracle's steps."""
        wrong = 0
        for task in self.subtasks():
            place, doors = self.grounded.place(task), self._doors(task)
            distance = task_field(self.grounded.model, self.grounded.nodes[place]).distance
            for cell in self.room(task):
                at = self.state(cell, doors)
                if distance[at] != UNREACHED:
                    wrong += self.learner.greedy_steps(place, at) != int(distance[at])
        return wrong

    def wrong_starts(self) -> int:
        """Count starts from which the whole task takes other than the fewest steps possible."""
        root = self.grounded.root
        best = flat_field(self.grounded.model, self.grounded.nodes[root].terminal).distance
        starts = self._states(self.first - {self.layout.triggers[self.trigger]}, "closed")
        return sum(self.learner.greedy_steps(root, at) != int(best[at]) for at in starts)

    def _states(self, cells: frozenset[Cell], doors: str) -> list[int]:
        return [self.state(cell, doors) for cell in sorted(cells)]

    def room(self, task: str) -> frozenset[Cell]:
        """Return the room that a subtask works in."""
        return self.second if task.startswith("GotoGoal") else self.first

    def _doors(self, task: str) -> str:
        return "closed" if task.startswith("GotoTrigger") else "open"

    def _measure(self, place: int, at: int, into: list[int | None]) -> Callable[[], None]:
        return lambda: into.append(self.learner.greedy_steps(place, at, limit=len(self.layout.cells)))
