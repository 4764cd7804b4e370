"""Many mazes as one TorchRL environment. Importing this module loads PyTorch and TorchRL."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import torch
from tensordict import TensorDict, TensorDictBase  # type: ignore[import-untyped]
from torch import Tensor
from torchrl.data import (  # type: ignore[import-untyped]
    Binary,
    Categorical,
    Composite,
    MultiCategorical,
    Unbounded,
)
from torchrl.envs import EnvBase  # type: ignore[import-untyped]

from worlds.batch_reference import StreamedMazeEnv, checked_count, checked_seed
from worlds.batched import MazeBatch
from worlds.batched_torch import TorchMazeBatch
from worlds.errors import UserError, suggest
from worlds.layout import ACTIONS, Layout

BACKENDS: Final = ("numba", "torch")
"""What steps the mazes: the kernel of `worlds.batched`, or PyTorch alone."""


class MazeTorchEnv(EnvBase):  # type: ignore[misc]  # TorchRL has no types
    """`num_envs` mazes, each as `MazeEnv` describes it, as one TorchRL environment.

    Environment i in its episode e draws from ``Stream(seed, i, e)`` alone: both backends, and
    `worlds.vector_env.MazeVectorEnv`, give the same episodes. Where ``"_reset"`` is given, the environments
    that it names are reset and no others.

    Parameters
    ----------
    num_envs
        How many mazes; the batch size is (num_envs,).
    layout, obstacles, trigger, goal, start, max_steps, most_obstacles
        As for `MazeEnv`.
    action_masks
        Whether to give ``"action_mask"``, shape (num_envs, 4), bool, as `torchrl.envs.ActionMask` wants it.
    backend
        One of `BACKENDS`; None takes numba on a CPU and PyTorch on any other device.
    device
        Where the tensors live; None is the CPU.

    Raises
    ------
    UserError
        If an argument names something that is not there.

    Examples
    --------
    >>> env = MazeTorchEnv(3, trigger="T4", goal="G2", start=(1, 0))
    >>> _ = env.set_seed(1)
    >>> data = env.reset()
    >>> data["action"] = torch.tensor([0, 1, 3])
    >>> env.step(data)["next", "observation"][:, 0].tolist()
    [0, 16, 9]
    """

    def __init__(
        self,
        num_envs: int = 1,
        layout: str | Path | Layout = "two_rooms",
        *,
        action_masks: bool = False,
        backend: str | None = None,
        device: torch.device | str | None = None,
        **arguments: Any,
    ) -> None:
        number = checked_count(num_envs)
        super().__init__(device=torch.device("cpu" if device is None else device), batch_size=[number])
        one = StreamedMazeEnv(layout, **arguments)
        self.backend = _backend(backend, self.device)
        self.batch: MazeBatch | TorchMazeBatch = (
            MazeBatch(one, number, masks=action_masks)
            if self.backend == "numba"
            else TorchMazeBatch(one, number, masks=action_masks, device=self.device)
        )
        self._masked = action_masks
        self._seeded = False
        sizes = torch.as_tensor(one.observation_space.nvec)  # type: ignore[attr-defined]
        device = self.device
        self.observation_spec = Composite(
            observation=MultiCategorical(sizes, shape=(number, len(sizes)), dtype=torch.int32, device=device),
            shape=(number,),
            device=device,
        )
        if action_masks:
            self.observation_spec["action_mask"] = Binary(
                len(ACTIONS), shape=(number, len(ACTIONS)), dtype=torch.bool, device=device
            )
        self.action_spec = Categorical(len(ACTIONS), shape=(number,), dtype=torch.int64, device=device)
        self.reward_spec = Unbounded(shape=(number, 1), dtype=torch.float32, device=device)
        flag = Binary(1, shape=(number, 1), dtype=torch.bool, device=device)
        self.done_spec = Composite(
            done=flag, terminated=flag.clone(), truncated=flag.clone(), shape=(number,), device=device
        )

    def _set_seed(self, seed: int | None) -> None:
        """Let the next reset begin with episode 0 of a seed; None draws one."""
        drawn = int(torch.randint(1 << 62, ())) if seed is None else checked_seed(seed)
        self.batch.seed(drawn)
        self._seeded = True

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDictBase:
        """Begin the next episode in the environments that ``"_reset"`` names, or in all."""
        if not self._seeded:
            self._set_seed(None)
        chosen = None if tensordict is None else tensordict.get("_reset", None)
        if chosen is not None:
            chosen = chosen.view(self.batch.number)
        if isinstance(self.batch, MazeBatch):
            arrays = self.batch.reset(None if chosen is None else chosen.contiguous().numpy())
            seen, masks = (torch.from_numpy(array) for array in arrays)
        else:
            seen, masks = self.batch.reset(chosen)
        return TensorDict(self._seen(seen, masks), batch_size=self.batch_size, device=self.device)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Carry out ``"action"``; with ``"_step"``, only in the environments that it names."""
        moving = tensordict.get("_step", None)
        if moving is not None and not moving.all():
            return self._step_some(tensordict, moving.view(self.batch.number))
        return self._step_all(tensordict)

    def _step_all(self, tensordict: TensorDictBase) -> TensorDictBase:
        action = tensordict.get("action")
        if isinstance(self.batch, MazeBatch):
            stepped = self.batch.step(action.numpy())
            seen, terminated, truncated, masks = (
                torch.from_numpy(array)
                for array in (
                    stepped.observations,
                    stepped.terminated,
                    stepped.truncated,
                    stepped.masks,
                )
            )
        else:
            seen, _, terminated, truncated, masks = self.batch.step(action)
        found = self._seen(seen, masks)
        found["reward"] = torch.full((self.batch.number, 1), -1.0, device=self.device)
        found["terminated"], found["truncated"] = terminated[:, None], truncated[:, None]
        found["done"] = found["terminated"] | found["truncated"]
        return TensorDict(found, batch_size=self.batch_size, device=self.device)

    def _step_some(self, tensordict: TensorDictBase, moving: Tensor) -> TensorDictBase:
        """Step all, and put those back that were to stay: few ask for this."""
        resting = ~moving
        if isinstance(self.batch, MazeBatch):
            arrays = self.batch.kept(resting.numpy())
            found = self._step_all(tensordict)
            self.batch.put_back(arrays)
        else:
            tensors = self.batch.kept(resting)
            found = self._step_all(tensordict)
            self.batch.put_back(tensors)
        return torch.where(moving, found, self._skip_tensordict(tensordict).select(*found.keys()))

    def _seen(self, observations: Tensor, masks: Tensor) -> dict[str, Tensor]:
        if not self._masked:
            return {"observation": observations}
        return {"observation": observations, "action_mask": masks.bool()}


def _backend(name: str | None, device: torch.device) -> str:
    if name is None:
        return "numba" if device.type == "cpu" else "torch"
    if name not in BACKENDS:
        raise UserError(f"backend {name!r} is not possible; {suggest(str(name), BACKENDS)}")
    if name == "numba" and device.type != "cpu":
        raise UserError(f"backend 'numba' is not possible on {device}; use 'torch', or the device 'cpu'")
    return name
