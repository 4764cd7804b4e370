"""Reading a layout from its text, with errors that name the line and the mend."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import NoReturn

from worlds.errors import LayoutError, UserError, nearest, suggest
from worlds.layout import KINDS, SIZES, Appears, Cell, Kind, Layout, Obstacle, Size
from worlds.layout_checks import layout_faults
from worlds.layout_grid import Grid, Line, begins_row

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
_KEYS = ("name", "grid", "start", "trigger", "goal", "chosen", "obstacles")
_HEADINGS = ("grid", "obstacles")  # keys whose lines stand below them
_SUFFIX = ".maze"
_OBSTACLE_WORDS = 6  # name, kind, cell, size, colour, and when it appears in one word or more


def layout_names() -> tuple[str, ...]:
    """Return the names of the layouts that come with the package."""
    found = (entry.name for entry in files("worlds").joinpath("layouts").iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in found if name.endswith(_SUFFIX)))


def load_layout(name: str | Path) -> Layout:
    """Read a layout that comes with the package, by its name, or any ``.maze`` file, by its path.

    Raises
    ------
    UserError
        If there is no such layout or file, or it cannot be read.
    LayoutError
        If its text is wrong; the message names the line and the mend.

    Examples
    --------
    >>> maze = load_layout("two_rooms")
    >>> maze.rows, maze.cols, maze.triggers["T4"], sorted(maze.rooms)
    (8, 8, Cell(row=6, col=1), ['A', 'B'])
    """
    if isinstance(name, str) and name in layout_names():
        text = files("worlds").joinpath("layouts", name + _SUFFIX).read_text(encoding="utf-8")
        return parse_layout(text, source=name + _SUFFIX)
    path = Path(name)
    try:
        if not path.is_file():
            hint = suggest(str(name), layout_names(), "layouts by name:")
            raise UserError(f"{name}: no layout of this name and no such file; {hint}")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(
            f"{path}: it cannot be read ({error.strerror}); check the path and its rights"
        ) from error
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: cannot be read as UTF-8 text ({error}); check the file") from error
    return parse_layout(text, source=str(path))


def parse_layout(text: str, source: str = "layout") -> Layout:
    """Read a layout from its text; `source` names it in errors.

    Raises
    ------
    LayoutError
        If the text is wrong.
    """
    return _Parser(source).parse(text)


@dataclass
class _Parser:
    source: str
    lines: dict[str, int] = field(default_factory=dict)  # where each key, mark and obstacle was read
    values: dict[str, list[str]] = field(default_factory=dict)
    grid: Grid = field(init=False)

    def fail(self, line: int | None, problem: str, mend: str) -> NoReturn:
        raise LayoutError(self.source, line, problem, mend)

    def parse(self, text: str) -> Layout:
        grid_lines, obstacle_lines = self._split(text)
        self.grid = grid = self._read_grid(grid_lines)
        start = self._cell(*self._single("start"))
        trigger, goal = self._mark_of("trigger", "T"), self._mark_of("goal", "G")
        obstacles = tuple(self._obstacle(number, words) for number, words in obstacle_lines)
        layout = Layout(
            name=" ".join(self.values.get("name", [])) or Path(self.source).stem,
            rows=len(grid.rows),
            cols=grid.cols,
            solid=frozenset(grid.solid),
            walls=frozenset(grid.walls),
            doors=frozenset(grid.doors),
            triggers=grid.marked("T"),
            goals=grid.marked("G"),
            thresholds=grid.marked("D"),
            start=start,
            trigger=trigger,
            goal=goal,
            obstacles=obstacles,
            chosen=self._chosen(obstacles),
        )
        for fault in layout_faults(layout, self.lines, grid.rows):
            self.fail(*fault)
        return layout

    def _split(self, text: str) -> tuple[list[Line], list[Line]]:
        """Keep the `key value` lines, and return the grid's lines and the obstacles'."""
        section = ""
        below: dict[str, list[Line]] = {heading: [] for heading in _HEADINGS}
        for number, raw in enumerate(text.splitlines(), start=1):
            words = [] if raw.lstrip().startswith("#") else raw.split()
            if not words:
                continue
            if words[0] in _KEYS:
                section = words[0]
                if section in self.values:
                    self.fail(
                        number, f"{section!r} is given twice", f"keep one (first: line {self.lines[section]})"
                    )
                if section in _HEADINGS and words[1:]:
                    self.fail(
                        number, f"{section!r} stands alone on its line", "move the rest to the lines below it"
                    )
                self.lines[section] = number
                self.values[section] = words[1:]
            elif section in _HEADINGS and not _misspelt_key(words, section):
                below[section].append((number, words))
            else:
                self.fail(number, f"unknown key {words[0]!r}", suggest(words[0], _KEYS))
        return below["grid"], below["obstacles"]

    def _read_grid(self, rows: list[Line]) -> Grid:
        grid = Grid(self.source)
        if not rows:
            self.fail(self.lines.get("grid"), "the layout has no grid", "add 'grid' and its rows below it")
        grid.read(rows)
        self.lines.update(grid.lines)
        for mark, meaning in (("T", "trigger"), ("G", "goal")):
            if not grid.marked(mark):
                self.fail(
                    self.lines["grid"],
                    f"missing mark: no {meaning} in the grid",
                    f"mark a cell {mark}1 in place of '.'",
                )
        return grid

    def _cell(self, number: int, word: str) -> Cell:
        grid = self.grid
        if word in grid.marks:
            return grid.marks[word]
        match = re.fullmatch(r"(\d+),(\d+)", word)
        if match is None:
            self.fail(
                number, f"{word!r} is not a cell", "write row,column (such as 3,0) or a mark of the grid"
            )
        cell = Cell(int(match[1]), int(match[2]))
        rows, cols = len(grid.rows), grid.cols
        if cell.row >= rows or cell.col >= cols:
            self.fail(
                number,
                f"cell {cell} is outside the grid of {rows} x {cols}",
                f"rows run 0 to {rows - 1}, columns 0 to {cols - 1}",
            )
        if cell in grid.solid:
            self.fail(number, f"cell {cell} is solid", "choose a free cell")
        return cell

    def _single(self, key: str) -> tuple[int, str]:
        if key not in self.values:
            self.fail(None, f"missing line {key!r}", f"add '{key}' and its value")
        number, words = self.lines[key], self.values[key]
        if len(words) != 1:
            self.fail(number, f"{key!r} takes one value, not {len(words)}", f"write '{key} VALUE'")
        return number, words[0]

    def _mark_of(self, key: str, letter: str) -> str:
        number, word = self._single(key)
        if word not in self.grid.marked(letter):
            self.fail(
                number,
                f"missing mark: {key} {word!r} is not in the grid",
                f"mark its cell, or name one of {', '.join(self.grid.marked(letter))}",
            )
        return word

    def _chosen(self, obstacles: tuple[Obstacle, ...]) -> frozenset[str]:
        known = {*self.grid.marks, *(obstacle.name for obstacle in obstacles), "start"}
        for name in self.values.get("chosen", []):
            if name not in known:
                self.fail(
                    self.lines["chosen"],
                    f"'chosen' names {name!r}, which the layout does not have",
                    f"known names: {', '.join(sorted(known))}",
                )
        return frozenset(self.values.get("chosen", []))

    def _obstacle(self, number: int, words: list[str]) -> Obstacle:
        if len(words) < _OBSTACLE_WORDS:
            self.fail(
                number,
                "an obstacle's line is too short",
                "write: name kind cell size colour when (S1 sphere 3,0 middle #d9332b at start)",
            )
        name, kind, cell, size, colour, *when = words
        if not _NAME.fullmatch(name) or name in self.lines:
            self.fail(
                number, f"obstacle name {name!r} is taken or not a word", "give each obstacle its own name"
            )
        self.lines[name] = number
        return Obstacle(
            name=name,
            kind=self._kind(number, kind),
            cell=self._cell(number, cell),
            size=self._size(number, size),
            colour=self._colour(number, colour),
            appears=self._appears(number, when),
        )

    def _kind(self, number: int, word: str) -> Kind:
        for kind in KINDS:
            if word == kind:
                return kind
        self.fail(number, f"unknown obstacle kind {word!r}", suggest(word, KINDS))

    def _size(self, number: int, word: str) -> Size:
        for size in SIZES:
            if word == size:
                return size
        self.fail(number, f"unknown size {word!r}", suggest(word, SIZES))

    def _colour(self, number: int, word: str) -> str:
        if not _COLOUR.fullmatch(word):
            self.fail(number, f"{word!r} is not a colour", "write it as #rrggbb, such as #d9332b")
        return word.lower()

    def _appears(self, number: int, words: list[str]) -> Appears:
        match words:
            case ["at", "start"]:
                return Appears("start")
            case ["at", "step", step] if step.isdecimal():
                return Appears("step", step=int(step))
            case ["when", "robot", cell]:
                return Appears("robot", cell=self._cell(number, cell))
            case ["when", "doors", "open"]:
                return Appears("doors")
        self.fail(
            number,
            f"cannot read when the obstacle appears: {' '.join(words)!r}",
            "write 'at start', 'at step N', 'when robot R,C' or 'when doors open'",
        )


def _misspelt_key(words: list[str], section: str) -> bool:
    """Return whether a line among the grid's rows or the obstacles is rather a key with a slip in it."""
    fits = begins_row(words[0]) if section == "grid" else len(words) >= _OBSTACLE_WORDS
    return not fits and nearest(words[0], _KEYS) is not None
