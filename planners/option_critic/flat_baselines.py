"""Flat PPO and flat DQN of TorchRL's own parts: what an option-critic is held against.

Both see the state as the option-critic does (`worlds.encoding.Encoding`), have networks of two hidden layers,
and collect, anneal and count as `OptionCriticConfig` says; they know nothing of tasks. What they learnt comes
as the same tables, over the options of the flattened graph, which are the primitive actions.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase  # type: ignore[import-untyped]
from tensordict.nn import TensorDictModule, TensorDictSequential  # type: ignore[import-untyped]
from torch import Generator, Tensor, nn
from torchrl.modules import EGreedyModule, ProbabilisticActor, QValueActor  # type: ignore[import-untyped]
from torchrl.objectives import ClipPPOLoss, DQNLoss, SoftUpdate  # type: ignore[import-untyped]
from torchrl.objectives.value import GAE  # type: ignore[import-untyped]

from hierarchy import GroundGraph
from planners.flat import flattened
from planners.option_critic.arrays import Arrays
from planners.option_critic.collecting import CollectingLearner
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.memory import Memory
from planners.option_critic.networks import SideBySide
from planners.option_critic.options import compile_options

WIDTH: Final = 128
"""Width of a flat learner's hidden layers, unless said otherwise: one network stands for an option-critic's
many narrow ones."""
MEMORY: Final = 100_000
"""Steps that flat DQN keeps; those of one update if these are more."""
_TARGET: Final = 0.95  # how much of its target network stays at an update
_LEAST: Final = 0.05  # share of actions that flat DQN still draws at last


class Flat(CollectingLearner):
    """What both baselines share: the flattened graph, the network and the tables.

    Parameters
    ----------
    grounded
        The ground graph; only its world and its root's end count.
    seed
        Names the run: the same seed and config give the same bits on one machine.
    config
        What to learn with; what it says of options has no say here. Defaults to
        ``OptionCriticConfig(hidden=WIDTH)``.
    starts
        Where episodes of learning begin, shape (states,), bool. Defaults to the model's starts.
    device
        Where torch computes.
    """

    unread = frozenset({"terminations", "abstracted", "epsilon", "termination", "prior", "deliberation"})

    def __init__(
        self,
        grounded: GroundGraph,
        seed: int,
        config: OptionCriticConfig | None = None,
        *,
        starts: NDArray[np.bool_] | None = None,
        device: torch.device | str = "cpu",
    ) -> None:
        config = OptionCriticConfig(hidden=WIDTH) if config is None else config
        options = compile_options(flattened(grounded))
        super().__init__(grounded, options, seed, config, starts=starts, device=device)

    @abstractmethod
    def _rows(self, batch: TensorDictBase) -> Iterator[TensorDictBase]:
        """Yield what each step of the optimiser learns from."""

    @abstractmethod
    def _preferences(self, observation: Tensor) -> Tensor:
        """Return a number for each action, the best action's the largest, shape (..., actions)."""

    def _network(self, outputs: int, draw: Generator, *, scaled: bool) -> nn.Module:
        scale = self.config.scale(self.grounded.model.rewards) if scaled else 1.0
        columns = len(self.world.encoding.columns)
        return _One(columns, outputs, self.config.hidden, scale, draw).to(self.world.device)

    def _update(self, batch: TensorDictBase) -> dict[str, float]:
        found = None
        for rows in self._rows(batch):
            found = self.loss(rows)
            self._improve(found)
        return {} if found is None else {name: float(value.detach().mean()) for name, value in found.items()}

    @torch.no_grad()
    def greedy(self) -> GreedyPolicy:
        """Return what the policy would do in every state, nothing left to chance."""
        states = torch.arange(self.grounded.model.index.size, device=self.world.device)
        best = self._preferences(self.world.encoding(states)).argmax(-1).cpu().numpy()
        option_of = np.argsort(self.options.action)  # each option is one action
        actions = len(self.grounded.model.actions)
        option = np.repeat(option_of[best][:, None], actions + 1, axis=1)
        return GreedyPolicy(self.options, option, np.tile(self.options.action, (len(best), 1)))


