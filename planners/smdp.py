"""The best policy of one decision problem whose actions take time, by exact policy iteration.

Every degree of optimality is such a problem: a task over its children (Sutton, Precup and Singh, 1999,
section 3), a whole hierarchy over its stacks, a flat world over its primitive actions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, eye_array, vstack
from scipy.sparse.linalg import splu

from hierarchy import Exits
from hierarchy.exits import chain, surely_ends
from worlds import UserError

Mask = NDArray[np.bool_]

TIE = 1e-9
"""Values that differ by no more than this, for values of size 1, are equal."""


class EndlessRewardError(UserError):
    """Without discounting, reward can be collected for ever: no policy is best."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """A best policy of a decision problem.

    Parameters
    ----------
    value
        Its value, shape (states,); -inf where no policy surely ends.
    choice
        The place of what it chooses, first in order among equals, shape (states,); -1 where nothing.
    """

    value: NDArray[np.float64]
    choice: NDArray[np.int64]


def best_policy(
    choices: Sequence[tuple[Mask, Exits]],
    terminal: Mask,
    ends: NDArray[np.float64] | None = None,
    name: str = "the problem",
) -> Optimum:
    """Find the best among the policies that surely end.

    Policy iteration starts from a policy that ends, and takes strict improvements only (Bertsekas and
    Tsitsiklis, 1991, on stochastic shortest paths). A strict improvement that led into a loop would earn
    more than nothing on every round of it: then no policy is best, which is an error. So rewards may have
    any sign, and steps may cost nothing. At the end ties go to what comes first, except where that would
    go round for ever.

    Parameters
    ----------
    choices
        What can be chosen, in the order that breaks ties: where, shape (states,), and what becomes of it.
    terminal
        Where the problem has ended, shape (states,).
    ends
        Value of ending in each terminal state, shape (states,); 0 unless given.
    name
        What to call the problem in an error.

    Raises
    ------
    EndlessRewardError
        If reward can be collected for ever without discounting.

    Examples
    --------
    From 0 either straight to the end, 2, at a cost of 5, or by 1 at a cost of 1 and 2.

    >>> slow = Exits(np.array([-5.0, -2, 0]), csr_array(np.eye(3)[[2, 2, 2]]))
    >>> fast = Exits(np.array([-1.0, -9, 0]), csr_array(np.eye(3)[[1, 1, 2]]))
    >>> running = np.array([True, True, False])
    >>> best = best_policy([(running, slow), (running, fast)], ~running)
    >>> best.value, best.choice
    (array([-3., -2.,  0.]), array([ 1,  0, -1]))
    """
    problem = _Problem(choices, terminal, np.zeros(terminal.size) if ends is None else ends)
    value = np.where(terminal, problem.ends, -np.inf)
    region, choice = problem.ending_policy(problem.usable)
    if not region.any():
        return Optimum(value, choice)
    problem.confine(region)
    while True:
        now = problem.evaluate(choice)
        quality = problem.quality(now)
        slack = TIE * max(1.0, float(np.abs(now).max()))
        better = region & (quality.max(axis=0) > now + slack)
        if not better.any():
            break
        choice = np.where(better, quality.argmax(axis=0), choice)
        if not problem.ends_from(choice)[region].all():
            raise EndlessRewardError(
                f"{name} can collect reward for ever, so no policy is best; "
                "discount it (gamma below 1), or mend the rewards"
            )
    tied = problem.usable & (quality >= quality.max(axis=0, initial=-np.inf) - slack)
    choice = problem.first_that_ends(tied, region)
    value[region] = problem.evaluate(choice)[region]
    return Optimum(value, choice)


class _Problem:
    """A decision problem as stacked arrays: row k * states + s is choice k in state s."""

    def __init__(
        self, choices: Sequence[tuple[Mask, Exits]], terminal: Mask, ends: NDArray[np.float64]
    ) -> None:
        self.terminal = terminal
        self.ends = np.where(terminal, ends, 0.0)
        self.exits = [exits for _, exits in choices]
        self.reward = np.stack([exits.value for exits in self.exits])
        self.kernel = csr_array(vstack([exits.kernel for exits in self.exits], format="csr"))
        self.leaking = self._through(np.ones(terminal.size)) < 1 - TIE
        self.usable = np.stack([mask for mask, _ in choices]) & np.isfinite(self.reward) & ~terminal

    def _through(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the discounted expectation of values a state after each choice, (choices, states)."""
        after: NDArray[np.float64] = np.asarray(self.kernel @ values).reshape(self.reward.shape)
        return after

    def confine(self, region: Mask) -> None:
        """Keep only choices that stay in a region, or end."""
        self.usable &= (self._through((~(region | self.terminal)).astype(float)) == 0) & region

    def ending_policy(self, allowed: Mask) -> tuple[Mask, NDArray[np.int64]]:
        """Return the states from which some policy surely ends, and one such policy.

        States are added layer by layer, each with a choice that may lead into an earlier layer and never
        out of the region; the region shrinks until every state of it is added. A discounted choice needs
        no end.
        """
        region: Mask = np.logical_or.reduce(allowed)
        before = csc_array(self.kernel)  # what may lead into a state, by its column
        while True:
            stays = self._through((~(region | self.terminal)).astype(float)) == 0
            allowed = allowed & stays & region
            choice: NDArray[np.int64] = np.full(self.terminal.size, -1)
            done, fresh = self.terminal.copy(), self.terminal.copy()
            into = allowed & self.leaking
            found = np.flatnonzero(into.any(axis=0) & ~done)
            entered = _sources(before, np.flatnonzero(fresh))
            while True:
                choices, states = np.divmod(entered, self.terminal.size)
                possible = allowed[choices, states]
                into[choices[possible], states[possible]] = True
                found = np.unique(np.concatenate([found, states[possible]]))
                found = found[~done[found]]
                if not found.size:
                    break
                choice[found] = into[:, found].argmax(axis=0)
                done[found] = True
                entered = _sources(before, found)
            if (done & ~self.terminal == region).all():
                return region, choice
            region = done & ~self.terminal

    def ends_from(self, choice: NDArray[np.int64]) -> Mask:
        """Return the states from which a policy surely ends."""
        return surely_ends(chain(choice, self.exits).kernel, choice >= 0, self.terminal)

    def first_that_ends(self, tied: Mask, region: Mask) -> NDArray[np.int64]:
        """Return the policy of the first choices among equals, mended where it would never end."""
        first: NDArray[np.int64] = np.where(region, tied.argmax(axis=0), -1)
        sure = self.ends_from(first)
        if (sure == region).all():
            return first
        _, mended = self.ending_policy(np.where(sure, np.arange(len(tied))[:, None] == first, tied))
        return mended

    def evaluate(self, choice: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the value of a policy that ends, shape (states,): 0 where it has no choice."""
        step = chain(choice, self.exits)
        inside = np.flatnonzero(choice >= 0)
        value = self.ends.copy()
        here = step.kernel[inside]
        reward = step.value[inside] + here @ self.ends
        value[inside] = splu(csc_array(eye_array(inside.size) - here[:, inside])).solve(reward)
        return value

    def quality(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the value of each choice when all later ones follow a policy, (choices, states)."""
        return np.where(self.usable, self.reward + self._through(value), -np.inf)


def _sources(before: csc_array[np.float64], states: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the rows that have a chance of leading into some states, from the matrix by its columns."""
    first, count = before.indptr[states], before.indptr[states + 1] - before.indptr[states]
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    at = np.repeat(first, count) + within
    rows: NDArray[np.int64] = before.indices[at[before.data[at] > 0]].astype(np.int64)
    return rows
