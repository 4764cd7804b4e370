"""Affordances: the first action of the current subtask's strategy when an obstacle is seen (equation 1).

Two strategies answer. `LocalRule` is the paper's (table 3): values learnt without obstacles, and beside
a cube the next best action. `Replanning` searches anew under everything the robot knows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

from hierarchy import GroundGraph
from planners.maxq import MaxQ
from planners.search import Replanner
from planners.task_values import TaskValues
from worlds import DELTAS, Kind, Layout, MazeState, state_number


@dataclass(frozen=True)
class Affordance:
    """What an obstacle affords in a subtask.

    Parameters
    ----------
    shape
        What the obstacle is believed to be.
    on_route
        Whether it stands on the route that was planned before it was seen. One that does not needs no
        care (table 3), and affords nothing.
    action
        The action, by its place in `worlds.ACTIONS`; None off the route, or where no action is left.
    """

    shape: Kind
    on_route: bool
    action: int | None


class Strategy(Protocol):
    """What decides for the robot. Tasks are places in the ground graph, obstacles are cells."""

    def choose(self, belief: MazeState) -> int | None:
        """Return the root's next subtask, or None if none has a way left."""

    def route(self, task: int, belief: MazeState) -> tuple[int, ...] | None:
        """Return the planned primitive actions of a subtask, or None if it has no way left."""

    def affordance(self, task: int, obstacle: int, belief: MazeState) -> Affordance:
        """Return what a known obstacle affords in a subtask (equation 1)."""


class LocalRule:
    """The paper's rule: static values, and beside a cube the next best action (table 3).

    Examples
    --------
    Table 4's first row: the cube C1 at 5,0, met at 4,0 on the way to T4.

    >>> from hierarchy import ground, two_rooms
    >>> from worlds import ACTIONS, load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> learner = MaxQ(ground(two_rooms(maze), maze_model(maze)), seed=(0,))
    >>> goto = learner.grounded.place("GotoTrigger(T4)")
    >>> state = MazeState(robot=32, trigger=49, goal=31, cubes=frozenset({40}))
    >>> start = state_number(maze, learner.grounded.model.index, state)
    >>> _ = learner.train(goto, [start], episodes=300)
    >>> ACTIONS[LocalRule(maze, learner).affordance(goto, 40, state).action]
    'East'
    """

    def __init__(self, layout: Layout, learner: TaskValues) -> None:
        self.layout = layout
        self.learner = learner

    def choose(self, belief: MazeState) -> int | None:
        """Return the root's best subtask by the learnt values, obstacles left out of account."""
        learner, root = self.learner, self.learner.grounded.root
        state = self._state(belief)
        return learner.grounded.nodes[root].calls[learner.greedy(root, state)].child

    def route(self, task: int, belief: MazeState) -> tuple[int, ...] | None:
        """Return the learnt route, its first action the best that no known cube stops at once."""
        first = self._best(task, belief, None)
        if first is None:
            return None
        learner, state = self.learner, self._state(belief)
        after = int(learner.grounded.model.successors[state, first])
        return (first, *(action for _, action in self._learnt(task, after)))

    def affordance(self, task: int, obstacle: int, belief: MazeState) -> Affordance:
        """Apply table 3 to a known obstacle."""
        learnt = self._learnt(task, self._state(belief))
        on_route = obstacle in _cells(self.layout, belief.robot, tuple(action for _, action in learnt))
        if obstacle in belief.spheres:
            return Affordance("sphere", on_route, learnt[0][1] if on_route else None)
        return Affordance("cube", on_route, self._best(task, belief, learnt[0][1]) if on_route else None)

    def _learnt(self, task: int, state: int) -> list[tuple[int, int]]:
        route = self.learner.greedy_route(task, state)
        if route is None:
            raise RuntimeError("the learnt values lead nowhere; train for more episodes")
        return route

    def _best(self, task: int, belief: MazeState, refused: int | None) -> int | None:
        """Return the best action by the learnt values, past one refused and those that would not move.

        Running into a wall or a known cube is an action as well, and its value is one step below the
        best; but it is no way of avoiding anything.
        """
        learner, state = self.learner, self._state(belief)
        calls = learner.grounded.nodes[task].calls
        ways = (self.layout.passage(belief.robot, call.child, doors_open=belief.doors_open) for call in calls)
        blocked = [to < 0 or to in belief.cubes for to in ways]
        choices = learner.choices(task, state)
        open_to = [k for k in choices if calls[k].child != refused and not blocked[k]]
        if not open_to:
            return None
        values = [learner.q(task, state, k) for k in open_to]
        least = max(values) - learner.tie
        return next(calls[k].child for k, value in zip(open_to, values, strict=True) if value >= least)

    def _state(self, belief: MazeState) -> int:
        return state_number(self.layout, self.learner.grounded.model.index, belief)


class Replanning:
    """The optimal strategy of the current subtask under everything that the robot knows.

    Parameters
    ----------
    replanner
        The search that plans each subtask.
    learner
        Gives the root's completion values, by which it chooses among subtasks.
    """

    def __init__(self, replanner: Replanner, learner: MaxQ) -> None:
        self.replanner = replanner
        self.learner = learner

    @property
    def grounded(self) -> GroundGraph:
        """The ground graph that is planned on."""
        return self.replanner.grounded

    def choose(self, belief: MazeState) -> int | None:
        """Return the subtask with the greatest value: its replanned length, and its learnt completion."""
        root, layout = self.grounded.root, self.replanner.layout
        state = state_number(layout, self.grounded.model.index, belief)
        best, chosen = float("-inf"), None
        for k in self.learner.choices(root, state):
            child = self.grounded.nodes[root].calls[k].child
            plan = self.replanner.plan(child, belief)
            value = float("-inf") if plan is None else self.learner.c(root, state, k) - len(plan.actions)
            if value > best + self.learner.tie:
                best, chosen = value, child
        return chosen

    def route(self, task: int, belief: MazeState) -> tuple[int, ...] | None:
        """Return a shortest plan, the first in the order of the actions."""
        plan = self.replanner.plan(task, belief)
        return None if plan is None else plan.actions

    def affordance(self, task: int, obstacle: int, belief: MazeState) -> Affordance:
        """Return the first action of the replanned strategy, if the obstacle stands on the earlier route."""
        shape: Kind = "sphere" if obstacle in belief.spheres else "cube"
        spheres, cubes = belief.spheres - {obstacle}, belief.cubes - {obstacle}
        before = self.route(task, replace(belief, spheres=spheres, cubes=cubes))
        if before is None or obstacle not in _cells(self.replanner.layout, belief.robot, before):
            return Affordance(shape, on_route=False, action=None)
        after = self.route(task, belief)
        return Affordance(shape, on_route=True, action=None if after is None else after[0])


def _cells(layout: Layout, robot: int, actions: tuple[int, ...]) -> set[int]:
    """Return the cells that a planned route enters."""
    cell = layout.cells[robot]
    entered = set()
    for action in actions:
        row, col = DELTAS[action]
        cell = cell._replace(row=cell.row + row, col=cell.col + col)
        entered.add(layout.number(cell))
    return entered
