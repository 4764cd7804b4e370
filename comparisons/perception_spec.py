"""What a comparison of perception backends is to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from perception.data import SPLITS, split_of
from perception.learnt import MOST_EFFORT
from perception.protocol import LABELS
from worlds.errors import UserError

_MOST_PUSHES: Final = 100_000


@dataclass(frozen=True)
class LearningSpec:
    """How backends are trained anew.

    Parameters
    ----------
    seeds
        Number of training seeds, from 0 on; 0 leaves training out.
    pushes
        Numbers of trials to learn from: a seed's first ones.
    wrong
        Shares of wrong labels.
    effort
        Share of the usual number of training steps.

    Raises
    ------
    UserError
        If a number is out of range.
    """

    seeds: int = 3
    pushes: tuple[int, ...] = (25, 50, 100, 200, 500, 2000)
    wrong: tuple[float, ...] = (0.0, 0.1, 0.2)
    effort: float = 0.3

    def __post_init__(self) -> None:
        most = len(SPLITS["training"])
        if not 0 <= self.seeds <= most:
            raise UserError(f"--training-seeds {self.seeds}: give 0 to {most}")
        if not 0 < self.effort <= MOST_EFFORT:
            raise UserError(
                f"--effort {self.effort:g}: give a share of the usual, above 0, at most {MOST_EFFORT:g}"
            )
        if not self.pushes or not all(len(LABELS) <= n <= _MOST_PUSHES for n in self.pushes):
            raise UserError(
                f"pushes {list(self.pushes)}: give one number or more, each {len(LABELS)} to {_MOST_PUSHES}"
            )
        if not self.wrong or not all(0 <= share < 1 for share in self.wrong):
            raise UserError(
                f"wrong labels {list(self.wrong)}: give one share or more, each from 0 to below 1"
            )


QUICK: Final = LearningSpec(seeds=1, pushes=(25, 100), wrong=(0.0, 0.2), effort=0.02)
"""For a first look."""


@dataclass(frozen=True)
class StudySpec:
    """What to compare.

    Parameters
    ----------
    backends
        Names; () takes every one that reads frames.
    seed
        Of the scenes: 200 or more, for those below train and tune.
    frames
        Of every set of scenes.
    episodes
        Random episodes in which mistakes are paid for.
    severities
        Of each corruption.
    learning
        How backends that learn are trained anew.

    Raises
    ------
    UserError
        If the seed is not for tests, or a number is not positive.
    """

    backends: tuple[str, ...] = ()
    seed: int = 200
    frames: int = 1000
    episodes: int = 200
    severities: tuple[int, ...] = (1, 2, 3, 4, 5)
    learning: LearningSpec = field(default_factory=LearningSpec)

    def __post_init__(self) -> None:
        if split_of(self.seed) != "test":
            raise UserError(f"--seed {self.seed} names {split_of(self.seed)} frames; use 200 to 299")
        if self.frames < len(LABELS):
            raise UserError(f"--frames {self.frames}: give at least {len(LABELS)}, one of each label")
        if self.episodes < 0:
            raise UserError(f"--episodes {self.episodes}: give 0 or more")
