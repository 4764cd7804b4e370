"""The settings that each learner has, read from text before anything is learnt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib.metadata import EntryPoint
from typing import Final

from comparisons.learn.registry import GROUP, learner_names
from planners.option_critic.config import load_config
from planners.tabular_config import load_tabular_config
from worlds.errors import UserError, suggest

Settings = dict[str, bool | int | float | str]

TABULAR: Final = ("maxq-0", "maxq-q", "hsmq", "flat-q")
"""The learners that keep tables."""
# Reached by name: what a flat learner does not read is known to modules that load PyTorch.
_FLAT: Final = {
    "flat-ppo": "comparisons.learn.neural:flat_ppo_settings",
    "flat-dqn": "comparisons.learn.neural:flat_dqn_settings",
}


def learner_settings(learner: str, given: Mapping[str, str]) -> Settings:
    """Return all of a learner's settings, those that are not given at their defaults.

    Those of a learner of another package are returned as they are given: it checks them as it begins.

    Raises
    ------
    UserError
        If there is no such learner, or a setting is unknown, out of range or never read.

    Examples
    --------
    >>> learner_settings("maxq-0", {"gamma": "0.9"})["gamma"]
    0.9
    >>> learner_settings("option-critic", {"gama": "0.9"})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: gama=0.9: there is no such setting; did you mean 'gamma'?
    """
    if learner not in learner_names():
        raise UserError(f"learner: {learner} is not possible; {suggest(learner, learner_names())}")
    if learner in TABULAR:
        return asdict(load_tabular_config(overrides=given))
    if learner == "option-critic":
        return asdict(load_config(overrides=given))
    if learner in _FLAT:
        read: Callable[[Mapping[str, str]], Settings] = EntryPoint(learner, _FLAT[learner], GROUP).load()
        return read(given)
    return dict(given)
