"""Pictures of a maze from above, by numpy alone."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from worlds.layout import Cell, Edge, Layout, Obstacle, Size
from worlds.maze import MazeState

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]

FLOOR: Final[tuple[Colour, Colour]] = ((247, 249, 252), (140, 178, 229))
WALL: Final[Colour] = (48, 55, 68)
DOOR: Final[Colour] = (178, 98, 36)
TRIGGER: Final[Colour] = (245, 190, 30)
GOAL: Final[Colour] = (22, 150, 84)
ROBOT: Final[Colour] = (38, 42, 56)
UNKNOWN: Final[Colour] = (128, 128, 128)  # an obstacle of which only the cell is given
RADIUS: Final[dict[Size, float]] = {"small": 0.20, "middle": 0.28, "large": 0.37}
"""Half an obstacle's width, in cells."""
_WALL_HALF: Final = 0.0625  # half a wall's thickness, in cells
_LINE: Final = 0.05  # an outline's width, in cells


def draw_maze(
    layout: Layout,
    state: MazeState,
    looks: Mapping[int, Obstacle] = MappingProxyType({}),
    *,
    pixels: int = 32,
) -> Picture:
    """Draw a maze from above: North is up.

    Doors are brown bars while shut and leave their posts when open. The trigger is a yellow diamond,
    hollow once pressed; the goal a green flag; the robot a dark disc with two wheels. Cubes are drawn
    square and spheres round.

    Parameters
    ----------
    layout
        The maze.
    state
        What stands where.
    looks
        The obstacle in each cell, by the cell's number, for its size and colour. An obstacle of the
        state that is missing here is drawn grey and middle-sized.
    pixels
        Width of a cell.

    Returns
    -------
    numpy.ndarray
        RGB, shape (rows x pixels + m, cols x pixels + m, 3), uint8, where m is twice a quarter cell:
        the border, in the walls' colour.

    Examples
    --------
    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> draw_maze(maze, MazeState(robot=8, trigger=49, goal=31)).shape
    (272, 272, 3)
    """
    canvas = _Canvas(layout.rows, layout.cols, pixels)
    for cell in layout.cells:
        canvas.fill(cell, WALL if cell in layout.solid else FLOOR[(cell.row + cell.col) % 2])
    _draw_trigger(canvas, layout.cells[state.trigger], pressed=state.doors_open)
    _draw_goal(canvas, layout.cells[state.goal])
    for cells, square in ((state.cubes, True), (state.spheres, False)):
        for number in sorted(cells):
            _draw_obstacle(canvas, layout.cells[number], looks.get(number), square=square)
    _draw_robot(canvas, layout.cells[state.robot])
    for wall in layout.walls:
        canvas.bar(wall, WALL, 0.0, 0.5 + _WALL_HALF)
    for door in layout.doors:
        canvas.bar(door, DOOR, 0.32 if state.doors_open else 0.0, 0.5)
    return canvas.picture()


class _Canvas:
    """An RGB picture in floats that shapes are blended into; lengths are in cells."""

    def __init__(self, rows: int, cols: int, pixels: int) -> None:
        self.pixels = pixels
        self.margin = pixels // 4
        size = (rows * pixels + 2 * self.margin, cols * pixels + 2 * self.margin, 3)
        self.rgb = np.full(size, WALL, dtype=np.float64)
        middles = (np.arange(pixels) + 0.5) / pixels - 0.5
        self.y, self.x = np.meshgrid(middles, middles, indexing="ij")  # from a cell's middle, y down

    def _square(self, top: float, left: float) -> NDArray[np.float64]:
        """Return a view of one cell's worth of pixels from a place given in cells."""
        y = self.margin + round(top * self.pixels)
        x = self.margin + round(left * self.pixels)
        return self.rgb[y : y + self.pixels, x : x + self.pixels]

    def fill(self, cell: Cell, colour: Colour) -> None:
        """Paint a whole cell."""
        self._square(cell.row, cell.col)[:] = colour

    def blend(self, cell: Cell, outside: NDArray[np.float64], colour: Colour) -> None:
        """Paint where `outside`, the distance from a shape's edge, is below 0; the edge is antialiased."""
        self._blend(self._square(cell.row, cell.col), outside, colour)

    def _blend(self, square: NDArray[np.float64], outside: NDArray[np.float64], colour: Colour) -> None:
        cover = np.clip(0.5 - outside * self.pixels, 0.0, 1.0)[:, :, None]
        square += cover * (np.asarray(colour) - square)

    def bar(self, edge: Edge, colour: Colour, start: float, end: float) -> None:
        """Paint along an edge, on either side of its middle, from `start` to `end` cells away."""
        a, b = edge
        across, along = (self.x, self.y) if a.row == b.row else (self.y, self.x)
        length = np.maximum(np.abs(along) - end, start - np.abs(along))
        outside = np.maximum(np.abs(across) - _WALL_HALF, length)
        self._blend(self._square((a.row + b.row) / 2, (a.col + b.col) / 2), outside, colour)

    def picture(self) -> Picture:
        """Return the picture in bytes."""
        return np.rint(self.rgb).astype(np.uint8)


