"""Where the parts of a task graph's picture stand: rows in which nothing overlaps and few edges cross."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, Literal

from worlds import Stream

_GAP: Final = 0.22  # between things of a row, inches
_MARGIN: Final = 0.12
_SWEEPS: Final = 8
_TRIES: Final = 8


@dataclass(eq=False)
class Item:
    """What has a place in a row: a node's box, an edge's label, or a point that an edge passes through."""

    kind: Literal["box", "label", "point"]
    width: float = 0.0  # all in inches
    height: float = 0.0
    text: str = ""
    above: list[Item] = field(default_factory=list)
    below: list[Item] = field(default_factory=list)
    x: float = 0.0  # middle
    y: float = 0.0


def linked(above: Item, below: Item) -> Item:
    """Let an edge lead from one item to another, which is returned."""
    above.below.append(below)
    below.above.append(above)
    return below


def place_rows(rows: Sequence[list[Item]]) -> tuple[float, float]:
    """Give everything its middle, and return the picture's width and height; nothing overlaps."""
    _order(rows)
    for row in rows:
        _spread(row, [0.0] * len(row))
    for sweep in range(_SWEEPS):
        for row in rows if sweep % 2 == 0 else rows[::-1]:
            _spread(row, [_mean([other.x for other in _pulling(item)], item.x) for item in row])
    left = min(item.x - item.width / 2 for row in rows for item in row) - _MARGIN
    top = _MARGIN
    for row, following in pairwise([*rows, []]):
        high = max(item.height for item in row)
        for item in row:
            item.x -= left
            item.height = item.height if item.kind == "label" else high  # a point passes the whole row
            item.y = top + (high - item.height / 2 if item.kind == "label" else high / 2)
        reach = max((abs(child.x - left - item.x) for item in row for child in item.below), default=0.0)
        labels = all(item.kind != "box" for item in row)
        top += high + (0.0 if not following else 0.16 if labels else min(0.3 + 0.12 * reach, 1.1))
    top += _MARGIN
    for item in (item for row in rows for item in row):
        item.y = top - item.y  # rows were stacked downwards; the axes' y goes up
    return max(item.x + item.width / 2 for row in rows for item in row) + _MARGIN, top


def _pulling(item: Item) -> list[Item]:
    """Return what an item would stand near: a label near its child, a point near points, to run straight."""
    others = [*item.above, *item.below]
    if item.kind == "label":
        return item.below
    points = [other for other in others if other.kind == "point"]
    return points if item.kind == "point" and points else others


def _order(rows: Sequence[list[Item]]) -> None:
    """Order every row such that few edges cross, and otherwise as it was declared.

    The first try begins with the declared order, the others with chance ones.
    """
    declared = [list(row) for row in rows]
    best, fewest = [list(row) for row in rows], _crossings(rows)
    for seed in range(_TRIES):
        tried = [Stream(seed, i).shuffled(row) if seed else list(row) for i, row in enumerate(declared)]
        for sweep in range(_SWEEPS):
            _sort(tried, down=sweep % 2 == 0)
            if (crossings := _crossings(tried)) < fewest:
                best, fewest = [list(row) for row in tried], crossings
    for row, order, first in zip(best, declared, rows, strict=True):
        _restore(best, row, {id(item): i for i, item in enumerate(order)})
        first[:] = row


def _restore(rows: list[list[Item]], row: list[Item], rank: dict[int, int]) -> None:
    """Swap neighbours in a row back into their declared order where no further edge crosses for it."""
    fewest, i = _crossings(rows), 0
    while i < len(row) - 1:
        here, after = row[i], row[i + 1]
        if rank[id(here)] > rank[id(after)]:
            row[i], row[i + 1] = after, here
            if _crossings(rows) <= fewest:
                i = max(i - 1, 0)
                continue
            row[i], row[i + 1] = here, after
        i += 1


def _sort(rows: list[list[Item]], *, down: bool) -> None:
    """Sort every row by the mean places of what its items are linked to in the row before; ties stay."""
    place: dict[int, float] = {}
    for row in rows if down else rows[::-1]:
        here = {id(item): i / len(row) for i, item in enumerate(row)}
        for item in row:
            others = item.above if down else item.below
            here[id(item)] = _mean([place[id(other)] for other in others], here[id(item)])
        row.sort(key=lambda item, here=here: here[id(item)])  # type: ignore[misc]
        place |= {id(item): (i + 0.5) / len(row) for i, item in enumerate(row)}


def _crossings(rows: Sequence[list[Item]]) -> int:
    """Return how many pairs of edges cross between neighbouring rows."""
    place = {id(item): i for row in rows for i, item in enumerate(row)}
    count = 0
    for row in rows:
        edges = [(place[id(item)], place[id(child)]) for item in row for child in item.below]
        count += sum((a - c) * (b - d) < 0 for a, b in edges for c, d in edges) // 2
    return count


def _spread(row: Sequence[Item], wanted: Sequence[float]) -> None:
    """Bring a row's middles as near to those wanted as their widths allow, by least squares.

    What is left once every item's distance from the first is taken off must not decrease: an isotonic
    regression, by pooling neighbours that are in the wrong order.
    """
    offsets = [0.0]
    for one, other in pairwise(row):
        offsets.append(offsets[-1] + (one.width + other.width) / 2 + _GAP)
    pools: list[tuple[float, int]] = []  # mean and size
    for target, offset in zip(wanted, offsets, strict=True):
        mean, size = target - offset, 1
        while pools and pools[-1][0] > mean:
            before, many = pools.pop()
            mean, size = (mean * size + before * many) / (size + many), size + many
        pools.append((mean, size))
    means = [mean for mean, size in pools for _ in range(size)]
    for item, mean, offset in zip(row, means, offsets, strict=True):
        item.x = mean + offset


def _mean(numbers: Sequence[float], otherwise: float) -> float:
    return sum(numbers) / len(numbers) if numbers else otherwise
