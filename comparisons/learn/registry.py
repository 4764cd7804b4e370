"""The learners that `affordant learn` offers, by name.

A package adds one by an entry point of the group ``affordant.learners``, whose value is called with a
`Request` and returns a `Run`. In its pyproject.toml::

    [project.entry-points."affordant.learners"]
    mine = "my_package:my_learner"
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundGraph
from planners.option_critic.greedy import GreedyPolicy
from worlds.entry_points import entry_points
from worlds.errors import UserError, suggest

Pieces = Generator[tuple[int, Mapping[str, float]], None, None]
"""Steps so far, and measurements, after each piece of learning."""
GROUP: Final = "affordant.learners"
"""The entry points' group."""
# Reached by name, so that only the learner that is asked for loads its libraries.
_OURS: Final = {
    "option-critic": "comparisons.learn.neural:option_critic",
    "flat-ppo": "comparisons.learn.neural:flat_ppo",
    "flat-dqn": "comparisons.learn.neural:flat_dqn",
    "maxq-0": "comparisons.learn.tabular:maxq_0",
    "maxq-q": "comparisons.learn.tabular:maxq_q",
    "hsmq": "comparisons.learn.tabular:hsmq",
    "flat-q": "comparisons.learn.tabular:flat_q",
}


# Those that can begin with another one's networks.
_CARRYING: Final = ("option-critic",)


class StuckError(UserError):
    """Learning cannot go on: an episode does not end."""


@dataclass(frozen=True, eq=False)
class Carry:
    """Networks to begin with: those of a checkpoint that do not see what has moved since.

    Parameters
    ----------
    path
        The checkpoint.
    moved
        Names of state variables.
    tell
        Is told the names of what was carried.
    """

    path: Path
    moved: tuple[str, ...]
    tell: Callable[[tuple[str, ...]], None]


@dataclass(frozen=True, eq=False)
class Request:
    """What is to be learnt, and with what.

    Parameters
    ----------
    learner
        The learner's name.
    grounded
        The ground graph.
    seed
        Of learning.
    config
        A file of settings; None for the defaults.
    settings
        Single settings as text, by name, which count more than the file.
    steps
        Environment steps to learn for; None for the config's.
    carry
        What to begin with; None for networks freshly drawn.
    """

    learner: str
    grounded: GroundGraph
    seed: int = 0
    config: Path | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    steps: int | None = None
    carry: Carry | None = None


class Run(Protocol):
    """One run of a learner: it learns piece by piece, can be asked what it would do, and goes on later."""

    @property
    def grounded(self) -> GroundGraph:
        """The ground graph that was given."""

    @property
    def settings(self) -> Mapping[str, bool | int | float | str]:
        """What it learns with, by name; ``total`` is the number of steps after which it ends."""

    def learn(self) -> Pieces:
        """Learn, and yield the steps so far and measurements after each piece, until all steps are done."""

    def due(self) -> bool:
        """Return whether the policy is to be evaluated after this piece."""

    def greedy(self) -> GreedyPolicy:
        """Return what it would do in every state, nothing left to chance."""

    def state(self) -> Mapping[str, NDArray[np.generic]]:
        """Return all that learning hangs on, as arrays by name."""

    def restore(self, state: Mapping[str, NDArray[np.generic]], /) -> None:
        """Take up a state, or raise a `UserError` if it is of another run."""


def learner_names() -> tuple[str, ...]:
    """Return the names of the learners there are, ours first.

    Examples
    --------
    >>> learner_names()[:7]
    ('option-critic', 'flat-ppo', 'flat-dqn', 'maxq-0', 'maxq-q', 'hsmq', 'flat-q')
    """
    return tuple(_points())


def new_run(request: Request) -> Run:
    """Return a run of the learner that is asked for.

    Raises
    ------
    UserError
        If there is no such learner, or it cannot learn what is asked for.
    """
    points = _points()
    if request.learner not in points:
        raise UserError(f"--learner {request.learner}: there is none; {suggest(request.learner, points)}")
    if request.carry is not None and request.learner not in _CARRYING:
        raise UserError(
            f"--carry: the learner {request.learner} has no networks to begin with; "
            f"leave it out, or use {', '.join(_CARRYING)}"
        )
    point = points[request.learner]
    try:
        make: Callable[[Request], Run] = point.load()
    except (ImportError, AttributeError) as error:
        raise UserError(
            f"learner {point.name!r} ({point.value}) cannot be loaded: {error}; "
            "install what it needs, or mend its entry point"
        ) from error
    return make(request)


def _points() -> dict[str, EntryPoint]:
    """Return entry points by name; a name of ours cannot be taken."""
    ours = {name: EntryPoint(name, value, GROUP) for name, value in _OURS.items()}
    others = sorted(entry_points(group=GROUP), key=lambda point: point.name)
    return {**ours, **{point.name: point for point in others if point.name not in ours}}
