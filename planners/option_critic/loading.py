"""An option-critic from its checkpoint. Importing this module loads PyTorch and TorchRL."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from hierarchy.check import checked
from hierarchy.starts import beginning_where
from hierarchy.text import load_world, parse_graph
from planners.option_critic.checkpoint import Checkpoint, load_checkpoint, restore
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.training import OptionCritic
from worlds import UserError

OPTION_CRITIC: Final = "option-critic"
"""What a checkpoint calls this learner."""


def load_option_critic(path: Path | str) -> OptionCritic:
    """Return the option-critic of a checkpoint, on the graph and world that it learnt on.

    Raises
    ------
    UserError
        If the checkpoint cannot be read, is of another learner, or its world is no longer what it was.
    """
    stored = load_checkpoint(path)
    about = stored.about
    if about.learner != OPTION_CRITIC:
        raise UserError(f"{path}: it is of the learner {about.learner!r}; give one of {OPTION_CRITIC!r}")
    world = load_world(about.world)
    grounded = checked(parse_graph(about.graph, f"{path}: its task graph", world).graph, world.model())
    if about.starts:
        grounded = beginning_where(grounded, about.starts)
    learner = OptionCritic(grounded, about.seed, _config(path, about))
    restore(path, stored, learner)
    return learner


def _config(path: Path | str, about: Checkpoint) -> OptionCriticConfig:
    try:
        return OptionCriticConfig(**about.config)  # type: ignore[arg-type]  # it looks at each itself
    except (TypeError, UserError) as error:
        raise UserError(f"{path}: its config is wrong ({error}); learn anew") from error
