"""Learning: collect steps with TorchRL, improve the networks, look how far they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase  # type: ignore[import-untyped]
from tensordict.nn import TensorDictModule  # type: ignore[import-untyped]
from torchrl.collectors import Collector  # type: ignore[import-untyped]
from torchrl.envs import TransformedEnv  # type: ignore[import-untyped]
from torchrl.envs.utils import ExplorationType  # type: ignore[import-untyped]

from hierarchy import GroundGraph
from planners.option_critic.arrays import refuse_foreign
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.loss import OptionCriticLoss
from planners.option_critic.networks import Actor, Critic, Terminations, called_tasks, columns_of
from planners.option_critic.options import NONE, Options, compile_options
from planners.option_critic.policy import OptionPolicy
from planners.option_critic.transform import TaskStack
from worlds import UserError
from worlds.encoding import Encoding
from worlds.model_env import ModelTorchEnv
from worlds.torch_stream import generator

_FIRST, _ACT, _ORDER = range(3)  # what a stream of the seed is for
_CHUNK: Final = 1 << 16  # states looked at at once


class Progress(NamedTuple):
    """How far learning is: environment steps, and what was measured in the last update.

    Measured are the losses, and how options were used in the update's steps: ``option_duration``, steps from
    one choice to the next; ``usage_entropy``, the entropy of what was chosen, in nats: 0 if it was always the
    same option.
    """

    steps: int
    measures: dict[str, float]


class OptionCritic:
    """An option-critic of a ground graph.

    Parameters
    ----------
    grounded
        The ground graph, with its world's model.
    seed
        Names the run: the same seed and config give the same bits on one machine.
    config
        What to learn with. Defaults to ``OptionCriticConfig()``.
    starts
        Where episodes of learning begin, shape (states,), bool. Defaults to the model's starts.
    encoding
        What the networks see of a state. Defaults to ``Encoding(grounded.model.index)``.
    device
        Where torch computes.

    Raises
    ------
    UserError
        If there is no start, or the root may call nothing in one; if the graph has findings or is too large.
    """

    def __init__(
        self,
        grounded: GroundGraph,
        seed: int,
        config: OptionCriticConfig | None = None,
        *,
        starts: NDArray[np.bool_] | None = None,
        encoding: Encoding | None = None,
        device: torch.device | str = "cpu",
    ) -> None:
        self.grounded, self.seed = grounded, seed
        self.config = config = OptionCriticConfig() if config is None else config
        self.options = options = compile_options(grounded)
        terminal = grounded.nodes[grounded.root].terminal
        self.world = ModelTorchEnv(
            grounded.model,
            terminal,
            config.num_envs,
            starts=starts,
            max_steps=config.max_steps,
            encoding=encoding,
            device=device,
        )
        _refuse_idle(options, grounded.model.starts if starts is None else starts)
        self.stack = TaskStack(options)
        self.env = TransformedEnv(self.world, self.stack)
        self.env.set_seed(seed)
        actor, critic, termination = self._networks()
        self.draw = torch.Generator()
        self.policy = OptionPolicy(actor, critic, termination, draw=self.draw)
        self.loss = OptionCriticLoss(
            actor,
            critic,
            termination,
            clip_epsilon=config.clip,
            entropy_coeff=config.entropy,
            critic_coeff=config.critic,
            termination_coeff=config.termination,
            prior_coeff=config.prior if config.terminations == "prior" else 0.0,
            deliberation_cost=config.deliberation,
        )
        self.loss.make_value_estimator(gamma=config.gamma, lmbda=config.lmbda)
        self.optimiser = torch.optim.Adam(self.loss.parameters(), lr=config.rate, eps=1e-5)
        self.updates = 0

    @property
    def steps(self) -> int:
        """Environment steps so far."""
        return self.updates * self.config.per_update

    def _networks(self) -> tuple[TensorDictModule, TensorDictModule, TensorDictModule | None]:
        options, config, encoding = self.options, self.config, self.world.encoding
        draw = generator(self.seed, _FIRST)
        sees = columns_of(encoding, options.task_uses, abstracted=config.abstracted)
        actor = Actor(options, sees, config.hidden, draw)
        sees = columns_of(encoding, [part.uses for part in options.parts], abstracted=config.abstracted)
        critic = Critic(options, sees, config.hidden, config.scale(self.grounded.model.rewards), draw)
        found = [
            TensorDictModule(actor, ["observation"], ["option_logits"]),
            TensorDictModule(critic, ["observation"], ["option_value"]),
        ]
        if config.terminations == "given":
            return found[0], found[1], None
        graph = self.grounded.graph
        tasks = [graph.tasks[self.grounded.nodes[place].task] for place in called_tasks(options)]
        uses = [tuple({*task.uses, *task.until.variables()}) for task in tasks]
        sees = columns_of(encoding, uses, abstracted=config.abstracted)
        ending = Terminations(options, sees, config.hidden, draw)
        return found[0], found[1], TensorDictModule(ending, ["observation"], ["termination_logits"])

    def learn(self) -> Iterator[Progress]:
        """Learn, and yield after every update, until the config's steps are done."""
        config = self.config
        if self.updates:
            self._go_on(self._where())  # the collector begins with a reset, which is to change nothing
        collector = Collector(
            self.env,
            self.policy,
            frames_per_batch=config.per_update,
            total_frames=-1,
            exploration_type=ExplorationType.RANDOM,
            no_cuda_sync=True,
            auto_register_policy_transforms=False,  # TaskStack tells the policy all that it goes by
        )
        batches = iter(collector)
        try:
            while self.steps < config.total:
                self._schedule()
                self.draw.manual_seed(generator(self.seed, _ACT, self.updates).initial_seed())
                measures = self._update(next(batches))
                self.updates += 1
                yield Progress(self.steps, measures)
        finally:
            collector.shutdown(close_env=False)

    def state(self) -> dict[str, NDArray[np.generic]]:
        """Return all that learning hangs on, besides graph, world, seed and config, as arrays by name."""
        found = {f"loss.{name}": value for name, value in self.loss.state_dict().items()}
        for i, moments in self.optimiser.state_dict()["state"].items():
            found |= {f"adam.{i}.{name}": value for name, value in moments.items()}
        found |= {f"env.{name}": value for name, value in self._where().items()}
        arrays = {name: value.detach().cpu().numpy().copy() for name, value in found.items()}
        return {**arrays, "updates": np.array(self.updates)}

    def restore(self, state: Mapping[str, NDArray[np.generic]]) -> None:
        """Take up what `state` returned, of the same graph, world, seed and config.

        Raises
        ------
        UserError
            If an array is missing, of another shape or type, or no place of this world.
        """
        self._refuse_foreign(state)
        tensors = {name: torch.from_numpy(np.array(array)) for name, array in state.items()}
        self.updates = int(tensors["updates"])
        self.loss.load_state_dict(_under("loss", tensors))
        moments: dict[int, dict[str, torch.Tensor]] = {}
        for name, value in _under("adam", tensors).items():
            place, _, moment = name.partition(".")
            moments.setdefault(int(place), {})[moment] = value
        groups = self.optimiser.state_dict()["param_groups"]
        self.optimiser.load_state_dict({"state": moments, "param_groups": groups})
        self._go_on(_under("env", tensors))

    def _refuse_foreign(self, state: Mapping[str, NDArray[np.generic]]) -> None:
        """Refuse arrays that are not of this learner."""
        wanted = {f"loss.{name}": value for name, value in self.loss.state_dict().items()}
        learnt = dict(enumerate(self.loss.parameters()))
        for place in {name.split(".")[1] for name in state if name.startswith("adam.")}:
            like = learnt.get(int(place)) if place.isdecimal() else None
            if like is not None:
                moments = {"step": torch.zeros(()), "exp_avg": like, "exp_avg_sq": like}
                wanted |= {f"adam.{place}.{name}": value for name, value in moments.items()}
        places = {**self.world.snapshot(), "running": torch.zeros(self.world.number, dtype=torch.int64)}
        wanted |= {f"env.{name}": value for name, value in places.items()}
        arrays = {name: value.detach().cpu().numpy() for name, value in wanted.items()}
        bounds = {
            "env.state": range(self.grounded.model.index.size),
            "env.running": range(NONE, len(self.options)),
            "env.steps": range(self.config.max_steps),
            "env.episodes": range(1 << 62),
            "updates": range(1, 1 << 62),
        }
        refuse_foreign(state, {**arrays, "updates": np.array(0)}, bounds)

    def _where(self) -> dict[str, torch.Tensor]:
        running = self.stack.running
        assert running is not None, "it is kept from the first reset on"
        return {**self.world.snapshot(), "running": running}

    def _go_on(self, where: dict[str, torch.Tensor]) -> None:
        self.stack.resume(where["running"])
        self.world.resume({name: value for name, value in where.items() if name != "running"})
        self.stack.running = where["running"]

    def _schedule(self) -> None:
        config = self.config
        left = config.left(self.steps)
        self.policy.epsilon = config.epsilon * left
        self.loss.entropy_coeff.fill_(config.entropy * left)
        for group in self.optimiser.param_groups:
            group["lr"] = config.rate_with(left)

    def _update(self, batch: TensorDictBase) -> dict[str, float]:
        config, found = self.config, None
        keys = [key for key in self.loss.in_keys if key not in ("advantage", "value_target")]
        for epoch in range(config.epochs):
            self.loss.advantages(batch)
            rows = batch.select(*keys, "advantage", "value_target").reshape(-1)
            order = torch.randperm(len(rows), generator=generator(self.seed, _ORDER, self.updates, epoch))
            for chosen in torch.split(order, config.minibatch):
                found = self.loss(rows[chosen])
                total = sum(value for name, value in found.items() if name.startswith("loss_"))
                self.optimiser.zero_grad()
                total.backward()
                torch.nn.utils.clip_grad_norm_(self.loss.parameters(), config.most_gradient)
                self.optimiser.step()
        assert found is not None, "there is at least one epoch, and a row to learn from"
        return {**{name: float(value.detach()) for name, value in found.items()}, **_used(batch)}

    @torch.no_grad()
    def greedy(self) -> GreedyPolicy:
        """Return what the policy would do in every state, nothing left to chance."""
        states = torch.arange(self.grounded.model.index.size, device=self.world.device)
        parts = [self._greedy(part) for part in torch.split(states, _CHUNK)]
        option, action = (torch.cat(part).cpu().numpy() for part in zip(*parts, strict=True))
        return GreedyPolicy(self.options, option, action)

    def _greedy(self, state: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        seen = self.policy.seen(self.world.encoding(state))
        count = len(self.options)
        option = []
        for running in (*range(count), NONE):
            before = torch.full_like(state, running)
            initiation, ended, mask = self.stack.tables(state, before)
            option.append(self.policy.choose(seen, before, initiation, ended)[0])
        action = self.policy.best_actions(seen, mask)
        return torch.stack(option, -1), action


def _used(batch: TensorDictBase) -> dict[str, float]:
    """Return how options were used in some steps."""
    chosen = batch.get("option")[batch.get("switch")]
    shares = torch.bincount(chosen).double() / max(1, chosen.numel())
    entropy = -(shares * shares.clamp(min=1e-12).log()).sum()
    return {
        "option_duration": batch.get("option").numel() / max(1, chosen.numel()),
        "usage_entropy": abs(float(entropy)),
    }


def _refuse_idle(options: Options, starts: NDArray[np.bool_]) -> None:
    """Refuse to begin in a state in which the root may call nothing."""
    idle = np.flatnonzero(starts & ~options.initiation[:, 0].any(axis=1))
    if idle.size:
        where = options.grounded.model.index.words(int(idle[0]))
        raise UserError(
            f"{idle.size} of {int(starts.sum())} starts leave the root nothing to call, such as state "
            f"{idle[0]} ({where}); give starts from which a task can be called"
        )


def _under(prefix: str, tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Return the tensors whose names begin with a prefix and a dot, by the rest of their names."""
    start = f"{prefix}."
    return {name.removeprefix(start): value for name, value in tensors.items() if name.startswith(start)}
