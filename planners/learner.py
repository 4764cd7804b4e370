"""What every tabular learner on a ground graph shares: settings, exploring, learning.

A learner adds its tables, the value of a child, and one update: what it learns when a child has ended.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from hierarchy import GroundGraph
from planners.exploration import Exploration, Explorer
from planners.schedules import LearningRate, Rate, by_task
from planners.states import starting_states
from planners.task_values import TaskValues
from worlds import Stream


class Step(NamedTuple):
    """A primitive step of a task: the state that it was taken in, its reward, and `again`.

    `again` says that the task, begun anew in that state, would have gone on as it did.
    """

    state: int
    reward: float
    again: bool = True


Trace = list[Step]
"""The primitive steps of a task, in one flat sequence whatever the depth."""

_FIRST: Final[Sequence[int]] = (0,)  # the one step that a caller learns at without all-states updating

_FOLLOWING = 0x466F_6C6C_6F77  # names the stream of greedy ways


class EpisodeTooLongError(RuntimeError):
    """An episode of learning passed its limit of primitive steps."""


@dataclass(frozen=True)
class Settings:
    """What a learner learns with.

    Parameters
    ----------
    rate, exploration
        Schedules over a task's own episodes: `LearningRate` or `HarmonicRate`, `Exploration` or `Boltzmann`.
    gamma
        Discount factor; 1 in the paper.
    tie
        Children whose values differ by no more than this count as equal; the first in order is taken. It
        lies between what is left to learn (below 0.002 on the two-room maze) and the cost of a step.
    max_steps
        Primitive steps after which an episode of learning is given up with an error.
    all_states
        Whether a task learns at the first state of its child alone, or also at those that the child passed
        through and would have gone on from in the same way (Dietterich 2000, section 4.3).
    rates, explorations
        Schedules of single tasks, by the name of a task or of a ground task, which comes first.
    """

    rate: Rate = field(default_factory=LearningRate)
    exploration: Explorer = field(default_factory=Exploration)
    gamma: float = 1.0
    tie: float = 0.01
    max_steps: int = 100_000
    all_states: bool = False
    rates: Mapping[str, Rate] = field(default_factory=dict, hash=False)
    explorations: Mapping[str, Explorer] = field(default_factory=dict, hash=False)


class Learner(TaskValues):
    """A tabular learner on a ground graph.

    Each task keeps its own count of episodes, so that its rate and exploration fall with its own experience.

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
    episodes
        Episodes of each node since its schedules began.
    steps
        Primitive steps of learning so far.
    random, chance
        The streams of learning and of greedy ways.

    Raises
    ------
    UserError
        If the settings name a task that the graph does not have.
    """

    def __init__(self, grounded: GroundGraph, seed: Sequence[int], settings: Settings | None = None) -> None:
        self.settings = settings or Settings()
        self.random, chance = streams_of(seed)
        super().__init__(grounded, self.settings.tie, chance)
        self._rates = by_task(grounded, self.settings.rate, self.settings.rates)
        self._explorers = by_task(grounded, self.settings.exploration, self.settings.explorations)
        self.episodes = [0] * len(grounded.nodes)
        self.steps = 0
        self._limit = 0

    @abstractmethod
    def value(self, task: int, state: int) -> float:
        """Return V(task, state): what carrying out the task from a state is worth; 0 where it has ended."""

    @abstractmethod
    def _learn(self, task: int, k: int, trace: Trace, after: int, rate: float) -> None:
        """Learn from the k-th child of a task, which took the steps of `trace` and ended in `after`."""

    def _learn_reward(self, action: int, state: int, reward: float, rate: float) -> None:
        """Learn from a primitive action's reward; without values of actions there is nothing to do."""

    def train(
        self,
        task: int,
        starts: Sequence[int],
        episodes: int,
        after_each: Callable[[], None] | None = None,
        *,
        afresh: bool = True,
    ) -> list[int]:
        """Run episodes of a task, each from a random one of `starts`; return their primitive steps.

        The task's rate and exploration start afresh, as each of figure 12's curves does; what it and its
        children have learnt stays. `after_each` is called after every episode, to take a measurement. If not
        `afresh`, the schedules go on falling.

        Raises
        ------
        EpisodeTooLongError
            If an episode passes the settings' `max_steps`.
        UserError
            If there is nothing to start from, or a task comes to a state in which it has no child to call.
        """
        begin = starting_states(self.grounded, task, starts).tolist()
        if afresh:
            self.episodes[task] = 0
        counts = []
        for _ in range(episodes):
            self._limit = self.steps + self.settings.max_steps
            counts.append(len(self._run(task, self.random.choose(begin))[0]))
            if after_each is not None:
                after_each()
        return counts

    def _run(self, task: int, state: int, caller_rate: float = 1.0) -> tuple[Trace, int]:
        """Carry out a task once, learning; return its primitive steps and the state it ends in.

        The loop of the paper's table 2 and of Dietterich's table 4. A primitive action has no episodes of
        its own, and learns its reward at its caller's rate.
        """
        if task < self._primitives:
            after, reward = self._act(task, state, self.random)
            self._learn_reward(task, state, reward, caller_rate)
            self.steps += 1
            if self.steps > self._limit:
                raise EpisodeTooLongError(f"no end after {self.settings.max_steps} primitive steps")
            return [Step(state, reward)], after
        rate = self._rates[task](self.episodes[task])
        level = self._explorers[task](self.episodes[task])
        steps: Trace = []
        while not self._terminal[task][state]:
            k = self._explore(task, state, level)
            trace, after = self._run(self._children[task][k], state, rate)
            self._learn(task, k, trace, after, rate)
            steps += self._seen_by_caller(task, k, trace)
            state = after
        self.episodes[task] += 1
        return steps, state

    def _seen_by_caller(self, task: int, k: int, trace: Trace) -> Trace:
        """Return the steps of a task's k-th child as steps of the task.

        On the way of a child that is itself a task, the task may have had no say for a while: begun anew
        there, it would be free to call another child. What it would then have been worth, this way does not
        tell.
        """
        if not self.settings.all_states or len(trace) == 1 or task == self.grounded.root:
            return trace  # nothing learns from the root's steps
        free = self._available[task]

        def freely(step: Step) -> bool:
            return step.again and k in free[step.state] and self.greedy(task, step.state) == k

        return [trace[0], *(step._replace(again=freely(step)) for step in trace[1:])]

    def _updated(self, task: int, k: int, trace: Trace) -> Sequence[int]:
        """Return which of a child's steps its caller learns at, the last first.

        In all-states updating these are all whose state the child may be called in, and from where it would
        have gone on as it did (Dietterich 2000, section 4.3).
        """
        if not self.settings.all_states:
            return _FIRST
        steps = range(len(trace) - 1, 0, -1)
        return (*(at for at in steps if trace[at].again and k in self._available[task][trace[at].state]), 0)

    def _explore(self, task: int, state: int, level: float) -> int:
        """Choose a child by the task's way to explore."""
        choices, settings = self._runnable(task, state), self.settings
        return self._explorers[task].choose(
            level, choices, lambda: self._preferences(task, state), settings.tie, self.random
        )


def streams_of(seed: Sequence[int]) -> tuple[Stream, Stream]:
    """Return the streams that a seed names: a learner's own, and that of greedy ways.

    >>> learning, following = streams_of((3, 1))
    >>> learning.uniform() == following.uniform()
    False
    """
    return Stream(*seed), Stream(*seed, _FOLLOWING)


def pseudo_rewards(grounded: GroundGraph) -> list[list[float]]:
    """Return each node's pseudo-reward of ending in each state, shape (nodes, states).

    It is 0 at a goal, where the task does not end, and where the graph gives none.
    """
    tables = []
    for node in grounded.nodes:
        short = node.terminal & ~node.goal
        tables.append((short * (node.pseudo_reward or 0.0)).tolist())
    return tables
