"""How often a snapshot's affordance is optimal where spheres move: in episodes, and in every placement."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from comparisons.dynamic import Verdict
from planners import Replanner
from planners.dynamics import SNAPSHOTS, Fault, Judgement, Moves, Reading, explore, judge_snapshot
from planners.fields import UNREACHED, Field
from worlds import Cell, Layout, MazeState

NOWHERE = -1  # the trigger and the goal of a maze in which the doors are open and any cell may be the target

Choices = NDArray[np.bool_]


@dataclass(frozen=True)
class Shortfall:
    """A snapshot's affordance that is not optimal.

    Parameters
    ----------
    state
        What the robot knows, or where everything is.
    steps
        The fewest steps that end the task.
    task
        The task's place in the ground graph; None where it is to reach the state's goal.
    judgement
        What the snapshot holds optimal, and what is.
    """

    state: MazeState
    steps: int
    task: int | None = None
    judgement: Judgement | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Obstacles, then steps: what makes it hard to see through."""
        return len(self.state.cubes | self.state.spheres), self.steps


@dataclass
class SnapshotTally:
    """What one reading of the spheres came to, over beliefs that have a way.

    Parameters
    ----------
    faults
        Affordances by what is wrong with them.
    alike
        Those in which all actions that the snapshot holds optimal are the optimal ones.
    lost, most
        Steps that they cost beyond the fewest, in all and at most, where a way is left.
    smallest
        Of the affordances that are not optimal, one with the fewest obstacles and steps.
    """

    faults: Counter[Fault] = field(default_factory=Counter)
    alike: int = 0
    lost: int = 0
    most: int = 0
    smallest: Shortfall | None = None

    @property
    def asked(self) -> int:
        """Number of affordances."""
        return self.faults.total()

    def add(self, judgement: Judgement) -> None:
        """Count one affordance."""
        self.faults[judgement.fault] += 1
        self.alike += judgement.snapshot == judgement.exact
        self.lost += judgement.loss or 0
        self.most = max(self.most, judgement.loss or 0)

    def count(self, held: Choices, exact: Field, at: NDArray[np.int64]) -> int | None:
        """Count the affordances of many states at once; return where the shortest one falls short, if any.

        Parameters
        ----------
        held
            The actions that the snapshot holds optimal, shape (beliefs, actions).
        exact
            The exact field; a goal can be reached from every belief.
        at
            The beliefs' places in the exact field, shape (beliefs,).
        """
        first, sees = held.argmax(axis=1), held.any(axis=1)
        before, after = exact.distance[at], exact.distance[exact.successors[at, first]]
        trapped = sees & (after == UNREACHED)
        loss = np.where(sees & ~trapped, 1 + after - before, 0)
        wrong = ~sees | trapped | (loss > 0)
        found = {Fault.NONE: ~wrong, Fault.LONGER: loss > 0, Fault.TRAP: trapped, Fault.BLIND: ~sees}
        self.faults.update({fault: int(mask.sum()) for fault, mask in found.items()})
        self.alike += int((held == exact.optimal()[at]).all(axis=1).sum())
        self.lost += int(loss.sum())
        self.most = max(self.most, int(loss.max(initial=0)))
        return int(at[wrong][before[wrong].argmin()]) if wrong.any() else None

    def show(self, found: Shortfall) -> None:
        """Take an affordance that is not optimal for the smallest, if it is."""
        if self.smallest is None or found.size < self.smallest.size:
            self.smallest = found


def judge_all(oracle: Replanner, verdicts: Iterable[Verdict]) -> dict[Reading, SnapshotTally]:
    """Hold every reading of a snapshot to the exact optimum, where the robot knows of a sphere.

    Where the robot knows of no sphere the snapshot is exact, and nothing is asked.
    """
    tallies = {reading: SnapshotTally() for reading in SNAPSHOTS}
    for verdict in verdicts:
        met = verdict.encounter
        if not met.belief.spheres:
            continue
        for reading, tally in tallies.items():
            judgement = judge_snapshot(oracle, met.task, met.belief, reading)
            assert judgement is not None, "what was proved has a way"
            tally.add(judgement)
            if judgement.fault is not Fault.NONE:
                steps = len(verdict.replanned.best.actions)
                tally.show(Shortfall(met.belief, steps, met.task, judgement))
    return tallies


