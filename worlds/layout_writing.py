"""Writing a layout as the text that it is read from."""

from __future__ import annotations

from worlds.errors import LayoutError, UserError
from worlds.layout import Cell, Edge, Layout, edge
from worlds.layout_grid import DOOR, DOOR_BELOW, NOTHING_BELOW, OPEN, SOLID, WALL, WALL_BELOW
from worlds.layout_text import parse_layout


def layout_text(layout: Layout) -> str:
    r"""Return the text of a layout, which `parse_layout` reads back as the same layout.

    Raises
    ------
    UserError
        If no text gives this layout: it has a fault, or a name or colour that the text has no form for.

    Examples
    --------
    >>> maze = parse_layout("grid\nT1 . | G1\n- + +\n. . : D1\nstart 1,0\ntrigger T1\ngoal G1", source="maze")
    >>> print(layout_text(maze), end="")
    name maze
    <BLANKLINE>
    grid
    T1  .  |  G1
    -   +     +
    .   .  :  D1
    <BLANKLINE>
    start 1,0
    trigger T1
    goal G1
    """
    lines = [f"name {layout.name}", "", "grid", *_grid(layout), ""]
    lines += [f"start {layout.start}", f"trigger {layout.trigger}", f"goal {layout.goal}"]
    if layout.chosen:
        lines += ["", f"chosen {' '.join(sorted(layout.chosen))}"]
    if layout.obstacles:
        lines += ["", "obstacles", *map(str, layout.obstacles)]
    text = "\n".join(lines) + "\n"
    _check(layout, text)
    return text


def _check(layout: Layout, text: str) -> None:
    """Read the text back: what it cannot say would be lost without a word."""
    try:
        same = parse_layout(text, source=layout.name) == layout
    except LayoutError as error:
        raise UserError(f"layout {layout.name!r} cannot be written: {error.problem}; {error.mend}") from error
    if not same:
        raise UserError(
            f"layout {layout.name!r} cannot be written: its text reads back as another layout; write names "
            "without doubled blanks, marks that begin with T (triggers), G (goals) and D (thresholds) on "
            "free cells, colours in small letters, and each wall or door between two neighbours"
        )


def _grid(layout: Layout) -> list[str]:
    """Return the rows, and the lines of walls between them where there are any, in columns."""
    lines: list[list[str]] = []  # a word for each column, and one before each but the first
    marks = _marks(layout)
    for row in range(layout.rows):
        between = [_sign(layout, _north(row, col), WALL_BELOW, DOOR_BELOW) for col in range(layout.cols)]
        if any(between):
            words = [sign or NOTHING_BELOW for sign in between]
            lines.append([word for sign in words for word in ("", sign)][1:])
        line = []
        for col in range(layout.cols):
            cell = Cell(row, col)
            if col:
                line.append(_sign(layout, edge(Cell(row, col - 1), cell), WALL, DOOR))
            line.append(SOLID if cell in layout.solid else marks.get(cell, OPEN))
        lines.append(line)
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    shown = [i for i, width in enumerate(widths) if width]
    return ["  ".join(line[i].ljust(widths[i]) for i in shown).rstrip() for line in lines]


def _marks(layout: Layout) -> dict[Cell, str]:
    names: dict[Cell, list[str]] = {}
    for name, cell in layout.marks.items():
        names.setdefault(cell, []).append(name)
    return {cell: "/".join(sorted(marks)) for cell, marks in names.items()}


def _north(row: int, col: int) -> Edge:
    return edge(Cell(row - 1, col), Cell(row, col))


def _sign(layout: Layout, between: Edge, wall: str, door: str) -> str:
    return wall if between in layout.walls else door if between in layout.doors else ""
