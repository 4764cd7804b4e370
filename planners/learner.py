"""What every tabular learner on a ground graph shares: settings, choices, acting, learning, greedy ways.

A learner adds its tables, the value of a child, and one update: what it learns when a child has ended.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from typing import Final, NamedTuple

from hierarchy import GroundGraph
from planners.exploration import Exploration, Explorer, first_best
from planners.schedules import LearningRate, Rate, by_task
from worlds import Stream, TransitionModel, UserError


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


class Learner(ABC):
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
        self.grounded = grounded
        self.settings = settings or Settings()
        nodes = grounded.nodes
        self._primitives = len(grounded.model.actions)
        self._terminal: list[list[bool]] = [node.terminal.tolist() for node in nodes]
        self._children = [[call.child for call in node.calls] for node in nodes]
        self._available = [_choices(grounded, place) for place in range(len(nodes))]
        self._rates = by_task(grounded, self.settings.rate, self.settings.rates)
        self._explorers = by_task(grounded, self.settings.exploration, self.settings.explorations)
        self.episodes = [0] * len(nodes)
        self.steps = 0
        self._limit = 0
        self.random, self.chance = streams_of(seed)

    @abstractmethod
    def value(self, task: int, state: int) -> float:
        """Return V(task, state): what carrying out the task from a state is worth; 0 where it has ended."""

    @abstractmethod
    def q(self, task: int, state: int, k: int) -> float:
        """Return Q(task, state, k-th child): the child first, then the task to its end."""

    @abstractmethod
    def _learn(self, task: int, k: int, trace: Trace, after: int, rate: float) -> None:
        """Learn from the k-th child of a task, which took the steps of `trace` and ended in `after`."""

    def _learn_reward(self, action: int, state: int, reward: float, rate: float) -> None:  # noqa: B027
        """Learn from a primitive action's reward; without values of actions there is nothing to do."""

    def _preference(self, task: int, state: int, k: int) -> float:
        """Return what the task's own policy compares its children by."""
        return self.q(task, state, k)

    def choices(self, task: int, state: int) -> tuple[int, ...]:
        """Return the places of the children that a task may call in a state."""
        return self._available[task][state]

    def greedy(self, task: int, state: int) -> int:
        """Return the place of the best child, the first in order among equals."""
        return first_best(self._runnable(task, state), self._preferences(task, state), self.settings.tie)

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

        Raises
        ------
        EpisodeTooLongError
            If an episode passes the settings' `max_steps`.
        """
        self.episodes[task] = 0
        counts = []
        for _ in range(episodes):
            self._limit = self.steps + self.settings.max_steps
            counts.append(len(self._run(task, self.random.choose(starts))[0]))
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

    def _preferences(self, task: int, state: int) -> list[float]:
        return [self._preference(task, state, k) for k in self._available[task][state]]

    def _runnable(self, task: int, state: int) -> tuple[int, ...]:
        """Return what a task may call in a state, at least one child."""
        choices = self._available[task][state]
        if not choices:
            index, name = self.grounded.model.index, self.grounded.nodes[task].name
            values = zip(index.variables, index.state(state), strict=True)
            where = ", ".join(f"{variable.name} = {variable.label(value)}" for variable, value in values)
            raise UserError(
                f"task {name} has no child to call in state {state} ({where}); start it where it runs, "
                "and see what hierarchy.check says of the graph"
            )
        return choices

    @cached_property
    def _outcomes(self) -> list[list[list[tuple[int, float, float]]]]:
        """What may follow, by state and action; read when needed, for a black box has nothing to read."""
        return _outcomes(self.grounded.model)

    def _act(self, action: int, state: int, chance: Stream) -> tuple[int, float]:
        """Return the next state and the reward of a primitive action; chance decides if it must."""
        outcomes = self._outcomes[state][action]
        if len(outcomes) == 1:
            return outcomes[0][:2]
        draw = chance.uniform()
        for after, reward, up_to in outcomes:
            if draw < up_to:
                return after, reward
        return outcomes[-1][:2]

    def follow(self, action: int, state: int) -> int:
        """Return the state that a primitive action leads to, learning nothing.

        Chance has a stream of its own here, so that a measurement never changes what is learnt after it.
        """
        return self._act(action, state, self.chance)[0]

    def greedy_route(self, task: int, state: int, limit: int = 1000) -> list[tuple[int, int]] | None:
        """Return the (state, primitive action) pairs of the greedy policy, or None past `limit` steps."""
        route: list[tuple[int, int]] = []
        return route if self._follow(task, state, route, limit) is not None else None

    def _follow(self, task: int, state: int, route: list[tuple[int, int]], limit: int) -> int | None:
        if task < self._primitives:
            route.append((state, task))
            return self.follow(task, state) if len(route) <= limit else None
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
