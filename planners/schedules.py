"""How a learner's rate falls with the number of episodes, and which task goes by which schedule."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from hierarchy import GroundGraph
from worlds import UserError, suggest

T = TypeVar("T")

Rate = Callable[[int], float]
"""The rate in an episode, counted from 0."""


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
class HarmonicRate:
    """A rate that falls as half / (half + n), for worlds with chance.

    The rates' sum is infinite and that of their squares finite, which convergence on a stochastic world
    asks for (Dietterich 2000, theorem 3); a geometric rate comes to rest a little beside the limit.

    Examples
    --------
    >>> rate = HarmonicRate(half=100)
    >>> rate(0), rate(100), rate(300)
    (1.0, 0.5, 0.25)
    """

    half: int = 100

    def __post_init__(self) -> None:
        if self.half <= 0:
            raise ValueError(f"harmonic rate needs half > 0, not {self.half}")

    def __call__(self, episode: int) -> float:
        """Return the rate in the given episode, counted from 0."""
        return self.half / (self.half + episode)


def by_task(grounded: GroundGraph, default: T, named: Mapping[str, T]) -> list[T]:
    """Return one setting a node: the ground task's own, its task's, or the default.

    Raises
    ------
    UserError
        If a name is no task of the graph.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> halves = by_task(grounded, 150, {"GotoDoor": 50, "GotoDoor(D2)": 20})
    >>> [halves[grounded.place(name)] for name in ("Root", "GotoDoor(D1)", "GotoDoor(D2)")]
    [150, 50, 20]
    """
    tasks = [node for node in grounded.nodes if node.calls]
    known = sorted({node.name for node in tasks} | {node.task for node in tasks})
    for name in named:
        if name not in known:
            mend = suggest(name, known, "there are")
            raise UserError(f"settings name {name!r}, which is no task of {grounded.graph.name}; {mend}")
    return [named.get(node.name, named.get(node.task, default)) for node in grounded.nodes]
