"""The option-critic in tables, as published: the small reference.

Bacon, Harb and Precup, "The option-critic architecture" (AAAI 2017), algorithm 1: intra-option Q-learning,
softmax policies inside options, sigmoid terminations, an epsilon-greedy policy over options. Options are
learnt from nothing: each may begin anywhere, and no task graph has a say. `planners.option_critic` is the
neural one that a graph is compiled to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from worlds import Stream, TransitionModel, UserError

Array = NDArray[np.float64]
_SHARES: Final = ("gamma", "epsilon", "critic_rate", "actor_rate", "termination_rate")


@dataclass(frozen=True)
class TabularOptionCriticConfig:
    """What a tabular option-critic learns with; the defaults suit a reward of 1 at the goal.

    Parameters
    ----------
    options
        How many options.
    gamma
        Discount.
    epsilon
        Share of options chosen at random.
    temperature
        Of the softmax policies: the higher, the more alike the actions.
    critic_rate, actor_rate, termination_rate
        Learning rates of Q_U, of the policies (one over the temperature taken in) and of the terminations.
    baseline
        Whether the policies climb the advantage Q_U - Q in place of Q_U.
    deliberation
        Added to the advantage of going on (Harb et al., 2018); a cost of ending.
    max_steps
        Steps after which an episode is cut off.

    Raises
    ------
    UserError
        If a number is out of range.
    """

    options: int = 4
    gamma: float = 0.99
    epsilon: float = 0.01
    temperature: float = 0.1
    critic_rate: float = 0.5
    actor_rate: float = 0.25
    termination_rate: float = 0.25
    baseline: bool = True
    deliberation: float = 0.0
    max_steps: int = 1000

    def __post_init__(self) -> None:
        for name in ("options", "max_steps"):
            if getattr(self, name) < 1:
                raise UserError(f"{name}: {getattr(self, name)} is not possible; give at least 1")
        for name in _SHARES:
            if not 0 <= getattr(self, name) <= 1:
                raise UserError(f"{name}: {getattr(self, name)} is not possible; give 0 to 1")
        if not self.temperature > 0:
            raise UserError(f"temperature: {self.temperature} is not possible; give more than 0")


class TabularOptionCritic:
    """An option-critic of a finite world, one state and one option a row.

    Parameters
    ----------
    model
        The world.
    terminal
        Where an episode ends, shape (states,), bool.
    seed
        Names the random stream; every integer part counts.
    config
        What to learn with.

    Attributes
    ----------
    q_u
        Q_U, the value of an action in an option and state, shape (options, states, actions).
    preferences
        Of the softmax policies, shape (options, states, actions).
    endings
        Logits of the terminations, shape (options, states).
    episodes
        How many there were.

    Raises
    ------
    UserError
        If the world has no start, or one that is terminal.

    Examples
    --------
    >>> from worlds import StateIndex, Variable
    >>> x = StateIndex((Variable("x", tuple(range(6))),))
    >>> moves = np.stack([np.maximum(np.arange(6) - 1, 0), np.minimum(np.arange(6) + 1, 5)], axis=1)
    >>> rewards = (moves == 5).astype(float)
    >>> model = TransitionModel(x, ("left", "right"), moves, rewards, np.arange(6) < 1)
    >>> learner = TabularOptionCritic(model, np.arange(6) == 5, seed=(1,))
    >>> steps = learner.train(200)
    >>> learner.greedy_route(0)
    [0, 1, 2, 3, 4, 5]
    """

    def __init__(
        self,
        model: TransitionModel,
        terminal: NDArray[np.bool_],
        seed: Sequence[int],
        config: TabularOptionCriticConfig | None = None,
    ) -> None:
        self.model, self.terminal, self.seed = model, terminal, tuple(seed)
        self.config = config = TabularOptionCriticConfig() if config is None else config
        self.starts = np.flatnonzero(model.starts).tolist()
        if not self.starts or terminal[self.starts].any():
            raise UserError("an episode needs a state to begin in that is not terminal; give other starts")
        shape = (config.options, model.index.size, len(model.actions))
        self.q_u, self.preferences = np.zeros(shape), np.zeros(shape)
        self.endings = np.zeros(shape[:2])
        self.episodes = 0
        self._chances = model.probabilities.cumsum(axis=2)

    def policy(self, option: int, state: int) -> Array:
        """Return the probability of each action, shape (actions,)."""
        return softmax(self.preferences[option, state] / self.config.temperature)

    def ending(self, option: int, state: int) -> float:
        """Return the probability that an option ends where it arrives."""
        return float(sigmoid(self.endings[option, state]))

    def values(self, state: int) -> Array:
        """Return Q of each option, shape (options,): Q_U under the option's policy (equation 1)."""
        policies = softmax(self.preferences[:, state] / self.config.temperature)
        found: Array = (policies * self.q_u[:, state]).sum(axis=1)
        return found

    def train(self, episodes: int) -> list[int]:
        """Learn from so many more episodes; return the steps of each."""
        return [self._episode() for _ in range(episodes)]

    def _episode(self) -> int:
        draw = Stream(*self.seed, self.episodes)
        self.episodes += 1
        state = draw.choose(self.starts)
        option = self._choose(state, draw)
        for step in range(1, self.config.max_steps + 1):
            action = _place(self.policy(option, state).cumsum(), draw.uniform())
            which = _place(self._chances[state, action], draw.uniform())
            after = int(self.model.outcomes[state, action, which])
            reward = float(self.model.outcome_rewards[state, action, which])
            self.update(state, option, action, reward, after)
            if self.terminal[after]:
                return step
            if draw.uniform() < self.ending(option, after):
                option = self._choose(after, draw)
            state = after
        return self.config.max_steps

    def _choose(self, state: int, draw: Stream) -> int:
        """Return the best option, or any with probability epsilon."""
        if draw.uniform() < self.config.epsilon:
            return draw.below(self.config.options)
        return int(self.values(state).argmax())

    def update(self, state: int, option: int, action: int, reward: float, after: int) -> None:
        """Learn from one step: evaluate the option, then improve its policy and its termination.

        Nothing follows a terminal state, and the termination is that of the state of arrival.
        """
        config, over = self.config, bool(self.terminal[after])
        there = self.values(after)
        target = reward
        if not over:
            target += config.gamma * upon_arrival(there, option, self.ending(option, after))
        self.q_u[option, state, action] += config.critic_rate * (target - self.q_u[option, state, action])
        chances = self.policy(option, state)
        critique = self.q_u[option, state, action]
        if config.baseline:
            critique -= self.values(state)[option]
        slope = (np.arange(len(chances)) == action) - chances
        self.preferences[option, state] += config.actor_rate * critique * slope
        if not over:
            end = self.ending(option, after)
            ahead = there[option] - there.max() + config.deliberation
            self.endings[option, after] -= config.termination_rate * end * (1 - end) * ahead

    def greedy_route(self, state: int, limit: int = 1000) -> list[int] | None:
        """Return the states from one to the end by the likeliest actions, None past `limit` steps.

        Options end where that is likelier than not. The world must be deterministic.
        """
        route, option = [state], int(self.values(state).argmax())
        while not self.terminal[state]:
            if len(route) > limit:
                return None
            state = int(self.model.successors[state, self.preferences[option, state].argmax()])
            if self.ending(option, state) > 1 / 2:
                option = int(self.values(state).argmax())
            route.append(state)
        return route


