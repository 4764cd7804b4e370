"""MAXQ-0, the paper's table 2, in readable Python: the reference that fast kernels are held to.

Dietterich (2000), "Hierarchical reinforcement learning with the MAXQ value function decomposition":
V(i, s) = max_a Q(i, s, a) and Q(i, s, a) = V(a, s) + C(i, s, a) (equations 2 and 3 of the paper).
"""

from __future__ import annotations

from collections.abc import Sequence

from hierarchy import GroundGraph
from planners.learner import Learner, Settings, Trace


class MaxQ(Learner):
    """A MAXQ-0 learner on a ground graph.

    Completion values start at 0, which is optimistic where every step costs. It knows no pseudo-rewards:
    a task that can end short of its goal learns to, if that is cheaper (`MaxQQ` does not).

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
    completion
        C by task, place of the child, and row of the call's projection.
    reward
        V of each primitive action, by row of its leaf's projection.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> learner = MaxQ(grounded, seed=(1,))
    >>> goto = grounded.place("GotoTrigger(T4)")
    >>> start = grounded.model.index.number((maze.start, maze.triggers["T4"], maze.goals["G2"], "closed"))
    >>> steps = learner.train(goto, [start], episodes=200)
    >>> learner.greedy_steps(goto, start), round(learner.value(goto, start), 3)
    (6, -6.0)
    """

    def __init__(self, grounded: GroundGraph, seed: Sequence[int], settings: Settings | None = None) -> None:
        super().__init__(grounded, seed, settings)
        nodes = grounded.nodes
        self._row: list[list[list[int]]] = [[c.projection.tolist() for c in node.calls] for node in nodes]
        self.completion: list[list[list[float]]] = [[[0.0] * c.rows for c in node.calls] for node in nodes]
        leaves = [node.leaf for node in nodes if node.leaf is not None]
        self._leaf_row: list[list[int]] = [leaf.projection.tolist() for leaf in leaves]
        self.reward: list[list[float]] = [[0.0] * leaf.rows for leaf in leaves]

    def value(self, task: int, state: int) -> float:
        """Return V(task, state): 0 where the task has ended, equation 2 elsewhere."""
        if task < self._primitives:
            return self.reward[task][self._leaf_row[task][state]]
        if self._terminal[task][state]:
            return 0.0
        return max(self.q(task, state, k) for k in self._runnable(task, state))

    def q(self, task: int, state: int, k: int) -> float:
        """Return Q(task, state, k-th child) = V(child, state) + C(task, state, child) (equation 3)."""
        child = self._children[task][k]
        if child < self._primitives:
            value = self.reward[child][self._leaf_row[child][state]]
        else:
            value = self.value(child, state)
        return value + self.completion[task][k][self._row[task][k][state]]

    def c(self, task: int, state: int, k: int) -> float:
        """Return C(task, state, k-th child), the value of completing the task after that child."""
        return self.completion[task][k][self._row[task][k][state]]

    def _learn_reward(self, action: int, state: int, reward: float, rate: float) -> None:
        """V(a, s) <- (1 - alpha) V(a, s) + alpha r (table 2, the primitive action)."""
        values, row = self.reward[action], self._leaf_row[action][state]
        values[row] += rate * (reward - values[row])

    def _learn(self, task: int, k: int, trace: Trace, after: int, rate: float) -> None:
        """C(i, s, a) <- (1 - alpha) C(i, s, a) + alpha gamma**N V(i, s') (table 2, the subtask)."""
        completion, rows = self.completion[task][k], self._row[task][k]
        ahead = self.value(task, after)
        for at in self._updated(task, k, trace):
            row = rows[trace[at].state]
            target = self.settings.gamma ** (len(trace) - at) * ahead
            completion[row] += rate * (target - completion[row])
