"""Layouts drawn from a seed, and the text that any layout is written as."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import SMALL, maze_layouts, obstacles_in

from hierarchy import check, two_rooms
from worlds import (
    ACTIONS,
    Cell,
    Layout,
    LayoutError,
    MazeState,
    Obstacle,
    Stream,
    UserError,
    load_layout,
    maze_model,
    parse_layout,
    state_number,
    step,
)
from worlds.appearing import shortest_way
from worlds.generate import generate_layout
from worlds.layout_checks import layout_faults
from worlds.layout_writing import layout_text


@st.composite
def generated(draw: st.DrawFn, most: int = 12) -> Layout:
    """Draw a generated layout, of any size that holds what is asked for."""
    rows, cols = draw(st.integers(2, most)), draw(st.integers(6, most))
    return generate_layout(
        rows,
        cols,
        draw(st.integers(0, 2**64)),
        rooms=(draw(st.integers(1, rows)), draw(st.integers(2, 4))),
        doors=draw(st.integers(1, min(rows, 2))),
        triggers=draw(st.integers(1, 2)),
        goals=draw(st.integers(1, 2)),
        obstacles=draw(st.integers(0, 5)),
    )


@settings(max_examples=80, deadline=None)
@given(generated())
def test_a_generated_maze_can_be_played(layout: Layout) -> None:
    """Two parts with the doors shut: start and triggers in one, goals and thresholds in the other."""
    near, far = sorted(layout.rooms.values(), key=lambda room: layout.start not in room)
    assert near | far == set(layout.cells)
    assert {layout.start, *layout.triggers.values()} <= near
    assert {*layout.goals.values(), *layout.thresholds.values()} <= far
    assert layout.reach([layout.start], doors_open=True) == near | far
    for trigger, goal in product(layout.triggers.values(), layout.goals.values()):
        assert shortest_way(layout, layout.start, trigger, goal)[-1] == goal


@settings(max_examples=25, deadline=None)
@given(generated(most=6))
def test_the_paper_s_task_graph_runs_on_a_generated_maze(layout: Layout) -> None:
    """The check finds nothing."""
    assert check(two_rooms(layout), maze_model(layout)) == ()


@settings(max_examples=80, deadline=None)
@given(generated())
def test_a_generated_maze_is_read_back_from_its_text(layout: Layout) -> None:
    """The layout is the same, its marks in the same order too: states keep their numbers."""
    again = parse_layout(layout_text(layout))
    assert again == layout
    assert list(again.marks.items()) == list(layout.marks.items())


@settings(max_examples=80, deadline=None)
@given(maze_layouts(), st.data())
def test_any_maze_is_read_back_from_its_text(layout: Layout, data: st.DataObject) -> None:
    """Walls and doors on any side, marks that share a cell, obstacles at any event."""
    lines = dict.fromkeys(layout.marks, 0)
    assume(not [*layout_faults(layout, lines, range(layout.rows))])  # two marks may stand beside a door
    obstacles = data.draw(obstacles_in(layout, most=3))
    late = tuple(obstacle for obstacle in obstacles if obstacle.appears.event != "start")
    chosen = frozenset(data.draw(st.sets(st.sampled_from(sorted({*layout.marks, "start"})))))
    whole = replace(layout, obstacles=late, chosen=chosen)
    assert parse_layout(layout_text(whole)) == whole


@pytest.mark.parametrize("text", [SMALL, layout_text(load_layout("two_rooms"))])
def test_a_text_is_written_once_and_for_all(text: str) -> None:
    """What is read from a written text is written as the same text."""
    written = layout_text(parse_layout(text))
    assert layout_text(parse_layout(written)) == written
    assert parse_layout(written) == parse_layout(text)


def test_the_seed_names_the_maze() -> None:
    """The same arguments give the same layout, twenty seeds twenty layouts."""
    mazes = [generate_layout(12, 12, seed, rooms=(3, 4)) for seed in range(20)]
    assert mazes[7] == generate_layout(12, 12, 7, rooms=(3, 4))
    assert len({(maze.walls, maze.start) for maze in mazes}) == 20


def test_more_marks_leave_the_walls_as_they_are() -> None:
    """Each part of a maze has a stream of its own, and more obstacles add to those there were."""
    few = generate_layout(12, 12, 4, rooms=(2, 2), goals=1, obstacles=2)
    many = generate_layout(12, 12, 4, rooms=(2, 2), goals=9, obstacles=5)
    assert (few.walls, few.doors, few.triggers) == (many.walls, many.doors, many.triggers)
    ten = generate_layout(12, 12, 4, rooms=(2, 2), goals=10, obstacles=2)
    assert list(ten.goals)[:2] == ["G01", "G02"]
    longer = generate_layout(12, 12, 4, rooms=(2, 2), goals=1, obstacles=5)
    assert longer.obstacles[:2] == few.obstacles


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rooms": (1, 1)}, "two columns of rooms"),
        ({"doors": 0}, "at least one of each"),
        ({"obstacles": -1}, "at least one of each"),
        ({"rooms": (9, 2)}, "9 x 2 rooms do not fit in a maze of 8 x 8 cells; ask for fewer"),
        ({"doors": 9}, "9 doors do not fit"),
        ({"obstacles": 62}, "62 obstacles do not fit"),
        ({"triggers": 32}, "start and triggers: 33 cells are needed and 32 are left"),
        ({"goals": 31}, "goals: 31 cells are needed and 30 are left"),
    ],
)
def test_a_maze_too_small_for_its_contents_is_refused(arguments: dict[str, int], message: str) -> None:
    """The message says what does not fit."""
    with pytest.raises(UserError, match=message):
        generate_layout(8, 8, 0, **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "two  blanks"}, "reads back as another layout"),
        ({"obstacles": (Obstacle("C1", "cube", Cell(0, 0), colour="#ABCDEF"),)}, "reads back as another"),
        ({"triggers": {"Q1": Cell(0, 1)}, "trigger": "Q1"}, "unknown cell 'Q1'"),
        ({"start": Cell(0, 2)}, "cannot be reached from start 0,2"),
    ],
)
def test_a_layout_without_a_text_is_refused(change: dict[str, object], message: str) -> None:
    """Nothing is lost without a word."""
    layout = replace(parse_layout(SMALL), obstacles=())
    with pytest.raises(UserError, match=message):
        layout_text(replace(layout, **change))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("between", "line", "problem"),
    [
        ("- +", 4, "this line of walls has 2 words, the rows have 4 cells"),
        ("- + | +", 4, "unknown word '|' in a line of walls"),
        ("- + + +\n+ + + +", 5, "this line of walls does not stand between two rows"),
    ],
)
def test_a_wrong_line_of_walls_is_named(between: str, line: int, problem: str) -> None:
    """The message names the line and the mend."""
    with pytest.raises(LayoutError) as caught:
        parse_layout(SMALL.replace("\n.   .   :", f"\n{between}\n.   .   :"))
    assert (caught.value.line, caught.value.problem) == (line, problem)


@pytest.mark.parametrize("old", ["grid\n", "D1  G1\n"])
def test_a_line_of_walls_needs_a_row_on_either_side(old: str) -> None:
    """Above the first row and below the last there is nothing to part."""
    with pytest.raises(LayoutError, match="does not stand between two rows; put a row on either side"):
        parse_layout(SMALL.replace(old, f"{old}- - - -\n"))


def test_walls_and_doors_between_rows_are_read() -> None:
    """A word a column: '-' a wall, '=' a door, '+' nothing."""
    text = "grid\nT1 . .\n- = +\nG1 D1/G2 | .\n- - +\n. . .\nstart 0,1\ntrigger T1\ngoal G1\n"
    layout = parse_layout(text)
    assert layout.marks == {"T1": (0, 0), "G1": (1, 0), "G2": (1, 1), "D1": (1, 1)}
    assert layout.walls == {
        (Cell(0, 0), Cell(1, 0)),
        (Cell(1, 0), Cell(2, 0)),
        (Cell(1, 1), Cell(2, 1)),
        (Cell(1, 1), Cell(1, 2)),
    }
    assert layout.doors == {(Cell(0, 1), Cell(1, 1))}


@settings(max_examples=60, deadline=None)
@given(maze_layouts())
def test_the_maze_model_is_the_step_of_every_state(layout: Layout) -> None:
    """The arrays are those that `worlds.step` gives, state by state."""
    model = maze_model(layout)
    room = layout.room(layout.start)
    for number, (robot, trigger, goal, doors) in enumerate(model.index):
        assert isinstance(robot, Cell)
        assert isinstance(trigger, Cell)
        assert isinstance(goal, Cell)
        state = MazeState(*map(layout.number, (robot, trigger, goal)), doors == "open")
        after = [state_number(layout, model.index, step(layout, state, a)[0]) for a in range(len(ACTIONS))]
        assert model.successors[number].tolist() == after
        assert model.starts[number] == (doors == "closed" and robot in room and robot != trigger)


@given(st.integers(0, 2**64), st.integers(0, 9), st.integers(0, 40))
def test_many_numbers_at_once_are_those_drawn_one_by_one(seed: int, before: int, count: int) -> None:
    """Also after some were drawn, and the stream goes on from there."""
    one, many = Stream(seed), Stream(seed)
    for _ in range(before):
        assert one.bits() == many.bits()
    assert np.array_equal(many.uniforms(count), [one.uniform() for _ in range(count)])
    assert one.bits() == many.bits()
