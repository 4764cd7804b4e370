"""Gymnasium's environments as worlds of a task graph's text: ``gym:FrozenLake-v1,is_slippery=False``."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np

from hierarchy.terms import ValueSet
from hierarchy.text_words import literal
from hierarchy.text_worlds import GYM_PREFIX, TextWorld, site_sets
from worlds import TransitionModel, UserError, suggest
from worlds.gym_model import gym_model


def gym_world(name: str) -> TextWorld:
    """Return the world of an environment that exposes its model, as `worlds.gym_model.gym_model` reads it.

    A world of one state variable has the set ``ends``, the values in which an episode is over; Taxi's has
    the set ``sites``.

    Parameters
    ----------
    name
        ``gym:`` and the environment's id, then its arguments if any, each after a comma, as
        ``gym:FrozenLake-v1,map_name=8x8,is_slippery=False``.

    Raises
    ------
    UserError
        If there is no such environment, it does not take the arguments, or it exposes no model.

    Examples
    --------
    >>> lake = gym_world("gym:FrozenLake-v1,is_slippery=False")
    >>> lake.actions, [str(values) for values in lake.sets], lake.model().is_deterministic
    (('Left', 'Down', 'Right', 'Up'), ['ends'], True)
    """
    model = gym_model(_made(name))
    return TextWorld(name, model.index.variables, model.actions, lambda: model, _sets(model))


def _made(name: str) -> gymnasium.Env[Any, Any]:
    env_id, *arguments = (part.strip() for part in name.removeprefix(GYM_PREFIX).split(","))
    given: dict[str, Any] = {}
    for argument in arguments:
        key, sign, value = (part.strip() for part in argument.partition("="))
        if not key or not sign:
            raise UserError(
                f"world {name!r}: {argument!r} is no argument; write KEY=VALUE, such as is_slippery=False"
            )
        given[key] = literal(value)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", DeprecationWarning
            )  # an outdated id that is gone is an error, too
            return gymnasium.make(env_id, **given)
    except (gymnasium.error.UnregisteredEnv, gymnasium.error.DeprecatedEnv) as error:
        mend = suggest(env_id, _known(), "with a model there are")
        raise UserError(f"world {name!r}: Gymnasium has no environment {env_id!r}; {mend}") from error
    except Exception as error:  # an environment refuses an argument in whatever way it likes
        problem = " ".join(str(error).split()).rstrip(".")
        mend = "mend its arguments" if given else "name another, or install what it needs"
        raise UserError(
            f"world {name!r} cannot be made ({type(error).__name__}: {problem}); {mend}"
        ) from error


def _known() -> list[str]:
    """Return the ids of Gymnasium's own environments that come with a model."""
    modelled = ("CliffWalking", "FrozenLake", "Taxi")
    return [name for name in gymnasium.registry if name.startswith(modelled)]


def _sets(model: TransitionModel) -> tuple[ValueSet, ...]:
    if len(model.index.variables) > 1:
        return site_sets(model.index.variables)
    here = np.arange(model.index.size)[:, None, None]
    stays = ((model.outcomes == here) | (model.probabilities == 0)).all(axis=(1, 2))
    over = stays & (model.rewards == 0).all(axis=1)
    ends = frozenset(model.index.state(int(state))[0] for state in np.flatnonzero(over))
    return (ValueSet("ends", ends),) if ends else ()
