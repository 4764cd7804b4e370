"""How far each degree of optimality falls short of the next, where, by which task's doing, and at what cost.

Recursive <= hierarchical <= global, state by state: a task that looks no further than its own end loses
against the best that the hierarchy can express, and that loses against the best that the world allows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

from hierarchy import GroundGraph
from hierarchy.exits import chain, surely_ends
from planners.recursive import Solution, recursive_optimum
from planners.smdp import TIE, Mask, Optimum
from planners.stack import StackProblem, StackSolution, flat_optimum, hierarchical_optimum

Degree = Literal["hierarchical", "global"]


@dataclass(frozen=True)
class Gap:
    """How far a hierarchy falls short of the global optimum over its start states.

    Parameters
    ----------
    starts
        Number of start states.
    short
        Those from which the recursively optimal policy earns less than it could.
    worst, total
        The most reward lost from one start, and the sum over all: where every step costs 1, steps. Whole
        numbers where rewards are; inf if the policy may never end.
    """

    starts: int
    short: int
    worst: float
    total: float


def gap(grounded: GroundGraph, solution: Solution) -> Gap:
    """Compare a recursively optimal policy of the root with the global optimum.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> single = ground(two_rooms(maze, one_door_task=True), maze_model(maze))
    >>> gap(single, recursive_optimum(single))
    Gap(starts=496, short=31, worst=2, total=62)
    """
    model, root = grounded.model, grounded.root
    best = flat_optimum(model, grounded.nodes[root].terminal, solution.gamma).value
    lost = _lost(best[model.starts], solution.value[root, model.starts])
    return Gap(lost.size, int((lost > 0).sum()), _whole(lost.max(initial=0.0)), _whole(lost.sum()))


@dataclass(frozen=True)
class Shortfall:
    """A state from which the recursively optimal policy falls short: a counter-example.

    Parameters
    ----------
    start
        The state's number.
    steps
        Expected primitive steps of the recursively optimal policy.
    recursive, hierarchical, best
        Value of the root for each degree of optimality; `best` is the global one.
    short_of
        The next degree: the one against which the first losing choice loses.
    task, state
        The task responsible, and where it makes that choice. Among all paths of the policy it is the choice
        with the fewest choices before it.
    chosen, better
        What it chooses there, and what the next degree would: children's names.
    cost
        What that choice loses by itself.
    by_choice
        What each task loses by choosing with no thought of what comes after it, as expected over all paths:
        adds up to hierarchical - recursive.
    by_hierarchy
        What each task loses because the hierarchy forbids it better: adds up to best - hierarchical.
    """

    start: int
    steps: float
    recursive: float
    hierarchical: float
    best: float
    short_of: Degree
    task: str
    state: int
    chosen: str
    better: str
    cost: float
    by_choice: dict[str, float]
    by_hierarchy: dict[str, float]

    @property
    def lost(self) -> float:
        """What the recursively optimal policy loses against the global optimum."""
        return _whole(self.best - self.recursive)


@dataclass(frozen=True, eq=False)
class GapReport:
    """Every state looked at that falls short, smallest counter-example first.

    Parameters
    ----------
    grounded
        The ground graph.
    starts
        Number of states looked at: start states, unless others were asked for.
    shortfalls
        All of those that fall short, by expected steps, then by number.
    among
        What was looked at: "start states", or "states" that were asked for.
    """

    grounded: GroundGraph
    starts: int
    shortfalls: tuple[Shortfall, ...]
    among: str = "start states"

    @property
    def by_task(self) -> dict[str, tuple[int, float]]:
        """How often each task is responsible, and what is lost in all then."""
        found: dict[str, tuple[int, float]] = {}
        for one in self.shortfalls:
            count, lost = found.get(one.task, (0, 0.0))
            found[one.task] = count + 1, _whole(lost + one.lost)
        return found

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        yield f"{len(self.shortfalls)} of {self.starts} {self.among} fall short of the global optimum"
        for task, (count, lost) in self.by_task.items():
            yield f"{task} is responsible in {count}, which lose {lost:g} in all"
        if self.shortfalls:
            yield f"smallest: {self.explain(self.shortfalls[0])}"

    def explain(self, one: Shortfall) -> str:
        """Return one of the shortfalls in words, on four lines."""
        upper = f"{one.hierarchical:g} hierarchically, {one.best:g} globally"
        better = f"the {one.short_of} optimum {one.better}"
        return (
            f"from {self.describe(one.start)}\n"
            f"  {one.recursive:g} recursively, {upper}\n"
            f"in {self.describe(one.state)}\n"
            f"  {one.task} chooses {one.chosen}, {better}: that costs {one.cost:g} of {one.lost:g}"
        )

    def describe(self, state: int) -> str:
        """Return a state in words."""
        return self.grounded.model.index.words(state)


def gap_report(grounded: GroundGraph, gamma: float = 1.0, states: Mask | None = None) -> GapReport:
    """Solve a ground graph to all three degrees and explain each state that falls short.

    Losses are told apart exactly. A choice loses what the next degree's value drops by when it is made; over
    all paths of a policy these drops add up to what the policy loses (Kakade and Langford, 2002, lemma 6.1),
    so that each task's share is known.

    Parameters
    ----------
    grounded
        The ground graph.
    gamma
        Discount factor for one primitive step.
    states
        From which states to look, a mask of shape (states,); the start states unless given.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> print(gap_report(ground(two_rooms(maze, one_door_task=True), maze_model(maze))))
    31 of 496 start states fall short of the global optimum
    GotoDoor is responsible in 31, which lose 62 in all
    smallest: from robot = 3,2, trigger = T3, goal = G1, doors = closed
      -9 recursively, -7 hierarchically, -7 globally
    in robot = 4,2, trigger = T3, goal = G1, doors = open
      GotoDoor chooses South, the hierarchical optimum North: that costs 2 of 2
    """
    recursive, hierarchical = recursive_optimum(grounded, gamma), hierarchical_optimum(grounded, gamma)
    flat = flat_optimum(grounded.model, grounded.nodes[grounded.root].terminal, gamma)
    explained = _Explained(recursive, hierarchical, flat)
    starts = np.flatnonzero(grounded.model.starts if states is None else states)
    lost = _lost(flat.value[starts], recursive.value[grounded.root, starts])
    found = [explained.shortfall(int(start)) for start in starts[lost > 0]]
    found.sort(key=lambda one: (one.steps, one.start))
    among = "start states" if states is None else "states"
    return GapReport(grounded, starts.size, tuple(found), among)


class _Losses:
    """What every choice of a policy over stacks loses against a yardstick, and each task's share."""

    def __init__(
        self, problem: StackProblem, policy: NDArray[np.int64], yardstick: NDArray[np.float64]
    ) -> None:
        step = chain(policy, [exits for _, exits in problem.choices])
        self.kernel = step.kernel
        self.sure = surely_ends(step.kernel, policy >= 0, problem.terminal)
        inside = np.flatnonzero(self.sure)
        finite = np.where(np.isfinite(yardstick), yardstick, 0.0)
        drop = finite - step.value - step.kernel @ finite
        slack = TIE * max(1.0, float(np.abs(finite).max()))
        self.drop = np.where(self.sure & (np.abs(drop) > slack), drop, 0.0)
        size = problem.grounded.model.index.size
        top = np.repeat(problem.tops, size)
        self.tasks = sorted(set(problem.tops))
        own = np.stack([np.where(top == task, self.drop, 0.0) for task in self.tasks], axis=1)
        if inside.size:
            here = self.kernel[inside][:, inside]
            own[inside] = splu(csc_array(eye_array(inside.size) - here)).solve(own[inside])
        self.shares = own[:size]

    def first(self, start: int) -> int | None:
        """Return the joint state of the losing choice with the fewest choices before it, if there is one."""
        frontier, seen = np.array([start]), {start}
        while frontier.size:
            losing = frontier[self.drop[frontier] > 0]
            if losing.size:
                return int(losing[0])
            after = np.unique(self.kernel[frontier].indices).tolist()
            frontier = np.array([joint for joint in after if joint not in seen], dtype=np.int64)
            seen.update(after)
        return None


