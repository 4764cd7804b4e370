"""How an option-critic uses its options: what its return does not tell.

Learnt options fail in two ways that leave the return near the best: each lasts one step, or one runs for ever
(Bacon, Harb and Precup, 2017, section 6; Harb et al., 2018). All is measured on the exact greedy routes from
given starts, each step of each route counting once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.fields import task_field
from planners.option_critic.greedy import EVEN, GreedyPolicy
from planners.option_critic.options import NONE, Options
from planners.stack import Stack, StackSolution, hierarchical_optimum
from planners.states import state_numbers
from worlds import UserError

_TIE: Final = 1e-9
_LOST: Final = -1e12  # stands for minus infinity, whose products are no numbers


@dataclass(frozen=True)
class Degeneracy:
    """How options are used on greedy routes.

    A share of nothing is nan: of changes where every route is one step long, say.

    Parameters
    ----------
    duration
        Mean steps from one choice of an option to the next, or to the route's end; an option that ends and
        is chosen again counts anew.
    switch_rate
        Share of steps, each route's first left out, that run another option than the step before.
    usage_entropy
        Entropy of the steps' options over the logarithm of the number of options: 1 if all are used alike.
    beta_at_subgoals, beta_elsewhere
        Mean probability that a task of the running stack ends where its option arrives, in states where the
        graph's task has ended and in others; the world's own end left out.
    oracle_subtasks
        Share of steps whose running task is one that a hierarchically optimal policy may run there.
    optimal_actions
        Share of the steps of tasks whose action is an optimal first action of the running task.
    steps
        Steps in all.
    """

    duration: float
    switch_rate: float
    usage_entropy: float
    beta_at_subgoals: float
    beta_elsewhere: float
    oracle_subtasks: float
    optimal_actions: float
    steps: int


class Oracle:
    """What the options of a graph are held against: solved once, asked of many learners.

    Parameters
    ----------
    options
        The options, of a deterministic world whose actions cost one each.

    Attributes
    ----------
    may_run
        Where a hierarchically optimal policy may run an option, shape (states, options).
    optimal
        Optimal first actions of the task on top of an option, shape (states, options, actions); of an option
        that is an action, this action.

    Raises
    ------
    UserError
        If the world has chance in it.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from planners.option_critic.options import compile_options
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> oracle = Oracle(compile_options(ground(two_rooms(maze), maze_model(maze))))
    >>> start = oracle.options.grounded.model.starts.argmax()
    >>> [oracle.options.names[i] for i in oracle.may_run[start].nonzero()[0]]
    ['GotoTrigger(T1)']
    """

    def __init__(self, options: Options) -> None:
        model = options.grounded.model
        if not model.is_deterministic:
            raise UserError(
                "how options are used is told of deterministic worlds, and this one has actions with several "
                "outcomes; compare returns alone"
            )
        self.options = options
        runs = _Runs(hierarchical_optimum(options.grounded))
        self.may_run = np.stack([self._runs(runs, k) for k in range(len(options))], axis=1)
        self.optimal = np.stack([self._optimal(k) for k in range(len(options))], axis=1)

    def _runs(self, runs: _Runs, k: int) -> NDArray[np.bool_]:
        below = (self.options.grounded.root, *(edge.child for edge in self.options.stacks[k]))
        return runs.calling(below) if self.options.task[k] == NONE else runs.running(below)

    def _optimal(self, k: int) -> NDArray[np.bool_]:
        grounded = self.options.grounded
        if self.options.task[k] == NONE:
            return np.asarray(self.options.actions[:, k])
        return task_field(grounded.model, grounded.nodes[self.options.stacks[k][-1].child]).optimal()


class _Runs:
    """Which stacks hierarchically optimal policies build, and which calls they make, begun in any state."""

    def __init__(self, best: StackSolution) -> None:
        self.problem = problem = best.problem
        self.states = problem.grounded.model.index.size
        value = np.maximum(best.value.ravel(), _LOST)
        slack = _TIE * np.maximum(1.0, np.abs(value))
        self.made = [
            may & (value > _LOST) & (exits.value + exits.kernel @ value >= value - slack)
            for may, exits in problem.choices
        ]
        self.reached = np.zeros(value.size, dtype=np.bool_)
        self.reached[: self.states] = True
        front = np.arange(self.states)
        while front.size:
            pairs = zip(self.made, problem.choices, strict=True)
            led = [exits.kernel[front[made[front]]].indices for made, (_, exits) in pairs]
            front = np.setdiff1d(np.concatenate(led), np.flatnonzero(self.reached))
            self.reached[front] = True

    def running(self, stack: Stack) -> NDArray[np.bool_]:
        """Return where a stack may run, shape (states,)."""
        if stack not in self.problem.stacks:
            return np.zeros(self.states, dtype=np.bool_)
        first = self.problem.stacks.index(stack) * self.states
        return np.asarray(self.reached[first : first + self.states])

    def calling(self, stack: Stack) -> NDArray[np.bool_]:
        """Return where the task below the last of a stack may run and call it, a primitive action."""
        first = self.problem.stacks.index(stack[:-1]) * self.states
        found = np.zeros(self.states, dtype=np.bool_)
        for call, made in zip(self.problem.grounded.nodes[stack[-2]].calls, self.made, strict=False):
            if call.child == stack[-1]:
                found |= made[first : first + self.states]
        return found & self.running(stack[:-1])


class _Steps(NamedTuple):
    """All steps of some routes: arrays of one length."""

    state: NDArray[np.int64]
    option: NDArray[np.int64]
    before: NDArray[np.int64]
    action: NDArray[np.int64]


def degeneracy(
    policy: GreedyPolicy,
    starts: NDArray[np.int64],
    *,
    beta: NDArray[np.floating] | None = None,
    oracle: Oracle | None = None,
    limit: int = 200,
) -> Degeneracy:
    """Measure how the options are used on the greedy routes from some states.

    Parameters
    ----------
    policy
        What is followed; the world must be deterministic.
    starts
        Numbers of the states, none of them terminal, shape (starts,).
    beta
        Probability that an option's task at a level ends in a state, shape (states, options, levels):
        `OptionCritic.terminations`. Defaults to what the graph says.
    oracle
        What the options are held against, if it is there already.
    limit
        Steps after which a route that does not end is left.

    Raises
    ------
    UserError
        If the world has chance in it, or there is no start.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from planners.option_critic.options import compile_options
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> options = compile_options(ground(two_rooms(maze), maze_model(maze)))
    >>> oracle = Oracle(options)
    >>> chosen = (oracle.may_run & options.initiation[:, 0]).argmax(1)
    >>> goes_on = ~options.ended[:, 0]
    >>> option = np.where(goes_on, np.arange(10), chosen[:, None])
    >>> policy = GreedyPolicy(options, np.c_[option, chosen], oracle.optimal.argmax(2))
    >>> found = degeneracy(policy, options.grounded.model.starts.nonzero()[0], oracle=oracle)
    >>> found.oracle_subtasks, found.optimal_actions, found.beta_at_subgoals, round(found.duration, 2)
    (1.0, 1.0, 1.0, 3.83)
    """
    options = policy.options
    oracle = Oracle(options) if oracle is None else oracle
    states = state_numbers(starts, options.grounded.model.index.size)
    if not states.size:
        raise UserError("there is no state to start from; give at least one")
    if beta is None:
        beta = options.ended.transpose(0, 2, 1).astype(np.float64)
    steps = _followed(policy, states, limit)
    grounded = options.grounded
    after = grounded.model.successors[steps.state, steps.action]
    live = ~grounded.nodes[grounded.root].terminal[after]
    fresh = steps.before == NONE
    # What ran before was chosen anew where any task of its stack had ended.
    ended = (beta[steps.state, steps.before] > EVEN).any(1)
    chosen = fresh | ended | (steps.option != steps.before)
    shares = np.bincount(steps.option, minlength=len(options)) / steps.option.size
    used = shares[shares > 0]
    arrived, ran = after[live], steps.option[live]
    called = options.nodes[ran] != NONE
    graph = options.ended[arrived, :, ran] & called
    betas = beta[arrived, ran]
    on_top = options.task[steps.option] != NONE
    return Degeneracy(
        duration=steps.option.size / int(chosen.sum()),
        switch_rate=_mean((steps.option != steps.before)[~fresh]),
        usage_entropy=float((used * np.log(1 / used)).sum() / np.log(max(len(options), 2))),
        beta_at_subgoals=_mean(betas[graph]),
        beta_elsewhere=_mean(betas[called & ~graph]),
        oracle_subtasks=_mean(oracle.may_run[steps.state, steps.option]),
        optimal_actions=_mean(oracle.optimal[steps.state, steps.option, steps.action][on_top]),
        steps=steps.option.size,
    )


def _followed(policy: GreedyPolicy, starts: NDArray[np.int64], limit: int) -> _Steps:
    """Follow all routes at once, a step at a time."""
    grounded = policy.options.grounded
    over = grounded.nodes[grounded.root].terminal
    state, before = starts, np.full(len(starts), NONE)
    found = []
    for _ in range(limit):
        going = ~over[state]
        state, before = state[going], before[going]
        if not state.size:
            break
        option = policy.option[state, before]
        action = policy.action[state, option]
        found.append(_Steps(state, option, before, action))
        state, before = grounded.model.successors[state, action], option
    return _Steps(*(np.concatenate(part) for part in zip(*found, strict=True)))


def _mean(found: NDArray[np.generic]) -> float:
    return float(found.mean()) if found.size else float("nan")
