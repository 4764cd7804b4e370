"""Learning with an option-critic: the networks that a ground graph's options need, and their updates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase  # type: ignore[import-untyped]
from tensordict.nn import TensorDictModule  # type: ignore[import-untyped]
from torch import Generator, Tensor
from torchrl.envs import TransformedEnv  # type: ignore[import-untyped]

from hierarchy import GroundGraph
from planners.option_critic.collecting import ORDER, CollectingLearner
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.loss import OptionCriticLoss
from planners.option_critic.networks import Actor, Critic, Terminations, called_tasks, columns_of
from planners.option_critic.options import NONE, Options, compile_options
from planners.option_critic.policy import OptionPolicy
from planners.option_critic.transform import TaskStack
from planners.states import state_numbers
from worlds import UserError
from worlds.encoding import Encoding
from worlds.torch_stream import generator

_CHUNK: Final = 1 << 16  # states looked at at once


class OptionCritic(CollectingLearner):
    """An option-critic of a ground graph.

    Besides its losses it measures how options were used in the update's steps: ``option_duration``, steps
    from one choice to the next; ``usage_entropy``, the entropy of what was chosen, in nats: 0 if it was
    always the same option.

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
        config = OptionCriticConfig() if config is None else config
        options = compile_options(grounded)
        super().__init__(grounded, options, seed, config, starts=starts, encoding=encoding, device=device)
        _refuse_idle(options, grounded.model.starts if starts is None else starts)

    def _build(self, draw: Generator) -> None:
        config, device = self.config, self.world.device
        # Where the graph has no say in what ends a task, nor has it in how well it ended.
        self.stack = TaskStack(self.options, pseudo_rewards=config.terminations != "learnt").to(device)
        self.env = TransformedEnv(self.world, self.stack)
        networks = self._networks(draw)
        actor, critic, termination = (None if one is None else one.to(device) for one in networks)
        self.policy = OptionPolicy(actor, critic, termination)
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

    def _networks(
        self, draw: Generator
    ) -> tuple[TensorDictModule, TensorDictModule, TensorDictModule | None]:
        options, config, encoding = self.options, self.config, self.world.encoding
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

    def _anneal(self, left: float) -> None:
        self.policy.epsilon = self.config.epsilon * left
        self.loss.entropy_coeff.fill_(self.config.entropy * left)

    def _update(self, batch: TensorDictBase) -> dict[str, float]:
        config, found = self.config, None
        keys = [key for key in self.loss.in_keys if key not in ("advantage", "value_target")]
        for epoch in range(config.epochs):
            self.loss.advantages(batch)
            rows = batch.select(*keys, "advantage", "value_target").reshape(-1)
            order = torch.randperm(len(rows), generator=generator(self.seed, ORDER, self.updates, epoch))
            for chosen in torch.split(order, config.minibatch):
                found = self.loss(rows[chosen])
                self._improve(found)
        assert found is not None, "there is at least one epoch, and a row to learn from"
        return {**{name: float(value.detach()) for name, value in found.items()}, **_used(batch)}

    def _where(self) -> dict[str, Tensor]:
        found, running = super()._where(), self.stack.running
        return {**found, "running": torch.full_like(found["state"], NONE) if running is None else running}

    def _go_on(self, where: dict[str, Tensor]) -> None:
        super()._go_on({name: value for name, value in where.items() if name != "running"})
        running = where["running"].to(self.world.device)
        self.stack.resume(running)
        self.stack.running = running

    def _bounds(self) -> dict[str, range]:
        return {**super()._bounds(), "env.running": range(NONE, len(self.options))}

    def greedy(self) -> GreedyPolicy:
        """Return what the policy would do in every state, nothing left to chance."""
        return GreedyPolicy(self.options, *self.greedy_in(np.arange(self.grounded.model.index.size)))

    @torch.no_grad()
    def greedy_in(self, states: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return what the policy would do in some states, nothing left to chance.

        Parameters
        ----------
        states
            Numbers of the states, shape (states,).

        Returns
        -------
        option
            What runs on from each, shape (states, options + 1): the rows of `GreedyPolicy.option`.
        action
            What each option does there, shape (states, options): the rows of `GreedyPolicy.action`.
        """
        numbers = state_numbers(states, self.grounded.model.index.size)
        parts = [self._chosen(part, seen) for part, seen in self._seen(torch.from_numpy(numbers))]
        option, action = (torch.cat(part).cpu().numpy() for part in zip(*parts, strict=True))
        return option, action

    def _chosen(self, state: Tensor, seen: TensorDictBase) -> tuple[Tensor, Tensor]:
        option = []
        for running in (*range(len(self.options)), NONE):
            before = torch.full_like(state, running)
            initiation, ended, mask = self.stack.tables(state, before)
            option.append(self.policy.choose(seen, before, initiation, ended)[0])
        return torch.stack(option, -1), self.policy.best_actions(seen, mask)

    @torch.no_grad()
    def terminations(self) -> NDArray[np.float64] | None:
        """Return what has been learnt of where tasks end; None where the graph says it.

        It is the probability that the task that an option calls at a level ends in a state, shape
        (states, options, levels).
        """
        if self.policy.termination is None:
            return None
        parts = self._seen(torch.arange(self.grounded.model.index.size))
        logits = torch.cat([seen.get("termination_logits") for _, seen in parts])
        found: NDArray[np.float64] = logits.sigmoid().double().cpu().numpy()
        return found

    def _seen(self, states: Tensor) -> Iterator[tuple[Tensor, TensorDictBase]]:
        """Yield states, not too many at once, with what the networks make of them."""
        for part in torch.split(states.to(self.world.device), _CHUNK):
            yield part, self.policy.seen(self.world.encoding(part))


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
