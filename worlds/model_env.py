"""Any finite world as a batched TorchRL environment. Importing this module loads PyTorch and TorchRL."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase  # type: ignore[import-untyped]
from torch import Tensor
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded  # type: ignore[import-untyped]
from torchrl.envs import EnvBase  # type: ignore[import-untyped]

from worlds.batch_reference import checked_count, checked_seed
from worlds.encoding import Encoding
from worlds.errors import UserError
from worlds.model import TransitionModel
from worlds.randomness import Stream
from worlds.torch_stream import below, bits, fractions, keys_of

_START = 1  # the draw of an episode's stream that says where it begins; its steps draw the next ones
_KEPT = ("state", "steps", "episodes", "_keys", "_episode_keys")  # what the next steps hang on


class ModelTorchEnv(EnvBase):  # type: ignore[misc]  # TorchRL has no types
    """`num_envs` runs of a finite world as one TorchRL environment.

    Environment i in its episode e draws from ``Stream(seed, i, e)`` alone: draw 1 chooses the start, draw
    1 + t the outcome of step t. So an episode is the same in a batch of any size. The environment gives
    ``"state"``, the state's number, and ``"observation"``, what `worlds.encoding.Encoding` makes of it.

    Parameters
    ----------
    model
        The world.
    terminal
        Where an episode ends, shape (states,), bool.
    num_envs
        How many runs; the batch size is (num_envs,).
    starts
        Where an episode may begin, each as often, shape (states,), bool. Defaults to the model's.
    max_steps
        Steps after which an episode is truncated.
    encoding
        What is seen of a state; called with numbers of states. Defaults to ``Encoding(model.index)``.
    device
        Where the tensors live; None is the CPU.

    Raises
    ------
    UserError
        If there is no start, a start is terminal, a mask has another shape, or a number is not possible. On
        the CPU also `step`, of an action that there is not; other devices are not waited for to look.

    Examples
    --------
    >>> from worlds import load_layout, maze_model
    >>> model = maze_model(load_layout("two_rooms"))
    >>> env = ModelTorchEnv(model, np.zeros(model.index.size, bool), 3)
    >>> _ = env.set_seed(1)
    >>> env.rollout(5).batch_size
    torch.Size([3, 5])
    """

    def __init__(
        self,
        model: TransitionModel,
        terminal: NDArray[np.bool_],
        num_envs: int = 1,
        *,
        starts: NDArray[np.bool_] | None = None,
        max_steps: int = 200,
        encoding: Encoding | None = None,
        device: torch.device | str | None = None,
    ) -> None:
        number = checked_count(num_envs)
        super().__init__(device=torch.device("cpu" if device is None else device), batch_size=[number])
        if max_steps < 1:
            raise UserError(f"max_steps {max_steps} is not possible; give 1 or more")
        self.number, self.max_steps, self.model = number, max_steps, model
        starts = model.starts if starts is None else starts
        for name, mask in (("terminal", terminal), ("starts", starts)):
            if np.shape(mask) != (model.index.size,):
                wanted = f"one flag for each of {model.index.size} states"
                raise UserError(f"{name} has shape {np.shape(mask)}; give {wanted}")
        chosen = np.flatnonzero(starts)
        if not chosen.size or terminal[chosen].any():
            raise UserError("an episode needs a state to begin in that is not terminal; give other starts")
        self.encoding = Encoding(model.index, self.device) if encoding is None else encoding
        self._starts = torch.tensor(chosen, device=self.device)
        # Tables are read by index_select, quicker than brackets, and as columns, which is what TorchRL wants.
        self._terminal = torch.tensor(terminal, device=self.device)[:, None]
        self._after, self._rewards, self._upper = _tables(model, self.device)
        self._outcomes = model.outcomes.shape[2]
        zeros = torch.zeros(number, dtype=torch.int64, device=self.device)
        self.state, self.steps, self.episodes = zeros.clone(), zeros.clone(), zeros.clone()
        self._keys, self._episode_keys = zeros.clone(), zeros.clone()
        self._seeded = self._resumed = False
        self._specify()

    def _specify(self) -> None:
        number, device = self.number, self.device
        width = self.encoding(torch.zeros(1, dtype=torch.int64, device=device)).shape[-1]
        self.observation_spec = Composite(
            state=Categorical(self.model.index.size, shape=(number,), dtype=torch.int64, device=device),
            observation=Unbounded(shape=(number, width), dtype=torch.float32, device=device),
            shape=(number,),
            device=device,
        )
        actions = len(self.model.actions)
        self.action_spec = Categorical(actions, shape=(number,), dtype=torch.int64, device=device)
        low, high = float(self._rewards.min()), float(self._rewards.max())
        self.reward_spec = Bounded(low, high, shape=(number, 1), dtype=torch.float32, device=device)
        flag = Binary(1, shape=(number, 1), dtype=torch.bool, device=device)
        self.done_spec = Composite(
            done=flag, terminated=flag.clone(), truncated=flag.clone(), shape=(number,), device=device
        )

    def snapshot(self) -> dict[str, Tensor]:
        """Return all that the next steps hang on, to be taken up by `resume`."""
        return {name.strip("_"): getattr(self, name).clone() for name in _KEPT}

    def resume(self, snapshot: dict[str, Tensor]) -> None:
        """Go on from a snapshot: the next reset of all environments leads there, once.

        Raises
        ------
        UserError
            If it is of another number of environments, or no snapshot.
        """
        found = {name: tuple(value.shape) for name, value in snapshot.items()}
        wanted = {name.strip("_"): (self.number,) for name in _KEPT}
        if found != wanted:
            problem = f"the snapshot holds {found}, not {wanted}"
            raise UserError(f"{problem}; take one of an environment with num_envs={self.number}")
        for name in _KEPT:
            setattr(self, name, snapshot[name.strip("_")].to(self.device).clone())
        self._seeded = self._resumed = True

    def _set_seed(self, seed: int | None) -> None:
        """Let the next reset begin with episode 0 of a seed; None draws one."""
        drawn = int(torch.randint(1 << 62, ())) if seed is None else checked_seed(seed)
        self._keys = keys_of(Stream(drawn).key, self.number, self.device)
        self.episodes = torch.zeros_like(self.episodes)
        self._seeded = True

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDictBase:
        """Begin the next episode in the environments that ``"_reset"`` names, or in all."""
        if not self._seeded:
            self._set_seed(None)
        chosen = None if tensordict is None else tensordict.get("_reset", None)
        if chosen is None and self._resumed:
            self._resumed = False
            return self._begun()
        keys = bits(self._keys + self.episodes, 1)
        start = self._starts[below(keys, _START, len(self._starts))]
        if chosen is None:
            self.state, self.steps, self._episode_keys = start, torch.zeros_like(start), keys
            self.episodes = self.episodes + 1
        else:
            here = chosen.view(self.number)
            self.state = torch.where(here, start, self.state)
            self.steps = torch.where(here, 0, self.steps)
            self._episode_keys = torch.where(here, keys, self._episode_keys)
            self.episodes = self.episodes + here
        return self._begun()

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Carry out ``"action"``; with ``"_step"``, only in the environments that it names."""
        before, moving = (self.state, self.steps), tensordict.get("_step", None)
        found = self._step_all(tensordict)
        if moving is None or moving.all():
            return found
        here = moving.view(self.number)
        self.state, self.steps = (
            torch.where(here, self.state, before[0]),
            torch.where(here, self.steps, before[1]),
        )
        return torch.where(here, found, self._skip_tensordict(tensordict).select(*found.keys()))

    def _step_all(self, tensordict: TensorDictBase) -> TensorDictBase:
        action = tensordict.get("action")
        if action.device.type == "cpu":
            self._check(action)
        row = torch.add(action, self.state, alpha=len(self.model.actions))
        self.steps = self.steps + 1
        if self._outcomes > 1:
            draw = fractions(self._episode_keys, self.steps + _START)
            which = (self._upper.index_select(0, row) <= draw[:, None]).sum(1)
            row = torch.add(which, row, alpha=self._outcomes)
        self.state = self._after.index_select(0, row)
        terminated = self._terminal.index_select(0, self.state)
        late = (self.steps >= self.max_steps)[:, None]
        return self._seen(
            {
                "reward": self._rewards.index_select(0, row),
                "terminated": terminated,
                "truncated": late > terminated,  # and not terminated
                "done": late | terminated,
            }
        )

    def _check(self, action: Tensor) -> None:
        least, most = torch.aminmax(action)
        if least < 0 or most >= len(self.model.actions):
            i = int(((action < 0) | (action >= len(self.model.actions))).nonzero()[0, 0])
            problem = f"action {int(action[i])} of environment {i} is not possible"
            raise UserError(f"{problem}; give 0 to {len(self.model.actions) - 1}")

    def _begun(self) -> TensorDictBase:
        # TorchRL would make these from their specs, which takes it longer.
        flags = ("done", "terminated", "truncated")
        return self._seen({name: self._terminal.new_zeros(self.number, 1) for name in flags})

    def _seen(self, more: dict[str, Tensor]) -> TensorDictBase:
        found = {"state": self.state, "observation": self.encoding(self.state), **more}
        return TensorDict(found, batch_size=self.batch_size, device=self.device)


def _tables(model: TransitionModel, device: torch.device) -> tuple[Tensor, Tensor, Tensor]:
    """Return next states and rewards, a row an outcome, and the draws below which outcomes occur.

    Of shapes (rows * outcomes,), (rows * outcomes, 1) and (rows, outcomes), where the rows are states times
    actions. Draws are whole numbers below 2**53, for not every device knows 64-bit floats.
    """
    shape = (-1, model.outcomes.shape[2])
    chances = model.probabilities.reshape(shape)
    upper = np.ceil(np.cumsum(chances, axis=1) * 2.0**53).astype(np.int64)
    outcomes = shape[1]
    last = outcomes - 1 - np.argmax(chances[:, ::-1] > 0, axis=1)  # of rounding, the last that can occur
    upper[np.arange(outcomes) >= last[:, None]] = 1 << 53
    rewards_of = model.outcome_rewards.reshape(-1, 1).astype(np.float32)
    arrays = (model.outcomes.reshape(-1), rewards_of, upper)
    after, rewards, draws = (torch.tensor(array, device=device) for array in arrays)  # its own, not views
    return after, rewards, draws
