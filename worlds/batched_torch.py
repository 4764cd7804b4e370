"""Many mazes at once in PyTorch alone, on any device: `worlds.batched.MazeBatch`, number for number.

A step has no branch and waits for no value, so that it can be queued on a GPU. Importing this module loads
PyTorch.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import torch
from torch import Tensor

from worlds.appearing import FARTHEST, ON_THE_WAY
from worlds.batch_reference import StreamedMazeEnv, Wanted, checked_count
from worlds.batch_tables import CELL, EVENTS, SLOT, tables_of
from worlds.env import CUBE, FREE, SHUT, SPHERE
from worlds.errors import UserError
from worlds.layout import ACTIONS, KINDS
from worlds.randomness import Stream
from worlds.torch_stream import below, bits, keys_of, nth, sooner
from worlds.torch_ways import Ways, joined

_PENDING: Final = -1
_SETTLED: Final = -2
_START, _STEP, _ROBOT, _DOORS = range(len(EVENTS))


class Stepped(NamedTuple):
    """What a step of all mazes gives.

    Attributes
    ----------
    observations
        Shape (mazes, 8), int32, as `worlds.env.MazeEnv` describes them.
    rewards
        Shape (mazes,), float32: -1.
    terminated, truncated
        Shape (mazes,), bool.
    masks
        Shape (mazes, 4), bool: whether an action would move the robot; no rows if not asked for.
    """

    observations: Tensor
    rewards: Tensor
    terminated: Tensor
    truncated: Tensor
    masks: Tensor


class TorchMazeBatch:
    """Mazes of one kind that are stepped together.

    Parameters
    ----------
    one
        Says what each of them is: `StreamedMazeEnv` with its arguments.
    number
        How many.
    masks
        Whether to compute which actions would move the robot.
    device
        Where they live.

    Attributes
    ----------
    robot, trigger, goal, open, steps, episodes
        The robot's cell, its marks' places, doors, steps, and the next episode; shape (mazes,), int64.
    grid
        Obstacles by cell, shape (mazes, cells and a row before and after them), uint8: 0, `CUBE` or `SPHERE`.

    Examples
    --------
    >>> batch = TorchMazeBatch(StreamedMazeEnv("two_rooms", trigger="T4", goal="G2"), 3)
    >>> batch.seed(7)
    >>> batch.reset()[0][:, 0].tolist()
    [9, 26, 16]
    >>> batch.step(torch.tensor([0, 1, 2])).observations[:, 0].tolist()
    [1, 34, 16]
    """

    def __init__(
        self,
        one: StreamedMazeEnv,
        number: int,
        *,
        masks: bool = False,
        device: torch.device | str | None = None,
    ) -> None:
        self.number = checked_count(number)
        self.device = torch.device("cpu" if device is None else device)
        self.masks = masks
        self._wanted = one.wanted()
        self._limit = one.max_steps
        self.tables = tables = tables_of(one)
        self._cols = tables.cols
        actions = torch.arange(len(ACTIONS), device=self.device)
        # By doors, cell and action: whether it is stopped, and how far a sphere could roll.
        self._shut = (self._long(tables.shut)[:, :, None] >> actions) % 2 == 1
        self._by = torch.tensor([-tables.cols, tables.cols, -1, 1], device=self.device)
        self._reach = _reach(self._shut, self._by)
        self._doorways = self._long(tables.doorways) == 1
        self._triggers, self._goals = self._long(tables.triggers), self._long(tables.goals)
        self._starts, self._seats = self._long(tables.starts), self._long(tables.seats)
        self._floor = torch.zeros(tables.cells, dtype=torch.bool, device=self.device)
        self._floor[self._long(tables.free)] = True
        if tables.drawn:
            self._to_trigger = Ways(self._long(tables.to_trigger), self._starts)
            self._to_goal = Ways(self._long(tables.to_goal), self._triggers)
        zeros = torch.zeros(number, dtype=torch.int64, device=self.device)
        self.robot, self.trigger, self.goal = zeros.clone(), zeros.clone(), zeros.clone()
        self.open, self.steps, self.episodes = zeros.clone(), zeros.clone(), zeros.clone()
        self.keys = zeros.clone()
        self.grid = torch.zeros((number, tables.room), dtype=torch.uint8, device=self.device)
        shape = (number, tables.most, SLOT) if tables.drawn else (1, tables.most, SLOT)
        self.slots = self._long(tables.slots).reshape(shape) if not tables.drawn else zeros.new_zeros(shape)
        self.due = zeros.new_full((number, tables.most), _SETTLED)
        cells = self.slots[0, :, CELL]
        rivals = (cells[:, None] == cells) & ~torch.eye(tables.most, dtype=torch.bool, device=self.device)
        self._rivals = rivals if not tables.drawn and bool(rivals.any()) else None

    def seed(self, seed: int, chosen: Tensor | None = None) -> None:
        """Let mazes, or those chosen, begin with episode 0 of a seed at their next reset."""
        keys = keys_of(Stream(seed).key, self.number, self.device)
        keep = torch.zeros_like(self.keys, dtype=torch.bool) if chosen is None else ~chosen
        self.keys = torch.where(keep, self.keys, keys)
        self.episodes = self.episodes * keep

    def reset(self, chosen: Tensor | None = None, wanted: Wanted | None = None) -> tuple[Tensor, Tensor]:
        """Begin the next episode of all mazes, or of those chosen.

        Parameters
        ----------
        chosen
            Shape (mazes,), bool.
        wanted
            What these episodes are given, in place of what `one` says.

        Returns
        -------
        observations, masks
            Of all mazes, shapes (mazes, 8) and (mazes, 4).
        """
        if chosen is None:
            rows = torch.arange(self.number, device=self.device)
        else:
            rows = chosen.nonzero().squeeze(1)
        self._begin(rows, self._wanted if wanted is None else wanted)
        return self._observations(), self._masks()

    def step(self, actions: Tensor) -> Stepped:
        """Carry out an action in each maze; an episode that is over runs on until it is reset.

        Parameters
        ----------
        actions
            Integers of 0 to 3, shape (mazes,). Their values are not looked at, for which a GPU would wait:
            what is above 3 or below 0 is an error of the device.

        Raises
        ------
        UserError
            If there are not as many actions, or they are no integers.
        """
        if actions.shape != (self.number,) or actions.is_floating_point() or actions.dtype == torch.bool:
            raise UserError(
                f"actions of type {actions.dtype} and shape {tuple(actions.shape)} are not possible;"
                f" give an integer for each environment, shape ({self.number},)"
            )
        action = actions.long()
        by = self._by[action]
        to = self.robot + by
        passes = ~self._shut[self.open, self.robot, action]
        moves = passes
        if self.tables.most:
            what = self._at(to[:, None])[:, 0]
            rolls = passes & (what == SPHERE) & self._roll(to, action, by, passes & (what == SPHERE))
            moves = passes & ((what == FREE) | rolls)
        self.robot = torch.where(moves, to, self.robot)
        opened = (self.open == 0) & (self.robot == self._triggers[self.trigger])
        self.open = self.open | opened
        self.steps = self.steps + 1
        if self.tables.most:
            self._appear(slice(None), moves, opened)
        terminated = (self.open == 1) & (self.robot == self._goals[self.goal])
        truncated = ~terminated & (self.steps >= self._limit)
        rewards = torch.full((self.number,), -1.0, device=self.device)
        return Stepped(self._observations(), rewards, terminated, truncated, self._masks())

    def kept(self, chosen: Tensor) -> tuple[Tensor, ...]:
        """Return a copy of what a step changes in the mazes that are chosen, for `put_back`."""
        rows = chosen.nonzero().squeeze(1)
        changing = (self.robot, self.open, self.steps, self.grid, self.due)
        return rows, *(part[rows] for part in changing)

    def put_back(self, kept: tuple[Tensor, ...]) -> None:
        """Undo a step, which must not have reset them, in the mazes that `kept` was asked for."""
        rows, *parts = kept
        for part, before in zip((self.robot, self.open, self.steps, self.grid, self.due), parts, strict=True):
            part[rows] = before

    def _long(self, values: object) -> Tensor:
        return torch.as_tensor(values, device=self.device).long()

    def _at(self, cells: Tensor) -> Tensor:
        """Return what stands in cells, shape (mazes, any)."""
        return self.grid.gather(1, cells + self._cols)

    def _roll(self, sphere: Tensor, action: Tensor, by: Tensor, pushed: Tensor) -> Tensor:
        """Roll the spheres that are pushed, `worlds.roll`; return which of all cells' could move."""
        cells = self._shut.shape[1]
        here = sphere.clamp(0, cells - 1)
        reach = self._reach[self.open, here, action]
        ahead = torch.arange(1, max(self.tables.rows, self._cols), device=self.device)
        beyond = (here[:, None] + by[:, None] * ahead).clamp(0, cells - 1)
        clear = (ahead <= reach[:, None]) & (self._at(beyond) == FREE)
        distance = clear.long().cumprod(1).sum(1)
        rolls = pushed & (distance > 0)
        # Where nothing rolls, the first byte of the row before the maze is written, which nobody reads.
        start = torch.where(rolls, here + self._cols, 0)
        end = torch.where(rolls, here + by * distance + self._cols, 0)
        self.grid.scatter_(1, start[:, None], FREE)
        self.grid.scatter_(1, end[:, None], SPHERE)
        return rolls

    def _appear(self, rows: Tensor | slice, moved: Tensor, opened: Tensor) -> None:
        """Place every obstacle whose time has come and whose cell is free: `worlds.Episode`."""
        robot, steps, doors = (x[rows, None] for x in (self.robot, self.steps, self.open))
        due = self.due[rows]
        slots = self.slots[rows] if self.tables.drawn else self.slots
        cell, kind, event, step, at = slots.unbind(-1)
        moved, opened = moved[:, None], opened[:, None]
        come = (event == _START) & (steps == 0) | (event == _STEP) & (steps >= step)
        come |= (event == _ROBOT) & (at == robot) & (moved | (steps == 0)) | (event == _DOORS) & opened
        due = torch.where((due == _PENDING) & come, steps, due)
        cell = cell.expand_as(due)
        standing = self.grid[rows].gather(1, cell + self._cols)
        free = (due >= 0) & (cell != robot) & (standing == FREE) & ((doors == 1) | ~self._doorways[cell])
        if self._rivals is not None:
            rank = due * due.shape[1] + torch.arange(due.shape[1], device=self.device)
            before = (due >= 0)[:, None, :] & (rank[:, None, :] < rank[:, :, None])
            free &= ~(before & self._rivals).any(-1)
        target = torch.where(free, cell + self._cols, 0)  # the first byte is read by nobody
        looks = (CUBE + kind).expand_as(due).to(torch.uint8)
        self.grid[rows] = self.grid[rows].scatter(1, target, looks)
        self.due[rows] = torch.where(free, _SETTLED, due)

    def _begin(self, rows: Tensor, wanted: Wanted) -> None:
        """Begin the next episodes of mazes, drawn as `MazeEnv` draws them."""
        key = bits(self.keys[rows] + self.episodes[rows], 1)
        counter = 0
        if wanted.trigger >= 0:
            trigger = torch.full_like(rows, wanted.trigger)
        else:
            counter += 1
            choices = (self._triggers != wanted.start).nonzero().squeeze(1)
            trigger = choices[below(key, counter, len(choices))]
        if wanted.goal >= 0:
            goal = torch.full_like(rows, wanted.goal)
        else:
            counter += 1
            goal = below(key, counter, len(self._goals))
        if wanted.start >= 0:
            start = torch.full_like(rows, wanted.start)
        else:
            counter += 1
            seat = below(key, counter, len(self._starts) - 1)
            start = self._starts[seat + (seat >= self._seats[trigger])]
        self.robot[rows], self.trigger[rows], self.goal[rows] = start, trigger, goal
        self.open[rows], self.steps[rows] = 0, 0
        self.episodes[rows] += 1
        if not self.tables.most:
            return
        self.grid[rows] = FREE
        if self.tables.drawn:
            self._draw(rows, key, counter)
        else:
            self.due[rows] = _PENDING
        never = torch.zeros_like(rows, dtype=torch.bool)
        self._appear(rows, never, never)

    def _draw(self, rows: Tensor, key: Tensor, counter: int) -> None:
        """Draw the obstacles of episodes: `worlds.appearing.random_obstacles`, draw for draw."""
        most = self.tables.most
        trigger, goal = self.trigger[rows], self.goal[rows]
        start, mark, end = self.robot[rows], self._triggers[trigger], self._goals[goal]
        way, length = joined(self._to_trigger.walk(trigger, start), self._to_goal.walk(goal, mark))
        free = self._floor.repeat(len(rows), 1)
        free.scatter_(1, torch.stack((start, mark, end), 1), value=False)
        counter += 1
        count = 1 + below(key, counter, most)
        place = torch.arange(way.shape[1], device=self.device)
        before = torch.arange(-FARTHEST, 0, device=self.device)
        for k in range(most):
            kind = below(key, counter + 1, len(KINDS))
            wish = sooner(key, counter + 4, ON_THE_WAY)  # 2 and 3 are size and colour
            counter += 6
            spots = (place >= 1) & (place < length[:, None]) & free.gather(1, way)
            room = spots.sum(1)
            on_the_way = wish & (room > 0)
            spot = nth(spots, below(key, counter - 1, room)).clamp(max=way.shape[1] - 1)
            steps = spot[:, None] + before
            there = way.gather(1, spot[:, None])
            fits = (steps >= 0) & (way.gather(1, steps.clamp(min=0)) != there)
            when = spot - FARTHEST + nth(fits, below(key, counter, fits.sum(1)))
            anywhere = nth(free, below(key, counter - 1, free.sum(1))).clamp(max=free.shape[1] - 1)
            cell = torch.where(on_the_way, there[:, 0], anywhere)
            step = torch.where(on_the_way, when, below(key, counter, length + 1))
            used = k < count
            free.scatter_(1, cell[:, None], free.gather(1, cell[:, None]) & ~used[:, None])
            self.slots[rows, k] = torch.stack(
                (cell, kind, torch.full_like(cell, _STEP), step, torch.full_like(cell, -1)), 1
            )
            self.due[rows, k] = torch.where(used, _PENDING, _SETTLED)

    def _observations(self) -> Tensor:
        beside = self._at(self.robot[:, None] + self._by).int()
        beside = torch.where(self._shut[self.open, self.robot], SHUT, beside)
        head = torch.stack((self.robot, self.trigger, self.goal, self.open), 1).int()
        return torch.cat((head, beside), 1)

    def _masks(self) -> Tensor:
        if not self.masks:
            return torch.empty((0, len(ACTIONS)), dtype=torch.bool, device=self.device)
        cells = self._shut.shape[1]
        shut = self._shut[self.open, self.robot]
        to = (self.robot[:, None] + self._by).clamp(0, cells - 1)
        wedged = self._shut[self.open[:, None], to, torch.arange(len(ACTIONS), device=self.device)]
        wedged = wedged | (self._at((to + self._by).clamp(-self._cols, cells + self._cols - 1)) != FREE)
        what = self._at(to)
        return ~shut & ((what == FREE) | (what == SPHERE) & ~wedged)


def _reach(shut: Tensor, by: Tensor) -> Tensor:
    """Return how many steps past walls and doors lead on from each cell, shape as `shut`."""
    cells = shut.shape[1]
    nexts = (torch.arange(cells, device=shut.device)[:, None] + by).clamp(0, cells - 1)
    reach = torch.zeros_like(shut, dtype=torch.int64)
    while True:
        further = torch.where(shut, 0, 1 + reach.gather(1, nexts.expand_as(reach)))
        if bool((further == reach).all()):
            return reach
        reach = further
