"""What must hold of a whole layout: doors with their grids, marks within reach, room for obstacles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from worlds.layout import Cell, Layout


class Fault(NamedTuple):
    """What is wrong with a layout, in which line of its text, and how to mend it."""

    line: int
    problem: str
    mend: str


def layout_faults(layout: Layout, lines: Mapping[str, int], rows: Sequence[int]) -> Iterator[Fault]:
    """Yield every fault of a layout that could be read.

    Parameters
    ----------
    layout
        The layout.
    lines
        The line of each mark, each obstacle and ``start``.
    rows
        The line of each row of the grid.
    """
    yield from _doors(layout, lines, rows)
    yield from _reach(layout, lines)
    yield from _room(layout, lines)


def _doors(layout: Layout, lines: Mapping[str, int], rows: Sequence[int]) -> Iterator[Fault]:
    """Hold that every door has its grid, and every D mark a door."""
    for door in sorted(layout.doors):
        named = [name for name, cell in layout.thresholds.items() if cell in door]
        if len(named) != 1:
            needs = (
                f"the door between {door[0]} and {door[1]} needs one D mark beside it, and has {len(named)}"
            )
            yield Fault(
                rows[door[0].row], f"missing mark: {needs}", "mark the grid behind the door D1, D2, ..."
            )
    for name, cell in layout.thresholds.items():
        if not any(cell in door for door in layout.doors):
            mend = "write ':' between it and its neighbour"
            yield Fault(lines[name], f"{name} is not beside a door", mend)


def _reach(layout: Layout, lines: Mapping[str, int]) -> Iterator[Fault]:
    """Hold that triggers can be reached with doors shut, and goals with doors open."""
    for marks, doors_open, state in ((layout.triggers, False, "shut"), (layout.goals, True, "open")):
        reach = layout.reach([layout.start], doors_open=doors_open)
        for name, cell in marks.items():
            if cell not in reach:
                problem = f"{name} cannot be reached from start {layout.start} with doors {state}"
                mend = "move it, open a wall, or move the start"
                yield Fault(lines[name], f"unreachable: {problem}", mend)
    if layout.start == layout.triggers[layout.trigger]:
        yield Fault(lines["start"], f"the robot starts on its trigger {layout.trigger}", "start it elsewhere")


def _room(layout: Layout, lines: Mapping[str, int]) -> Iterator[Fault]:
    """Hold that what appears at the start has room there."""
    taken: dict[Cell, str] = {layout.start: "the robot"}
    for obstacle in layout.obstacles:
        if obstacle.appears.event != "start":
            continue
        line = lines[obstacle.name]
        if obstacle.cell in taken:
            yield Fault(line, f"{obstacle.name} appears on {taken[obstacle.cell]}", "move one of the two")
        if obstacle.cell in layout.thresholds.values():
            problem = f"{obstacle.name} appears in a door that is shut at the start"
            yield Fault(line, problem, "move it, or let it appear 'when doors open'")
        taken[obstacle.cell] = obstacle.name
