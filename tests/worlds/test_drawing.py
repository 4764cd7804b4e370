from dataclasses import replace

import numpy as np
import pytest

from worlds import Cell, MazeState, Obstacle, load_layout
from worlds.drawing import DOOR, FLOOR, GOAL, TRIGGER, UNKNOWN, WALL, Picture, draw_maze

LAYOUT = load_layout("two_rooms")
STATE = MazeState(robot=8, trigger=49, goal=31)
RED = (217, 51, 43)


def _cell(picture: Picture, row: int, col: int, pixels: int = 32) -> Picture:
    """Return the pixels of a cell."""
    top, left = pixels // 4 + row * pixels, pixels // 4 + col * pixels
    return picture[top : top + pixels, left : left + pixels]


def _count(pixels: Picture, colour: tuple[int, int, int]) -> int:
    return int((pixels == np.array(colour)).all(axis=-1).sum())


@pytest.mark.parametrize("pixels", [9, 16, 32])
def test_a_picture_has_a_border_of_a_quarter_cell(pixels: int) -> None:
    """Its size follows from the layout's, and the border is wall."""
    picture = draw_maze(LAYOUT, STATE, pixels=pixels)
    side = 8 * pixels + 2 * (pixels // 4)
    assert picture.shape == (side, side, 3)
    assert picture.dtype == np.uint8
    assert (picture[0] == WALL).all()
    assert (picture[:, -1] == WALL).all()


def test_adjacent_floor_cells_differ() -> None:
    """The floor is a checker, as in section 4 of the paper."""
    picture = draw_maze(LAYOUT, STATE)
    for row, col in ((3, 2), (3, 1), (4, 1)):
        assert (_cell(picture, row, col) == FLOOR[(row + col) % 2]).all()


def test_walls_doors_and_marks_show() -> None:
    """A wall is dark, a shut door brown, the trigger yellow, the goal green; other cells hold none of it."""
    picture = draw_maze(LAYOUT, STATE)
    assert _count(_cell(picture, 3, 3)[:, -2:], WALL) == 64
    assert _count(_cell(picture, 2, 3)[:, -2:], DOOR) == 64
    assert _count(_cell(picture, 6, 1), TRIGGER) > 50
    assert _count(_cell(picture, 3, 7), GOAL) > 50
    assert _count(picture, TRIGGER) == _count(_cell(picture, 6, 1), TRIGGER)
    assert _count(picture, GOAL) == _count(_cell(picture, 3, 7), GOAL)


def test_open_doors_let_the_floor_through() -> None:
    """The middle of an open door is floor, its posts stay, and the trigger turns hollow."""
    shut, opened = (draw_maze(LAYOUT, replace(STATE, doors_open=doors)) for doors in (False, True))
    assert (_cell(opened, 2, 3)[12:20] == FLOOR[1]).all()
    assert 0 < _count(opened, DOOR) < _count(shut, DOOR) / 2
    assert 0 < _count(opened, TRIGGER) < _count(shut, TRIGGER)


def test_the_robot_is_drawn_in_its_cell() -> None:
    """Moving it changes its old and its new cell, and nothing else."""
    before, after = draw_maze(LAYOUT, STATE), draw_maze(LAYOUT, replace(STATE, robot=17))
    changed = (before != after).any(axis=-1)
    for row, col in ((1, 0), (2, 1)):
        cell = _cell(changed[:, :, None], row, col)
        assert cell.mean() > 0.2
        cell[:] = False
    assert not changed.any()


def test_cubes_are_square_and_spheres_round() -> None:
    """A cube fills the corners of its box, and a sphere does not; both have their own colour."""
    cell = Cell(4, 4)
    number = LAYOUT.number(cell)
    areas = {}
    for kind in ("cube", "sphere"):
        state = replace(STATE, **{f"{kind}s": frozenset({number})})
        picture = draw_maze(LAYOUT, state, {number: Obstacle("O", kind, cell, "large", "#d9332b")})
        changed = (picture != draw_maze(LAYOUT, STATE)).any(axis=-1)
        assert _count(_cell(picture, 4, 4), RED) > 150
        areas[kind] = int(_cell(changed[:, :, None], 4, 4).sum())
        assert areas[kind] == changed.sum()
        corner = _cell(changed[:, :, None], 4, 4)[6, 6, 0]
        assert corner == (kind == "cube")
    assert areas["sphere"] / areas["cube"] == pytest.approx(np.pi / 4, abs=0.08)


def test_larger_obstacles_are_drawn_larger() -> None:
    """The three sizes differ in area."""
    number = LAYOUT.number(Cell(4, 4))
    state = replace(STATE, spheres=frozenset({number}))
    empty = draw_maze(LAYOUT, STATE)
    areas = [
        (draw_maze(LAYOUT, state, {number: Obstacle("S", "sphere", Cell(4, 4), size)}) != empty).any(-1).sum()
        for size in ("small", "middle", "large")
    ]
    assert areas[0] * 1.3 < areas[1] < areas[2] / 1.3


def test_an_obstacle_of_unknown_look_is_grey() -> None:
    """A belief, which holds cells alone, can be drawn too."""
    picture = draw_maze(LAYOUT, replace(STATE, cubes=frozenset({36})))
    assert _count(_cell(picture, 4, 4), UNKNOWN) > 50


def test_solid_cells_are_wall() -> None:
    """They are painted over as a whole."""
    layout = replace(LAYOUT, solid=frozenset({Cell(0, 1)}))
    assert (_cell(draw_maze(layout, STATE), 0, 1) == WALL).all()
