"""The draws of `worlds.Stream` in PyTorch, for many keys at once."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor

from worlds.randomness import Stream

_GOLDEN: Final = 0x9E37_79B9_7F4A_7C15
_LOW: Final = 0xFFFF_FFFF


def _signed(x: int) -> int:
    """Return the integer that stands for 64 bits in PyTorch, which has no arithmetic without sign."""
    x &= (1 << 64) - 1
    return x - (1 << 64) if x >> 63 else x


def _right(x: Tensor, by: int) -> Tensor:
    """Shift to the right, zeros coming in."""
    return (x >> by) & ((1 << (64 - by)) - 1)


def bits(key: Tensor, counter: int) -> Tensor:
    """Return draw `counter` of the streams of some keys, 64 bits each.

    Examples
    --------
    >>> from worlds import Stream
    >>> stream = Stream(7)
    >>> key = torch.tensor([_signed(stream.key)])
    >>> int(bits(key, 1)[0]) == _signed(stream.bits())
    True
    """
    x = key + _signed(counter * _GOLDEN)
    x = (x ^ _right(x, 30)) * _signed(0xBF58_476D_1CE4_E5B9)
    x = (x ^ _right(x, 27)) * _signed(0x94D0_49BB_1331_11EB)
    return x ^ _right(x, 31)


def below(key: Tensor, counter: int, n: Tensor | int) -> Tensor:
    """Return draw `counter` as integers in range(n), where n < 2**30: `Stream.below`."""
    x = bits(key, counter)
    return (_right(x, 32) * n + (((x & _LOW) * n) >> 32)) >> 32


def sooner(key: Tensor, counter: int, probability: float) -> Tensor:
    """Return whether draw `counter` as a float in [0, 1) is below a probability.

    Whole numbers are compared, since not every device knows 64-bit floats; `probability` must be a
    multiple of 2**-53, as every float from 1/2 to 1 is.
    """
    return _right(bits(key, counter), 11) < int(probability * 2**53)


def keys_of(key: int, number: int, device: torch.device) -> Tensor:
    """Return the keys of the streams that a stream's key and each integer below `number` name."""
    return bits(torch.arange(number, device=device) + _signed(key), 1)


def nth(flags: Tensor, n: Tensor) -> Tensor:
    """Return the place of the n-th flag that is set in each row, from 0; past the last, the row's length.

    Examples
    --------
    >>> nth(torch.tensor([[True, False, True], [False, True, False]]), torch.tensor([1, 1])).tolist()
    [2, 3]
    """
    return (flags.long().cumsum(1) <= n[:, None]).sum(1)


def fractions(key: Tensor, counter: Tensor) -> Tensor:
    """Return a draw of each stream as a whole number below 2**53; over 2**53 it is `Stream.uniform`.

    Examples
    --------
    >>> from worlds import Stream
    >>> stream = Stream(7)
    >>> key = torch.tensor([_signed(stream.key)])
    >>> int(fractions(key, torch.tensor([1]))[0]) / 2**53 == stream.uniform()
    True
    """
    return _right(bits(key + counter * _signed(_GOLDEN), 0), 11)


def generator(*key: int) -> torch.Generator:
    """Return torch's generator for the stream that integers name.

    Examples
    --------
    >>> torch.rand(2, generator=generator(1, 2)).equal(torch.rand(2, generator=generator(1, 2)))
    True
    """
    made = torch.Generator()
    made.manual_seed(Stream(*key).bits() >> 1)
    return made
