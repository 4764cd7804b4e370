from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import ACTION_NUMBERS, maze_layouts, obstacles_in

from worlds import (
    ACTIONS,
    Appears,
    Cell,
    Episode,
    Layout,
    MazeState,
    Obstacle,
    Push,
    ahead,
    load_layout,
    parse_layout,
    roll,
    step,
)

NORTH, SOUTH, WEST, EAST = range(4)
# One row, so that a cell's number is its column: the trigger 0, a door between 4 and 5, the goal 7.
CORRIDOR = parse_layout("grid\nT1 . . . . : D1 . G1\nstart 0,2\ntrigger T1\ngoal G1")


def _state(robot: int, cubes: set[int], spheres: set[int], *, doors_open: bool = False) -> MazeState:
    return MazeState(robot, 0, 7, doors_open, frozenset(cubes), frozenset(spheres))


def _obstacle(name: str, col: int, appears: Appears) -> Obstacle:
    kind = "cube" if name.startswith("C") else "sphere"
    return Obstacle(name, kind, Cell(0, col), appears=appears)


def _episode(*obstacles: Obstacle, start: int = 2) -> Episode:
    return Episode(CORRIDOR, "T1", "G1", Cell(0, start), obstacles)


def _names(obstacles: tuple[Obstacle, ...]) -> list[str]:
    return [obstacle.name for obstacle in obstacles]


@pytest.mark.parametrize(
    ("state", "action"),
    [
        (_state(2, set(), set()), NORTH),
        (_state(4, set(), set()), EAST),
        (_state(1, {2}, set()), EAST),
        (_state(3, set(), {4}), EAST),
        (_state(1, {3}, {2}), EAST),
        (_state(1, set(), {2, 3}), EAST),
        (_state(1, set(), {0}), WEST),
    ],
    ids=[
        "the outer wall",
        "a shut door",
        "a cube",
        "a sphere wedged by a shut door",
        "a sphere wedged by a cube",
        "a sphere wedged by a sphere",
        "a sphere wedged by a wall, on the trigger",
    ],
)
def test_the_robot_stays_where_it_is(state: MazeState, action: int) -> None:
    """What blocks leaves the whole state as it was, and nothing rolls."""
    assert step(CORRIDOR, state, action) == (state, None)


@pytest.mark.parametrize(
    ("state", "action", "end"),
    [
        (_state(1, set(), {2}), EAST, 4),
        (_state(1, set(), {2}, doors_open=True), EAST, 7),
        (_state(1, {4}, {2}), EAST, 3),
        (_state(1, set(), {2, 4}), EAST, 3),
        (_state(4, set(), {3}), WEST, 0),
        (_state(4, set(), {5}, doors_open=True), EAST, 7),
    ],
    ids=[
        "to a shut door",
        "through an open door to the wall",
        "to a cube",
        "to a sphere",
        "over the trigger to the wall",
        "from behind an open door",
    ],
)
def test_a_pushed_sphere_rolls(state: MazeState, action: int, end: int) -> None:
    """It comes to rest at the first thing in its way; the robot takes its place; others lie still."""
    start = state.robot + (1 if action == EAST else -1)
    after, push = step(CORRIDOR, state, action)
    assert push == Push(start, end)
    assert after == replace(state, robot=start, spheres=state.spheres - {start} | {end})


def test_a_roll_stops_before_the_robot() -> None:
    """A sphere that rolls towards the robot does not pass through it."""
    assert roll(CORRIDOR, _state(4, set(), {1}), 1, EAST) == 3


def test_a_sphere_rolls_north_and_south_too() -> None:
    """In column 2 of the two rooms a sphere pushed South ends in the last row, and a cube at 6,2 stops it."""
    layout = load_layout("two_rooms")
    sphere = layout.number(Cell(3, 2))
    state = MazeState(layout.number(Cell(2, 2)), 49, 31, spheres=frozenset({sphere}))
    assert layout.cells[roll(layout, state, sphere, SOUTH)] == (7, 2)
    blocked = replace(state, cubes=frozenset({layout.number(Cell(6, 2))}))
    assert layout.cells[roll(layout, blocked, sphere, SOUTH)] == (5, 2)
    assert layout.cells[roll(layout, state, sphere, NORTH)] == (3, 2)


def test_doors_open_at_the_trigger_and_stay_open() -> None:
    """The step on to the trigger opens them; leaving it does not shut them."""
    pressed, _ = step(CORRIDOR, _state(1, set(), set()), WEST)
    assert pressed == _state(0, set(), set(), doors_open=True)
    left, _ = step(CORRIDOR, pressed, EAST)
    assert left == _state(1, set(), set(), doors_open=True)


