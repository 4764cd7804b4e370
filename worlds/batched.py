"""Many mazes at once: the arrays of a batch, and its kernel.

Environment i in its episode e draws from ``Stream(seed, i, e)`` alone, so that it is the same in a batch of
any size, whatever the others do. Importing this module loads numba.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from worlds import batch_kernels as kernels
from worlds.batch_reference import StreamedMazeEnv, Wanted, checked_count
from worlds.batch_tables import SLOT, tables_of
from worlds.errors import UserError
from worlds.layout import ACTIONS
from worlds.randomness import Stream

DISABLED, SAME_STEP, NEXT_STEP = kernels.DISABLED, kernels.SAME_STEP, kernels.NEXT_STEP
_GOLDEN: Final = np.uint64(0x9E37_79B9_7F4A_7C15)

Flags = NDArray[np.bool_]


class Stepped(NamedTuple):
    """What a step of all mazes gives; arrays that nothing else holds.

    Attributes
    ----------
    observations
        Shape (mazes, 8), int32, as `MazeEnv` describes them.
    rewards
        Shape (mazes,), float64: -1, or 0 for a maze that was reset instead.
    terminated, truncated
        Shape (mazes,), bool.
    masks
        Shape (mazes, 4), int8: 1 for the actions that would move the robot; no rows if not asked for.
    ended
        The mazes whose episode ended, ascending.
    last
        With `SAME_STEP`, the last observation of each of these and its steps, shape (ended, 9).
    last_masks
        The masks of these, shape (ended, 4).
    """

    observations: NDArray[np.int32]
    rewards: NDArray[np.float64]
    terminated: Flags
    truncated: Flags
    masks: NDArray[np.int8]
    ended: NDArray[np.int64]
    last: NDArray[np.int32]
    last_masks: NDArray[np.int8]


class MazeBatch:
    """Mazes of one kind that are stepped together.

    Parameters
    ----------
    one
        Says what each of them is: `StreamedMazeEnv` with its arguments.
    number
        How many.
    masks
        Whether to compute which actions would move the robot.

    Attributes
    ----------
    state
        Shape (mazes, 8), int32: the robot's cell, its marks' places, doors, steps, the step by which to look
        for obstacles that appear, the next episode, and whether this one is over.
    grid
        Obstacles by cell, shape (mazes, cells), uint8: 0 none, 2 cube, 3 sphere. One row, of zeros, where
        nothing may appear.

    Examples
    --------
    >>> batch = MazeBatch(StreamedMazeEnv("two_rooms", trigger="T4", goal="G2"), 3)
    >>> batch.seed(7)
    >>> batch.reset()[0][:, 0]
    array([ 9, 26, 16], dtype=int32)
    >>> batch.step([0, 1, 2]).observations[:, 0]
    array([ 1, 34, 16], dtype=int32)
    """

    def __init__(self, one: StreamedMazeEnv, number: int, *, masks: bool = False) -> None:
        self.one = one
        self.number = checked_count(number)
        self.tables = tables = tables_of(one)
        own = number if tables.most else 1
        self._grid = np.zeros((own, tables.room), dtype=np.uint8)
        self.grid = self._grid[:, tables.cols : tables.cols + tables.cells]
        self.state = np.zeros((number, kernels.FIELDS), dtype=np.int32)
        slots = np.zeros((number, tables.most, SLOT), dtype=np.int32) if tables.drawn else tables.slots[None]
        self.slots = np.ascontiguousarray(slots)
        self.due = np.zeros((number, tables.most), dtype=np.int32)
        self.keys = np.zeros(number, dtype=np.uint64)
        self._wanted = np.array(one.wanted(), dtype=np.int32)
        sizes = (len(tables.triggers), len(tables.goals), len(tables.starts), len(tables.free))
        strides = (
            tables.room if tables.most else 0,
            tables.most * SLOT if tables.drawn else 0,
            tables.most,
            one.max_steps,
        )
        numbers = (tables.cells, tables.cols, tables.most, tables.drawn, *sizes, *strides)
        self._mazes = (
            *(self.state, self._grid, self.slots, self.due, np.array(numbers, dtype=np.int64)),
            *(tables.shut, tables.doorways, tables.traps, tables.triggers, tables.goals, tables.starts),
            *(tables.seats, tables.free, tables.to_trigger, tables.to_goal),
            np.zeros(tables.most + 3, dtype=np.int32),
            np.zeros(2 * tables.cells + 2, dtype=np.int32),
        )
        self._all = np.ones(number, dtype=np.bool_)
        self._masks = (number if masks else 0, len(ACTIONS))
        # Room for what a step may find, used again and again.
        self._ended = np.zeros(number, dtype=np.int64)
        self._last = np.zeros((number, kernels.VIEW + 1), dtype=np.int32)
        self._last_masks = np.zeros(self._masks, dtype=np.int8)

    def seed(self, seed: int, chosen: Flags | None = None) -> None:
        """Let mazes, or those chosen, begin with episode 0 of a seed at their next reset."""
        chosen = self._all if chosen is None else chosen
        self.keys[chosen] = keys_of(seed, self.number)[chosen]
        self.state[chosen, kernels.EPISODE] = 0

    def reset(
        self, chosen: Flags | None = None, wanted: Wanted | None = None
    ) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
        """Begin the next episode of all mazes, or of those chosen.

        Parameters
        ----------
        chosen
            Shape (mazes,).
        wanted
            What these episodes are given, in place of what `one` says.

        Returns
        -------
        observations, masks
            Of all mazes, shapes (mazes, 8) and (mazes, 4).
        """
        views = np.empty((self.number, kernels.VIEW), dtype=np.int32)
        masks = np.empty(self._masks, dtype=np.int8)
        given = self._wanted if wanted is None else np.array(wanted, dtype=np.int32)
        kernels.reset(self._all if chosen is None else chosen, self.keys, given, self._mazes, masks, views)
        return views, masks

    def step(self, actions: Any, mode: int = DISABLED) -> Stepped:
        """Carry out an action in each maze.

        Parameters
        ----------
        actions
            Integers of 0 to 3, shape (mazes,).
        mode
            `DISABLED`: an episode that is over runs on until it is reset. `SAME_STEP`: it is reset at once,
            and the observation is the next episode's first. `NEXT_STEP`: its next step resets it, whatever
            the action.

        Raises
        ------
        UserError
            If there are not as many actions, or one is none; nothing has moved then.
        """
        number = self.number
        given = self._checked(actions)
        views = np.empty((number, kernels.VIEW), dtype=np.int32)
        masks = np.empty(self._masks, dtype=np.int8)
        rewards = np.empty(number)
        over = np.empty((2, number), dtype=np.uint8)
        out = (masks, views, rewards, over, self._ended, self._last, self._last_masks)
        ends = kernels.step(given, mode, self.keys, self._wanted, self._mazes, out)
        if ends < 0:
            where = -1 - ends
            raise UserError(f"action {given[where]} of environment {where} is not possible; give 0 to 3")
        terminated, truncated = over.view(np.bool_)
        last, last_masks = self._last[:ends], self._last_masks[:ends]
        return Stepped(views, rewards, terminated, truncated, masks, self._ended[:ends], last, last_masks)

    def kept(self, chosen: Flags) -> tuple[NDArray[Any], ...]:
        """Return a copy of what a step changes in the mazes that are chosen, for `put_back`."""
        grid = self._grid[chosen] if self.tables.most else self._grid[:0]
        return np.flatnonzero(chosen), self.state[chosen], grid, self.due[chosen]

    def put_back(self, kept: tuple[NDArray[Any], ...]) -> None:
        """Undo a step, which must not have reset them, in the mazes that `kept` was asked for."""
        rows, state, grid, due = kept
        self.state[rows], self.due[rows] = state, due
        if self.tables.most:
            self._grid[rows] = grid

    def _checked(self, actions: Any) -> NDArray[np.int64]:
        given = np.asarray(actions)
        if given.dtype.kind not in "iu":
            raise UserError(f"actions of type {given.dtype} are not possible; give integers of 0 to 3")
        if given.shape != (self.number,):
            raise UserError(
                f"actions of shape {given.shape} are not possible; give one for each of the {self.number}"
                f" environments, shape ({self.number},)"
            )
        return np.ascontiguousarray(given, dtype=np.int64)


def keys_of(seed: int, number: int) -> NDArray[np.uint64]:
    """Return the keys of ``Stream(seed, i)`` for each i below `number`.

    Examples
    --------
    >>> [int(key) for key in keys_of(7, 3)] == [Stream(7, i).key for i in range(3)]
    True
    """
    x = np.uint64(Stream(seed).key) + np.arange(number, dtype=np.uint64) + _GOLDEN
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58_476D_1CE4_E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D0_49BB_1331_11EB)
    return x ^ (x >> np.uint64(31))
