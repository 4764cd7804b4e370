"""How a learner's rate and exploration fall with the number of episodes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LearningRate:
    """A rate that falls geometrically: 0.9, times 0.9 every 40 episodes (section 6.2 of the paper).

    Examples
    --------
    >>> rate = LearningRate()
    >>> [round(rate(n), 3) for n in (0, 39, 40, 80)]
    [0.9, 0.9, 0.81, 0.729]
    """

    start: float = 0.9
    factor: float = 0.9
    every: int = 40

    def __post_init__(self) -> None:
        if not (0 < self.start <= 1 and 0 < self.factor <= 1 and self.every > 0):
            raise ValueError(f"learning rate needs 0 < start <= 1, 0 < factor <= 1, every > 0, not {self}")

    def __call__(self, episode: int) -> float:
        """Return the rate in the given episode, counted from 0."""
        return self.start * self.factor ** (episode // self.every)


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
    """

    half: int = 150

    def __post_init__(self) -> None:
        if self.half <= 0:
            raise ValueError(f"exploration needs half > 0, not {self.half}")

    def __call__(self, episode: int) -> float:
        """Return the share of random choices in the given episode, counted from 0."""
        return self.half / (self.half + episode)
