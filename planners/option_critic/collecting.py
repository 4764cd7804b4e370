"""Learners that collect steps with TorchRL and improve networks by Adam; they can be put down and taken up.

What is improved, and by which loss, `planners.option_critic.training` and
`planners.option_critic.flat_baselines` say.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import ClassVar, Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase  # type: ignore[import-untyped]
from tensordict.nn import TensorDictModuleBase  # type: ignore[import-untyped]
from torch import Generator, Tensor
from torchrl.collectors import Collector  # type: ignore[import-untyped]
from torchrl.envs import EnvBase  # type: ignore[import-untyped]
from torchrl.envs.utils import ExplorationType  # type: ignore[import-untyped]
from torchrl.objectives import LossModule  # type: ignore[import-untyped]

from hierarchy import GroundGraph
from planners.option_critic.arrays import Arrays, refuse_foreign
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.options import Options
from worlds.encoding import Encoding
from worlds.model_env import ModelTorchEnv
from worlds.torch_stream import generator

ORDER: Final = 2
"""What, after the seed, names the streams that say in which order steps are learnt from."""
_FIRST, _ACT = range(2)  # the streams of first weights, and of what is done
_COUNTED: Final = range(1 << 62)


class Progress(NamedTuple):
    """How far learning is: environment steps, and what was measured in the last update."""

    steps: int
    measures: dict[str, float]


class CollectingLearner(ABC):
    """What such learners share: the world, the schedules, the collecting, and their state as arrays.

    Parameters
    ----------
    grounded
        The ground graph, with its world's model.
    options
        What the greedy policy is told of.
    seed
        Names the run: the same seed and config give the same bits on one machine.
    config
        What to learn with.
    starts
        Where episodes of learning begin, shape (states,), bool. Defaults to the model's starts.
    encoding
        What the networks see of a state. Defaults to ``Encoding(grounded.model.index)``.
    device
        Where torch computes.

    Attributes
    ----------
    unread
        Names of the settings that have no say in what is learnt.
    env
        What is collected from: `world`, or what is made of it.
    updates
        How often the networks were improved with newly collected steps.
    """

    unread: ClassVar[frozenset[str]] = frozenset()
    env: EnvBase
    policy: TensorDictModuleBase
    loss: LossModule

    def __init__(
        self,
        grounded: GroundGraph,
        options: Options,
        seed: int,
        config: OptionCriticConfig,
        *,
        starts: NDArray[np.bool_] | None = None,
        encoding: Encoding | None = None,
        device: torch.device | str = "cpu",
    ) -> None:
        self.grounded, self.options, self.seed, self.config = grounded, options, seed, config
        self.env = self.world = ModelTorchEnv(
            grounded.model,
            grounded.nodes[grounded.root].terminal,
            config.num_envs,
            starts=starts,
            max_steps=config.max_steps,
            encoding=encoding,
            device=device,
        )
        self.world.set_seed(seed)
        with _drawing(seed, _FIRST):
            self._build(generator(seed, _FIRST))
        self.optimiser = torch.optim.Adam(self.loss.parameters(), lr=config.rate, eps=1e-5)
        self.updates = 0

    @property
    def steps(self) -> int:
        """Environment steps so far."""
        return self.updates * self.config.per_update

    @abstractmethod
    def _build(self, draw: Generator) -> None:
        """Make the policy that collects, the loss, and what else is needed."""

    @abstractmethod
    def _anneal(self, left: float) -> None:
        """Set what falls with the share of annealing that is left, besides the learning rate."""

    @abstractmethod
    def _update(self, batch: TensorDictBase) -> dict[str, float]:
        """Improve the networks with collected steps, shape (num_envs, horizon), and return measurements."""

    @abstractmethod
    def greedy(self) -> GreedyPolicy:
        """Return what the policy would do in every state, nothing left to chance."""

    def learn(self) -> Iterator[Progress]:
        """Learn, and yield after every update, until the config's steps are done."""
        config = self.config
        if self.updates:
            self._go_on(self._where())  # the collector begins with a reset, which is to change nothing
        with _drawing(self.seed, _FIRST):
            collector = Collector(
                self.env,
                self.policy,
                frames_per_batch=config.per_update,
                total_frames=-1,
                exploration_type=ExplorationType.RANDOM,
                no_cuda_sync=True,
                auto_register_policy_transforms=False,  # the environment tells all that a policy goes by
            )
        batches = iter(collector)
        try:
            while self.steps < config.total:
                left = config.left(self.steps)
                self._anneal(left)
                for group in self.optimiser.param_groups:
                    group["lr"] = config.rate_with(left)
                with _drawing(self.seed, _ACT, self.updates):
                    batch = next(batches)
                with _drawing(self.seed, ORDER, self.updates):
                    measures = self._update(batch)
                self.updates += 1
                yield Progress(self.steps, measures)
        finally:
            collector.shutdown(close_env=False)

    def _improve(self, found: TensorDictBase) -> None:
        """Let the optimiser make a step against the sum of what a loss module gave as losses."""
        total = sum(value for name, value in found.items() if name.startswith("loss"))
        self.optimiser.zero_grad()
        total.backward()
        torch.nn.utils.clip_grad_norm_(self.loss.parameters(), self.config.most_gradient)
        self.optimiser.step()

    def state(self) -> dict[str, NDArray[np.generic]]:
        """Return all that learning hangs on, besides graph, world, seed and config, as arrays by name."""
        found = _named("loss", self.loss.state_dict())
        for i, moments in self.optimiser.state_dict()["state"].items():
            found |= _named(f"adam.{i}", moments)
        found |= _named("env", self._where())
        arrays = {name: value.detach().cpu().numpy().copy() for name, value in found.items()}
        return {**arrays, "updates": np.array(self.updates)}

    def restore(self, state: Mapping[str, NDArray[np.generic]]) -> None:
        """Take up what `state` returned, of the same graph, world, seed and config.

        Raises
        ------
        UserError
            If an array is missing, of another shape or type, or counts what there is not in this world.
        """
        bounds = {"updates": _COUNTED[1:], **self._bounds()}
        counted = {"updates": np.array(0)}  # looked at first, for other shapes may hang on it
        refuse_foreign({name: state[name] for name in counted if name in state}, counted, bounds)
        refuse_foreign(state, {**counted, **self._wanted(state)}, bounds)
        self._take_up(state)

    def _wanted(self, state: Arrays) -> dict[str, NDArray[np.generic]]:
        """Return arrays of the names, shapes and types that a state must have, ``"updates"`` left out."""
        wanted = _named("loss", self.loss.state_dict())
        learnt = dict(enumerate(self.loss.parameters()))
        for place in {name.split(".")[1] for name in state if name.startswith("adam.")}:
            like = learnt.get(int(place)) if place.isdecimal() else None
            if like is not None:
                moments = {"step": torch.zeros(()), "exp_avg": like, "exp_avg_sq": like}
                wanted |= _named(f"adam.{place}", moments)
        wanted |= _named("env", self._where())
        return {name: value.detach().cpu().numpy() for name, value in wanted.items()}

    def _bounds(self) -> dict[str, range]:
        """Return what the integers of a state's arrays may be."""
        return {
            "env.state": range(self.grounded.model.index.size),
            "env.steps": range(self.config.max_steps),
            "env.episodes": _COUNTED,
        }

    def _take_up(self, state: Arrays) -> None:
        """Take up arrays that were found to be of this learner."""
        tensors = {name: torch.from_numpy(np.array(array)) for name, array in state.items()}
        self.updates = int(tensors["updates"])
        self.loss.load_state_dict(_under("loss", tensors))
        moments: dict[int, dict[str, Tensor]] = {}
        for name, value in _under("adam", tensors).items():
            place, _, moment = name.partition(".")
            moments.setdefault(int(place), {})[moment] = value
        groups = self.optimiser.state_dict()["param_groups"]
        self.optimiser.load_state_dict({"state": moments, "param_groups": groups})
        self._go_on(_under("env", tensors))

    def _where(self) -> dict[str, Tensor]:
        """Return all that the environment's next steps hang on."""
        return self.world.snapshot()

    def _go_on(self, where: dict[str, Tensor]) -> None:
        """Let the environment's next reset lead to where it was."""
        self.world.resume(where)


def _named(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return tensors with a prefix and a dot before their names."""
    return {f"{prefix}.{name}": value for name, value in tensors.items()}


def _under(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return the tensors whose names begin with a prefix and a dot, by the rest of their names."""
    start = f"{prefix}."
    return {name.removeprefix(start): value for name, value in tensors.items() if name.startswith(start)}


@contextmanager
def _drawing(*key: int) -> Iterator[None]:
    """Let what knows torch's own generator alone draw from a stream that integers name."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(generator(*key).initial_seed())
        yield