def test_doors_open_at_this_episode_s_trigger_alone() -> None:
    """Another trigger of the layout is plain floor, and a sphere on the trigger does not press it."""
    layout = load_layout("two_rooms")
    state = MazeState(layout.number(Cell(1, 2)), layout.number(layout.triggers["T4"]), 31)
    on_t1, _ = step(layout, state, NORTH)
    assert layout.cells[on_t1.robot] == layout.triggers["T1"]
    assert not on_t1.doors_open
    rolled, push = step(CORRIDOR, _state(4, set(), {3}), WEST)
    assert push == Push(3, 0)
    assert not rolled.doors_open


def test_ahead_looks_past_obstacles_but_not_past_walls() -> None:
    """Cells ahead are counted along the action until a wall or a shut door."""
    state = _state(2, {3}, set())
    assert [ahead(CORRIDOR, state, EAST, n) for n in range(4)] == [2, 3, 4, -1]
    assert ahead(CORRIDOR, replace(state, doors_open=True), EAST, 3) == 5
    assert ahead(CORRIDOR, state, NORTH, 1) == -1


def test_what_appears_at_the_start_is_there_at_once() -> None:
    """The episode's first state holds it."""
    episode = _episode(_obstacle("C1", 3, Appears("start")), _obstacle("S1", 1, Appears("start")))
    assert _names(episode.appeared) == ["C1", "S1"]
    assert (episode.state.cubes, episode.state.spheres) == ({3}, {1})


def test_what_appears_at_a_step_comes_after_that_many() -> None:
    """Step 2 means: once two actions are carried out, moving or not."""
    episode = _episode(_obstacle("C1", 4, Appears("step", step=2)))
    assert _names(episode.appeared) == []
    assert [_names(episode.step(NORTH).appeared) for _ in range(3)] == [[], ["C1"], []]


def test_what_appears_as_the_robot_enters_a_cell_comes_then() -> None:
    """Entering another cell does nothing."""
    episode = _episode(_obstacle("C1", 4, Appears("robot", cell=Cell(0, 1))))
    assert [_names(episode.step(a).appeared) for a in (EAST, WEST, WEST)] == [[], [], ["C1"]]


def test_a_robot_that_starts_in_the_cell_counts_as_entering_it() -> None:
    """The event comes before the first step."""
    assert _names(_episode(_obstacle("C1", 4, Appears("robot", cell=Cell(0, 2)))).appeared) == ["C1"]


def test_what_appears_as_doors_open_comes_with_the_trigger() -> None:
    """It comes at the step on to the trigger, also behind the door and in it."""
    episode = _episode(_obstacle("C1", 6, Appears("doors")), _obstacle("S1", 5, Appears("doors")))
    changes = [episode.step(WEST) for _ in range(2)]
    assert [change.opened for change in changes] == [False, True]
    assert [_names(change.appeared) for change in changes] == [[], ["C1", "S1"]]


def test_an_obstacle_waits_while_the_robot_is_in_its_cell() -> None:
    """It appears at the step at which the robot leaves."""
    episode = _episode(_obstacle("C1", 2, Appears("step", step=1)))
    assert [_names(episode.step(a).appeared) for a in (NORTH, SOUTH, EAST)] == [[], [], ["C1"]]
    assert episode.state == _state(3, {2}, set())


def test_an_obstacle_waits_while_another_is_in_its_cell() -> None:
    """It appears once the sphere there has been pushed away and the robot has gone on."""
    episode = _episode(_obstacle("S1", 2, Appears("start")), _obstacle("C1", 2, Appears("start")), start=1)
    assert _names(episode.appeared) == ["S1"]
    assert [_names(episode.step(EAST).appeared) for _ in range(2)] == [[], ["C1"]]
    assert episode.placed == {"S1": 4, "C1": 2}


def test_an_obstacle_waits_while_its_door_is_shut() -> None:
    """It appears with the doors' opening."""
    episode = _episode(_obstacle("C1", 5, Appears("start")))
    assert [_names(episode.step(WEST).appeared) for _ in range(2)] == [[], ["C1"]]


def test_names_follow_the_spheres() -> None:
    """After a push the name is found in the new cell, and not in the old."""
    episode = _episode(_obstacle("S1", 3, Appears("start")), _obstacle("C1", 1, Appears("start")))
    change = episode.step(EAST)
    assert (change.action, change.moved, change.push, change.opened) == (EAST, True, Push(3, 4), False)
    assert [episode.name_at(cell) for cell in (1, 3, 4)] == ["C1", None, "S1"]
    assert not episode.step(EAST).moved


def test_the_goal_counts_once_doors_are_open() -> None:
    """A goal on the robot's own side is not reached before the trigger."""
    layout = parse_layout("grid\nT1 . G1\nstart 0,1\ntrigger T1\ngoal G1")
    episode = Episode(layout, "T1", "G1", layout.start)
    reached = []
    for action in (EAST, WEST, WEST, EAST, EAST):
        episode.step(action)
        reached.append(episode.reached)
    assert reached == [False, False, False, False, True]


