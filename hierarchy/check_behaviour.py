"""What is wrong with a task graph in its world: where it runs, what it can do there, and whether it ends."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hierarchy.abstraction_scope import course
from hierarchy.check_reach import Origins
from hierarchy.finding import Finding
from hierarchy.grounding import GroundCall, GroundGraph, GroundTask

Mask = NDArray[np.bool_]


def behaviour_findings(grounded: GroundGraph) -> Iterator[Finding]:
    """Yield every fault that shows in some state that the world may come to.

    A task counts as called wherever a caller of its may call it and the world may be, the root wherever an
    episode may begin.

    Examples
    --------
    >>> from hierarchy import TaskGraph, ground
    >>> from worlds import StateIndex, TransitionModel, Variable
    >>> x, right = StateIndex((Variable("x", (0, 1, 2, 3)),)), np.array([[1], [2], [3], [3]])
    >>> model = TransitionModel(x, ("right",), right, np.full((4, 1), -1.0), np.array([1, 0, 0, 0], bool))
    >>> graph = TaskGraph("corridor", x.variables, model.actions)
    >>> (at,) = graph.variables
    >>> go = graph.task("Go", until=at.eq(1), uses=[at], do="right")
    >>> _ = graph.task("Root", until=at.eq(3), uses=[at], do=[go().when(at.eq(0)), "right"])
    >>> list(behaviour_findings(ground(graph, model)))
    []
    """
    check = _Check(grounded)
    yield from check.root()
    for place in range(grounded.root, len(grounded.model.actions) - 1, -1):
        yield from check.task(place)


class _Check:
    """Goes through the tasks, callers before their children, and keeps where each is called."""

    def __init__(self, grounded: GroundGraph) -> None:
        self.grounded = grounded
        self.reachable: Mask = grounded.model.reachable()
        self.origins = Origins(grounded)
        self.called: list[dict[str, Mask]] = [{} for _ in grounded.nodes]
        """Where each node is called, by caller."""

    def root(self) -> Iterator[Finding]:
        """Check that an episode may begin in states in which the root runs."""
        root, starts = self.grounded.nodes[self.grounded.root], self.grounded.model.starts
        self.called[self.grounded.root]["an episode's start"] = starts & root.live
        outside = starts & ~root.live & ~root.terminal
        if outside.any():
            yield Finding(
                "strays",
                root.name,
                f"an episode may begin outside its working space, such as in {self._describe(outside)}",
                f"widen the working space (within) of {root.name}",
            )
        elif not (starts & root.live).any():
            problem = f"it has ended ({self._until(root)}) wherever an episode may begin"
            yield Finding("never runs", root.name, problem, "narrow its until")

    def task(self, place: int) -> Iterator[Finding]:
        """Check one ground task and its calls, and note where these are made."""
        task = self.grounded.nodes[place]
        if self._never_starts(task):
            start = self.grounded.graph.tasks[task.task].start
            problem = f"its initiation ({start}) holds nowhere where it runs"
            yield Finding("never starts", task.name, problem, "relax its start")
        for call in task.calls:
            yield from self._call(task, call)
        yield from self._ending(place, task)

    def _never_starts(self, task: GroundTask) -> bool:
        """Return whether a task runs somewhere, but its `start` lets nobody call it."""
        return bool((task.live & self.reachable).any() and not (task.initiation & self.reachable).any())

    def _call(self, task: GroundTask, call: GroundCall) -> Iterator[Finding]:
        """Check that a child can be called, and does not end where its caller neither runs nor ends."""
        child, made = self.grounded.nodes[call.child], call.available & self.reachable
        where = f"{task.name} -> {child.name}"
        callers = self.called[call.child]
        callers[task.name] = callers.get(task.name, np.False_) | made
        if not made.any() and not self._never_starts(child):
            yield Finding(
                "never runs",
                where,
                "the child can never run: guard, working space and termination leave no state",
                "relax the guard (when), or remove the edge",
            )
        outside = child.terminal & self.reachable & ~task.live & ~task.terminal
        if not outside.any():
            return
        strays = course(self.grounded, call.child, made).ends & outside
        if strays.any():
            yield Finding(
                "strays",
                where,
                f"the child can end outside its caller's working space, such as {self._describe(strays)}",
                f"widen the working space (within) of {task.name}, or narrow that of {child.name}",
            )

    def _ending(self, place: int, task: GroundTask) -> Iterator[Finding]:
        """Check that a task ends, reaches its goal from wherever it is called, and has something to do."""
        if not (task.terminal & self.reachable).any():
            problem = f"its termination ({self._until(task)}) never holds"
            yield Finding("never ends", task.name, problem, "mend its until")
            return
        if not (task.goal & self.reachable).any():
            problem = f"its goal ({self._goal(task)}) holds at none of its terminations"
            yield Finding("no goal", task.name, problem, "mend its goal or its until")
        yield from self._ends_short(place, task)
        available = np.logical_or.reduce([call.available for call in task.calls])
        stuck = task.live & self.reachable & ~available
        if stuck.any():
            yield Finding(
                "stuck",
                task.name,
                f"in {int(stuck.sum())} states it runs but no child can, such as {self._describe(stuck)}",
                "widen a child's guard (when), or end the task there (until)",
            )
        yield from self._out_of_reach(place, task)

    def _ends_short(self, place: int, task: GroundTask) -> Iterator[Finding]:
        short = task.terminal & ~task.goal & self.reachable
        if task.pseudo_reward is not None or not short.any():
            return
        short &= course(self.grounded, place, self._where_called(place)).ends
        if short.any():
            yield Finding(
                "ends short",
                task.name,
                f"it can end without reaching its goal, such as in {self._describe(short)}",
                "give it a pseudo_reward below what finishing costs, or a learner will quit early",
            )

    def _out_of_reach(self, place: int, task: GroundTask) -> Iterator[Finding]:
        """Check that a task can come to its goal from wherever it is called, and tell if not even to an end.

        Where no termination is a goal, that is another finding, and any end will do here.
        """
        called = self._where_called(place)
        has_goal = (task.goal & self.reachable).any()
        lost = called & ~self.origins.of(place, task.goal if has_goal else task.terminal)
        endless = lost & ~self.origins.of(place, task.terminal) if lost.any() else lost
        for states, what, mend in (
            (endless, "it cannot end from", "its until"),
            (lost & ~endless, f"from which it can end, but not at its goal ({self._goal(task)})", "its goal"),
        ):
            if states.any():
                callers = ", ".join(
                    name for name, where in self.called[place].items() if (where & states).any()
                )
                yield Finding(
                    "out of reach",
                    task.name,
                    f"called in {int(states.sum())} states {what}, such as {self._describe(states)} "
                    f"(by {callers})",
                    f"call it elsewhere (when), widen its working space (within), or mend {mend}",
                )

    def _where_called(self, place: int) -> Mask:
        nowhere = np.zeros_like(self.reachable)
        called: Mask = np.logical_or.reduce([nowhere, *self.called[place].values()])
        return called

    def _until(self, task: GroundTask) -> str:
        return str(self.grounded.graph.tasks[task.task].until)

    def _goal(self, task: GroundTask) -> str:
        """Return a task's goal in words; without one of its own any end will do."""
        declared = self.grounded.graph.tasks[task.task]
        return str(declared.until if (task.goal == task.terminal).all() else declared.goal)

    def _describe(self, mask: Mask) -> str:
        return self.grounded.model.index.words(int(np.flatnonzero(mask)[0]))
