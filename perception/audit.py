"""The shortcut audit: a backend on every colour, size and distance, and on those kept from its training.

A network that learns from too narrow data takes short cuts: it goes by colour or by size in the frame, and
fails as soon as these change. Accuracy on the whole does not show it; accuracy group by group does, and so do
ranges that were kept out of training.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from perception.labelled import Labelled, Rows
from perception.protocol import LABELS, REACH, Frames
from worlds import SIZES

HUES: Final = ("red", "yellow", "green", "cyan", "blue", "magenta")
"""Sixths of the circle of hues, the first around 0 degrees."""
_GREY: Final = 0.15  # saturation below which a colour has no hue to speak of
Groups = Mapping[str, NDArray[np.bool_]]
"""Which frames are in each group, shape (frames,), by the group's name."""
Confusion = tuple[tuple[int, ...], ...]
"""Frames by true label and likeliest label."""


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


def groups_to_hold_out() -> tuple[str, ...]:
    """Return the groups whose absence from training tells of a short cut: each hue, distance and size.

    Examples
    --------
    >>> groups_to_hold_out()[5:9]
    ('colour magenta', 'distance 1', 'distance 2', 'size small')
    """
    colours = (f"colour {hue}" for hue in HUES)
    distances = (f"distance {cells}" for cells in range(1, REACH + 1))
    return (*colours, *distances, *(f"size {size}" for size in SIZES))


def without(data: Described, group: str) -> NDArray[np.int64]:
    """Return the rows of data that are left when a group is kept out, shape (rows,).

    Raises
    ------
    ValueError
        If the data have no such group, or nothing else.
    """
    found = groups(data)
    if group not in found or not found[group].any():
        raise ValueError(
            f"no group {group!r}; groups: {', '.join(n for n, rows in found.items() if rows.any())}"
        )
    if found[group].all():
        raise ValueError(f"group {group!r} is all there is to learn from")
    return np.flatnonzero(~found[group])


@dataclass(frozen=True)
class HeldOut:
    """What became of a group of frames when it was kept out of training.

    Parameters
    ----------
    group
        The group.
    learnt_from
        Frames that were left to learn from.
    apart
        What the backend that learnt without the group makes of it: frames by true label (rows) and likeliest
        label (columns), in the order of `LABELS`.
    reference
        The same of a backend that learnt from everything, for as long.
    both
        Frames that both got right.
    """

    group: str
    learnt_from: int
    apart: Confusion
    reference: Confusion
    both: int

    @property
    def frames(self) -> int:
        """Frames of the group."""
        return sum(map(sum, self.apart))

    @property
    def right(self) -> int:
        """Right ones of them, of the backend that learnt without the group."""
        return _right(self.apart)

    @property
    def reference_right(self) -> int:
        """Right ones of them, of the backend that learnt from everything."""
        return _right(self.reference)

    @property
    def errors(self) -> tuple[int, ...]:
        """What the wrong ones were taken for without the group: none, cube, sphere."""
        return tuple(
            sum(row[seen] for true, row in enumerate(self.apart) if true != seen)
            for seen in range(len(LABELS))
        )


def held_out(
    test: Described,
    group: str,
    learnt_from: int,
    apart: NDArray[np.integer],
    reference: NDArray[np.integer],
) -> HeldOut:
    """Hold what two backends make of a group to the truth.

    Parameters
    ----------
    test
        Frames that neither learnt from.
    group
        The group that was kept out of one backend's training.
    learnt_from
        Frames left to it.
    apart, reference
        Likeliest labels of all test frames by this one, and by one that learnt from everything; (frames,).
    """
    here = groups(test)[group]
    labels, apart, reference = test.labels[here], apart[here], reference[here]
    return HeldOut(
        group,
        learnt_from,
        confusion_of(labels, apart),
        confusion_of(labels, reference),
        int(((apart == labels) & (reference == labels)).sum()),
    )


def held_out_audit(
    fit: Callable[[Labelled], Callable[[Frames], Any]],
    data: Described,
    test: Described,
    by: Sequence[str] | None = None,
) -> tuple[HeldOut, ...]:
    """Keep groups out of training in turn, and hold what comes of it to a training with everything.

    Parameters
    ----------
    fit
        Learns from data, and returns the backend's `perceive`. It is called once for each group, and once
        for the reference.
    data, test
        To learn from, and to measure on.
    by
        The groups to keep out, such as "colour red" or "distance 2" (`groups`). Defaults to every hue,
        distance and size that both data hold.

    Raises
    ------
    ValueError
        If a group is not there, or nothing is left to learn from.
    """
    if by is None:
        by = shared_groups(data, test)
    left = {group: without(data, group) for group in by}
    for group in by:
        without(test, group)  # there must be something to measure on
    reference = fit(Rows.of(data))(test.frames).labels
    return tuple(
        held_out(test, group, len(rows), fit(Rows.of(data, rows))(test.frames).labels, reference)
        for group, rows in left.items()
    )


def shared_groups(data: Described, test: Described) -> tuple[str, ...]:
    """Return the groups to hold out (`groups_to_hold_out`) of which there are frames in both data."""
    both = groups(data), groups(test)
    return tuple(
        group
        for group in groups_to_hold_out()
        if all(group in found and found[group].any() and not found[group].all() for found in both)
    )


def confusion_of(labels: NDArray[np.integer], seen: NDArray[np.integer]) -> Confusion:
    """Return frames by true label (rows) and likeliest label (columns), in the order of `LABELS`.

    Examples
    --------
    >>> confusion_of(np.array([1, 1, 2]), np.array([1, 0, 2]))
    ((0, 0, 0), (1, 1, 0), (0, 0, 1))
    """
    matrix = np.zeros((len(LABELS), len(LABELS)), dtype=np.int64)
    np.add.at(matrix, (labels, seen), 1)
    return tuple(tuple(int(n) for n in row) for row in matrix)


def _right(confusion: Confusion) -> int:
    return sum(row[i] for i, row in enumerate(confusion))
