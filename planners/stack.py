"""The best that a hierarchy can express, and the best that the world allows, exactly.

While a hierarchy runs there is a stack of tasks besides the state (Dietterich 2000, section 3.2). Over both
it is an ordinary decision problem (Parr and Russell, 1998; the joint states of Andre and Russell, 2002),
whose optimum is the hierarchically optimal policy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from hierarchy import Exits, GroundCall, GroundGraph, primitive_exits
from planners.smdp import Mask, Optimum, best_policy
from worlds import TransitionModel

Stack = tuple[int, ...]
"""Places of the running tasks, from the root to the one that chooses next."""


@dataclass(frozen=True, eq=False)
class StackProblem:
    """A ground graph as a decision problem over task stacks and states.

    Joint state number ``stack * states + state`` has that stack running in that state. To choose a task
    puts it on the stack, at no time and no reward; to choose a primitive action takes a step, after which
    every task that has ended there is taken off, from the top down to the first that has not. The problem
    has ended when only the root is left and has ended.

    Parameters
    ----------
    grounded
        The ground graph.
    stacks
        Every stack that calls can build, the root's own first, callers before their children.
    choices
        The k-th call of whatever task is on top: where it is available, shape (joint states,), and what
        becomes of it.
    terminal
        Where the problem has ended, shape (joint states,).
    """

    grounded: GroundGraph
    stacks: tuple[Stack, ...]
    choices: tuple[tuple[Mask, Exits], ...]
    terminal: Mask

    @property
    def tops(self) -> tuple[int, ...]:
        """The task on top of each stack, by place."""
        return tuple(stack[-1] for stack in self.stacks)

    def spread(self, table: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return a policy that looks at no stack, shape (nodes, states), as one of joint states."""
        return table[list(self.tops)].ravel()


@dataclass(frozen=True, eq=False)
class StackSolution:
    """A hierarchically optimal policy.

    Parameters
    ----------
    problem
        The decision problem that it solves.
    value
        V of each stack and state, shape (stacks, states): what is still to come until the root ends, -inf
        where no policy surely ends. Row 0 is the root's.
    choice
        The call that the task on top makes, first in order among equals, shape (stacks, states); -1 where
        none.
    """

    problem: StackProblem
    value: NDArray[np.float64]
    choice: NDArray[np.int64]


def stack_problem(grounded: GroundGraph, gamma: float = 1.0) -> StackProblem:
    """Build the decision problem over stacks and states.

    The number of stacks is the number of paths of calls from the root to a task.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> problem = stack_problem(ground(two_rooms(maze), maze_model(maze)))
    >>> len(problem.stacks), problem.terminal.size
    (11, 22528)
    """
    stacks = _stacks(grounded)
    joint = _Joint(grounded, stacks, gamma)
    most = max(len(grounded.nodes[stack[-1]].calls) for stack in stacks)
    size = grounded.model.index.size
    terminal = np.zeros(len(stacks) * size, dtype=np.bool_)
    terminal[:size] = grounded.nodes[grounded.root].terminal
    return StackProblem(grounded, stacks, tuple(joint.choice(k) for k in range(most)), terminal)


def hierarchical_optimum(grounded: GroundGraph, gamma: float = 1.0) -> StackSolution:
    """Find the best policy that the hierarchy can express, when choices may depend on the whole stack.

    Its calls are those of the ground graph, and a task that is called runs until it ends. Pseudo-rewards
    have no say in it.

    Raises
    ------
    planners.EndlessRewardError
        If reward can be collected for ever without discounting.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> best = hierarchical_optimum(ground(two_rooms(maze, one_door_task=True), maze_model(maze)))
    >>> best.value[0, best.problem.grounded.model.starts].sum()
    np.float64(-5702.0)
    """
    problem = stack_problem(grounded, gamma)
    best = best_policy(problem.choices, problem.terminal, name=f"the hierarchy {grounded.graph.name}")
    shape = (len(problem.stacks), grounded.model.index.size)
    return StackSolution(problem, best.value.reshape(shape), best.choice.reshape(shape))