@pytest.mark.parametrize("start", [Cell(0, 0), Cell(0, 1)], ids=["on the trigger", "in a solid cell"])
def test_an_impossible_start_is_refused(start: Cell) -> None:
    """The error names the cell."""
    layout = parse_layout("grid\nT1 X G1\n. . .\nstart 1,0\ntrigger T1\ngoal G1")
    with pytest.raises(ValueError, match=f"an episode cannot start at {start}"):
        Episode(layout, "T1", "G1", start)


def test_an_obstacle_in_a_wall_is_refused() -> None:
    """The error names the obstacle and its cell."""
    layout = parse_layout("grid\nT1 X G1\n. . .\nstart 1,0\ntrigger T1\ngoal G1")
    with pytest.raises(ValueError, match="obstacle C1 stands in the solid cell 0,1"):
        Episode(layout, "T1", "G1", layout.start, [_obstacle("C1", 1, Appears("start"))])


def _hold_together(episode: Episode) -> None:
    """Hold what is true of every state of every episode."""
    layout, state = episode.layout, episode.state
    assert state.robot not in state.cubes | state.spheres
    assert state.cubes.isdisjoint(state.spheres)
    assert all(layout.cells[cell] not in layout.solid for cell in state.cubes | state.spheres)
    assert len(set(episode.placed.values())) == len(episode.placed)
    for kind, cells in (("cube", state.cubes), ("sphere", state.spheres)):
        placed = {cell for name, cell in episode.placed.items() if episode.obstacles[name].kind == kind}
        assert placed == cells


@settings(max_examples=300, deadline=None)
@given(st.data(), maze_layouts(), st.lists(ACTION_NUMBERS, max_size=30))
def test_nothing_overlaps_and_nothing_is_lost(
    data: st.DataObject, layout: Layout, actions: list[int]
) -> None:
    """Whatever happens, obstacles stay apart, and are only ever added, where and when they may be."""
    episode = Episode(layout, "T1", "G1", layout.start, data.draw(obstacles_in(layout)))
    _hold_together(episode)
    for action in actions:
        before, placed = episode.state, dict(episode.placed)
        change = episode.step(action)
        after = episode.state
        _hold_together(episode)
        step_to = layout.passage(before.robot, action, doors_open=before.doors_open)
        assert after.robot in (before.robot, step_to)
        assert change.moved == (after.robot != before.robot)
        assert after.doors_open == (before.doors_open or after.robot == after.trigger)
        assert (after.trigger, after.goal) == (before.trigger, before.goal)
        assert before.cubes <= after.cubes
        new = {obstacle.name: layout.number(obstacle.cell) for obstacle in change.appeared}
        if change.push is not None:
            placed = {name: change.push.end if at == change.push.start else at for name, at in placed.items()}
        assert episode.placed == placed | new
        assert len(episode.placed) == len(placed) + len(new)
        shut = set() if after.doors_open else {layout.number(cell) for cell in layout.thresholds.values()}
        assert shut.isdisjoint(new.values())


@settings(max_examples=200, deadline=None)
@given(st.data(), maze_layouts())
def test_a_roll_is_straight_and_ends_at_something(data: st.DataObject, layout: Layout) -> None:
    """Every cell of a roll is free, and the one after its end is not."""
    free = [layout.number(cell) for cell in layout.cells if cell not in layout.solid]
    robot, sphere, *others = data.draw(st.permutations(free))
    cubes = data.draw(st.sets(st.sampled_from(others), max_size=2)) if others else set()
    state = MazeState(
        robot, free[0], free[-1], data.draw(st.booleans()), frozenset(cubes), frozenset({sphere})
    )
    action = data.draw(ACTION_NUMBERS)
    end = roll(layout, state, sphere, action)
    taken = {-1, robot, sphere, *cubes}
    cell = sphere
    while cell != end:
        cell = layout.passage(cell, action, doors_open=state.doors_open)
        assert cell not in taken
    assert layout.passage(end, action, doors_open=state.doors_open) in taken - {sphere}


def test_the_example_run_s_first_room() -> None:
    """Table 4: from 1,0 the robot pushes S1 out of its way, C1 appears before it, East goes round it."""
    layout = load_layout("two_rooms")
    episode = Episode(layout, "T4", "G2", layout.start, layout.obstacles)
    assert _names(episode.appeared) == ["S1"]
    log = [
        episode.step(ACTIONS.index(a)) for a in ("South", "South", "South", "South", "East", "South", "South")
    ]
    assert [_names(change.appeared) for change in log] == [[], ["C2"], ["C1"], ["S3"], [], [], ["S2"]]
    assert [change.moved for change in log] == [True, True, True, False, True, True, True]
    assert log[1].push == Push(layout.number(Cell(3, 0)), layout.number(Cell(7, 0)))
    assert log[-1].opened
