"""The steps that deep Q-learning learns from again: a replay buffer of TorchRL's that holds numbers alone.

What states look like is not kept, for the encoding tells it anew. So a step in the paper's maze takes 11
bytes of a checkpoint, in place of some 850.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase  # type: ignore[import-untyped]
from torchrl.data import TensorDictReplayBuffer, TensorStorage  # type: ignore[import-untyped]

from planners.option_critic.arrays import Arrays
from worlds.model_env import ModelTorchEnv

_KEYS: Final = {
    "memory.state": "state",
    "memory.action": "action",
    "memory.next_state": ("next", "state"),
    "memory.reward": ("next", "reward"),
    "memory.done": ("next", "done"),
    "memory.terminated": ("next", "terminated"),
}  # the names of a state's arrays, and where steps hold the same


class Memory:
    """The last steps that were made in a world, to be drawn from.

    Parameters
    ----------
    world
        Where steps are made.
    most
        How many are kept; those kept longest are the first to go.
    rows
        How many are drawn at a time, with repetition, by torch's own generator.

    Examples
    --------
    >>> from worlds import load_layout, maze_model
    >>> model = maze_model(load_layout("two_rooms"))
    >>> world = ModelTorchEnv(model, np.zeros(model.index.size, bool), 3)
    >>> memory = Memory(world, most=10, rows=4)
    >>> memory.keep(world.rollout(5))  # 15 steps
    >>> len(memory), memory.draw()["next", "observation"].shape
    (10, torch.Size([4, 105]))
    """

    def __init__(self, world: ModelTorchEnv, most: int, rows: int) -> None:
        self.world, self.most = world, most
        like = world.fake_tensordict().select(*_KEYS.values())[0]
        # Room is made here, since a storage that makes it lazily says so on standard output.
        storage = TensorStorage(torch.zeros_like(like.expand(most)), device=world.device)
        self._buffer = TensorDictReplayBuffer(storage=storage, batch_size=rows)
        self._buffer.empty()

    def __len__(self) -> int:
        return len(self._buffer)

    def keep(self, batch: TensorDictBase) -> None:
        """Keep steps, of any batch size."""
        for rows in batch.select(*_KEYS.values()).reshape(-1).split(self.most):
            self._buffer.extend(rows)

    def draw(self) -> TensorDictBase:
        """Return some steps with their observations, shape (rows,)."""
        rows = self._buffer.sample()
        rows["observation"] = self.world.encoding(rows["state"])
        rows["next", "observation"] = self.world.encoding(rows["next", "state"])
        return rows

    def state(self) -> dict[str, NDArray[np.generic]]:
        """Return what is kept as arrays by name, shape (steps,), in the order of the buffer's places."""
        rows, kinds = self._buffer[:], self._kinds()
        return {name: rows[key].flatten().cpu().numpy().astype(kinds[name]) for name, key in _KEYS.items()}

    def wanted(self, made: int) -> dict[str, NDArray[np.generic]]:
        """Return arrays like those of `state` after so many steps were kept and dropped, all 0."""
        count = min(made, self.most)
        return {name: np.zeros(count, kind) for name, kind in self._kinds().items()}

    def bounds(self) -> dict[str, range]:
        """Return what the integers of `state` may be."""
        model = self.world.model
        states, actions = range(model.index.size), range(len(model.actions))
        return {"memory.state": states, "memory.next_state": states, "memory.action": actions}

    def restore(self, state: Arrays, made: int) -> None:
        """Take up what `state` returned after so many steps, every step in its place."""
        found = {}
        for name, key in _KEYS.items():
            number = state[name].dtype.kind == "u"  # of a state or an action; the others are columns
            array = np.array(state[name], dtype=np.int64 if number else None)
            found[key] = torch.from_numpy(array if number else array[:, None])
        rows = TensorDict(found, [min(made, self.most)], device=self.world.device)
        self._buffer.empty()
        self._buffer.extend(rows)
        if made > self.most and made % self.most:
            self._buffer.extend(rows[: made % self.most])  # to the place that is written next

    def _kinds(self) -> dict[str, np.dtype[np.generic]]:
        """Return the smallest types that hold what is kept, by name."""
        model = self.world.model
        state, action = (np.min_scalar_type(n - 1) for n in (model.index.size, len(model.actions)))
        flag, reward = np.dtype(np.bool_), np.dtype(np.float32)
        return {
            "memory.state": state,
            "memory.action": action,
            "memory.next_state": state,
            "memory.reward": reward,
            "memory.done": flag,
            "memory.terminated": flag,
        }
