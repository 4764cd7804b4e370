"""MAXQ-0, the paper's table 2, in readable Python: the reference that fast kernels are held to.

Dietterich (2000), "Hierarchical reinforcement learning with the MAXQ value function decomposition":
V(i, s) = max_a Q(i, s, a) and Q(i, s, a) = V(a, s) + C(i, s, a) (equations 2 and 3 of the paper).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import accumulate

from hierarchy import GroundGraph
from planners.schedules import Exploration, LearningRate
from worlds import Stream, TransitionModel


class EpisodeTooLongError(RuntimeError):
    """An episode of learning passed its limit of primitive steps."""


@dataclass(frozen=True)
class Settings:
    """What MAXQ-0 learns with.

    Parameters
    ----------
    rate, exploration
        Schedules over a task's own episodes.
    gamma
        Discount factor; 1 in the paper.
    tie
        Children whose values differ by no more than this count as equal; the first in order is taken. It
        lies between what is left to learn (below 0.002 on the two-room maze) and the cost of a step.
    max_steps
        Primitive steps after which an episode of learning is given up with an error.
    """

    rate: LearningRate = field(default_factory=LearningRate)
    exploration: Exploration = field(default_factory=Exploration)
    gamma: float = 1.0
    tie: float = 0.01
    max_steps: int = 100_000


class MaxQ:
    """A MAXQ-0 learner on a ground graph.

    Completion values start at 0, which is optimistic where every step costs. Each task keeps its own
    count of episodes, so that its rate and exploration fall with its own experience.

    Parameters
    ----------
    grounded
        The ground graph, with its world's model.
    seed
        Names the random stream; every integer part counts.
    settings
        Schedules, discount and tie break.

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
        self.grounded = grounded
        self.settings = settings or Settings()
        nodes = grounded.nodes
        self._primitives = len(grounded.model.actions)
        self._outcomes = _outcomes(grounded.model)
        self._terminal: list[list[bool]] = [node.terminal.tolist() for node in nodes]
        self._children = [[call.child for call in node.calls] for node in nodes]
        self._available = [_choices(grounded, place) for place in range(len(nodes))]
        self._row: list[list[list[int]]] = [[c.projection.tolist() for c in node.calls] for node in nodes]
        self.completion: list[list[list[float]]] = [[[0.0] * c.rows for c in node.calls] for node in nodes]
        leaves = [node.leaf for node in nodes if node.leaf is not None]
        self._leaf_row: list[list[int]] = [leaf.projection.tolist() for leaf in leaves]
        self.reward: list[list[float]] = [[0.0] * leaf.rows for leaf in leaves]
        self.episodes = [0] * len(nodes)
        self.steps = 0
        self._limit = 0
        self._random = Stream(*seed)

    def value(self, task: int, state: int) -> float:
        """Return V(task, state): 0 where the task has ended, equation 2 elsewhere."""
        if task < self._primitives:
            return self.reward[task][self._leaf_row[task][state]]
        if self._terminal[task][state]:
            return 0.0
        return max(self.q(task, state, k) for k in self._available[task][state])

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

    def choices(self, task: int, state: int) -> tuple[int, ...]:
        """Return the places of the children that a task may call in a state."""
        return self._available[task][state]

    def greedy(self, task: int, state: int) -> int:
        """Return the place of the best child, the first in order among equals."""
        choices = self._available[task][state]
        values = [self.q(task, state, k) for k in choices]
        least = max(values) - self.settings.tie
        return next(k for k, value in zip(choices, values, strict=True) if value >= least)

    def train(
        self,
        task: int,
        starts: Sequence[int],
        episodes: int,
        after_each: Callable[[], None] | None = None,
    ) -> list[int]:
        """Run episodes of a task, each from a random one of `starts`; return their primitive steps.

        The task's rate and exploration start afresh, as each of figure 12's curves does; what it and its
        children have learnt stays. `after_each` is called after every episode, to take a measurement.
        """
        self.episodes[task] = 0
        counts = []
        for _ in range(episodes):
            self._limit = self.steps + self.settings.max_steps
            counts.append(self._run(task, self._random.choose(starts))[0])
            if after_each is not None:
                after_each()
        return counts

    def _run(self, task: int, state: int, caller_rate: float = 1.0) -> tuple[int, int]:
        """Carry out a task once, learning; return its primitive steps N and the state it ends in (table 2).

        A primitive action has no episodes of its own, and learns its reward at its caller's rate.
        """
        if task < self._primitives:
            after, reward = self._act(task, state)
            values, row = self.reward[task], self._leaf_row[task][state]
            values[row] += caller_rate * (reward - values[row])
            self.steps += 1
            if self.steps > self._limit:
                raise EpisodeTooLongError(f"no end after {self.settings.max_steps} primitive steps")
            return 1, after
        rate = self.settings.rate(self.episodes[task])
        explore = self.settings.exploration(self.episodes[task])
        count = 0
        while not self._terminal[task][state]:
            k = self._explore(task, state, explore)
            steps, after = self._run(self._children[task][k], state, rate)
            target = self.settings.gamma**steps * self.value(task, after)
            table, row = self.completion[task][k], self._row[task][k][state]
            table[row] += rate * (target - table[row])
            count += steps
            state = after
        self.episodes[task] += 1
        return count, state

    def _act(self, action: int, state: int) -> tuple[int, float]:
        """Return the next state and the reward of a primitive action; chance decides if it must."""
        outcomes = self._outcomes[state][action]
        if len(outcomes) == 1:
            return outcomes[0][:2]
        draw = self._random.uniform()
        for after, reward, up_to in outcomes:
            if draw < up_to:
                return after, reward
        return outcomes[-1][:2]

    def _explore(self, task: int, state: int, share: float) -> int:
        """Choose a child by the ordered GLIE policy."""
        if self._random.uniform() < share:
            return self._random.choose(self._available[task][state])
        return self.greedy(task, state)

    def greedy_route(self, task: int, state: int, limit: int = 1000) -> list[tuple[int, int]] | None:
        """Return the (state, primitive action) pairs of the greedy policy, or None past `limit` steps."""
        route: list[tuple[int, int]] = []
        return route if self._follow(task, state, route, limit) is not None else None

    def _follow(self, task: int, state: int, route: list[tuple[int, int]], limit: int) -> int | None:
        if task < self._primitives:
            route.append((state, task))
            return self._act(task, state)[0] if len(route) <= limit else None
        while not self._terminal[task][state]:
            child = self._children[task][self.greedy(task, state)]
            after = self._follow(child, state, route, limit)
            if after is None:
                return None
            state = after
        return state

    def greedy_steps(self, task: int, state: int, limit: int = 1000) -> int | None:
        """Return the primitive steps of the greedy policy from a state, or None past `limit`."""
        route = self.greedy_route(task, state, limit)
        return None if route is None else len(route)


def _choices(grounded: GroundGraph, place: int) -> list[tuple[int, ...]]:
    """Return the places of the available calls of a node, for every state."""
    calls = grounded.nodes[place].calls
    columns = [call.available.tolist() for call in calls]
    return [tuple(k for k, on in enumerate(row) if on) for row in zip(*columns, strict=True)]


def _outcomes(model: TransitionModel) -> list[list[list[tuple[int, float, float]]]]:
    """Return, by state and action, the outcomes that occur: next state, reward, cumulated probability."""
    table = []
    for after, rewards, chances in zip(
        model.outcomes.tolist(), model.outcome_rewards.tolist(), model.probabilities.tolist(), strict=True
    ):
        row = []
        for outcomes in zip(after, rewards, chances, strict=True):
            occurring = [outcome for outcome in zip(*outcomes, strict=True) if outcome[2] > 0]
            cumulated = accumulate(chance for _, _, chance in occurring)
            row.append([(s, r, up_to) for (s, r, _), up_to in zip(occurring, cumulated, strict=True)])
        table.append(row)
    return table
