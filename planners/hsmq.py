"""Hierarchical semi-Markov Q-learning, HSMQ (Dietterich, "An overview of MAXQ hierarchical RL", 2000)."""

from __future__ import annotations

from collections.abc import Sequence

from hierarchy import GroundGraph
from planners.learner import Learner, Settings, Trace, pseudo_rewards
from worlds import UserError


class HSMQ(Learner):
    """Hierarchical Q-learning without decomposition: each task stores Q(i, s, a) whole.

    A child that took N steps backs up like one long action of a semi-Markov decision problem. Nothing is
    shared between tasks, and a value depends on all of the task's relevant variables: an edge's own
    (`Call.using`) are those of a completion, and do not serve here. Pseudo-rewards are part of a task's
    values; its callers count the real rewards on the way.

    Parameters
    ----------
    grounded
        The ground graph, with its world's model.
    seed
        Names the random stream; every integer part counts.
    settings
        Schedules, discount and tie break.

    Attributes
    ----------
    table
        Q by task, place of the child, and row of the projection onto the task's relevant variables.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> learner = HSMQ(grounded, seed=(1,))
    >>> goto = grounded.place("GotoTrigger(T4)")
    >>> start = grounded.model.index.number((maze.start, maze.triggers["T4"], maze.goals["G2"], "closed"))
    >>> steps = learner.train(goto, [start], episodes=300)
    >>> learner.greedy_steps(goto, start), round(learner.value(goto, start), 2)
    (6, -6.0)
    """

    def __init__(self, grounded: GroundGraph, seed: Sequence[int], settings: Settings | None = None) -> None:
        super().__init__(grounded, seed, settings)
        self._pseudo = pseudo_rewards(grounded)
        self._row: list[list[int]] = []
        self.table: list[list[list[float]]] = []
        index, tasks = grounded.model.index, grounded.graph.tasks
        for node in grounded.nodes:
            row = index.project(tasks[node.task].uses) if node.calls else index.project(())
            self._row.append(row.tolist())
            self.table.append([[0.0] * (int(row.max()) + 1) for _ in node.calls])

    def value(self, task: int, state: int) -> float:
        """Return V(task, state) = max_a Q(task, state, a); 0 where the task has ended.

        Raises
        ------
        UserError
            For a primitive action: it has no value of its own here.
        """
        if task < self._primitives:
            name = self.grounded.nodes[task].name
            raise UserError(f"this learner stores no value of the primitive action {name}; ask for a task's")
        if self._terminal[task][state]:
            return 0.0
        return max(self.q(task, state, k) for k in self._runnable(task, state))

    def q(self, task: int, state: int, k: int) -> float:
        """Return Q(task, state, k-th child)."""
        return self.table[task][k][self._row[task][state]]

    def _learn(self, task: int, k: int, trace: Trace, after: int, rate: float) -> None:
        """Q(i, s, a) <- (1 - alpha) Q(i, s, a) + alpha [r + gamma**N max_a' Q(i, s', a')].

        r is the discounted sum of the child's rewards from s on. Where the task has ended its
        pseudo-reward stands for the maximum.
        """
        ended = self._terminal[task][after]
        target = self._pseudo[task][after] if ended else self.value(task, after)
        targets = []
        for step in reversed(trace):
            target = step.reward + self.settings.gamma * target
            targets.append(target)
        targets.reverse()
        table = self.table[task][k]
        for at in self._updated(task, k, trace):
            row = self._row[task][trace[at].state]
            table[row] += rate * (targets[at] - table[row])
