"""What an option-critic learns with: a dataclass, and the same as a file.

``option_critic.yaml`` beside this module lists every setting with its default; a file of one's own needs only
those that differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Final, Literal, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from hierarchy.text_files import file_text
from hierarchy.text_nodes import Document, Fault, TaskGraphTextError, read_yaml
from worlds import UserError, suggest

Ends = Literal["given", "learnt", "prior"]
"""What ends a task: the graph; a learnt termination; a learnt one that the graph's is a prior of."""
Size = Annotated[int, Field(ge=1, le=100_000)]
Count = Annotated[int, Field(ge=1, le=10**12)]
Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Weight = Annotated[float, Field(ge=0, allow_inf_nan=False)]

DEFAULTS: Final = "option_critic.yaml"
"""The file of the defaults, beside this module."""
_MENDS: Final = {
    Ends: f"use one of {', '.join(get_args(Ends))}",
    bool: "give true or false",
    Size: "give a whole number from 1 to 100000",
    Count: "give a whole number from 1 to 1000000000000",
    Share: "give a number from 0 to 1",
    Positive: "give a number above 0",
    Weight: "give a number from 0 on",
}


class ConfigError(UserError):
    """A file of settings is wrong; `faults` tells where.

    Examples
    --------
    >>> str(ConfigError("mine.yaml", [Fault(2, "rte", "there is no such setting", "did you mean 'rate'?")]))
    "mine.yaml, line 2, rte: there is no such setting; did you mean 'rate'?"
    """

    def __init__(self, source: str, faults: list[Fault]) -> None:
        self.faults = tuple(sorted(faults))
        super().__init__("\n".join(f"{source}, {fault}" for fault in self.faults))


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
        Steps over which the three fall.
    gamma, lmbda
        Discount, and the trace's decay in the advantages.
    clip, critic, most_gradient
        The clipped ratio's width, the weight of the critic's loss, and the largest norm of a gradient.
    termination, prior, deliberation
        Weights of the termination's gradient and of the graph as its prior, and the cost of ending a task.
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
        for name, adapter in _FIELDS.items():
            value = getattr(self, name)
            try:
                adapter.validate_python(value, strict=True)
            except ValidationError as error:
                raise UserError(f"{name}: {value!r} is not possible; {_mend(name, value)}") from error

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


_TYPES: Final = get_type_hints(OptionCriticConfig, include_extras=True)
_FIELDS: Final = {field.name: TypeAdapter[Any](_TYPES[field.name]) for field in fields(OptionCriticConfig)}


def load_config(
    path: str | Path | None = None, overrides: Mapping[str, str] | None = None
) -> OptionCriticConfig:
    """Read what to learn with from a file, single values replaced.

    Parameters
    ----------
    path
        A YAML file of settings; those that it leaves out keep their defaults. Defaults to the file of the
        defaults.
    overrides
        Values as text, by the names of settings.

    Raises
    ------
    UserError
        If the file cannot be read or is no YAML, or a setting is unknown or out of range; the message tells
        the file, every line and every mend.

    Examples
    --------
    >>> load_config(overrides={"rate": "1e-3", "terminations": "prior"}).rate
    0.001
    >>> load_config(overrides={"gama": "0.9"})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: gama=0.9: there is no such setting; did you mean 'gamma'?
    """
    values: dict[str, Any] = {}
    for name, text in (overrides or {}).items():
        found = _read(name, text)
        if isinstance(found, _Wrong):
            raise UserError(f"{name}={text}: {found.problem}; {found.mend}")
        values[name] = found.value
    if path is None:
        text = files("planners.option_critic").joinpath(DEFAULTS).read_text(encoding="utf-8")
        return replace(parse_config(text, DEFAULTS), **values)
    missing = "there is no such file; check the path, or copy planners/option_critic/option_critic.yaml"
    return replace(parse_config(file_text(Path(path), missing), str(path)), **values)


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
    planners.option_critic.config.ConfigError: mine.yaml, line 2, hiden: there is no such setting; did ...
    """
    lines = (line.partition("#")[0].strip() for line in text.splitlines())
    if not any(line and line != "---" for line in lines):
        return OptionCriticConfig()  # all is left out
    try:
        document = read_yaml(text, source)
    except TaskGraphTextError as error:
        raise ConfigError(source, list(error.faults)) from error
    if not isinstance(document.data, dict):
        fault = document.fault((), "these are no settings", "write NAME: VALUE in each line")
        raise ConfigError(source, [fault])
    return OptionCriticConfig(**_settings(document, source))


@dataclass(frozen=True)
class _Right:
    value: Any


@dataclass(frozen=True)
class _Wrong:
    problem: str
    mend: str


def _settings(document: Document, source: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    faults = []
    for name, text in document.data.items():
        found = _read(name, text)
        if isinstance(found, _Wrong):
            faults.append(document.fault((name,), found.problem, found.mend))
        else:
            values[name] = found.value
    if faults:
        raise ConfigError(source, faults)
    return values


def _read(name: str, text: Any) -> _Right | _Wrong:
    """Return the value that a setting's text stands for, or what is wrong with it."""
    if name not in _FIELDS:
        return _Wrong("there is no such setting", suggest(name, _FIELDS))
    if not isinstance(text, str):
        return _Wrong("this is no single value", _mend(name, text))
    try:
        return _Right(_FIELDS[name].validate_python(text))
    except ValidationError:
        return _Wrong(f"{text or 'nothing'} is not possible", _mend(name, text))


def _mend(name: str, value: Any) -> str:
    kind = _TYPES[name]
    if kind == Ends and isinstance(value, str):
        return suggest(value, get_args(Ends))
    return _MENDS[kind]