def softmax(preferences: Array) -> Array:
    """Return probabilities in proportion to exponentials, along the last axis.

    >>> softmax(np.log([1.0, 3.0])).tolist()
    [0.25, 0.75]
    """
    lifted = np.exp(preferences - preferences.max(axis=-1, keepdims=True))
    found: Array = lifted / lifted.sum(axis=-1, keepdims=True)
    return found


def sigmoid(logit: float) -> float:
    """Return the probability of a logit, which may be of any size.

    >>> sigmoid(0.0), sigmoid(-1000.0)
    (0.5, 0.0)
    """
    return float(np.exp(-np.logaddexp(0.0, -logit)))


def upon_arrival(values: Array, option: int, ending: float) -> float:
    """Return U, what an option is worth where it arrives (equation 3).

    Parameters
    ----------
    values
        Q of each option there, shape (options,).
    option
        The one that arrives.
    ending
        Probability that it ends there.

    Examples
    --------
    >>> upon_arrival(np.array([1.0, 5.0]), option=0, ending=0.5)
    3.0
    """
    return float((1 - ending) * values[option] + ending * values.max())


def _place(upper: Array, draw: float) -> int:
    """Return the first place whose cumulated chance is above a draw; of rounding, the last that can occur."""
    return min(int(np.searchsorted(upper, draw, side="right")), int(np.searchsorted(upper, upper[-1])))