class _Explained:
    """The three solutions, and what the policies of the lower two lose against the next."""

    def __init__(self, recursive: Solution, hierarchical: StackSolution, flat: Optimum) -> None:
        self.recursive, self.hierarchical, self.flat = recursive, hierarchical, flat
        problem = hierarchical.problem
        self.policy = problem.spread(recursive.choice)
        self.best = hierarchical.choice.ravel()
        self.by_choice = _Losses(problem, self.policy, hierarchical.value.ravel())
        everywhere = np.tile(flat.value, len(problem.stacks))
        self.by_hierarchy = _Losses(problem, self.best, everywhere)

    def shortfall(self, start: int) -> Shortfall:
        """Explain one start state."""
        problem, grounded = self.hierarchical.problem, self.recursive.grounded
        size = grounded.model.index.size
        value, attainable = self.recursive.value[grounded.root, start], self.hierarchical.value[0, start]
        degree: Degree = "hierarchical" if _lost(attainable, value) > 0 else "global"
        losses, policy = (
            (self.by_choice, self.policy) if degree == "hierarchical" else (self.by_hierarchy, self.best)
        )
        joint = losses.first(start)
        # A policy that may never end loses everything, and no single choice of it is to blame but the root's.
        cost = float("inf") if joint is None else _whole(losses.drop[joint])
        stack, state = divmod(start if joint is None else joint, size)
        task = grounded.nodes[problem.tops[stack]]
        if degree == "hierarchical":
            better = _child(grounded, problem.tops[stack], int(self.best[stack * size + state]))
        else:
            better = grounded.nodes[int(self.flat.choice[state])].name
        return Shortfall(
            start=start,
            steps=float(self.recursive.steps[grounded.root, start]),
            recursive=_whole(value),
            hierarchical=_whole(attainable),
            best=_whole(self.flat.value[start]),
            short_of=degree,
            task=task.name,
            state=state,
            chosen=_child(grounded, problem.tops[stack], int(policy[stack * size + state])),
            better=better,
            cost=cost,
            by_choice=self._shares(self.by_choice, start),
            by_hierarchy=self._shares(self.by_hierarchy, start),
        )

    def _shares(self, losses: _Losses, start: int) -> dict[str, float]:
        nodes = self.recursive.grounded.nodes
        shares = zip(losses.tasks, losses.shares[start].tolist(), strict=True)
        return {nodes[task].name: _whole(share) for task, share in shares if abs(share) > TIE}


def _child(grounded: GroundGraph, task: int, call: int) -> str:
    return "nothing" if call < 0 else grounded.nodes[grounded.nodes[task].calls[call].child].name


def _lost(best: float | NDArray[np.float64], value: float | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what is lost, and 0 where that is rounding, where neither ends, or where more is earned."""
    ends = np.isfinite(best)
    most = np.where(ends, best, 0.0)
    lost = most - np.where(ends, value, 0.0)
    return np.where(lost <= TIE * np.maximum(1.0, np.abs(most)), 0.0, lost)


def _whole(number: float) -> float:
    """Return a number as an int where rounding alone keeps it from one."""
    if np.isfinite(number) and abs(number - round(number)) <= TIE * max(1.0, abs(number)):
        return round(number)
    return float(number)
