"""What an environment tells an option-critic about its options, as a TorchRL transform."""

from __future__ import annotations

from typing import Final

import torch
from tensordict import TensorDictBase  # type: ignore[import-untyped]
from torch import Tensor
from torch.nn import functional
from torchrl.data import Binary, Bounded, TensorSpec, Unbounded  # type: ignore[import-untyped]
from torchrl.envs import Transform  # type: ignore[import-untyped]

from planners.option_critic.options import NONE, Options

RUNNING: Final = "running"
"""The option that ran up to here, `NONE` where an episode begins; int64."""
INITIATION: Final = "initiation"
"""What may be chosen if control comes back at a level, shape (levels, options), bool."""
ENDED: Final = "ended"
"""Whether the running option's task at a level has ended here, shape (levels,), bool; all where none runs."""
ACTION_MASK: Final = "option_action_mask"
"""Which actions each option may take, shape (options, actions), bool."""
PSEUDO_REWARD: Final = "pseudo_reward"
"""What the running option's policy is taught to expect of where it has ended, shape (1,), float32."""


class OptionTables(torch.nn.Module):
    """The masks of options as tensors, looked up by state and running option.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from planners.option_critic.options import compile_options
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> tables = OptionTables(compile_options(ground(two_rooms(maze), maze_model(maze))))
    >>> initiation, ended, actions = tables(torch.tensor([0]), torch.tensor([NONE]))
    >>> initiation.shape, ended.tolist(), actions.shape
    (torch.Size([1, 1, 10]), [[True]], torch.Size([1, 10, 4]))
    """

    initiation: Tensor
    ended: Tensor
    shares: Tensor
    actions: Tensor
    pseudo_reward: Tensor

    def __init__(self, options: Options) -> None:
        super().__init__()
        states, levels, count = options.initiation.shape
        self.register_buffer("initiation", torch.as_tensor(options.initiation), persistent=False)
        # The last row of these, and of the last table, stands for no running option, which NONE = -1 reads.
        everywhere = torch.ones(states, 1, levels, dtype=torch.bool)
        ended = torch.as_tensor(options.ended).transpose(1, 2)
        self.register_buffer("ended", torch.cat([ended, everywhere], 1), persistent=False)
        shares = torch.as_tensor(options.shares).transpose(0, 1)
        fresh = torch.ones(1, levels, count, dtype=torch.bool)
        self.register_buffer("shares", torch.cat([shares, fresh]), persistent=False)
        self.register_buffer("actions", torch.as_tensor(options.actions), persistent=False)
        pseudo_reward = functional.pad(torch.as_tensor(options.pseudo_reward), (0, 1))
        self.register_buffer("pseudo_reward", pseudo_reward, persistent=False)

    def forward(self, state: Tensor, running: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return `INITIATION`, `ENDED` and `ACTION_MASK` for states and running options of any shape."""
        return (
            self.initiation[state] & self.shares[running],
            self.ended[state, running],
            self.actions[state],
        )


class TaskStack(Transform):  # type: ignore[misc]  # TorchRL has no types
    """Keeps the running option from step to step, and says what may be chosen and what has ended.

    Parameters
    ----------
    options
        The options, over the states that the environment gives as ``"state"``.
    pseudo_rewards
        Whether the graph's pseudo-rewards are written, if it has any.

    Notes
    -----
    It reads ``"option"``, which the policy writes; after an action that came without one, none runs. It
    writes `RUNNING`, `INITIATION`, `ENDED` and `ACTION_MASK`, and `PSEUDO_REWARD` where the graph has one.
    Any environment that gives the first four can be learnt by `OptionCriticLoss`. Where ``"_step"`` is
    given, environments that it does not name keep the option that runs, whatever the policy has chosen.
    """

    def __init__(self, options: Options, *, pseudo_rewards: bool = True) -> None:
        teaches = pseudo_rewards and bool(options.pseudo_reward.any())
        written = [RUNNING, INITIATION, ENDED, ACTION_MASK, *([PSEUDO_REWARD] if teaches else [])]
        super().__init__(in_keys=["state"], out_keys=written)
        self.options, self.tables, self.teaches = options, OptionTables(options), teaches
        self.running: Tensor | None = None
        self._resumed: Tensor | None = None

    def resume(self, running: Tensor) -> None:
        """Let the next reset of all environments find these options running, once."""
        self._resumed = running.clone()

    def _written(self, tensordict: TensorDictBase, running: Tensor) -> TensorDictBase:
        self.running = running
        initiation, ended, actions = self.tables(tensordict.get("state"), running)
        found = {RUNNING: running, INITIATION: initiation, ENDED: ended, ACTION_MASK: actions}
        if self.teaches:
            found[PSEUDO_REWARD] = self.tables.pseudo_reward[tensordict.get("state"), running][..., None]
        return tensordict.update(found)

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        running = torch.full_like(tensordict_reset.get("state"), NONE)
        chosen = None if tensordict is None else tensordict.get("_reset", None)
        if chosen is not None and self.running is not None:
            running = torch.where(chosen.view_as(running), running, self.running)
        elif chosen is None and self._resumed is not None:
            running, self._resumed = self._resumed.to(running.device), None
        return self._written(tensordict_reset, running)

    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        option = tensordict.get("option", None)
        if option is None:
            option = torch.full_like(next_tensordict.get("state"), NONE)
        moving = tensordict.get("_step", None)
        if moving is not None and self.running is not None:
            option = torch.where(moving.view_as(option), option, self.running)
        return self._written(next_tensordict, option)

    def transform_observation_spec(self, observation_spec: TensorSpec) -> TensorSpec:
        """Add the specs of what is written."""
        batch, device = observation_spec.shape, observation_spec.device
        _, levels, count = self.options.initiation.shape
        actions = self.options.actions.shape[2]
        observation_spec[RUNNING] = Bounded(NONE, count - 1, shape=batch, dtype=torch.int64, device=device)
        for name, shape in (
            (INITIATION, (levels, count)),
            (ENDED, (levels,)),
            (ACTION_MASK, (count, actions)),
        ):
            observation_spec[name] = Binary(shape=(*batch, *shape), dtype=torch.bool, device=device)
        if self.teaches:
            observation_spec[PSEUDO_REWARD] = Unbounded(shape=(*batch, 1), dtype=torch.float32, device=device)
        return observation_spec