def open_room(rows: int, cols: int) -> Layout:
    """Return a room without walls, doors or marks, in which everything can be tried out."""
    nothing = frozenset[Cell]()
    return Layout("room", rows, cols, nothing, frozenset(), frozenset(), {}, {}, {}, Cell(0, 0), "", "")


@dataclass(frozen=True)
class Exhaustive:
    """Every placement in a small maze.

    Parameters
    ----------
    beliefs
        Placements of robot, target, cubes and spheres in which the robot has somewhere to go.
    hopeless
        Those that have no way, by the exact planner.
    fooled
        Those of `hopeless` in which a reading sees a way nevertheless.
    tallies
        What each reading came to on the others.
    """

    beliefs: int
    hopeless: int
    fooled: dict[Reading, int]
    tallies: dict[Reading, SnapshotTally]


def exhaustive(layout: Layout, *, cubes: int, spheres: int) -> Exhaustive:
    """Try every placement of robot, target, cubes and spheres, doors open.

    No two share a cell, but that a sphere may lie on the target. Robot and spheres are solved together, all
    placements at once: for small mazes only.

    Examples
    --------
    One sphere in a room of three by three: 9 x 8 places of sphere and robot, and 8 targets for each.

    >>> found = exhaustive(open_room(3, 3), cubes=0, spheres=1)
    >>> found.beliefs, found.hopeless
    (576, 32)
    >>> for reading, tally in found.tallies.items():
    ...     print(f"{reading}: {tally.faults[Fault.NONE]} of {tally.asked} optimal")
    as they stand: 528 of 544 optimal
    as floor: 504 of 544 optimal
    as blocks: 504 of 544 optimal
    """
    starts = list(_placements(layout, cubes, spheres))
    exact = explore(layout, starts, Reading.MOVING)
    frozen = {reading: explore(layout, starts, reading) for reading in SNAPSHOTS}
    tallies = {reading: SnapshotTally() for reading in SNAPSHOTS}
    fooled = dict.fromkeys(SNAPSHOTS, 0)
    beliefs = hopeless = 0
    for target in _free(layout):
        counted = np.array([state.robot != target and target not in state.cubes for state in starts])
        field = exact.field(_at(exact, target))
        ways = counted & (field.distance[: len(starts)] != UNREACHED)
        beliefs += int(counted.sum())
        hopeless += int((counted & ~ways).sum())
        for reading, moves in frozen.items():
            held = moves.field(_at(moves, target)).optimal()[: len(starts)]
            fooled[reading] += int((counted & ~ways & held.any(axis=1)).sum())
            at = np.flatnonzero(ways)
            worst = tallies[reading].count(held[at], field, at)
            if worst is not None:
                tallies[reading].show(
                    Shortfall(replace(starts[worst], goal=target), int(field.distance[worst]))
                )
    return Exhaustive(beliefs, hopeless, fooled, tallies)


def _placements(layout: Layout, cubes: int, spheres: int) -> Iterator[MazeState]:
    free = frozenset(_free(layout))
    for blocks in combinations(sorted(free), cubes):
        for balls in combinations(sorted(free.difference(blocks)), spheres):
            for robot in sorted(free.difference(blocks, balls)):
                yield MazeState(robot, NOWHERE, NOWHERE, True, frozenset(blocks), frozenset(balls))


def _free(layout: Layout) -> list[int]:
    return [layout.number(cell) for cell in layout.cells if cell not in layout.solid]


def _at(moves: Moves, target: int) -> NDArray[np.bool_]:
    return np.array([state.robot == target for state in moves.states])
