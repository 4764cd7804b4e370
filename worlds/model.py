"""Exact transition models of finite worlds, and the maze's."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from worlds.layout import ACTIONS, Cell, Layout
from worlds.maze import MazeState
from worlds.variables import StateIndex, Variable


class StochasticModelError(ValueError):
    """Something that needs a deterministic model was given one that is not."""


class TransitionModel:
    """What every action does in every state of a finite world: outcomes with probabilities and rewards.

    Parameters
    ----------
    index
        Numbers the states.
    actions
        Names of the primitive actions, in the order that breaks ties.
    successors
        Numbers of the next states, shape (states, actions, outcomes), or (states, actions) for a
        deterministic world.
    rewards
        Reward of each outcome, shaped like `successors`.
    starts
        The states in which an episode may begin, shape (states,), bool.
    probabilities
        Probability of each outcome, shaped like `successors`; the outcomes of an action sum to 1, and one
        of probability 0 does not occur. Left out where there is one outcome.

    Attributes
    ----------
    outcomes, outcome_rewards, probabilities
        As above, always of shape (states, actions, outcomes).

    Raises
    ------
    ValueError
        If shapes do not fit, a successor is no state, or probabilities do not sum to 1.

    Examples
    --------
    A slippery corridor: the step right fails in one of four cases.

    >>> x = StateIndex((Variable("x", (0, 1, 2)),))
    >>> successors = np.array([[[1, 0]], [[2, 1]], [[2, 2]]])
    >>> chances = np.tile([0.75, 0.25], (3, 1, 1))
    >>> rewards, starts = np.full((3, 1, 2), -1.0), np.ones(3, bool)
    >>> model = TransitionModel(x, ("right",), successors, rewards, starts, probabilities=chances)
    >>> model.is_deterministic, model.expectation(np.array([0.0, 0.0, 1.0]))[:, 0]
    (False, array([0.  , 0.75, 1.  ]))
    """

    def __init__(
        self,
        index: StateIndex,
        actions: tuple[str, ...],
        successors: NDArray[np.int64],
        rewards: NDArray[np.float64],
        starts: NDArray[np.bool_],
        *,
        probabilities: NDArray[np.float64] | None = None,
    ) -> None:
        if successors.ndim == 2:
            successors, rewards = successors[..., None], rewards[..., None]
        if probabilities is None:
            probabilities = np.ones(successors.shape)
        elif probabilities.ndim == 2:
            probabilities = probabilities[..., None]
        self.index = index
        self.actions = actions
        self.outcomes = successors
        self.outcome_rewards = rewards
        self.probabilities = probabilities
        self.starts = starts
        self._check()

    def _check(self) -> None:
        shape = self.outcomes.shape
        if shape[:2] != (self.index.size, len(self.actions)) or len(shape) != 3:
            wanted = (self.index.size, len(self.actions))
            raise ValueError(f"successors needs shape (states, actions[, outcomes]) = {wanted}, not {shape}")
        if self.outcome_rewards.shape != shape or self.probabilities.shape != shape:
            raise ValueError(f"rewards and probabilities need the shape of successors, {shape}")
        if self.starts.shape != shape[:1]:
            raise ValueError(f"starts needs shape (states,) = {shape[:1]}, not {self.starts.shape}")
        if self.outcomes.min() < 0 or self.outcomes.max() >= self.index.size:
            raise ValueError(f"successors must be state numbers, 0 to {self.index.size - 1}")
        if self.probabilities.min() < 0 or not np.allclose(self.probabilities.sum(axis=2), 1.0, atol=1e-9):
            raise ValueError("the probabilities of an action's outcomes must be at least 0 and sum to 1")

    @property
    def is_deterministic(self) -> bool:
        """Whether every action has one outcome in every state."""
        return bool(self.outcomes.shape[2] == 1)

    @property
    def successors(self) -> NDArray[np.int64]:
        """The next state of every action, shape (states, actions).

        Raises
        ------
        StochasticModelError
            If an action has several outcomes.
        """
        if not self.is_deterministic:
            raise StochasticModelError("this needs a deterministic model; actions here have several outcomes")
        return self.outcomes[..., 0]

    @property
    def rewards(self) -> NDArray[np.float64]:
        """Expected reward of every action, shape (states, actions)."""
        expected: NDArray[np.float64] = (self.probabilities * self.outcome_rewards).sum(axis=2)
        return expected

    def expectation(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the expected value of the next state, shape (states, actions), of values a state."""
        expected: NDArray[np.float64] = (self.probabilities * values[self.outcomes]).sum(axis=2)
        return expected

    def may_reach(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return whether an action may lead into `mask`, shape (states, actions)."""
        led: NDArray[np.bool_] = np.any((self.probabilities > 0) & mask[self.outcomes], axis=2)
        return led

    def must_reach(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return whether an action leads into `mask` whatever its outcome, shape (states, actions)."""
        return ~self.may_reach(~mask)

    def following(self, mask: NDArray[np.bool_], action: int) -> NDArray[np.int64]:
        """Return the states that an action may lead to from the states of `mask`, sorted."""
        occurs = self.probabilities[mask, action] > 0
        return np.unique(self.outcomes[mask, action][occurs])

    def beginning(self, starts: NDArray[np.bool_]) -> Self:
        """Return the same world with other starts, shape (states,), bool.

        Examples
        --------
        >>> x = StateIndex((Variable("x", (0, 1)),))
        >>> model = TransitionModel(x, ("go",), np.array([[1], [1]]), np.zeros((2, 1)), np.ones(2, bool))
        >>> part = model.beginning(np.array([True, False]))
        >>> part.starts.tolist(), part.whole is model, part.beginning(part.starts).whole is model
        ([True, False], True, True)
        """
        found = copy(self)
        found.starts, found.whole = starts, self.whole
        return found

    @cached_property
    def whole(self) -> Self:
        """The world with all the starts that it was made with: what a task graph is checked against."""
        return self

    def reachable(self, starts: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
        """Return the states that some action sequence may reach from `starts`, shape (states,)."""
        reach = np.array(self.starts if starts is None else starts)
        occurs = self.probabilities > 0
        frontier = np.flatnonzero(reach)
        while frontier.size:
            new = np.unique(self.outcomes[frontier][occurs[frontier]])
            frontier = new[~reach[new]]
            reach[frontier] = True
        return reach


def maze_variables(layout: Layout) -> tuple[Variable, Variable, Variable, Variable]:
    """Return a maze's state variables without obstacles: robot, trigger, goal, doors.

    Examples
    --------
    >>> from worlds import load_layout
    >>> [(v.name, len(v)) for v in maze_variables(load_layout("two_rooms"))]
    [('robot', 64), ('trigger', 4), ('goal', 4), ('doors', 2)]
    """
    free = tuple(cell for cell in layout.cells if cell not in layout.solid)
    return (
        Variable("robot", free, tuple(str(cell) for cell in free)),
        Variable("trigger", tuple(layout.triggers.values()), tuple(layout.triggers)),
        Variable("goal", tuple(layout.goals.values()), tuple(layout.goals)),
        Variable("doors", ("closed", "open")),
    )


def maze_model(layout: Layout) -> TransitionModel:
    """Return the exact model of a maze without obstacles; every action costs 1 (section 4).

    An episode may begin anywhere in the start's room except on its trigger, doors closed.
    """
    index = StateIndex(maze_variables(layout))
    free, triggers = _numbers(layout, index, "robot"), _numbers(layout, index, "trigger")
    place = np.full(len(layout.cells) + 1, -1)  # the last is read for -1: no passage
    place[free] = np.arange(free.size)
    shape = (*index.shape, len(ACTIONS))
    after = np.empty(shape, dtype=np.int64)
    goals = np.arange(shape[2])[:, None]
    for doors_open in (False, True):
        robot = place[_passages(layout, free, doors_open=doors_open)]  # (free cells, actions)
        robot = np.where(robot < 0, np.arange(free.size)[:, None], robot)[:, None, None, :]
        moved = robot != np.arange(free.size)[:, None, None, None]
        opens = doors_open | (moved & (free[robot] == triggers[:, None, None]))
        place_of = (robot, np.arange(triggers.size)[:, None, None], goals, opens.astype(np.int64))
        after[..., int(doors_open), :] = np.ravel_multi_index(np.broadcast_arrays(*place_of), index.shape)
    room = np.zeros(len(layout.cells), dtype=np.bool_)
    room[[layout.number(cell) for cell in layout.room(layout.start)]] = True
    starts = np.zeros(index.shape, dtype=np.bool_)
    starts[..., 0] = (room[free][:, None] & (free[:, None] != triggers))[..., None]
    successors = after.reshape(index.size, len(ACTIONS))
    return TransitionModel(index, ACTIONS, successors, np.full(successors.shape, -1.0), starts.reshape(-1))


def _numbers(layout: Layout, index: StateIndex, name: str) -> NDArray[np.int64]:
    """Return the cell numbers that a variable of a maze takes, in the order of its domain."""
    cells = index.variable(name).values
    return np.array([layout.number(cell) for cell in cells if isinstance(cell, Cell)], dtype=np.int64)


def _passages(layout: Layout, cells: NDArray[np.int64], *, doors_open: bool) -> NDArray[np.int64]:
    """Return `Layout.passage` of cells under every action, shape (cells, actions)."""
    neighbours = np.array(layout.neighbours, dtype=np.int64)[cells]
    shut = np.array(layout.gates, dtype=np.bool_)[cells] & (not doors_open)
    return np.where(shut, -1, neighbours)


def state_number(layout: Layout, index: StateIndex, state: MazeState) -> int:
    """Return the number of a maze's state, its obstacles left out."""
    return index.number(
        (
            layout.cells[state.robot],
            layout.cells[state.trigger],
            layout.cells[state.goal],
            "open" if state.doors_open else "closed",
        )
    )
