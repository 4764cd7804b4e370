"""The grid of a layout's text: its cells and marks, and the walls and doors between them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final, NoReturn

from worlds.errors import LayoutError
from worlds.layout import Cell, Edge, edge

OPEN: Final = "."
SOLID: Final = "X"
WALL: Final = "|"
DOOR: Final = ":"
WALL_BELOW: Final = "-"
DOOR_BELOW: Final = "="
NOTHING_BELOW: Final = "+"
MARK: Final = re.compile(r"[TGD][A-Za-z0-9_]*")
_BELOW: Final = (WALL_BELOW, DOOR_BELOW, NOTHING_BELOW)

Line = tuple[int, list[str]]
"""A line's number, counted from 1, and its words."""


def begins_row(word: str) -> bool:
    """Return whether a line of the grid may begin with a word.

    >>> [begins_row(word) for word in (".", "T1/D1", "-", "start")]
    [True, True, True, False]
    """
    return word in (OPEN, SOLID, WALL, DOOR, *_BELOW) or _is_marks(word)


@dataclass
class Grid:
    """What the lines of a grid say.

    Parameters
    ----------
    source
        Names the text in errors.
    cols
        Number of cells of every row.
    rows
        The line of each row.
    solid, walls, doors, marks
        As in `worlds.Layout`, the marks all together.
    lines
        The line of each mark.

    Examples
    --------
    >>> grid = Grid("doctest")
    >>> grid.read([(1, ["T1", "."]), (2, ["-", "+"]), (3, [".", "G1/G2"])])
    >>> grid.cols, grid.rows, grid.marks["G2"], *grid.walls
    (2, [1, 3], Cell(row=1, col=1), (Cell(row=0, col=0), Cell(row=1, col=0)))
    """

    source: str
    cols: int = 0
    rows: list[int] = field(default_factory=list)
    solid: set[Cell] = field(default_factory=set)
    walls: set[Edge] = field(default_factory=set)
    doors: set[Edge] = field(default_factory=set)
    marks: dict[str, Cell] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)

    def read(self, lines: Iterable[Line]) -> None:
        """Read the grid's lines in order.

        Raises
        ------
        LayoutError
            If one of them is wrong.
        """
        below: Line | None = None
        for number, words in lines:
            if words[0] in _BELOW:
                if below is not None or not self.rows:
                    self._fail_between(number)
                below = number, words
                continue
            self._read_row(number, words)
            if below is not None:
                self._read_between(*below)
                below = None
        if below is not None:
            self._fail_between(below[0])

    def marked(self, letter: str) -> dict[str, Cell]:
        """Return the marks that begin with a letter, by name."""
        return {name: self.marks[name] for name in sorted(self.marks) if name.startswith(letter)}

    def _fail(self, line: int, problem: str, mend: str) -> NoReturn:
        raise LayoutError(self.source, line, problem, mend)

    def _fail_between(self, line: int) -> NoReturn:
        self._fail(line, "this line of walls does not stand between two rows", "put a row on either side")

    def _read_row(self, number: int, words: Sequence[str]) -> None:
        row, col = len(self.rows), 0
        between = ""
        for word in words:
            if word in (WALL, DOOR):
                if col == 0 or between:
                    self._fail(
                        number, f"{word!r} does not stand between two cells", "put a cell on either side"
                    )
                between = word
                continue
            cell = Cell(row, col)
            self._read_cell(number, cell, word)
            if between:
                (self.walls if between == WALL else self.doors).add(edge(Cell(row, col - 1), cell))
                between = ""
            col += 1
        if between:
            self._fail(number, f"{between!r} does not stand between two cells", "put a cell on either side")
        self.rows.append(number)
        self.cols = self.cols or col
        if col != self.cols:
            self._fail(
                number,
                f"ragged rows: this row has {col} cells, the first has {self.cols}",
                "give every row the same number of cells",
            )

    def _read_cell(self, number: int, cell: Cell, word: str) -> None:
        if word == SOLID:
            self.solid.add(cell)
        elif _is_marks(word):
            for mark in word.split("/"):
                if mark in self.marks:
                    self._fail(
                        number,
                        f"doubled mark {mark} (first: line {self.lines[mark]})",
                        "rename or remove one of the two",
                    )
                self.marks[mark] = cell
                self.lines[mark] = number
        elif word != OPEN:
            self._fail(
                number,
                f"unknown cell {word!r}",
                "write '.', 'X' (solid), or a mark that begins with T, G or D; separate cells by blanks",
            )

    def _read_between(self, number: int, words: Sequence[str]) -> None:
        """Read a line between the last row and the one before it, a word for each column."""
        if len(words) != self.cols:
            self._fail(
                number,
                f"this line of walls has {len(words)} words, the rows have {self.cols} cells",
                "give every column one of '-' (wall), '=' (door) and '+' (open floor)",
            )
        row = len(self.rows) - 1
        for col, word in enumerate(words):
            if word not in _BELOW:
                self._fail(
                    number,
                    f"unknown word {word!r} in a line of walls",
                    "write '-' (wall), '=' (door) or '+' (open floor)",
                )
            between = edge(Cell(row - 1, col), Cell(row, col))
            if word != NOTHING_BELOW:
                (self.walls if word == WALL_BELOW else self.doors).add(between)


def _is_marks(word: str) -> bool:
    return all(MARK.fullmatch(part) for part in word.split("/"))
