"""The conformance kit for environments: what reset and step do, held against the model and the seed."""

from __future__ import annotations

import warnings
from collections import Counter
from typing import Any, Final

import numpy as np
from gymnasium.utils.env_checker import check_env

from comparisons.conformance_parts import ConformanceError, hold
from worlds import Stream, TransitionModel
from worlds.black_box import BlackBox, Move

_STEPS: Final = 400  # of an episode, at the most
_SURE: Final = 6.0  # standard deviations: chance goes further in one of 500 million cases
_EXPECTED: Final = 10  # times that an outcome must be expected before its frequency is looked at

Life = list[tuple[int, int, Move]]
"""State, action and what followed, step by step."""


def check_box(model: TransitionModel, box: BlackBox, episodes: int = 60) -> None:
    """Check an environment: Gymnasium's own checker, the seeds of its resets, and its steps by the model.

    Actions are random. Where an episode ends, the reward alone is compared: an observation need not say
    that the episode is over.

    Parameters
    ----------
    model
        What the environment is said to do.
    box
        The environment, and how its observations are read.
    episodes
        How many to live through; more of them find rarer faults.

    Raises
    ------
    ConformanceError
        If not; the message names the state, the action and both numbers.

    Examples
    --------
    >>> import gymnasium
    >>> from worlds import Cell
    >>> from worlds.gym_model import gym_model
    >>> lake = gymnasium.make("FrozenLake-v1")
    >>> model = gym_model(lake)
    >>> box = BlackBox(lake, model.index.variables, lambda n: [Cell(*divmod(n, 4))], model.actions)
    >>> check_box(model, box)
    """
    hold(box.index == model.index, "the environment and the model have different state variables")
    hold(
        box.actions == model.actions, "the environment and the model have different actions, or another order"
    )
    _gymnasium(box.env)
    seen: Counter[tuple[int, int, int]] = Counter()
    for seed in range(episodes):
        start, life = _lived(box, seed, seed)
        _same(model, (start, life), _lived(box, seed, seed), seed)
        if not model.starts[start]:
            raise ConformanceError(
                f"an episode begins in {model.index.words(start)}, which is no start of the model"
            )
        for state, action, move in life:
            _follows(model, state, action, move)
            seen[state, action, -1 if move.terminated else move.state] += 1
    _frequencies(model, seen)


def _gymnasium(env: Any) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # advice; what is wrong is raised
            check_env(env.unwrapped, skip_render_check=True)
    except Exception as error:  # the checker raises whatever the environment does
        raise ConformanceError(f"Gymnasium's checker refuses the environment: {error}") from error


def _lived(box: BlackBox, seed: int, choices: int) -> tuple[int, Life]:
    """Return the start and the steps of an episode with random actions."""
    stream, life = Stream(choices), []
    start = state = box.reset(seed=seed)
    for _ in range(_STEPS):
        action = stream.below(len(box.actions))
        move = box.step(action)
        life.append((state, action, move))
        if move.terminated or move.truncated:
            break
        state = move.state
    return start, life


def _same(model: TransitionModel, one: tuple[int, Life], other: tuple[int, Life], seed: int) -> None:
    """Refuse two episodes of one seed that differ."""
    mend = "draw every random number from the generator that reset(seed=...) seeds"
    if one[0] != other[0]:
        where = f"{model.index.words(one[0])}, and then in {model.index.words(other[0])}"
        raise ConformanceError(f"with seed {seed} an episode begins in {where}; {mend}")
    for (state, action, move), (_, _, again) in zip(one[1], other[1], strict=False):
        if move != again:
            where = f"{model.index.words(state)}, action {model.actions[action]}"
            raise ConformanceError(
                f"with seed {seed} the same actions led to something else in {where}; {mend}"
            )


def _follows(model: TransitionModel, state: int, action: int, move: Move) -> None:
    """Refuse a step that the model rules out."""
    occurs = model.probabilities[state, action] > 0
    rewarded = occurs & np.isclose(model.outcome_rewards[state, action], move.reward)
    here = model.outcomes[state, action]
    where = f"in {model.index.words(state)}, action {model.actions[action]}"
    known = sorted({int(each) for each in here[occurs]})
    if not move.terminated and move.state not in known:
        listed = " or ".join(f"({model.index.words(each)})" for each in known)
        raise ConformanceError(f"{where} led to ({model.index.words(move.state)}); the model says {listed}")
    if not (rewarded if move.terminated else rewarded & (here == move.state)).any():
        there = occurs if move.terminated else occurs & (here == move.state)
        listed = " or ".join(f"{each:g}" for each in np.unique(model.outcome_rewards[state, action][there]))
        raise ConformanceError(f"{where} earned {move.reward:g}; the model says {listed}")


def _frequencies(model: TransitionModel, seen: Counter[tuple[int, int, int]]) -> None:
    """Refuse outcomes that come far more or less often than the model says."""
    made: Counter[tuple[int, int]] = Counter()
    ended = {(state, action) for state, action, after in seen if after < 0}
    for (state, action, _), count in seen.items():
        made[state, action] += count
    for (state, action), times in made.items():
        if (state, action) in ended:
            continue
        for after in np.unique(model.outcomes[state, action]).tolist():
            same = model.outcomes[state, action] == after
            chance = float(model.probabilities[state, action][same].sum())
            off = abs(seen[state, action, after] - times * chance)
            spread = (times * chance * (1 - chance)) ** 0.5
            if times * chance >= _EXPECTED and off > _SURE * spread + 0.5:
                where = f"in {model.index.words(state)}, action {model.actions[action]} led"
                problem = (
                    f"{where} to ({model.index.words(after)}) {seen[state, action, after]} times of {times}"
                )
                raise ConformanceError(f"{problem}; the model's probability is {chance:g}")
