"""What an option-critic answers when it is asked for values: the same questions as MAXQ's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Self, cast

import numpy as np
import torch
from numpy.typing import NDArray

from planners.option_critic.choosing import upon_arrival
from planners.option_critic.options import Options
from planners.option_critic.training import OptionCritic
from planners.option_critic.transform import OptionTables
from planners.task_values import TaskValues
from worlds import Stream

_NEVER: Final = -np.inf  # the value of what no option does
_TIE: Final = 0.3  # networks are less exact than tables, but less than a step's cost of 1 off


class OptionValues(TaskValues):
    """The critic's values as values of the children of tasks, so that affordances can be asked of it.

    A task that calls tasks compares its children by the values of the options that begin with them. A task
    that calls actions compares them by what the critic expects after each: its reward, and then the worth of
    the running option where it arrives, as the world's model says where that is. So the second best action
    has a value as well as the best one, which the policy's probabilities would not tell.

    Parameters
    ----------
    options
        The options of a ground graph.
    critic
        Returns the options' values in states of some numbers, shape (states, options).
    gamma
        The discount that was learnt with.
    tie
        Children whose values differ by no more than this count as equal. It lies between what is left to
        learn and the cost of a step.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from planners.option_critic.options import compile_options
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> options = compile_options(ground(two_rooms(maze), maze_model(maze)))
    >>> values = OptionValues(options, lambda state: torch.zeros(len(state), len(options)), 0.98)
    >>> values.q(options.grounded.place("GotoTrigger(T4)"), 0, 1)
    -1.0
    """

    def __init__(
        self,
        options: Options,
        critic: Callable[[torch.Tensor], torch.Tensor],
        gamma: float,
        tie: float = _TIE,
    ) -> None:
        super().__init__(options.grounded, tie, Stream(0))
        self.options, self.gamma = options, gamma
        states = torch.arange(self.grounded.model.index.size)
        with torch.no_grad():
            self._options = critic(states).cpu()
        self._tables = OptionTables(options)
        self._states = states
        self._known: dict[int, NDArray[np.float64]] = {}

    @classmethod
    def of(cls, learner: OptionCritic, tie: float = _TIE) -> Self:
        """Return the values that an option-critic has learnt so far."""

        def critic(state: torch.Tensor) -> torch.Tensor:
            seen = learner.policy.seen(learner.world.encoding(state.to(learner.world.device)))
            return cast("torch.Tensor", seen.get("option_value"))

        return cls(learner.options, critic, learner.config.gamma, tie)

    def q(self, task: int, state: int, k: int) -> float:
        """Return Q(task, state, k-th child): the child first, then the root to its end."""
        if task not in self._known:
            self._known[task] = self._table(task)
        return float(self._known[task][state, k])

    def _table(self, task: int) -> NDArray[np.float64]:
        """Return the values of a task's children, shape (states, children)."""
        children = self._children[task]
        if task in self.options.tasks:
            return self._lookahead(task)[:, children]
        found = np.full((len(self._states), len(children)), _NEVER)
        values, initiation = self._options.numpy(), self.options.initiation
        for option, stack in enumerate(self.options.stacks):
            for level, edge in enumerate(stack):
                if edge.caller == task:
                    begins = np.where(initiation[:, level, option], values[:, option], _NEVER)
                    for k in (k for k, child in enumerate(children) if child == edge.child):
                        found[:, k] = np.maximum(found[:, k], begins)
        return found

    def _lookahead(self, task: int) -> NDArray[np.float64]:
        """Return the worth of every action of a task that calls actions, shape (states, actions).

        Where a task stands on top of several stacks, each state takes the first that may begin there, for
        below the task they all compare its actions alike.
        """
        own = np.flatnonzero(self.options.task == self.options.tasks.index(task))
        begins = self.options.initiation[:, 0, own]
        chosen = own[np.where(begins.any(axis=1), begins.argmax(axis=1), 0)]
        worth = np.stack([self._arriving(int(option)) for option in own], axis=1)
        model = self.grounded.model
        place = np.searchsorted(own, chosen)
        after = worth[model.outcomes, place[:, None, None]]
        found: NDArray[np.float64] = (model.probabilities * (model.outcome_rewards + self.gamma * after)).sum(
            axis=2
        )
        return found

    def _arriving(self, option: int) -> NDArray[np.float64]:
        """Return what an option is worth where it arrives, shape (states,); 0 where the root has ended."""
        running = torch.full_like(self._states, option)
        initiation, ended, _ = self._tables(self._states, running)
        worth, _ = upon_arrival(self._options, running, ended.to(self._options.dtype), initiation, 0.0)
        over = self.grounded.nodes[self.grounded.root].terminal
        return np.where(over, 0.0, worth.double().numpy())
