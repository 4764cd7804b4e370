"""What an option-critic would do in every state, as tables, and what that is worth, exactly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import splu

from hierarchy.exits import may_come_to, surely_ends
from planners.option_critic.options import NONE, Options
from planners.states import state_numbers

EVEN: Final = 0.5
"""What a learnt termination must exceed to end a task greedily, where nothing is drawn."""


@dataclass(frozen=True, eq=False)
class GreedyPolicy:
    """The greedy policy of an option-critic.

    Parameters
    ----------
    options
        The options that it chooses among.
    option
        What runs on from a state, by the option that ran up to there, the last column for none; `NONE` where
        nothing may be chosen. Shape (states, options + 1).
    action
        What each option does in a state, shape (states, options).
    """

    options: Options
    option: NDArray[np.int64]
    action: NDArray[np.int64]

    def route(self, state: int, limit: int = 1000) -> list[tuple[int, int, int]] | None:
        """Return the (state, option, action) of every step to the root's end.

        It is None where that takes more than `limit` steps, or where there is nothing to choose.

        The world must be deterministic.
        """
        grounded = self.options.grounded
        after, ended = grounded.model.successors, grounded.nodes[grounded.root].terminal
        running, route = NONE, list[tuple[int, int, int]]()
        while not ended[state]:
            if len(route) == limit:
                return None
            running = int(self.option[state, running])
            if running == NONE:
                return None
            action = int(self.action[state, running])
            route.append((state, running, action))
            state = int(after[state, action])
        return route

    def returns(self, starts: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the expected undiscounted reward from some states to the root's end, shape (starts,).

        States are given by their numbers. It is -inf where the policy does not surely end.
        """
        model = self.options.grounded.model
        numbers = state_numbers(starts, model.index.size)
        return self._followed(numbers) if model.is_deterministic else self._solved(numbers)

    def _followed(self, starts: NDArray[np.int64]) -> NDArray[np.float64]:
        """Follow the policy from every state by jumps that double, until no way can be new."""
        grounded, columns = self.options.grounded, self.option.shape[1]
        model, ended = grounded.model, grounded.nodes[grounded.root].terminal
        joint = np.arange(self.option.size)
        state, option = joint // columns, self.option.ravel()
        action = self.action[state, option]
        over = ended[state]
        halts = over | (option == NONE)
        after = np.where(halts, joint, model.successors[state, action] * columns + option)
        total = np.where(halts, 0.0, model.rewards[state, action])
        for _ in range(int(joint.size).bit_length()):
            total, after = total + total[after], after[after]
        values = np.where(over[after], total, -np.inf)
        found: NDArray[np.float64] = values[starts * columns + columns - 1]
        return found

    def returns_within(self, starts: NDArray[np.int64], limit: int) -> NDArray[np.float64]:
        """Return the expected undiscounted reward of the first so many steps, shape (starts,).

        States are given by their numbers. It is finite, whether the policy ends or not; where nothing may be
        chosen there is nothing to earn.
        """
        numbers = state_numbers(starts, self.options.grounded.model.index.size)
        first, kernel, rewards, live, _ = self._chain(numbers)
        places = np.flatnonzero(_reached(kernel, first, live.size))
        inside, earned = kernel[places][:, places], rewards[places]
        values = np.zeros(places.size)
        for _ in range(limit):
            values = earned + inside @ values
        found: NDArray[np.float64] = values[np.searchsorted(places, first)]
        return found

    def _solved(self, starts: NDArray[np.int64]) -> NDArray[np.float64]:
        """Solve for the value of every state and running option that can be reached."""
        first, kernel, rewards, live, over = self._chain(starts)
        reached = _reached(kernel, first, live.size)
        sure = surely_ends(kernel, live, over)
        inside = np.flatnonzero(sure & reached)
        values = np.where(over, 0.0, -np.inf)
        if inside.size:
            system = csc_array(eye_array(inside.size) - kernel[inside][:, inside])
            values[inside] = splu(system).solve(rewards[inside])
        found: NDArray[np.float64] = values[first]
        return found

    def _chain(self, starts: NDArray[np.int64]) -> _Chain:
        """Return the policy as a chain over states and running options, one after the other."""
        grounded, columns = self.options.grounded, self.option.shape[1]
        model, ended = grounded.model, grounded.nodes[grounded.root].terminal
        joint = np.arange(self.option.size)
        state, option = joint // columns, self.option.ravel()
        action, over = self.action[state, option], ended[state]
        live = ~over & (option != NONE)
        chances = np.where(live[:, None], model.probabilities[state, action], 0.0)
        rewards = (chances * model.outcome_rewards[state, action]).sum(axis=1)
        to = model.outcomes[state, action] * columns + option[:, None]
        occurs = chances > 0  # an entry of 0 would count as a way to go
        rows = np.broadcast_to(joint[:, None], to.shape)[occurs]
        kernel = csr_array((chances[occurs], (rows, to[occurs])), shape=(joint.size, joint.size))
        return _Chain(starts * columns + columns - 1, kernel, rewards, live, over)


class _Chain(NamedTuple):
    """A policy as a chain: where it begins, its chances and rewards, where it goes on, where it is over."""

    first: NDArray[np.int64]
    kernel: csr_array[np.float64]
    rewards: NDArray[np.float64]
    live: NDArray[np.bool_]
    over: NDArray[np.bool_]


def _reached(kernel: csr_array[np.float64], first: NDArray[np.int64], size: int) -> NDArray[np.bool_]:
    """Return which places of a chain it may come to, shape (size,)."""
    everywhere = np.ones(size, dtype=np.bool_)
    return may_come_to(csr_array(kernel.T), everywhere, np.isin(np.arange(size), first))