def flat_optimum(model: TransitionModel, terminal: Mask, gamma: float = 1.0) -> Optimum:
    """Find the global optimum: every primitive action is always allowed, and `terminal` ends the episode.

    Raises
    ------
    planners.EndlessRewardError
        If reward can be collected for ever without discounting.

    Examples
    --------
    >>> from worlds import StateIndex, Variable
    >>> x, moves = StateIndex((Variable("x", (0, 1, 2)),)), np.array([[0, 1], [0, 2], [1, 2]])
    >>> model = TransitionModel(x, ("left", "right"), moves, np.full((3, 2), -1.0), np.ones(3, bool))
    >>> best = flat_optimum(model, np.array([False, False, True]))
    >>> best.value, best.choice
    (array([-2., -1.,  0.]), array([ 1,  1, -1]))
    """
    exits = [primitive_exits(model, action, gamma) for action in range(len(model.actions))]
    return best_policy([(~terminal, one) for one in exits], terminal, name="the world")


def _stacks(grounded: GroundGraph) -> tuple[Stack, ...]:
    """Return every stack that available calls can build, callers before their children."""
    stacks: list[Stack] = [(grounded.root,)]
    for stack in stacks:
        calls = grounded.nodes[stack[-1]].calls
        called = {c.child for c in calls if grounded.nodes[c.child].calls and c.available.any()}
        stacks.extend((*stack, child) for child in sorted(called))
    return tuple(stacks)


class _Joint:
    """Builds the choices over joint states from the calls of every stack's top."""

    def __init__(self, grounded: GroundGraph, stacks: tuple[Stack, ...], gamma: float) -> None:
        self.size = grounded.model.index.size
        self.tops = [grounded.nodes[stack[-1]] for stack in stacks]
        self.stacks = stacks
        self.number = {stack: place for place, stack in enumerate(stacks)}
        actions = range(len(grounded.model.actions))
        self.primitive = [primitive_exits(grounded.model, action, gamma) for action in actions]
        # What is left of each stack when control comes back to it in a state; callers stand first.
        self.left = np.repeat(np.arange(len(stacks))[:, None], self.size, axis=1)
        for place, stack in enumerate(stacks[1:], start=1):
            caller = self.left[self.number[stack[:-1]]]
            self.left[place] = np.where(self.tops[place].terminal, caller, place)

    def choice(self, k: int) -> tuple[Mask, Exits]:
        """Return the k-th call of whatever is on top: where it is available, and what becomes of it."""
        joint = len(self.stacks) * self.size
        available, value = np.zeros(joint, dtype=np.bool_), np.zeros(joint)
        parts = []
        for place, top in enumerate(self.tops):
            if k < len(top.calls) and top.calls[k].available.any():
                block = slice(place * self.size, (place + 1) * self.size)
                available[block] = top.calls[k].available
                if top.calls[k].child < len(self.primitive):
                    value[block] = self.primitive[top.calls[k].child].value
                parts.append(self._moves(place, top.calls[k]))
        if not parts:
            return available, Exits(value, csr_array((joint, joint)))
        entries, rows, cols = (np.concatenate(part) for part in zip(*parts, strict=True))
        return available, Exits(value, csr_array(coo_array((entries, (rows, cols)), shape=(joint, joint))))

    def _moves(
        self, place: int, call: GroundCall
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Return a call's moves out of one stack: chances, discounted, and joint states before and after."""
        at = np.flatnonzero(call.available)
        if call.child >= len(self.primitive):
            called = self.number[*self.stacks[place], call.child]
            return np.ones(at.size), place * self.size + at, called * self.size + at
        steps = coo_array(self.primitive[call.child].kernel[at])
        before, after = steps.coords
        return steps.data, place * self.size + at[before], self.left[place, after] * self.size + after
