"""The tabular option-critic, as published, in `bench_option_critic`: same cases, same budget, same looks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np

from hierarchy import GroundGraph
from planners.option_critic.collecting import Progress
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.measures import Degeneracy
from planners.option_critic_tabular import TabularOptionCritic, TabularOptionCriticConfig, softmax

# The best of 13 trials on seed 0, each of 400,000 steps: 1, 2 or 4 options, temperatures of 0.1 to 1, rates.
SETTINGS: Final = TabularOptionCriticConfig(options=2, gamma=1.0, epsilon=0.1, temperature=1.0, max_steps=200)
_LONGEST: Final = 1000  # steps after which a route is left
_CUT: Final = 200  # the same where the use of options is told of

States = np.ndarray[Any, np.dtype[np.int64]]
Flags = np.ndarray[Any, np.dtype[np.bool_]]
Values = np.ndarray[Any, np.dtype[np.float64]]


class TabularRun:
    """A tabular option-critic that learns for as many steps, in as many pieces, as a config says."""

    def __init__(
        self,
        grounded: GroundGraph,
        seed: int,
        config: OptionCriticConfig,
        starts: None = None,  # always the model's
    ) -> None:
        self.config, self.starts = config, starts
        terminal = grounded.nodes[grounded.root].terminal
        self.learner = TabularOptionCritic(grounded.model, terminal, (seed,), SETTINGS)
        self.steps = self.updates = 0

    def learn(self) -> Iterator[Progress]:
        """Learn whole episodes, and yield once there are as many steps as another update would have."""
        while self.steps < self.config.total:
            self.updates += 1
            while self.steps < min(self.updates * self.config.per_update, self.config.total):
                self.steps += sum(self.learner.train(1))
            yield Progress(self.steps, {})

    def greedy(self) -> TabularPolicy:
        """Return what it would do, nothing left to chance."""
        return TabularPolicy(self.learner)


class Steps(NamedTuple):
    """The steps that some routes take at one time: arrays of one length."""

    route: States
    state: States
    option: States
    action: States
    chosen: Flags
    """Whether the option before had ended, or there was none."""
    changed: Flags
    """Whether the option before was another one."""
    beta: Values
    """Probability that the option before ended here."""


class TabularPolicy:
    """The likeliest actions of the best options, which end where that is likelier than not."""

    def __init__(self, learner: TabularOptionCritic) -> None:
        self.model, self.terminal = learner.model, learner.terminal
        policies = softmax(learner.preferences / learner.config.temperature)
        self.best = (policies * learner.q_u).sum(2).argmax(0)
        self.action = learner.preferences.argmax(2)
        self.beta = np.exp(-np.logaddexp(0.0, -learner.endings))

    def returns(self, states: States) -> Values:
        """Return the sum of rewards from each state, minus infinity where no end is reached."""
        found, over = np.zeros(len(states)), self.terminal[states].copy()
        for steps in self._followed(states, _LONGEST):
            found[steps.route] += self.model.rewards[steps.state, steps.action]
            over[steps.route] = self.terminal[self.model.successors[steps.state, steps.action]]
        return np.where(over, found, -np.inf)

    def used(self, states: States) -> Degeneracy:
        """Return how the options are used, as `planners.option_critic.measures.degeneracy` tells of ours.

        There are no subgoals and no subtasks: what is told of them is nan.
        """
        along = list(self._followed(states, _CUT))
        option, chosen = (
            np.concatenate([getattr(one, key) for one in along]) for key in ("option", "chosen")
        )
        later = along[1:]
        changed, beta = (np.concatenate([getattr(one, key) for one in later]) for key in ("changed", "beta"))
        shares = np.bincount(option, minlength=len(self.action)) / option.size
        shares = shares[shares > 0]
        return Degeneracy(
            duration=option.size / int(chosen.sum()),
            switch_rate=float(changed.mean()),
            usage_entropy=float((shares * np.log(1 / shares)).sum() / np.log(len(self.action))),
            beta_at_subgoals=float("nan"),
            beta_elsewhere=float(beta.mean()),
            oracle_subtasks=float("nan"),
            optimal_actions=float("nan"),
            steps=option.size,
        )

    def _followed(self, states: States, limit: int) -> Iterator[Steps]:
        """Follow all routes at once, a step at a time, to their ends or so many steps."""
        route, state = np.arange(len(states)), states
        option, beta = self.best[state], np.ones(len(states))
        before = option
        for _ in range(limit):
            going = ~self.terminal[state]
            if not going.any():
                return
            route, state, beta = route[going], state[going], beta[going]
            option, before = option[going], before[going]
            action = self.action[option, state]
            yield Steps(route, state, option, action, beta > 1 / 2, option != before, beta)
            state, before = self.model.successors[state, action], option
            beta = self.beta[option, state]
            option = np.where(beta > 1 / 2, self.best[state], option)
