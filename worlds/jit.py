"""Numba kernels: compiled once, kept on disk, and compiled again whenever what is on disk cannot be trusted.

Importing this module loads numba, which takes a while: only modules of kernels import it, and nothing
imports those before they are used.

A kernel may call kernels of its own file and of this one, no others: the cache knows of a change in
these two files alone.
"""

from __future__ import annotations

import contextlib
import hashlib
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numba
import numpy as np
from numba import types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.serialize import dumps
from numba.extending import intrinsic

_DIGEST: Final = hashlib.sha256().digest_size
_HERE: Final = hashlib.sha256(Path(__file__).read_bytes()).digest()


def kernel(signature: str | None = None, *, cached: bool = True, **options: Any) -> Callable[[Any], Any]:
    """Compile a function with numba; it releases the interpreter's lock while it runs.

    Parameters
    ----------
    signature
        Numba's signature, to compile at once; None compiles at the first call, for the types given there.
    cached
        Whether to keep the machine code beside the source, or in the user's cache where that cannot be
        written. A damaged or stale entry is replaced; where nothing can be written, nothing is kept.
    **options
        Further options of `numba.njit`.

    Examples
    --------
    >>> @kernel(cached=False)
    ... def double(x):
    ...     return 2 * x
    >>> double(21)
    42
    """

    def decorate(function: Any) -> Any:
        dispatcher = numba.njit(nogil=True, **options)(function)
        if cached:
            with contextlib.suppress(OSError, RuntimeError):  # there may be nowhere to keep it
                dispatcher._cache = _Cache(function)  # noqa: SLF001 - numba has no public way to set it
        if signature is not None:
            dispatcher.compile(signature)
        return dispatcher

    return decorate


class _Cache(FunctionCache):  # type: ignore[misc]  # numba has no types
    """Numba's cache, less its faith in what it finds: whatever goes wrong, the function is compiled."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        stamp = (self._impl.locator.get_source_stamp(), _HERE)
        self._cache_file = _SealedFile(self._cache_path, self._impl.filename_base, stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function for a signature, or None."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # noqa: BLE001 - any fault of the cache means that there is none
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled function, if that can be done."""
        with contextlib.suppress(OSError, pickle.PicklingError):
            super().save_overload(sig, data)


class _SealedFile(IndexDataCacheFile):  # type: ignore[misc]  # numba has no types
    """Numba's cache files with a checksum before each: damaged machine code must never be run."""

    def _load_index(self) -> dict[Any, str]:
        try:
            version, stamp, overloads = _unsealed(Path(self._index_path))
        except (OSError, ValueError):
            return {}
        return overloads if (version, stamp) == (self._version, self._source_stamp) else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        with self._open_for_write(self._index_path) as file:
            file.write(self._dump((self._version, self._source_stamp, overloads)))

    def _load_data(self, name: str) -> Any:
        return _unsealed(Path(self._data_path(name)))

    def _dump(self, obj: Any) -> bytes:
        payload: bytes = dumps(obj)
        return hashlib.sha256(payload).digest() + payload


def _unsealed(path: Path) -> Any:
    """Return what a sealed file of this cache holds.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    data = path.read_bytes()
    digest, payload = data[:_DIGEST], data[_DIGEST:]
    if hashlib.sha256(payload).digest() != digest:
        raise ValueError(f"{path} is damaged")
    # The files are this package's own, as compiled Python files are.
    return pickle.loads(payload)  # noqa: S301


@kernel(cached=False, forceinline=True)
def bits(key: Any, counter: Any) -> Any:
    """Return draw `counter` of a stream by its key, 64 bits: `worlds.Stream.bits`."""
    x = key + np.uint64(counter) * np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@kernel(cached=False, forceinline=True)
def uniform(key: Any, counter: Any) -> Any:
    """Return draw `counter` as a float in [0, 1): `worlds.Stream.uniform`."""
    return np.float64(np.int64(bits(key, counter) >> np.uint64(11))) * 2.0**-53


@kernel(cached=False, forceinline=True)
def below(key: Any, counter: Any, n: Any) -> Any:
    """Return draw `counter` as an integer in range(n), where n < 2**32: `worlds.Stream.below`."""
    x, m = bits(key, counter), np.uint64(n)
    low = (x & np.uint64(0xFFFFFFFF)) * m
    return np.int64(((x >> np.uint64(32)) * m + (low >> np.uint64(32))) >> np.uint64(32))


@kernel(cached=False, forceinline=True)
def ones(x: Any) -> Any:
    """Return how many bits of a 64-bit word are set."""
    x = x - ((x >> np.uint64(1)) & np.uint64(0x5555555555555555))
    x = (x & np.uint64(0x3333333333333333)) + ((x >> np.uint64(2)) & np.uint64(0x3333333333333333))
    x = (x + (x >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((x * np.uint64(0x0101010101010101)) >> np.uint64(56))


@kernel(cached=False, forceinline=True)
def lowest(x: Any) -> Any:
    """Return the place of the lowest bit that is set; 64 if none is."""
    return ones((x & (~x + np.uint64(1))) - np.uint64(1))


@kernel(cached=False, forceinline=True)
def without_lowest(x: Any) -> Any:
    """Return the word without its lowest bit."""
    return x & (x - np.uint64(1))


@intrinsic  # type: ignore[untyped-decorator]
def pointer(context: Any, array: Any) -> Any:  # noqa: ARG001 - numba's form
    """Return a pointer to an array's values: passed on, it costs neither a count nor a test of its index.

    It does not keep the array alive. Take it of arguments alone, which the caller holds.
    """

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    return types.CPointer(array.dtype)(array), code


@intrinsic  # type: ignore[untyped-decorator]
def moved(context: Any, start: Any, by: Any) -> Any:  # noqa: ARG001 - numba's form
    """Return a pointer some values further on."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        return builder.gep(arguments[0], [arguments[1]])

    return start(start, by), code
