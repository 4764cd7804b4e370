"""What an option-critic learns with: a dataclass, and the same as a file.

``option_critic.yaml`` beside this module lists every setting with its default; a file of one's own needs only
those that differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from planners.config_text import (
    Count,
    Positive,
    Share,
    Size,
    Unread,
    Weight,
    check_fields,
    load_settings,
    parse_settings,
)

Ends = Literal["given", "learnt", "prior"]
"""What ends a task: the graph; a learnt termination; a learnt one that the graph's is a prior of."""

_UNREAD: Final[Unread] = {
    ("terminations", "given"): ("termination", "prior"),
    ("terminations", "learnt"): ("prior",),
}


@dataclass(frozen=True)
class OptionCriticConfig:
    """What an option-critic learns with; the defaults learn the paper's maze.

    Parameters
    ----------
    terminations
        What ends a task (`Ends`).
    abstracted
        Whether each network sees the variables that its part uses, or all of them.
    hidden
        Width of the networks' two hidden layers.
    num_envs, horizon
        Environments side by side, and steps of each between two updates.
    epochs, minibatch
        Passes over these steps, and rows at a time.
    rate, last_rate
        Adam's learning rate at first and at last.
    entropy, epsilon
        Weight of the entropy, and the share of options chosen at random; both fall to 0.
    anneal
        Steps over which learning rate, entropy and epsilon fall.
    gamma, lmbda
        Discount, and the trace's decay in the advantages.
    clip, critic, most_gradient
        The clipped ratio's width, the weight of the critic's loss, and the largest norm of a gradient.
    termination, prior, deliberation
        Weights of the termination's gradient, where it is learnt, and of the graph as its prior, where it is
        one; and the cost of ending a task.
    max_steps
        Steps after which an episode of learning is cut off.
    total
        Steps after which learning ends.
    evaluate
        Updates between two evaluations.

    Raises
    ------
    UserError
        If a value is of the wrong kind or out of range.

    Examples
    --------
    >>> OptionCriticConfig(terminations="prior").per_update
    4096
    >>> OptionCriticConfig(gamma=1.5)
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: gamma: 1.5 is not possible; give a number from 0 to 1
    """

    terminations: Ends = "given"
    abstracted: bool = True
    hidden: Size = 32
    num_envs: Size = 128
    horizon: Size = 32
    epochs: Size = 3
    minibatch: Count = 1024
    rate: Positive = 3e-3
    last_rate: Weight = 2e-4
    entropy: Weight = 0.1
    epsilon: Share = 0.3
    anneal: Count = 300_000
    gamma: Share = 0.98
    lmbda: Share = 0.95
    clip: Positive = 0.2
    critic: Weight = 0.5
    most_gradient: Positive = 0.5
    termination: Weight = 0.1
    prior: Weight = 1.0
    deliberation: Weight = 0.0
    max_steps: Count = 200
    total: Count = 1_000_000
    evaluate: Count = 2

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def per_update(self) -> int:
        """Environment steps between two updates."""
        return self.num_envs * self.horizon

    def left(self, steps: int) -> float:
        """Return what is left of the annealing after so many steps, from 1 to 0."""
        return max(0.0, 1 - steps / self.anneal)

    def rate_with(self, left: float) -> float:
        """Return the learning rate with so much of the annealing left."""
        return self.last_rate + (self.rate - self.last_rate) * left

    def scale(self, rewards: NDArray[np.float64]) -> float:
        """Return about what an episode is worth in a world of some rewards, for critics to be scaled by."""
        steps = 0.4 / (1 - min(self.gamma, 0.999))
        return steps * float(np.abs(rewards).mean())


def load_config(
    path: str | Path | None = None, overrides: Mapping[str, str] | None = None
) -> OptionCriticConfig:
    """Read what to learn with from a file, single values replaced.

    Parameters
    ----------
    path
        A YAML file of settings; those that it leaves out keep their defaults. None for none.
    overrides
        Values as text, by the names of settings.

    Raises
    ------
    UserError
        If the file cannot be read or is no YAML, or a setting is unknown or out of range; the message tells
        the file, every line and every mend. If a single value would never be read.

    Examples
    --------
    >>> load_config(overrides={"rate": "1e-3", "terminations": "prior"}).rate
    0.001
    >>> load_config(overrides={"prior": "0.5"})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: prior: it is not read with terminations=given; leave it out, or give another ...
    >>> load_config(overrides={"gama": "0.9"})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: gama=0.9: there is no such setting; did you mean 'gamma'?
    """
    missing = "there is no such file; check the path, or copy planners/option_critic/option_critic.yaml"
    return load_settings(OptionCriticConfig(), path, overrides or {}, missing=missing, unread=_UNREAD)


def parse_config(text: str, source: str = "the settings") -> OptionCriticConfig:
    r"""Read what to learn with from YAML text.

    Parameters
    ----------
    text
        A mapping of settings to values; no tags, anchors or aliases.
    source
        What errors call it.

    Raises
    ------
    UserError
        If it is no such text, or a setting is unknown or out of range.

    Examples
    --------
    >>> parse_config("gamma: 0.9  # nearer\nhidden: 64").hidden
    64
    >>> parse_config("gamma: 0.9\nhiden: 64", "mine.yaml")
    Traceback (most recent call last):
        ...
    planners.config_text.ConfigError: mine.yaml, line 2, hiden: there is no such setting; did you ...
    """
    return parse_settings(OptionCriticConfig(), text, source)
