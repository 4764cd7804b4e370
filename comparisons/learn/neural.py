"""The option-critic and its flat rivals as runs of `affordant learn`.

Importing this module loads PyTorch and TorchRL.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from comparisons.learn.registry import Pieces, Request
from hierarchy import GroundGraph
from hierarchy.text_files import file_text
from hierarchy.text_nodes import TaskGraphTextError, read_yaml
from planners.option_critic.collecting import CollectingLearner
from planners.option_critic.config import OptionCriticConfig, load_config
from planners.option_critic.flat_baselines import WIDTH, Flat, FlatDQN, FlatPPO
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.training import OptionCritic
from planners.option_critic.transfer import carry_from
from worlds.errors import UserError


class NeuralRun:
    """A run of a learner that collects and has networks."""

    def __init__(self, learner: CollectingLearner) -> None:
        self.learner = learner

    @property
    def grounded(self) -> GroundGraph:
        """The ground graph."""
        return self.learner.grounded

    @property
    def settings(self) -> Mapping[str, bool | int | float | str]:
        """The config, by name, but for what the learner does not read."""
        return _read(type(self.learner), self.learner.config)

    def learn(self) -> Pieces:
        """Learn, update by update."""
        yield from self.learner.learn()

    def due(self) -> bool:
        """Return whether so many updates have been made that the config wants an evaluation."""
        return self.learner.updates % self.learner.config.evaluate == 0

    def greedy(self) -> GreedyPolicy:
        """Return the greedy policy."""
        return self.learner.greedy()

    def state(self) -> Mapping[str, NDArray[np.generic]]:
        """Return networks, moments and environments, and what else is kept."""
        return self.learner.state()

    def restore(self, state: Mapping[str, NDArray[np.generic]], /) -> None:
        """Take up a state."""
        self.learner.restore(state)


def option_critic(request: Request) -> NeuralRun:
    """Return a run of an option-critic on one thread, for the order of sums is part of what is repeated."""
    torch.set_num_threads(1)
    learner = OptionCritic(request.grounded, request.seed, _config(request))
    if (carry := request.carry) is not None:
        carry.tell(carry_from(carry.path, learner, carry.moved))
    return NeuralRun(learner)


def flat_ppo(request: Request) -> NeuralRun:
    """Return a run of flat PPO on one thread."""
    return _flat(FlatPPO, request)


def flat_dqn(request: Request) -> NeuralRun:
    """Return a run of flat DQN on one thread."""
    return _flat(FlatDQN, request)


def flat_ppo_settings(given: Mapping[str, str]) -> dict[str, bool | int | float | str]:
    """Return the settings of flat PPO by name, with the given ones in place of the defaults."""
    return _read(FlatPPO, _flat_config(FlatPPO, "flat-ppo", None, given))


def flat_dqn_settings(given: Mapping[str, str]) -> dict[str, bool | int | float | str]:
    """Return the settings of flat DQN by name, with the given ones in place of the defaults."""
    return _read(FlatDQN, _flat_config(FlatDQN, "flat-dqn", None, given))


def _flat(kind: type[Flat], request: Request) -> NeuralRun:
    """Return a run of a flat learner."""
    config = _flat_config(kind, request.learner, request.config, request.settings)
    torch.set_num_threads(1)
    return NeuralRun(kind(request.grounded, request.seed, _for_steps(config, request)))


def _flat_config(
    kind: type[Flat], learner: str, path: Path | None, given: Mapping[str, str]
) -> OptionCriticConfig:
    """Return what a flat learner learns with, its network wide unless its width is given.

    In a file, which may be meant for several learners, settings that it does not read are let be.
    """
    for name in given:
        if name in kind.unread:
            option = "--terminations" if name == "terminations" else f"--set {name}"
            read = [field.name for field in fields(OptionCriticConfig) if field.name not in kind.unread]
            raise UserError(
                f"{option}: the learner {learner} has no use for {name}; leave it out. "
                f"Its settings are {', '.join(read)}"
            )
    config = load_config(path, given)
    if "hidden" not in given and not _sets(path, "hidden"):
        config = replace(config, hidden=WIDTH)
    return config


def _read(kind: type[CollectingLearner], config: OptionCriticConfig) -> dict[str, bool | int | float | str]:
    """Return what a learner reads of a config, by name."""
    return {name: value for name, value in asdict(config).items() if name not in kind.unread}


def _config(request: Request) -> OptionCriticConfig:
    return _for_steps(load_config(request.config, request.settings), request)


def _for_steps(config: OptionCriticConfig, request: Request) -> OptionCriticConfig:
    return config if request.steps is None else replace(config, total=request.steps)


def _sets(path: Path | None, name: str) -> bool:
    """Return whether a file of settings, which has been read before, has something to say of one."""
    if path is None:
        return False
    try:
        return name in read_yaml(file_text(path, "give it back"), str(path)).data
    except TaskGraphTextError:
        return False  # it holds comments alone
