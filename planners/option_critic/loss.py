"""The option-critic's loss, as a TorchRL loss module.

Bacon, Harb and Precup, "The option-critic architecture" (AAAI 2017): the policy of the running option climbs
its advantage (theorem 1), the termination the disadvantage of going on (theorem 2), and the critic holds the
options' values. The first is clipped as in proximal policy optimisation (Klissarov et al., 2017).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, cast

import torch
from tensordict import TensorDict, TensorDictBase, TensorDictParams, unravel_key  # type: ignore[import-untyped]
from tensordict.nn import TensorDictModule, dispatch  # type: ignore[import-untyped]
from tensordict.utils import NestedKey  # type: ignore[import-untyped]
from torch import Tensor
from torch.nn import functional
from torchrl.objectives import LossModule  # type: ignore[import-untyped]
from torchrl.objectives.utils import ValueEstimators  # type: ignore[import-untyped]
from torchrl.objectives.value import (  # type: ignore[import-untyped]
    GAE,
    TD0Estimator,
    TD1Estimator,
    TDLambdaEstimator,
)

from planners.option_critic.choosing import of_option, permitted, summed_to_end, upon_arrival
from planners.option_critic.networks import OneOption
from planners.option_critic.transform import ACTION_MASK, ENDED, INITIATION, PSEUDO_REWARD
from worlds import UserError, suggest

_ESTIMATORS: Final = {
    ValueEstimators.TD0: TD0Estimator,
    ValueEstimators.TD1: TD1Estimator,
    ValueEstimators.TDLambda: TDLambdaEstimator,
    ValueEstimators.GAE: GAE,
}
_WITH_LAMBDA: Final = (ValueEstimators.TDLambda, ValueEstimators.GAE)
_WRITES: Final = {
    "actor": "option_logits",
    "critic": "option_value",
    "termination": "termination_logits",
}
_REDUCTIONS: Final[dict[str, Callable[[Tensor], Tensor]]] = {
    "mean": torch.mean,
    "sum": torch.sum,
    "none": torch.Tensor.clone,
}
_SMALL: Final = 1e-6


class OptionCriticLoss(LossModule):  # type: ignore[misc]  # TorchRL has no types
    """Losses of actor, critic and terminations of an option-critic.

    `advantages` is to be called on whole trajectories first; `forward` then takes any rows of them.

    Parameters
    ----------
    actor, critic, termination
        As `OptionPolicy` takes them; without a termination tasks end as the environment says (`ENDED`).
    clip_epsilon
        By how much the probability of an action may change before its gradient is cut.
    entropy_coeff, critic_coeff, termination_coeff
        Weights of the entropy, of the critic's loss, and of the termination's.
    prior_coeff
        How strongly learnt terminations are drawn to what `ENDED` says: the graph as a prior.
    deliberation_cost
        What ending a task costs (Harb et al., "When waiting is not an option", AAAI 2018).
    reduction
        What becomes of the rows' losses: ``"mean"``, ``"sum"`` or ``"none"``.

    Raises
    ------
    UserError
        If there is no such reduction.

    Notes
    -----
    The terminations are evaluated where the option arrives, in the next state; where the episode ends there,
    they have no say.
    """

    @dataclass
    class _AcceptedKeys:
        """Keys that may be renamed by `set_keys`.

        Attributes
        ----------
        action, option, action_log_prob
            What the policy wrote.
        advantage, value_target
            What `advantages` writes.
        value
            The value of the running option, in the root and in ``"next"``.
        ahead
            How much more it is worth to go on, in ``"next"`` (`upon_arrival`).
        initiation, ended, action_mask
            What the environment says of the options.
        reward, done, terminated
            What became of the step.
        pseudo_reward
            What the running option's policy, and nothing else, is taught to expect of where it ended, in
            ``"next"``; may be missing.
        """

        action: NestedKey = "action"
        option: NestedKey = "option"
        action_log_prob: NestedKey = "action_log_prob"
        advantage: NestedKey = "advantage"
        value_target: NestedKey = "value_target"
        value: NestedKey = "state_value"
        ahead: NestedKey = "ahead"
        initiation: NestedKey = INITIATION
        ended: NestedKey = ENDED
        action_mask: NestedKey = ACTION_MASK
        reward: NestedKey = "reward"
        done: NestedKey = "done"
        terminated: NestedKey = "terminated"
        pseudo_reward: NestedKey = PSEUDO_REWARD

    default_keys = _AcceptedKeys
    default_value_estimator = ValueEstimators.GAE

    actor_network: TensorDictModule
    critic_network: TensorDictModule
    termination_network: TensorDictModule | None
    actor_network_params: TensorDictParams
    critic_network_params: TensorDictParams
    termination_network_params: TensorDictParams | None
    target_actor_network_params: TensorDictParams
    target_critic_network_params: TensorDictParams
    target_termination_network_params: TensorDictParams | None
    entropy_coeff: Tensor

    def __init__(
        self,
        actor: TensorDictModule,
        critic: TensorDictModule,
        termination: TensorDictModule | None = None,
        *,
        clip_epsilon: float = 0.2,
        entropy_coeff: float = 0.01,
        critic_coeff: float = 0.5,
        termination_coeff: float = 0.1,
        prior_coeff: float = 0.0,
        deliberation_cost: float = 0.0,
        reduction: str = "mean",
    ) -> None:
        super().__init__()
        if reduction not in _REDUCTIONS:
            raise UserError(f"reduction: {reduction!r} is not possible; {suggest(reduction, _REDUCTIONS)}")
        self.reduction = reduction
        self.convert_to_functional(actor, "actor_network")
        self.convert_to_functional(critic, "critic_network")
        self.learns_terminations = termination is not None
        if termination is not None:
            self.convert_to_functional(termination, "termination_network")
        self.clip_epsilon, self.critic_coeff = clip_epsilon, critic_coeff
        self.termination_coeff, self.prior_coeff = termination_coeff, prior_coeff
        self.deliberation_cost = deliberation_cost
        self.register_buffer("entropy_coeff", torch.tensor(entropy_coeff))
        self.set_in_keys()

    def set_in_keys(self) -> None:
        """Say what `forward` reads and writes."""
        keys = self.tensor_keys
        observed = dict.fromkeys([*self.actor_network.in_keys, *self.critic_network.in_keys])
        read = [keys.action, keys.option, keys.action_log_prob, keys.action_mask]
        self.in_keys = [*observed, *read, keys.advantage, keys.value_target]
        self.out_keys = ["loss_objective", "loss_entropy", "loss_critic", "entropy", "clip_fraction"]
        if self.learns_terminations:
            assert self.termination_network is not None, "it learns them"
            after = (*self.termination_network.in_keys, keys.ended, keys.terminated, keys.ahead)
            self.in_keys += [unravel_key(("next", key)) for key in after]
            self.out_keys.insert(3, "loss_termination")

    def _forward_value_estimator_keys(self, **_: Any) -> None:
        if self._value_estimator is not None:
            self._value_estimator.set_keys(**self._estimator_keys())
        self.set_in_keys()

    def _estimator_keys(self) -> dict[str, NestedKey]:
        names = ("advantage", "value_target", "value", "reward", "done", "terminated")
        return {name: getattr(self.tensor_keys, name) for name in names}

    def make_value_estimator(self, value_type: ValueEstimators | None = None, **hyperparams: Any) -> None:
        """Choose how advantages are estimated: TD(0), TD(1), TD(lambda), or GAE, the default.

        Raises
        ------
        NotImplementedError
            If the estimator is of another kind.
        """
        chosen = self.default_value_estimator if value_type is None else value_type
        self.value_type = chosen
        if chosen not in _ESTIMATORS:
            raise NotImplementedError(f"{chosen} is not possible; choose one of {[*_ESTIMATORS]}")
        settings = {"gamma": 0.99, **({"lmbda": 0.95} if chosen in _WITH_LAMBDA else {}), **hyperparams}
        lmbda = settings.get("lmbda", float(chosen == ValueEstimators.TD1))
        self._decay = float(settings["gamma"]) * float(lmbda)
        self._value_estimator = _ESTIMATORS[chosen](value_network=None, **settings)
        self._value_estimator.set_keys(**self._estimator_keys())

    @torch.no_grad()
    def advantages(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the options' values, advantages and targets into trajectories, time last in the batch.

        The value of a step is that of its option where it starts, Q(s, o); that of its next state is
        U(s', o), which goes on or ends there. Pseudo-rewards have no say in values, but advantages take in
        those that the option comes to before it is over, as a task's own policy does in MAXQ-Q (Dietterich
        2000, section 4.4).
        """
        keys, after = self.tensor_keys, tensordict["next"]
        option = tensordict[keys.option]
        here, there = self._values(tensordict)
        if self.learns_terminations:
            ending = self._one("termination", after, option).sigmoid()
        else:
            ending = after[keys.ended].to(there.dtype)
        worth, ahead = upon_arrival(there, option, ending, after[keys.initiation], self.deliberation_cost)
        tensordict.set(keys.value, here.gather(-1, option[..., None]))
        after.set(keys.value, worth[..., None])
        after.set(keys.ahead, ahead)
        self.value_estimator(tensordict)
        pseudo_reward = after.get(keys.pseudo_reward, None)
        if pseudo_reward is not None:
            over = after[keys.done] | after[keys.ended].any(-1, keepdim=True)
            taught = summed_to_end(pseudo_reward, over, self._decay)
            tensordict.set(keys.advantage, tensordict[keys.advantage] + taught)
        return tensordict

    def _values(self, tensordict: TensorDictBase) -> tuple[Tensor, Tensor]:
        """Return the values of all options here and in the next states, shapes (..., options).

        Along a trajectory a next state is the following step's own, and is not looked at twice.
        """
        here, after = self._all("critic", tensordict), tensordict["next"]
        there, fresh = torch.empty_like(here), torch.ones(here.shape[:-1], dtype=torch.bool)
        fresh = fresh.to(here.device)
        if here.dim() > 1:
            there[..., :-1, :] = here[..., 1:, :]
            fresh[..., :-1] = False
            for key in self.critic_network.in_keys:
                changed = after[key][..., :-1, :] != tensordict[key][..., 1:, :]
                fresh[..., :-1] |= changed.flatten(here.dim() - 1).any(-1)
        there[fresh] = self._all("critic", after.select(*self.critic_network.in_keys)[fresh])
        return here, there

    @dispatch  # type: ignore[untyped-decorator]
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Return the losses, and the mean entropy and share of clipped actions beside them.

        Rows without advantages must be whole trajectories, of which these are worked out.
        """
        keys = self.tensor_keys
        if keys.advantage not in tensordict:
            tensordict = self.advantages(tensordict.copy())
        option, advantage = tensordict[keys.option], tensordict[keys.advantage].squeeze(-1)
        mask = of_option(tensordict[keys.action_mask], option)
        log_probs = permitted(self._one("actor", tensordict, option), mask)
        taken = log_probs.gather(-1, tensordict[keys.action][..., None]).squeeze(-1)
        ratio = (taken - tensordict[keys.action_log_prob]).exp()
        scaled = (advantage - advantage.mean()) / (advantage.std(correction=0) + _SMALL)
        clipped = ratio.clamp(1 - self.clip_epsilon, 1 + self.clip_epsilon)
        objective = torch.minimum(ratio * scaled, clipped * scaled)
        # What is refused has a log-probability of about -1e9 and a probability of 0.
        entropy = -(log_probs.exp() * log_probs).sum(-1)
        values, targets = self._one("critic", tensordict, option), tensordict[keys.value_target]
        losses = {
            "loss_objective": -objective,
            "loss_entropy": -self.entropy_coeff * entropy,
            "loss_critic": self.critic_coeff * functional.smooth_l1_loss(values, targets, reduction="none"),
        }
        if self.learns_terminations:
            losses["loss_termination"] = self._termination_loss(tensordict["next"], option)
        found = {name: _REDUCTIONS[self.reduction](loss) for name, loss in losses.items()}
        found["entropy"] = entropy.mean().detach()
        found["clip_fraction"] = (ratio != clipped).float().mean().detach()
        return TensorDict(found)

    def _termination_loss(self, after: TensorDictBase, option: Tensor) -> Tensor:
        """Return the loss of ending where going on is worth more, and of ending where the graph does not."""
        keys = self.tensor_keys
        logits = self._one("termination", after, option)
        alive = (~after[keys.terminated]).float()  # (..., 1): as for every level
        ending = self.termination_coeff * logits.sigmoid() * after[keys.ahead]
        prior = functional.binary_cross_entropy_with_logits(
            logits, after[keys.ended].to(logits.dtype), reduction="none"
        )
        loss: Tensor = ((ending + self.prior_coeff * prior) * alive).sum(-1)
        return loss

    def _all(self, name: str, tensordict: TensorDictBase) -> Tensor:
        """Return what a network makes of every option, shape (..., options[, columns])."""
        network = getattr(self, f"{name}_network")
        seen = tensordict.select(*network.in_keys)
        with getattr(self, f"{name}_network_params").to_module(network):
            network(seen)
        return cast("Tensor", seen.get(_WRITES[name]))

    def _one(self, name: str, tensordict: TensorDictBase, option: Tensor) -> Tensor:
        """Return what a network makes of one option a row, shape (..., columns)."""
        network = getattr(self, f"{name}_network")
        inner = getattr(network, "module", None)
        if not isinstance(inner, OneOption) or len(network.in_keys) != 1:
            found = self._all(name, tensordict)
            return of_option(found if found.dim() > option.dim() + 1 else found[..., None], option)
        with getattr(self, f"{name}_network_params").to_module(network):
            return inner.one_option(tensordict[network.in_keys[0]], option)
