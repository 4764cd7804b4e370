"""What a tabular learner learns with, as plain values: a dataclass that text can be read into."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final, Literal

from planners.config_text import Count, Part, Positive, Share, Unread, Weight, check_fields, load_settings
from planners.exploration import Boltzmann, Exploration, Explorer
from planners.learner import Settings
from planners.schedules import HarmonicRate, LearningRate, Rate
from worlds import UserError

Falls = Literal["fitting", "geometric", "harmonic"]
"""How the rate falls: the second where nothing is left to chance and the third elsewhere, or one of them."""
Explores = Literal["share", "boltzmann"]
"""How children are tried: a falling share of random choices, or by Boltzmann's probabilities."""

_UNREAD: Final[Unread] = {
    ("rate_falls", "geometric"): ("rate_half",),
    ("rate_falls", "harmonic"): ("rate", "rate_decay", "rate_every"),
    ("explores", "share"): ("heat", "cooling", "least_heat", "cooling_of"),
    ("explores", "boltzmann"): ("exploration_half",),
}
_BETWEEN: Final = re.compile(r",(?![^(]*\))")  # commas but for those inside a binding


@dataclass(frozen=True)
class TabularConfig:
    """What a tabular learner learns with; the defaults learn the paper's maze and Taxi.

    Parameters
    ----------
    gamma
        Discount.
    rate_falls
        How the rate falls (`Falls`).
    rate, rate_decay, rate_every
        A geometric rate: at first, and what it is multiplied by every so many episodes of a task
        (`LearningRate`; the paper has 0.9, 0.9 and 40). By default it stays at 1, for nothing needs
        averaging.
    rate_half
        A harmonic rate: episodes of a task after which it is a half (`HarmonicRate`).
    explores
        How children are tried (`Explores`).
    exploration_half
        Episodes of a task after which every second choice is random (`Exploration`).
    heat, cooling, least_heat
        The temperature at first, what it is multiplied by in each episode of a task, and the least that it
        falls to (`Boltzmann`).
    cooling_of
        The cooling of single tasks, such as "Root 0.95, Navigate 0.98".
    tie
        Children whose values differ by no more than this count as equal.
    all_states
        Whether a task also learns at the states that its child passed through; such learners are not
        compiled, and some hundred times slower.
    max_steps
        Steps of an episode after which learning is given up with an error.
    total
        Steps after which learning ends.
    evaluate
        Episodes between two evaluations, at first.
    spacing
        An evaluation also waits for this share of all episodes before: 0 keeps them equally far apart.

    Raises
    ------
    UserError
        If a value is of the wrong kind or out of range.

    Examples
    --------
    >>> TabularConfig(rate=0.9, rate_decay=0.9, rate_every=40).rate_in(deterministic=True)
    LearningRate(start=0.9, factor=0.9, every=40)
    >>> TabularConfig(rate_half=60).rate_in(deterministic=False)
    HarmonicRate(half=60)
    >>> TabularConfig(gamma=1.5)
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: gamma: 1.5 is not possible; give a number from 0 to 1
    """

    gamma: Share = 1.0
    rate_falls: Falls = "fitting"
    rate: Part = 1.0
    rate_decay: Part = 1.0
    rate_every: Count = 1
    rate_half: Count = 1000
    explores: Explores = "share"
    exploration_half: Count = 300
    heat: Positive = 50.0
    cooling: Part = 0.99
    least_heat: Positive = 0.01
    cooling_of: str = ""
    tie: Weight = 0.01
    all_states: bool = False
    max_steps: Count = 100_000
    total: Count = 1_000_000
    evaluate: Count = 100
    spacing: Weight = 0.2

    def __post_init__(self) -> None:
        check_fields(self)
        if self.least_heat > self.heat:
            raise UserError(
                f"least_heat: {self.least_heat:g} is not possible; give at most the heat, {self.heat:g}"
            )
        _ = self.coolings

    @cached_property
    def coolings(self) -> Mapping[str, float]:
        """The cooling of single tasks, by name."""
        return _coolings(self.cooling_of)

    @property
    def exploration(self) -> Explorer:
        """How children are tried."""
        if self.explores == "share":
            return Exploration(self.exploration_half)
        return self._cooled(self.cooling)

    def rate_in(self, *, deterministic: bool) -> Rate:
        """Return the rate's schedule in a world with or without chance."""
        if self.rate_falls == "harmonic" or (self.rate_falls == "fitting" and not deterministic):
            return HarmonicRate(self.rate_half)
        return LearningRate(self.rate, self.rate_decay, self.rate_every)

    def settings(self, *, deterministic: bool) -> Settings:
        """Return what a learner takes, in a world with or without chance."""
        of_tasks: dict[str, Explorer] = {name: self._cooled(factor) for name, factor in self.coolings.items()}
        return Settings(
            rate=self.rate_in(deterministic=deterministic),
            exploration=self.exploration,
            gamma=self.gamma,
            tie=self.tie,
            max_steps=self.max_steps,
            all_states=self.all_states,
            explorations=of_tasks if self.explores == "boltzmann" else {},
        )

    def piece(self, episodes: int) -> int:
        """Return how many episodes there are to the next evaluation, after so many.

        >>> [TabularConfig(evaluate=10).piece(episodes) for episodes in (0, 50, 100)]
        [10, 10, 20]
        """
        return max(self.evaluate, int(self.spacing * episodes))

    def _cooled(self, factor: float) -> Boltzmann:
        return Boltzmann(self.heat, factor, self.least_heat)


def load_tabular_config(
    path: str | Path | None = None, overrides: Mapping[str, str] | None = None
) -> TabularConfig:
    """Read what to learn with: from a YAML file, and from single values, which count more.

    Parameters
    ----------
    path
        A file of the settings that differ from the defaults; None for none.
    overrides
        Values as text, by the names of settings.

    Raises
    ------
    UserError
        If the file cannot be read, a setting is unknown or out of range, or a single value would never be
        read.

    Examples
    --------
    >>> load_tabular_config(overrides={"gamma": "0.95", "rate_falls": "harmonic"}).gamma
    0.95
    >>> load_tabular_config(overrides={"rate_falls": "harmonic", "rate": "0.5"})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: rate: it is not read with rate_falls=harmonic; leave it out, or give another ...
    """
    missing = "there is no such file; check the path, or leave it out"
    return load_settings(TabularConfig(), path, overrides or {}, missing=missing, unread=_UNREAD)


def _coolings(text: str) -> dict[str, float]:
    """Return factors by task.

    >>> _coolings("Root 0.9, GotoDoor(D1) 0.5")
    {'Root': 0.9, 'GotoDoor(D1)': 0.5}
    """
    found: dict[str, float] = {}
    for part in filter(None, (part.strip() for part in _BETWEEN.split(text))):
        name, _, number = part.rpartition(" ")
        try:
            factor = float(number)
        except ValueError:
            factor = 0.0
        if not name or not 0 < factor <= 1:
            raise UserError(
                f"cooling_of: {part!r} is not possible; give tasks with numbers above 0 and at most 1, "
                "such as Root 0.95, Navigate 0.98"
            )
        if name in found:
            raise UserError(f"cooling_of: {name} is there twice; give it once")
        found[name.strip()] = factor
    return found
