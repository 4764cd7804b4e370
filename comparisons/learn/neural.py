"""The option-critic as a run of `affordant learn`. Importing this module loads PyTorch and TorchRL."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace

import numpy as np
import torch
from numpy.typing import NDArray

from comparisons.learn.registry import Pieces, Request
from hierarchy import GroundGraph
from planners.option_critic.config import load_config
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.training import OptionCritic


class NeuralRun:
    """A run of an option-critic."""

    def __init__(self, learner: OptionCritic) -> None:
        self.learner = learner

    @property
    def grounded(self) -> GroundGraph:
        """The ground graph."""
        return self.learner.grounded

    @property
    def settings(self) -> Mapping[str, bool | int | float | str]:
        """The config, by name."""
        return asdict(self.learner.config)

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
        """Return networks, moments and environments."""
        return self.learner.state()

    def restore(self, state: Mapping[str, NDArray[np.generic]], /) -> None:
        """Take up a state."""
        self.learner.restore(state)


def option_critic(request: Request) -> NeuralRun:
    """Return a run of an option-critic on one thread, for the order of sums is part of what is repeated."""
    config = load_config(request.config, request.settings)
    if request.steps is not None:
        config = replace(config, total=request.steps)
    torch.set_num_threads(1)
    return NeuralRun(OptionCritic(request.grounded, request.seed, config))
