"""Snapshot and dynamics: what a field loses that takes the spheres as they lie, against the exact optimum.

A snapshot oracle searches over the robot's cells alone. The spheres stay where they are seen, and the field
has to read each as floor, as a block, or by whether it could roll just now. The exact planner searches over
the robot and the spheres together: a pushed sphere rolls, and a wedged one blocks. Both are distance fields
over the states that moves lead to; they differ in the moves alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planners.fields import Field, distance_field
from planners.proof import prove
from planners.search import Area, Replanner
from worlds import ACTIONS, Layout, MazeState, roll, step

_EVERYTHING: Final = tuple(range(len(ACTIONS)))


class Reading(StrEnum):
    """How spheres are read: as they move, or in one of three ways that let none of them move.

    As they stand: passable in the directions in which they could roll just now. As floor: always passable;
    as blocks: never.
    """

    MOVING = "moving"
    STANDING = "as they stand"
    FLOOR = "as floor"
    BLOCKS = "as blocks"


SNAPSHOTS: Final = (Reading.STANDING, Reading.FLOOR, Reading.BLOCKS)
"""The readings of a snapshot oracle."""


def move(layout: Layout, state: MazeState, action: int, reading: Reading) -> MazeState:
    """Return the state after one action, as a reading has it.

    Examples
    --------
    A sphere east of the robot has a cube behind it.

    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> state = MazeState(0, trigger=49, goal=31, cubes=frozenset({2}), spheres=frozenset({1}))
    >>> [move(maze, state, ACTIONS.index("East"), reading).robot for reading in Reading]
    [0, 0, 1, 0]
    """
    if reading is Reading.MOVING:
        return step(layout, state, action)[0]
    to = layout.passage(state.robot, action, doors_open=state.doors_open)
    if to < 0 or to in state.cubes:
        return state
    wedged = reading is Reading.STANDING and to in state.spheres and roll(layout, state, to, action) == to
    if wedged or (reading is Reading.BLOCKS and to in state.spheres):
        return state
    return replace(state, robot=to, doors_open=state.doors_open or to == state.trigger)


@dataclass(frozen=True, eq=False)
class Moves:
    """Every state that moves lead to from some states, and where each action leads.

    Parameters
    ----------
    states
        The states: the ones begun from first, in their order.
    places
        Each state's place in `states`.
    successors
        Place of the next state under every action, shape (states, actions).
    allowed
        Which action may be taken where, shape (states, actions).
    """

    states: tuple[MazeState, ...]
    places: dict[MazeState, int]
    successors: NDArray[np.int64]
    allowed: NDArray[np.bool_]

    def field(self, ends: Sequence[bool] | NDArray[np.bool_]) -> Field:
        """Return the steps from every state to the nearest in which `ends`, shape (states,), holds."""
        return distance_field(self.successors, np.asarray(ends, dtype=np.bool_), self.allowed)


def explore(layout: Layout, starts: Iterable[MazeState], reading: Reading, area: Area | None = None) -> Moves:
    r"""Return every state that moves lead to; an area limits them to what a task may do.

    The exact reading has a state for each placement of the spheres, which is for small worlds only: s
    spheres in n cells have n! / (s! (n - s)!) placements.

    Examples
    --------
    One sphere in a corridor of three cells: it can be pushed to the end, where it is wedged.

    >>> from worlds import parse_layout
    >>> maze = parse_layout("grid\n. . T1 : D1 G1\nstart 0,0\ntrigger T1\ngoal G1")
    >>> begin = MazeState(robot=0, trigger=2, goal=4, spheres=frozenset({1}))
    >>> [(state.robot, *state.spheres) for state in explore(maze, [begin], Reading.MOVING).states]
    [(0, 1), (1, 2), (0, 2)]
    """
    states = list(dict.fromkeys(starts))
    places = {state: place for place, state in enumerate(states)}
    successors: list[list[int]] = []
    allowed: list[list[bool]] = []
    for state in states:  # which grows as new ones are found
        may = _EVERYTHING if area is None else area.actions[state.doors_open][state.robot]
        after = [move(layout, state, action, reading) if action in may else state for action in _EVERYTHING]
        for found in after:
            if found not in places:
                places[found] = len(states)
                states.append(found)
        successors.append([places[found] for found in after])
        allowed.append([action in may for action in _EVERYTHING])
    return Moves(tuple(states), places, np.array(successors), np.array(allowed))


def area_field(layout: Layout, area: Area, belief: MazeState, reading: Reading) -> tuple[Moves, Field]:
    """Return the field of a task from everything that a belief can come to; the belief's place is 0."""
    moves = explore(layout, [belief], reading, area)
    return moves, moves.field([area.terminal[state.doors_open][state.robot] for state in moves.states])


class Fault(StrEnum):
    """How a snapshot's affordance fares in the world as it moves."""

    NONE = "optimal"
    LONGER = "longer than needed"
    TRAP = "leaves no way"
    BLIND = "sees no way"


@dataclass(frozen=True)
class Judgement:
    """A snapshot's affordance, held to the exact optimum.

    Parameters
    ----------
    snapshot
        The actions that the snapshot holds optimal; none where it sees no way.
    exact
        The set of optimal first actions.
    loss
        Steps that the first of `snapshot`, in the order of the actions, costs beyond the fewest; None
        where no way is left after it, or the snapshot has none.
    """

    snapshot: frozenset[int]
    exact: frozenset[int]
    loss: int | None

    @property
    def fault(self) -> Fault:
        """What is wrong with the affordance."""
        if not self.snapshot:
            return Fault.BLIND
        if self.loss is None:
            return Fault.TRAP
        return Fault.LONGER if self.loss else Fault.NONE


def judge_snapshot(oracle: Replanner, task: int, belief: MazeState, reading: Reading) -> Judgement | None:
    """Hold the snapshot's affordance for a belief to the exact planner; None where there is no way at all.

    Raises
    ------
    ValueError
        If the task has ended, so that there is nothing to afford.

    Examples
    --------
    On its way South the robot sees a sphere that the wall behind it would hold.

    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> oracle = Replanner(maze, ground(two_rooms(maze), maze_model(maze)))
    >>> task = oracle.grounded.place("GotoTrigger(T4)")
    >>> belief = MazeState(32, trigger=49, goal=31, cubes=frozenset({33, 48}), spheres=frozenset({40}))
    >>> for reading in SNAPSHOTS:
    ...     found = judge_snapshot(oracle, task, belief, reading)
    ...     print(f"{reading}: {found.fault}, {[ACTIONS[a] for a in found.snapshot]}, loses {found.loss}")
    as they stand: optimal, ['North'], loses 0
    as floor: longer than needed, ['South'], loses 1
    as blocks: optimal, ['North'], loses 0
    """
    plan = oracle.plan(task, belief)
    if plan is None:
        return None
    if not plan.actions:
        raise ValueError(f"{oracle.grounded.nodes[task].name} has ended here; ask where it runs")
    _, field = area_field(oracle.layout, oracle.area(task, belief), belief, reading)
    snapshot = frozenset(np.flatnonzero(field.optimal()[0]).tolist())
    if not snapshot:
        return Judgement(snapshot, plan.first_actions, None)
    first = min(snapshot)
    proof = None if first in plan.first_actions else prove(oracle, task, belief, first)
    return Judgement(snapshot, plan.first_actions, 0 if proof is None else proof.loss)
