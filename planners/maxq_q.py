"""MAXQ-Q: MAXQ with pseudo-rewards (Dietterich 2000, section 4.4 and table 4)."""

from __future__ import annotations

from collections.abc import Sequence

from hierarchy import GroundGraph
from planners.learner import Settings, Trace, pseudo_rewards
from planners.maxq import MaxQ


class MaxQQ(MaxQ):
    """A MAXQ-Q learner on a ground graph.

    Every task keeps two completion functions. Its own policy maximises V(a, s) + C~(i, s, a), where C~
    holds the pseudo-reward of ending short of the goal; its callers see V(a, s) + C(i, s, a) of the same
    choice, which holds real rewards alone. Without pseudo-rewards both are MAXQ-0's, to the last bit.

    Children that are equal by C~ may differ to callers. Which one they see must not hang on the last digits
    of what was learnt: it is the one that the task takes when it acts, the first within the settings' `tie`.

    Parameters
    ----------
    grounded
        The ground graph, with its world's model and its tasks' pseudo-rewards.
    seed
        Names the random stream; every integer part counts.
    settings
        Schedules, discount and tie break.

    Attributes
    ----------
    completion, reward
        C and V as in `MaxQ`: what callers see.
    inner_completion
        C~, shaped like `completion`: what a task's own policy goes by.

    Examples
    --------
    A task that ends at either end of a corridor; its goal is the far one, the near one is taught to cost 20.

    >>> import numpy as np
    >>> from hierarchy import TaskGraph, ground
    >>> from worlds import StateIndex, TransitionModel, Variable
    >>> index, cell = StateIndex((Variable("x", (0, 1, 2, 3, 4)),)), np.arange(5)
    >>> successors = np.stack([np.maximum(cell - 1, 0), np.minimum(cell + 1, 4)], axis=1)
    >>> costs = np.full(successors.shape, -1.0)
    >>> model = TransitionModel(index, ("left", "right"), successors, costs, cell == 1)
    >>> graph = TaskGraph("ends", index.variables, model.actions)
    >>> (x,) = graph.variables
    >>> ends, far = x.isin([0, 4]), x.eq(4)
    >>> task = graph.task("Go", until=ends, goal=far, pseudo_reward=-20, uses=[x], do="left right")
    >>> grounded = ground(graph, model)
    >>> learner = MaxQQ(grounded, seed=(0,))
    >>> steps = learner.train(grounded.root, [1], episodes=400)
    >>> learner.greedy_steps(grounded.root, 1), round(learner.value(grounded.root, 1), 2)
    (3, -3.0)
    """

    def __init__(self, grounded: GroundGraph, seed: Sequence[int], settings: Settings | None = None) -> None:
        super().__init__(grounded, seed, settings)
        self._pseudo = pseudo_rewards(grounded)
        self._taught = [bool(node.pseudo_reward) for node in grounded.nodes]
        self.inner_completion = [[list(rows) for rows in tables] for tables in self.completion]

    def value(self, task: int, state: int) -> float:
        """Return V(task, state) of the task's own policy, in real rewards."""
        if task < self._primitives or self._terminal[task][state]:
            return super().value(task, state)
        return self.q(task, state, self._best(task, state))

    def inner_q(self, task: int, state: int, k: int) -> float:
        """Return V(child, state) + C~(task, state, child), which the task's own policy maximises."""
        inside = self.inner_completion[task][k][self._row[task][k][state]]
        return self.value(self._children[task][k], state) + inside

    def _preference(self, task: int, state: int, k: int) -> float:
        return self.inner_q(task, state, k)

    def _best(self, task: int, state: int) -> int:
        """Return a* = argmax_a [C~(i, s, a) + V(a, s)], the choice whose value callers see."""
        if self._taught[task]:
            return self.greedy(task, state)
        # C~ is C here, and equals are equal to callers, too: the very maximum, as in MAXQ-0.
        return max(self._runnable(task, state), key=lambda k: self.inner_q(task, state, k))

    def _learn(self, task: int, k: int, trace: Trace, after: int, rate: float) -> None:
        """Update C~ and C by the best child a* of the state s' that the child has ended in (table 4).

        C~(i, s, a) <- (1 - alpha) C~(i, s, a) + alpha gamma**N [R~(i, s') + C~(i, s', a*) + V(a*, s')]
        C(i, s, a) <- (1 - alpha) C(i, s, a) + alpha gamma**N [C(i, s', a*) + V(a*, s')]

        Where the task has ended, nothing is left but its pseudo-reward R~.
        """
        if self._terminal[task][after]:
            inside, outside = self._pseudo[task][after], 0.0
        else:
            inside = max(self._preferences(task, after))
            outside = self.q(task, after, self._best(task, after))
        inner, outer = self.inner_completion[task][k], self.completion[task][k]
        for at in self._updated(task, k, trace):
            row = self._row[task][k][trace[at].state]
            discount = self.settings.gamma ** (len(trace) - at)
            inner[row] += rate * (discount * inside - inner[row])
            outer[row] += rate * (discount * outside - outer[row])
