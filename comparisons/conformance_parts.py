"""What the checks of the conformance kit share: their error, and how they name a state."""

from __future__ import annotations

from typing import Final

from worlds import Stream

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
