"""The shortcut audit: a backend on every colour, size and distance, and on those kept from its training.

A network that learns from too narrow data takes short cuts: it goes by colour or by size in the frame, and
fails as soon as these change. Accuracy on the whole does not show it; accuracy group by group does, and so do
ranges that were kept out of training.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from perception.protocol import Frames
from perception.training import Labelled, Rows

HUES: Final = ("red", "yellow", "green", "cyan", "blue", "magenta")
"""Sixths of the circle of hues, the first around 0 degrees."""
_GREY: Final = 0.15  # saturation below which a colour has no hue to speak of
Groups = Mapping[str, NDArray[np.bool_]]
"""Which frames are in each group, shape (frames,), by the group's name."""


class Described(Labelled, Protocol):
    """Labelled frames of which colour (RGB, shape (frames, 3)) and size of the obstacle are known."""

    @property
    def colours(self) -> NDArray[np.uint8]:
        """The obstacle's colour in each."""
        ...

    @property
    def sizes(self) -> NDArray[np.str_]:
        """The obstacle's size in each."""
        ...


def hues(colours: NDArray[np.uint8]) -> NDArray[np.str_]:
    """Return the names of colours, shape (frames,): one of `HUES`, or "grey".

    Parameters
    ----------
    colours
        RGB, shape (frames, 3).

    Examples
    --------
    >>> hues(np.array([[255, 0, 0], [0, 200, 190], [90, 90, 95]], np.uint8)).tolist()
    ['red', 'cyan', 'grey']
    """
    red, green, blue = (channel.astype(np.float64) for channel in colours.T)
    most, least = colours.max(axis=1).astype(np.float64), colours.min(axis=1).astype(np.float64)
    angle = np.degrees(np.arctan2(np.sqrt(3) * (green - blue), 2 * red - green - blue))
    sixth = np.floor(((angle + 30) % 360) / 60).astype(np.int64) % len(HUES)
    named: NDArray[np.str_] = np.where(
        most - least < _GREY * np.maximum(most, 1), "grey", np.array(HUES)[sixth]
    )
    return named


def groups(data: Described) -> Groups:
    """Return the groups of an audit: frames with an obstacle by colour, size and distance, and the rest."""
    there = np.asarray(data.labels) > 0
    named = hues(data.colours)
    found: dict[str, NDArray[np.bool_]] = {"nothing ahead": ~there}
    for hue in (*HUES, "grey"):
        found[f"colour {hue}"] = there & (named == hue)
    for size in np.unique(data.sizes[there]).tolist():
        found[f"size {size}"] = there & (data.sizes == size)
    for distance in np.unique(data.distances[there]).tolist():
        found[f"distance {distance}"] = there & (data.distances == distance)
    return found


def accuracies(
    predicted: NDArray[np.integer], labels: NDArray[np.integer], by: Groups
) -> dict[str, tuple[int, int]]:
    """Return, for each group that is not empty, how many labels were right and of how many.

    Examples
    --------
    >>> accuracies(np.array([1, 2]), np.array([1, 1]), {"all": np.array([True, True])})
    {'all': (1, 2)}
    """
    right = predicted == labels
    return {name: (int(right[rows].sum()), int(rows.sum())) for name, rows in by.items() if rows.any()}


def audit(perceive: Callable[[Frames], Any], data: Described) -> dict[str, tuple[int, int]]:
    """Return how many labels a backend gets right in each group, and of how many frames.

    Parameters
    ----------
    perceive
        The backend's.
    data
        Frames that it did not learn from.
    """
    return accuracies(perceive(data.frames).labels, data.labels, groups(data))


def held_out_audit(
    fit: Callable[[Labelled], Callable[[Frames], Any]], data: Described, test: Described, by: tuple[str, ...]
) -> dict[str, tuple[int, int]]:
    """Return how many labels are right in groups that were kept out of training, and of how many frames.

    Parameters
    ----------
    fit
        Learns from data, and returns the backend's `perceive`. It is called once for each group.
    data, test
        To learn from, and to measure on.
    by
        The groups to keep out, such as "colour red" or "distance 2" (`groups`).

    Raises
    ------
    ValueError
        If a group is not there, or nothing is left to learn from.
    """
    found = {}
    learnt, measured = groups(data), groups(test)
    for name in by:
        if name not in learnt or name not in measured:
            raise ValueError(f"no group {name!r}; groups: {', '.join(learnt)}")
        rows = np.flatnonzero(~learnt[name])
        if len(rows) == 0:
            raise ValueError(f"group {name!r} is all there is to learn from")
        predicted = fit(Rows.of(data, rows))(test.frames[measured[name]]).labels
        found[name] = (int((predicted == test.labels[measured[name]]).sum()), int(measured[name].sum()))
    return found
