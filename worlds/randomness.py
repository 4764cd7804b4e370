"""Counter-based random numbers: draw n of a stream depends on the key and on n alone.

A stream is the SplitMix64 finaliser (Steele, Lea and Flood, OOPSLA 2014) applied to a key and a
counter, so it can be restarted anywhere and gives the same numbers in a batch of any size.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

_MASK = 0xFFFF_FFFF_FFFF_FFFF
_GOLDEN = 0x9E37_79B9_7F4A_7C15
T = TypeVar("T")


def mix(x: int) -> int:
    """Scramble 64 bits, one to one (SplitMix64's finaliser).

    >>> mix(0), hex(mix(0x9E3779B97F4A7C15))
    (0, '0xe220a8397b1dcdaf')
    """
    x &= _MASK
    x = ((x ^ (x >> 30)) * 0xBF58_476D_1CE4_E5B9) & _MASK
    x = ((x ^ (x >> 27)) * 0x94D0_49BB_1331_11EB) & _MASK
    return x ^ (x >> 31)


class Stream:
    """A stream of random numbers, named by integers.

    Parameters
    ----------
    *key
        Any number of integers: seed first, then whatever names the stream (episode, pair, ...).

    Attributes
    ----------
    key
        The stream's name as 64 bits; with `drawn`, all that kernels need to go on with it.
    drawn
        How many numbers have been drawn.

    Examples
    --------
    >>> a, b = Stream(7, 1), Stream(7, 1)
    >>> [a.below(10) for _ in range(5)] == [b.below(10) for _ in range(5)]
    True
    >>> Stream(7, 2).uniform() == Stream(7, 1).uniform()
    False
    """

    def __init__(self, *key: int) -> None:
        state = 0
        for part in key:
            state = mix(state + _GOLDEN + (part & _MASK))
        self.key = state
        self.drawn = 0

    def bits(self) -> int:
        """Return 64 random bits."""
        self.drawn += 1
        return mix(self.key + self.drawn * _GOLDEN)

    def uniform(self) -> float:
        """Return a float in [0, 1), a multiple of 2**-53."""
        return (self.bits() >> 11) * 2.0**-53

    def uniforms(self, count: int) -> NDArray[np.float64]:
        """Return the next `count` numbers of `uniform`, shape (count,).

        >>> a, b = Stream(3), Stream(3)
        >>> a.uniforms(3).tolist() == [b.uniform() for _ in range(3)], a.drawn
        (True, 3)
        """
        counters = np.arange(self.drawn + 1, self.drawn + count + 1, dtype=np.uint64)
        self.drawn += count
        x = np.uint64(self.key) + counters * np.uint64(_GOLDEN)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58_476D_1CE4_E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D0_49BB_1331_11EB)
        return ((x ^ (x >> np.uint64(31))) >> np.uint64(11)).astype(np.float64) * 2.0**-53

    def between(self, low: float, high: float) -> float:
        """Return a float from `low` to `high`, which rounding alone can reach."""
        return low + (high - low) * self.uniform()

    def below(self, n: int) -> int:
        """Return an integer in range(n), by the multiply-shift method (bias below n / 2**64)."""
        return (self.bits() * n) >> 64

    def choose(self, items: Sequence[T]) -> T:
        """Return one of `items`."""
        return items[self.below(len(items))]

    def shuffled(self, items: Sequence[T]) -> list[T]:
        """Return the items in random order (Fisher and Yates)."""
        out = list(items)
        for i in range(len(out) - 1, 0, -1):
            j = self.below(i + 1)
            out[i], out[j] = out[j], out[i]
        return out
