"""How a learner chooses a child while it learns: mostly the best one, and every one again and again.

GLIE: greedy in the limit with infinite exploration (Singh et al., 2000). With ties broken in order this makes
the recursively optimal policy that MAXQ-0 converges to unique (Dietterich 2000, theorem 3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import exp
from typing import Protocol

from worlds import Stream


class Explorer(Protocol):
    """A way to choose a child: a level that falls with a task's episodes, and a choice at that level."""

    def __call__(self, episode: int) -> float:
        """Return the level in the given episode of a task, counted from 0."""

    def choose(
        self,
        level: float,
        choices: Sequence[int],
        values: Callable[[], Sequence[float]],
        tie: float,
        random: Stream,
    ) -> int:
        """Return one of `choices`.

        Parameters
        ----------
        level
            What the call with the episode's number returned.
        choices
            Places of the children that may be called, at least one.
        values
            Returns their values in the same order; it is called only if they are needed.
        tie
            Values that differ by no more than this count as equal.
        random
            The learner's stream.
        """


@dataclass(frozen=True)
class Exploration:
    """A greedy-in-the-limit share of random choices: half / (half + n) in episode n.

    The shares sum to infinity and fall to zero, so every child is tried infinitely often and the policy
    becomes greedy: GLIE (Singh et al., 2000). After `half` episodes every second choice is random.

    Examples
    --------
    >>> explore = Exploration(half=100)
    >>> explore(0), explore(100), explore(300)
    (1.0, 0.5, 0.25)
    >>> explore.choose(0.0, (4, 7), lambda: (-2.0, -1.0), 0.01, Stream(1))
    7
    """

    half: int = 150

    def __post_init__(self) -> None:
        if self.half <= 0:
            raise ValueError(f"exploration needs half > 0, not {self.half}")

    def __call__(self, episode: int) -> float:
        """Return the share of random choices in the given episode, counted from 0."""
        return self.half / (self.half + episode)

    def choose(
        self,
        level: float,
        choices: Sequence[int],
        values: Callable[[], Sequence[float]],
        tie: float,
        random: Stream,
    ) -> int:
        """Return any of the choices in a share `level` of the cases, else the first of the best."""
        if random.uniform() < level:
            return random.choose(choices)
        return first_best(choices, values(), tie)


@dataclass(frozen=True)
class Boltzmann:
    """Choices in proportion to exp(value / temperature), where the temperature falls geometrically.

    It is start * factor**n in episode n, and never below `least`. Dietterich (2000, section 7.1) cools each
    task at a rate of its own, each time that it ends in its goal; here every episode counts. A geometric fall
    is not GLIE: that takes a temperature that falls as slowly as 1 / log n (Singh et al., 2000). Cool slowly
    enough.

    Examples
    --------
    >>> cooling = Boltzmann(start=8.0, factor=0.5, least=1.5)
    >>> [cooling(n) for n in range(4)]
    [8.0, 4.0, 2.0, 1.5]
    """

    start: float = 50.0
    factor: float = 0.99
    least: float = 0.01

    def __post_init__(self) -> None:
        if not (self.start >= self.least > 0 and 0 < self.factor <= 1):
            raise ValueError(f"cooling needs start >= least > 0 and 0 < factor <= 1, not {self}")

    def __call__(self, episode: int) -> float:
        """Return the temperature in the given episode, counted from 0."""
        return max(self.start * self.factor**episode, self.least)

    def choose(
        self,
        level: float,
        choices: Sequence[int],
        values: Callable[[], Sequence[float]],
        tie: float,  # noqa: ARG002 - equal values have equal chances here
        random: Stream,
    ) -> int:
        """Return one of the choices, each with its Boltzmann probability at temperature `level`."""
        draw = random.uniform()
        for choice, chance in zip(choices, boltzmann(values(), level), strict=True):
            draw -= chance
            if draw < 0:
                return choice
        return choices[-1]


def boltzmann(values: Sequence[float], temperature: float) -> list[float]:
    """Return the probabilities exp(v / T) / sum exp(v / T), one a value.

    Examples
    --------
    >>> [round(chance, 3) for chance in boltzmann([-1.0, -2.0, -2.0], temperature=1.0)]
    [0.576, 0.212, 0.212]
    """
    most = max(values)  # taken off first, lest exp overflows; it cancels out
    weights = [exp((value - most) / temperature) for value in values]
    total = sum(weights)
    return [weight / total for weight in weights]


def first_best(choices: Sequence[int], values: Sequence[float], tie: float) -> int:
    """Return the first choice in order whose value is within `tie` of the best.

    Examples
    --------
    >>> first_best((0, 2, 3), (-5.0, -4.001, -4.0), tie=0.01)
    2
    """
    least = max(values) - tie
    return next(k for k, value in zip(choices, values, strict=True) if value >= least)
