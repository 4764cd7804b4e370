"""Generated kernels without numba: the same source, run by Python, so that many can be tried in a test."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np

from worlds.randomness import mix

_GOLDEN = 0x9E37_79B9_7F4A_7C15


def interpret(source: str) -> ModuleType:
    """Return the module of a generated source, with its kernels left to Python."""
    module = ModuleType("interpreted")
    plain = source.replace("from worlds.jit import", "from interpreted import")
    exec(compile(plain, "<interpreted>", "exec"), module.__dict__)  # noqa: S102 - our own source
    return module


def kernel(*_: object, **__: object) -> Callable[[Any], Any]:
    """Leave a function as it is."""
    return lambda function: function


def pointer(array: Any) -> Any:
    """Return the values in one row, as a view."""
    return array.reshape(-1)


def moved(start: Any, by: int) -> Any:
    """Return the values from a place on."""
    return start[by:]


def _draw(key: Any, counter: Any) -> int:
    return mix(int(key) + int(counter) * _GOLDEN)


def uniform(key: Any, counter: Any) -> float:
    """Return a draw as a float in [0, 1)."""
    return (_draw(key, counter) >> 11) * 2.0**-53


def below(key: Any, counter: Any, n: Any) -> int:
    """Return a draw as an integer in range(n)."""
    return (_draw(key, counter) * int(n)) >> 64


def ones(x: Any) -> int:
    """Return how many bits are set."""
    return int(x).bit_count()


def lowest(x: Any) -> int:
    """Return the place of the lowest bit that is set."""
    return (int(x) & -int(x)).bit_length() - 1


def without_lowest(x: Any) -> Any:
    """Return the word without its lowest bit."""
    return np.uint64(int(x) & (int(x) - 1))
