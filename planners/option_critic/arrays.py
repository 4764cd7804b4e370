"""Whether arrays that were read are those of a learner: names, shapes, types, and what they count."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from worlds import UserError

Arrays = Mapping[str, NDArray[np.generic]]


def refuse_foreign(found: Arrays, wanted: Arrays, bounds: Mapping[str, range]) -> None:
    """Refuse arrays that differ from those wanted in names, shapes or types, or count what there is not.

    Parameters
    ----------
    found
        What was read.
    wanted
        Arrays of the names, shapes and types that there must be.
    bounds
        What the integers of some arrays may be.

    Raises
    ------
    UserError
        If an array will not do; the message names the first.

    Examples
    --------
    >>> refuse_foreign({"at": np.array([7])}, {"at": np.array([0])}, {"at": range(5)})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: array 'at': 7 is none of 0 to 4; it is of another graph, world or config
    """
    for name in sorted(found.keys() | wanted.keys()):
        problem = _problem(found.get(name), wanted.get(name), bounds.get(name))
        if problem:
            raise UserError(f"array {name!r}: {problem}; it is of another graph, world or config")


def _problem(
    found: NDArray[np.generic] | None, want: NDArray[np.generic] | None, bounds: range | None
) -> str:
    if found is None:
        return "there is none"
    if want is None:
        return "there should be none"
    if (found.shape, found.dtype) != (want.shape, want.dtype):
        return f"it has shape {found.shape} and type {found.dtype}, not {want.shape} and {want.dtype}"
    if bounds is not None:
        numbers = found.ravel().astype(np.int64)
        off = numbers[(numbers < bounds.start) | (numbers >= bounds.stop)]
        if off.size:
            return f"{off[0]} is none of {bounds.start} to {bounds.stop - 1}"
    return ""