def _draw_trigger(canvas: _Canvas, cell: Cell, *, pressed: bool) -> None:
    diamond = (np.abs(canvas.x) + np.abs(canvas.y)) / np.sqrt(2) - 0.27
    canvas.blend(cell, diamond, WALL)
    canvas.blend(cell, diamond + _LINE, TRIGGER)
    if pressed:
        canvas.blend(cell, diamond + 3 * _LINE, FLOOR[(cell.row + cell.col) % 2])


def _draw_goal(canvas: _Canvas, cell: Cell) -> None:
    x, y = canvas.x, canvas.y
    pole = np.maximum(np.abs(x + 0.2) - 0.035, np.abs(y) - 0.38)
    # A triangle: right of the pole, below and above two lines that meet at its tip.
    cloth = np.maximum(-0.18 - x, np.abs(y + 0.16) + (x - 0.34) * 0.42) / 1.05
    canvas.blend(cell, pole, WALL)
    canvas.blend(cell, cloth, GOAL)


def _draw_obstacle(canvas: _Canvas, cell: Cell, look: Obstacle | None, *, square: bool) -> None:
    radius = RADIUS["middle" if look is None else look.size]
    colour = UNKNOWN if look is None else _rgb(look.colour)
    x, y = canvas.x, canvas.y
    body = (np.maximum(np.abs(x), np.abs(y)) if square else np.hypot(x, y)) - radius
    canvas.blend(cell, body, _shade(colour, 0.45))
    canvas.blend(cell, body + _LINE, colour)
    if square:
        canvas.blend(cell, np.maximum(body + _LINE, y + 0.45 * radius), _light(colour, 0.35))
    else:
        canvas.blend(cell, np.hypot(x + 0.3 * radius, y + 0.3 * radius) - 0.35 * radius, _light(colour, 0.6))


def _draw_robot(canvas: _Canvas, cell: Cell) -> None:
    x, y = canvas.x, canvas.y
    wheels = np.maximum(np.abs(np.abs(x) - 0.31) - 0.06, np.abs(y) - 0.17)
    hull = np.hypot(x, y) - 0.30
    canvas.blend(cell, wheels, (0, 0, 0))
    canvas.blend(cell, hull, ROBOT)
    canvas.blend(cell, np.abs(hull + 0.09) - 0.025, (255, 255, 255))
    canvas.blend(cell, np.hypot(x, y) - 0.08, (90, 200, 250))


def _rgb(colour: str) -> Colour:
    """Return the parts of ``#rrggbb``."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def _shade(colour: Colour, strength: float) -> Colour:
    return _mix(colour, (0, 0, 0), strength)


def _light(colour: Colour, strength: float) -> Colour:
    return _mix(colour, (255, 255, 255), strength)


def _mix(a: Colour, b: Colour, share: float) -> Colour:
    """Return a colour between two, `share` of the way from the first."""
    red, green, blue = (round(p + share * (q - p)) for p, q in zip(a, b, strict=True))
    return red, green, blue
