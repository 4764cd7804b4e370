"""One maze of a batch, in plain Python: what every batched implementation must equal.

`MazeEnv` draws from a NumPy generator, whose next number depends on all that were drawn before. Here the
draws of episode e of environment i come from ``Stream(seed, i, e)``, and so depend on nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import index
from typing import Any, NamedTuple, TypeVar

from worlds.appearing import random_obstacles, shortest_way
from worlds.env import Info, MazeEnv, Observation
from worlds.errors import UserError
from worlds.layout import Cell, Obstacle
from worlds.randomness import Stream

T = TypeVar("T")


class Wanted(NamedTuple):
    """What an episode is given and does not draw: places of marks and a cell's number; -1 is drawn."""

    trigger: int = -1
    goal: int = -1
    start: int = -1


class StreamedMazeEnv(MazeEnv):
    """A `MazeEnv` whose episodes are named by seed, environment and episode, and by nothing else.

    Parameters
    ----------
    layout
        As for `MazeEnv`.
    number
        The environment's place in its batch.
    **arguments
        The arguments of `MazeEnv`.

    Examples
    --------
    >>> env = StreamedMazeEnv("two_rooms", number=3)
    >>> first, _ = env.reset(seed=7)  # episode 0
    >>> second, _ = env.reset()  # episode 1
    >>> again, _ = env.reset(seed=7)
    >>> (first == again).all(), (first == second).all()
    (np.True_, np.False_)
    """

    def __init__(self, layout: Any = "two_rooms", *, number: int = 0, **arguments: Any) -> None:
        super().__init__(layout, **arguments)
        self.number = number
        self.seed = 0
        self.episodes = 0
        self._stream = Stream(self.seed, self.number, self.episodes)

    @property
    def starts(self) -> tuple[Cell, ...]:
        """The cells that an episode may start in, trigger and all."""
        return self._starts

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Begin the next episode; with a seed, its episode 0."""
        if seed is not None:
            self.seed = checked_seed(seed)
            self.episodes = 0
        self._stream = Stream(self.seed, self.number, self.episodes)
        found = super().reset(options=options)
        self.episodes += 1
        return found

    def wanted(self, options: Mapping[str, Any] | None = None) -> Wanted:
        """Return what the arguments and the options of one reset give.

        Raises
        ------
        UserError
            If an option is unknown, or names something that is not there.
        """
        given = self._checked({**self._fixed, **(options or {})})
        trigger, goal, start = given["trigger"], given["goal"], given["start"]
        return Wanted(
            -1 if trigger is None else list(self.layout.triggers).index(trigger),
            -1 if goal is None else list(self.layout.goals).index(goal),
            -1 if start is None else self.layout.number(start),
        )

    def _choose(self, items: Sequence[T]) -> T:
        return self._stream.choose(items)

    def _draw_obstacles(self, trigger: str, goal: str, start: Cell) -> tuple[Obstacle, ...]:
        if self.obstacles != "random":
            return super()._draw_obstacles(trigger, goal, start)
        ends = (start, self.layout.triggers[trigger], self.layout.goals[goal])
        count = 1 + self._stream.below(self.most_obstacles)
        way = shortest_way(self.layout, *ends)
        return random_obstacles(self.layout, self._stream, count, way, keep_free=frozenset(ends))


def checked_seed(seed: Any) -> int:
    """Return a seed as an integer.

    Raises
    ------
    UserError
        If it is none, or negative.
    """
    try:
        number = index(seed)
    except TypeError:
        raise UserError(f"seed {seed!r} is not possible; give an integer of 0 or more") from None
    if number < 0:
        raise UserError(f"seed {seed!r} is not possible; give an integer of 0 or more")
    return number


def checked_count(number: Any) -> int:
    """Return a number of environments.

    Raises
    ------
    UserError
        If it is none.
    """
    try:
        count = index(number)
    except TypeError:
        count = 0
    if count < 1:
        raise UserError(f"num_envs {number!r} is not possible; give an integer of 1 or more")
    return count
