"""What the checks of the conformance kit share: their error, and how they name a state."""

from __future__ import annotations

from typing import Final

from worlds import Stream, TransitionModel

_SAMPLED: Final = 200  # states that are looked at one by one


class ConformanceError(AssertionError):
    """Something does not keep the promises that the rest of affordant relies on."""


def hold(condition: bool, problem: str) -> None:
    """Raise `ConformanceError` if a condition does not hold."""
    if not condition:
        raise ConformanceError(problem)


def sample(size: int) -> list[int]:
    """Return all states of a small world, some of a large one, always the same.

    >>> sample(3), len(sample(5000))
    ([0, 1, 2], 200)
    """
    if size <= _SAMPLED:
        return list(range(size))
    stream = Stream(size)
    return [stream.below(size) for _ in range(_SAMPLED)]


def state_words(model: TransitionModel, number: int) -> str:
    """Return a state's variables with their values.

    >>> from worlds import load_layout, maze_model
    >>> state_words(maze_model(load_layout("two_rooms")), 0)
    'robot = 0,0, trigger = T1, goal = G1, doors = closed'
    """
    state = zip(model.index.variables, model.index.state(number), strict=True)
    return ", ".join(f"{variable.name} = {variable.label(value)}" for variable, value in state)