class FlatPPO(Flat):
    """Flat proximal policy optimisation (Schulman et al., 2017): `ClipPPOLoss` and `GAE`.

    Its epochs, minibatches, entropy, clipping and trace are the option-critic's.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> learner = FlatPPO(
    ...     ground(two_rooms(maze), maze_model(maze)), 1, OptionCriticConfig(num_envs=4, horizon=8, total=64)
    ... )
    >>> [progress.steps for progress in learner.learn()], learner.greedy().option.shape
    ([32, 64], (2048, 5))
    """

    def _build(self, draw: Generator) -> None:
        config, actions = self.config, len(self.grounded.model.actions)
        self.actor = self._network(actions, draw, scaled=False)
        critic = TensorDictModule(self._network(1, draw, scaled=True), ["observation"], ["state_value"])
        self.policy = ProbabilisticActor(
            TensorDictModule(self.actor, ["observation"], ["logits"]),
            in_keys=["logits"],
            spec=self.world.action_spec_unbatched,
            distribution_class=torch.distributions.Categorical,
            return_log_prob=True,
        )
        self.advantage = GAE(gamma=config.gamma, lmbda=config.lmbda, value_network=critic)
        self.loss = ClipPPOLoss(
            self.policy,
            critic,
            clip_epsilon=config.clip,
            entropy_coeff=config.entropy,
            critic_coeff=config.critic,
            normalize_advantage=True,
        )

    def _anneal(self, left: float) -> None:
        self.loss.entropy_coeff.fill_(self.config.entropy * left)

    def _rows(self, batch: TensorDictBase) -> Iterator[TensorDictBase]:
        for _ in range(self.config.epochs):
            with torch.no_grad():
                self.advantage(batch)
            rows = batch.reshape(-1)
            for chosen in torch.split(torch.randperm(len(rows)), self.config.minibatch):
                yield rows[chosen]

    def _preferences(self, observation: Tensor) -> Tensor:
        found: Tensor = self.actor(observation)
        return found


class FlatDQN(Flat):
    """Flat double deep Q-learning (van Hasselt et al., 2016): `DQNLoss`, a replay buffer, a slow target.

    It takes as many steps of the optimiser as the option-critic, on as many rows, drawn from its last
    `MEMORY` steps. Its epsilon begins at 1, for it has no other way to explore, and falls to 0.05.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> learner = FlatDQN(
    ...     ground(two_rooms(maze), maze_model(maze)), 1, OptionCriticConfig(num_envs=4, horizon=8, total=64)
    ... )
    >>> [progress.steps for progress in learner.learn()], learner.greedy().action[0].tolist()
    ([32, 64], [0, 1, 2, 3])
    """

    unread = Flat.unread | {"entropy", "lmbda", "clip", "critic"}

    def _build(self, draw: Generator) -> None:
        config = self.config
        self.values = self._network(len(self.grounded.model.actions), draw, scaled=True)
        values = QValueActor(self.values, in_keys=["observation"], spec=self.world.action_spec_unbatched)
        self.explorer = EGreedyModule(self.world.action_spec, eps_init=1.0, eps_end=0.0)
        self.policy = TensorDictSequential(values, self.explorer)
        self.loss = DQNLoss(
            values, action_space="categorical", loss_function="smooth_l1", delay_value=True, double_dqn=True
        )
        self.loss.make_value_estimator(gamma=config.gamma)
        self.target = SoftUpdate(self.loss, eps=_TARGET)
        most, rows = max(MEMORY, config.per_update), min(config.minibatch, config.per_update)
        self.memory = Memory(self.world, most, rows)

    def _anneal(self, left: float) -> None:
        self.explorer.eps.fill_(max(_LEAST, left))

    def _rows(self, batch: TensorDictBase) -> Iterator[TensorDictBase]:
        config = self.config
        self.memory.keep(batch)
        for _ in range(config.epochs * -(-config.per_update // config.minibatch)):
            yield self.memory.draw()
            self.target.step()  # the optimiser has gone its step by now

    def _preferences(self, observation: Tensor) -> Tensor:
        found: Tensor = self.values(observation)
        return found

    def state(self) -> dict[str, NDArray[np.generic]]:
        """Return all that learning hangs on, what it keeps of its steps included, as arrays by name."""
        return {**super().state(), **self.memory.state()}

    def _wanted(self, state: Arrays) -> dict[str, NDArray[np.generic]]:
        made = int(state["updates"]) * self.config.per_update
        return {**super()._wanted(state), **self.memory.wanted(made)}

    def _bounds(self) -> dict[str, range]:
        return {**super()._bounds(), **self.memory.bounds()}

    def _take_up(self, state: Arrays) -> None:
        super()._take_up(state)
        self.memory.restore(state, self.steps)


class _One(nn.Module):
    """One network of the kind that the option-critic has many of."""

    def __init__(self, columns: int, outputs: int, hidden: int, scale: float, draw: Generator) -> None:
        super().__init__()
        self.networks = SideBySide(torch.ones(1, columns, dtype=torch.bool), outputs, hidden, draw)
        self.scale = scale

    def forward(self, observation: Tensor) -> Tensor:
        """Return the outputs, shape (..., outputs)."""
        found: Tensor = self.networks(observation).squeeze(-2) * self.scale
        return found
