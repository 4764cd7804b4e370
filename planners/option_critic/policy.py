"""Acting: end what has ended, choose an option, let it choose an action. A TensorDict module."""

from __future__ import annotations

import torch
from tensordict import TensorDict, TensorDictBase  # type: ignore[import-untyped]
from tensordict.nn import TensorDictModule, TensorDictModuleBase  # type: ignore[import-untyped]
from torch import Generator, Tensor
from torchrl.envs.utils import ExplorationType, exploration_type  # type: ignore[import-untyped]

from planners.option_critic.choosing import any_of, first_ended, greedy, of_option, permitted
from planners.option_critic.greedy import EVEN
from planners.option_critic.transform import ACTION_MASK, ENDED, INITIATION, RUNNING


class OptionPolicy(TensorDictModuleBase):  # type: ignore[misc]  # tensordict has no types
    """Chooses options by the critic and actions by the running option's policy.

    The policy over options is epsilon-greedy in the options' values, as published (Bacon, Harb and Precup,
    2017, section 5); actions are drawn. Under `ExplorationType.DETERMINISTIC` or `MODE` the best is taken.

    Parameters
    ----------
    actor, critic
        Modules that read ``"observation"`` and write ``"option_logits"``, shape (..., options, actions), and
        ``"option_value"``, shape (..., options).
    termination
        Module that writes ``"termination_logits"``, shape (..., options, levels); None where the graph ends
        its tasks.
    draw
        Where chance comes from; None takes torch's own generator.

    Attributes
    ----------
    epsilon
        Probability of choosing any option that may be chosen.
    """

    def __init__(
        self,
        actor: TensorDictModule,
        critic: TensorDictModule,
        termination: TensorDictModule | None = None,
        *,
        epsilon: float = 0.0,
        draw: Generator | None = None,
    ) -> None:
        super().__init__()
        self.actor, self.critic, self.termination = actor, critic, termination
        self.epsilon, self.draw = epsilon, draw
        self.in_keys = ["observation", RUNNING, INITIATION, ENDED, ACTION_MASK]
        self.out_keys = ["option", "switch", "action", "action_log_prob"]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write ``"option"``, ``"switch"`` (whether it was chosen here), ``"action"``, log-probability."""
        drawn = exploration_type() == ExplorationType.RANDOM
        seen = self.seen(tensordict["observation"])
        option, switch = self.choose(
            seen, *(tensordict[key] for key in (RUNNING, INITIATION, ENDED)), drawn=drawn
        )
        mask = of_option(tensordict[ACTION_MASK], option)
        log_probs = permitted(of_option(seen.get("option_logits"), option), mask)
        action = (log_probs + self._gumbel(log_probs) if drawn else log_probs).argmax(-1)
        return tensordict.update(
            {
                "option": option,
                "switch": switch,
                "action": action,
                "action_log_prob": log_probs.gather(-1, action[..., None]).squeeze(-1),
            }
        )

    def seen(self, observation: Tensor) -> TensorDictBase:
        """Return what the networks make of observations, shape (..., columns)."""
        found = TensorDict({"observation": observation}, batch_size=observation.shape[:-1])
        for module in (self.actor, self.critic, self.termination):
            if module is not None:
                module(found)
        return found

    def choose(
        self, seen: TensorDictBase, running: Tensor, initiation: Tensor, ended: Tensor, *, drawn: bool = False
    ) -> tuple[Tensor, Tensor]:
        """Return the option that runs next and whether it was chosen anew, shapes (...,).

        Parameters
        ----------
        seen
            What `seen` gave.
        running, initiation, ended
            As `TaskStack` writes them.
        drawn
            Whether chance has a say.
        """
        if self.termination is not None:
            logits = of_option(seen.get("termination_logits"), running.clamp(min=0))
            ends = logits.sigmoid() > (self._uniform(logits) if drawn else EVEN)
            ended = torch.where((running < 0)[..., None], ended, ends)  # at the start all has ended
        switch, level = first_ended(ended)
        choosable = of_option(initiation, level)
        switch = switch & choosable.any(-1)  # with nothing to choose, what runs goes on
        chosen = greedy(seen.get("option_value"), choosable)
        if drawn:
            other = any_of(choosable, self._uniform(chosen))
            chosen = torch.where(self._uniform(chosen) < self.epsilon, other, chosen)
        return torch.where(switch, chosen, running), switch

    def best_actions(self, seen: TensorDictBase, mask: Tensor) -> Tensor:
        """Return the likeliest action of every option, shape (..., options)."""
        return permitted(seen.get("option_logits"), mask).argmax(-1)

    def _uniform(self, like: Tensor) -> Tensor:
        return torch.rand(like.shape, generator=self.draw).to(like.device)

    def _gumbel(self, like: Tensor) -> Tensor:
        """Return noise that makes the largest log-probability a draw."""
        return -torch.empty(like.shape).exponential_(generator=self.draw).log().to(like.device)
