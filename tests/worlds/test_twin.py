"""The PyBullet twin: grid and physics agree, runs repeat to the last bit, the camera sees what is there."""

import hashlib
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from math import hypot

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from strategies import ACTION_NUMBERS, maze_layouts, obstacles_in

from worlds import (
    ACTIONS,
    DELTAS,
    KINDS,
    SIZES,
    Appears,
    Cell,
    Episode,
    Kind,
    Layout,
    LayoutError,
    Obstacle,
    Size,
    Stream,
    load_layout,
    parse_layout,
)
from worlds.bullet import silent
from worlds.camera import RADIUS, Camera
from worlds.geometry import centre
from worlds.scene import ROBOT_RADIUS, TIME_STEP
from worlds.twin import TOLERANCE, Twin

MAZE = load_layout("two_rooms")
NORTH, SOUTH, WEST, EAST = range(4)


@pytest.fixture(scope="module")
def twin() -> Iterator[Twin]:
    """Share one twin of the two-room maze; every test begins or stages anew."""
    with Twin(MAZE, Camera(pixels=96)) as shared:
        yield shared


def example_run() -> Episode:
    """Return the example run of the layout, at its start."""
    return Episode(MAZE, "T4", "G2", MAZE.start, MAZE.obstacles)


def random_layout(stream: Stream) -> Layout:
    """Draw mazes as text until one can be played: random walls, solid cells and two doors."""
    while True:
        rows, cols = 4 + stream.below(5), 4 + stream.below(5)
        words = [["X" if stream.uniform() < 0.03 else "." for _ in range(cols)] for _ in range(rows)]
        marks = stream.shuffled([(r, c) for r in range(rows) for c in range(cols)])
        for name, (r, c) in zip(("T1", "T2", "G1", "G2"), marks, strict=False):
            words[r][c] = name
        between = [["|" if stream.uniform() < 0.1 else "" for _ in range(cols - 1)] for _ in range(rows)]
        for door in ("D1", "D2"):
            r, c = stream.below(rows), stream.below(cols - 1)
            words[r][c + 1], between[r][c] = door, ":"
        grid = "\n".join(
            " ".join(sum(zip(w, [*b, ""], strict=True), ())) for w, b in zip(words, between, strict=True)
        )
        start = f"{stream.below(rows)},{stream.below(cols)}"
        try:
            return parse_layout(f"name random\ngrid\n{grid}\nstart {start}\ntrigger T1\ngoal G1\n")
        except LayoutError:
            continue


def random_obstacles(stream: Stream, layout: Layout, count: int) -> tuple[Obstacle, ...]:
    """Draw obstacles that appear at the start, at a step, or as doors open."""
    free = [cell for cell in layout.cells if cell not in layout.solid]
    events = (Appears("start"), Appears("step", step=3), Appears("step", step=10), Appears("doors"))
    return tuple(
        Obstacle(
            f"O{i}",
            "sphere" if stream.uniform() < 0.7 else "cube",
            stream.choose(free),
            stream.choose(SIZES),
            f"#{stream.below(1 << 24):06x}",
            stream.choose(events),
        )
        for i in range(count)
    )


def random_move(stream: Stream, episode: Episode) -> int:
    """Draw an action; now and then one that meets an obstacle, if one is beside the robot."""
    state, neighbours = episode.state, episode.layout.neighbours[episode.state.robot]
    beside = [action for action, to in enumerate(neighbours) if to in state.spheres | state.cubes]
    return stream.choose(beside) if beside and stream.uniform() < 0.5 else stream.below(len(ACTIONS))


def digest(twin: Twin, episode: Episode, actions: list[int]) -> str:
    """Return a hash of every pose and frame of a run."""
    found = hashlib.sha256()
    twin.begin(episode)
    for action in actions:
        twin.carry_out(episode, episode.step(action))
        found.update(repr(twin.where()).encode())
        found.update(twin.frame().tobytes())
    return found.hexdigest()


def visible(frame: NDArray[np.uint8], background: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return which pixels differ between two frames, shape (pixels, pixels)."""
    return np.any(frame != background, axis=2)


# --- grid and physics ---


def test_grid_and_physics_agree_after_each_of_1000_random_moves() -> None:
    """Over 50 random mazes with obstacles, with pushes, stops and doors among the moves."""
    stream = Stream(5)
    pushes = stops = opened = appeared = 0
    for _ in range(50):
        layout = random_layout(stream)
        episode = Episode(layout, "T1", "G1", layout.start, random_obstacles(stream, layout, 8))
        with Twin(layout, Camera(pixels=16)) as twin:
            twin.begin(episode)
            assert twin.disagreements(episode) == ()
            for _ in range(20):
                change = episode.step(random_move(stream, episode))
                twin.carry_out(episode, change)
                assert twin.disagreements(episode) == (), (layout, change)
                pushes += change.push is not None
                stops += not change.moved
                opened += change.opened
                appeared += len(change.appeared)
    assert min(pushes, stops, appeared) > 30
    assert opened > 5


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data(), layout=maze_layouts(), actions=st.lists(ACTION_NUMBERS, max_size=25))
def test_grid_and_physics_agree_in_any_maze(data: st.DataObject, layout: Layout, actions: list[int]) -> None:
    """Also with walls and doors on every side of a cell, and when begun in the middle of an episode."""
    episode = Episode(layout, "T1", "G1", layout.start, data.draw(obstacles_in(layout)))
    with Twin(layout, Camera(pixels=16)) as twin:
        twin.begin(episode)
        for action in actions:
            twin.carry_out(episode, episode.step(action))
            assert twin.disagreements(episode) == ()
        twin.begin(episode)
        assert twin.disagreements(episode) == ()


def test_disagreements_name_what_differs(twin: Twin) -> None:
    """A robot left behind, a sphere elsewhere or off its centre, a missing cube and shut doors are told."""
    episode = example_run()
    twin.begin(episode)
    scene = twin._scene
    sphere = twin._bodies["S1"]
    scene.client.resetBasePositionAndOrientation(sphere, (0.5, -3.5 + 0.03, 0.25), (0, 0, 0, 1))
    assert twin.disagreements(episode) == ("S1 is 0.030 m off the centre of 3,0",)
    scene.client.resetBasePositionAndOrientation(sphere, (1.5, -3.5, 0.25), (0, 0, 0, 1))
    assert twin.disagreements(episode) == ("S1 is in 3,1 in physics and in 3,0 in the grid",)
    twin.begin(episode)
    for action in (SOUTH, EAST, SOUTH, SOUTH, SOUTH, SOUTH):  # to the trigger, past C2 and S3
        episode.step(action)
    told = twin.disagreements(episode)
    assert told[0] == "the robot is in 1,0 in physics and in 6,1 in the grid"
    assert "C2 is missing from physics" in told
    assert told[-1] == "the doors are open in the grid only"
    ahead, behind = example_run(), example_run()
    for action in (EAST, WEST):
        ahead.step(action)
    twin.begin(ahead)
    assert twin.disagreements(behind) == ("C2 has not appeared in the grid",)


def test_a_pushed_sphere_rolls() -> None:
    """Friction turns it: its rotation over its path is close to 1 all the way to the wall."""
    turned = path = 0.0
    with Twin(MAZE) as twin:
        episode = example_run()
        twin.begin(episode)
        twin.carry_out(episode, episode.step(SOUTH))
        scene, sphere, step = twin._scene, twin._bodies["S1"], twin._drag

        def watched(start: Cell, share: float) -> None:
            nonlocal turned, path
            before = scene.position(sphere)
            step(start, share)
            after = scene.position(sphere)
            spin_x, spin_y, _ = scene.client.getBaseVelocity(sphere)[1]
            turned += hypot(spin_x, spin_y) * TIME_STEP
            path += hypot(after[0] - before[0], after[1] - before[1])

        twin._drag = watched  # type: ignore[method-assign]
        twin.carry_out(episode, episode.step(SOUTH))
    assert path == pytest.approx(4.0, abs=TOLERANCE)
    assert turned * RADIUS["middle"] / path == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("size", "col"), list(product(SIZES, (2, 5))))
def test_the_robot_stays_behind_the_sphere_it_pushes(size: Size, col: int) -> None:
    """In no physics step do the bodies overlap by more than a step's travel, near or far from the wall."""
    open_maze = replace(MAZE, walls=frozenset(), doors=frozenset())
    episode = Episode(open_maze, "T4", "G2", Cell(1, col - 1), [Obstacle("S", "sphere", Cell(1, col), size)])
    gaps = []
    with Twin(open_maze) as twin:
        twin.begin(episode)
        scene, sphere, step = twin._scene, twin._bodies["S"], twin._drag

        def watched(start: Cell, share: float) -> None:
            step(start, share)
            gaps.append(scene.position(sphere)[0] - scene.position(scene.robot)[0])

        twin._drag = watched  # type: ignore[method-assign]
        twin.carry_out(episode, episode.step(EAST))
    assert gaps[-1] == pytest.approx(7 - col, abs=TOLERANCE)
    assert min(gaps) > RADIUS[size] + ROBOT_RADIUS - 0.04


def test_carrying_out_needs_an_episode(twin: Twin) -> None:
    """A staged twin has no episode to go on with."""
    twin.stage(Cell(1, 1), NORTH, ())
    episode = example_run()
    with pytest.raises(RuntimeError, match="call begin"):
        twin.carry_out(episode, episode.step(SOUTH))


# --- repeatability ---

RUN = [SOUTH, SOUTH, SOUTH, EAST, NORTH, WEST, SOUTH, EAST, SOUTH, SOUTH, EAST]


def test_what_the_twin_did_before_leaves_no_trace(twin: Twin) -> None:
    """Poses and frames after `begin` are bit-equal to those of a new twin."""
    with Twin(MAZE, twin.camera) as new:
        expected = digest(new, example_run(), RUN)
    stream = Stream(8)
    other = Episode(MAZE, "T1", "G1", Cell(7, 3), random_obstacles(stream, MAZE, 9))
    digest(twin, other, [stream.below(4) for _ in range(30)])
    twin.stage(Cell(2, 2), EAST, MAZE.obstacles, doors_open=True)
    assert digest(twin, example_run(), RUN) == expected
    assert digest(twin, example_run(), RUN) == expected
    assert digest(twin, example_run(), RUN[::-1]) != expected


def test_another_process_gives_the_same_bits_and_prints_nothing_else(twin: Twin) -> None:
    """Also, PyBullet's own lines stay off the standard output."""
    code = (
        "from worlds import Episode, load_layout\n"
        "from worlds.camera import Camera\n"
        "from worlds.twin import Twin\n"
        "import hashlib\n"
        "maze = load_layout('two_rooms')\n"
        "episode = Episode(maze, 'T4', 'G2', maze.start, maze.obstacles)\n"
        "found = hashlib.sha256()\n"
        "with Twin(maze, Camera(pixels=96)) as twin:\n"
        "    twin.begin(episode)\n"
        f"    for action in {RUN}:\n"
        "        twin.carry_out(episode, episode.step(action))\n"
        "        found.update(repr(twin.where()).encode())\n"
        "        found.update(twin.frame().tobytes())\n"
        "print(found.hexdigest())\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603 - our own code
    assert ran.stdout.split() == [digest(twin, example_run(), RUN)]


def test_silence_ends(capfd: pytest.CaptureFixture[str]) -> None:
    """What is written meanwhile is lost; what is written before and after is not."""
    os.write(1, b"before\n")
    with silent():
        os.write(1, b"meanwhile\n")
    os.write(1, b"after\n")
    assert capfd.readouterr().out == "before\nafter\n"


def test_closing_removes_the_texture() -> None:
    """No temporary file is left."""
    with Twin(MAZE) as twin:
        texture = twin._scene._texture
        assert texture.is_file()
    assert not texture.parent.exists()


# --- the camera ---


@pytest.mark.parametrize(("kind", "size", "distance"), list(product(KINDS, SIZES, (1, 2))))
def test_all_of_an_obstacle_is_in_the_frame(twin: Twin, kind: Kind, size: Size, distance: int) -> None:
    """One or two cells ahead, of any size, none touches the frame's edge; it stands where geometry says."""
    camera, radius = twin.camera, RADIUS[size]
    corners = [
        camera.project(distance + a * radius, b * radius, height)
        for a, b, height in product((-1, 1), (-1, 1), (0.0, 2 * radius))
    ]
    assert np.min(corners) > 2
    assert np.max(corners) < camera.pixels - 2
    robot = Cell(1, 1)
    obstacle = Obstacle("O", kind, Cell(1 + distance, 1), size, "#ff00ff")
    twin.stage(robot, SOUTH, ())
    empty = twin.frame()
    twin.stage(robot, SOUTH, [obstacle])
    rows, cols = np.nonzero(visible(twin.frame(), empty))
    (left, top), (right, bottom) = np.min(corners, axis=0), np.max(corners, axis=0)
    assert cols.min() >= left - 1
    assert rows.min() >= top - 1
    assert cols.max() <= right + 1
    assert rows.max() <= bottom + 1
    if kind == "cube":
        assert cols.max() - cols.min() == pytest.approx(right - left, abs=2.5)
        assert rows.max() - rows.min() == pytest.approx(bottom - top, abs=2.5)
    else:
        col, row = camera.project(distance, 0.0, radius)
        assert cols.mean() + 0.5 == pytest.approx(col, abs=1)
        assert rows.mean() + 0.5 == pytest.approx(row, abs=1)


@pytest.mark.parametrize("action", range(4))
def test_right_is_right_whichever_way_the_robot_faces(twin: Twin, action: int) -> None:
    """An obstacle ahead and to the right falls where `project` puts it."""
    ahead = DELTAS[action]
    right = (ahead[1], -ahead[0])
    robot = {NORTH: Cell(4, 1), SOUTH: Cell(3, 2), WEST: Cell(4, 7), EAST: Cell(4, 0)}[action]
    at = Cell(robot.row + 2 * ahead[0] + right[0], robot.col + 2 * ahead[1] + right[1])
    twin.stage(robot, action, ())
    empty = twin.frame()
    twin.stage(robot, action, [Obstacle("O", "sphere", at, "small", "#ff00ff")])
    shown = visible(twin.frame(), empty)
    col, row = twin.camera.project(2.0, 1.0, 0.15)
    assert shown[int(row), int(col) - 1]
    assert np.nonzero(shown)[1].mean() > twin.camera.pixels / 2 + 20


def test_project_agrees_with_the_matrices() -> None:
    """A point on the optical axis is the middle of the frame; farther and higher means farther up."""
    camera = Camera(pixels=100, fov=60, height=1.0, forward=0.0, pitch=45)
    assert camera.project(1.0, 0.0, 0.0) == pytest.approx((50, 50))
    # 1 m to the right at a depth of sqrt(2): 50 + 50 x (1 / sqrt 2) / tan 30 degrees
    assert camera.project(1.0, 1.0, 0.0)[0] == pytest.approx(50 + 50 / 2**0.5 * 3**0.5)
    assert camera.project(2.0, 0.0, 0.0)[1] < 50 < camera.project(0.8, 0.0, 0.0)[1]
    with pytest.raises(ValueError, match="not in front"):
        camera.project(-2.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="pixels >= 1"):
        Camera(pixels=0)


def test_the_matrices_are_those_of_pybullet(twin: Twin) -> None:
    """View and projection equal what PyBullet computes from an eye, a target and an angle."""
    client, camera = twin._scene.client, Camera()
    eye = np.array([2.5 - 0.4, -3.5, 1.2])
    look = np.array([np.cos(np.pi / 6), 0, -np.sin(np.pi / 6)])
    view = client.computeViewMatrix(eye.tolist(), (eye + look).tolist(), (0, 0, 1))
    assert camera.view(2.5, -3.5, (1.0, 0.0)).ravel(order="F") == pytest.approx(view, abs=1e-5)
    projection = client.computeProjectionMatrixFOV(camera.fov, 1.0, camera.near, camera.far)
    assert camera.projection.ravel(order="F") == pytest.approx(projection, abs=1e-5)


def test_the_robot_does_not_see_itself(twin: Twin) -> None:
    """Painting the robot's body changes no pixel of its own frame, and some of the overview."""
    twin.stage(Cell(4, 1), EAST, ())
    before, above = twin.frame(), twin.overview(100)
    twin._scene.client.changeVisualShape(twin._scene.robot, -1, rgbaColor=(1, 0, 1, 1))
    assert np.array_equal(twin.frame(), before)
    assert not np.array_equal(twin.overview(100), above)
    twin.begin(example_run())


def test_walls_and_shut_doors_hide_what_is_behind(twin: Twin) -> None:
    """An obstacle behind a wall or a shut door changes no pixel; behind an open door it does."""
    ball = [Obstacle("O", "sphere", Cell(2, 4), "large")]
    wall = [Obstacle("O", "sphere", Cell(3, 4), "large")]

    def seen(row: int, obstacles: list[Obstacle], *, doors_open: bool) -> bool:
        frames = []
        for some in ([], obstacles):
            twin.stage(Cell(row, 3), EAST, some, doors_open=doors_open)
            frames.append(twin.frame())
        return bool(visible(*frames).any())

    assert not seen(3, wall, doors_open=True)
    assert not seen(2, ball, doors_open=False)
    assert seen(2, ball, doors_open=True)


def test_a_wall_may_stand_on_any_side() -> None:
    """A wall to the South and a door to the North block the view as those to the sides do."""
    wall, door = (Cell(4, 1), Cell(5, 1)), (Cell(2, 1), Cell(3, 1))
    with (
        Twin(replace(MAZE, walls=MAZE.walls | {wall}), Camera(pixels=32)) as walled,
        Twin(replace(MAZE, doors=MAZE.doors | {door}), Camera(pixels=32)) as shut,
        Twin(MAZE, Camera(pixels=32)) as plain,
    ):
        frames = {}
        for twin, name in ((walled, "wall"), (shut, "door"), (plain, "plain")):
            for cell, action in ((Cell(4, 1), SOUTH), (Cell(3, 1), NORTH)):
                twin.stage(cell, action, ())
                frames[name, action] = twin.frame().reshape(-1, 3)
    assert np.ptp(frames["wall", SOUTH][:512], axis=0).max() == 0  # one plain surface
    assert np.ptp(frames["plain", SOUTH][:512], axis=0).max() > 50
    assert np.ptp(frames["door", NORTH][:512], axis=0).max() == 0
    red, green, _ = frames["door", NORTH][0]
    assert red > 2 * green
    assert np.array_equal(frames["wall", NORTH], frames["plain", NORTH])


def test_staging_shows_exactly_what_is_staged(twin: Twin) -> None:
    """Frames depend on the staged scene alone, in whatever order scenes are staged."""
    stream = Stream(3)
    scenes = [
        (stream.choose(MAZE.cells), stream.below(4), random_obstacles(stream, MAZE, 3)) for _ in range(12)
    ]

    def frames(order: list[int]) -> dict[int, bytes]:
        found = {}
        for i in order:
            cell, action, obstacles = scenes[i]
            twin.stage(cell, action, obstacles)
            found[i] = twin.frame().tobytes() + twin.overview(64).tobytes()
            assert set(twin.where().obstacles) == {obstacle.name for obstacle in obstacles}
        return found

    order = list(range(len(scenes)))
    assert frames(order) == frames(stream.shuffled(order))


def test_the_overview_has_north_on_top(twin: Twin) -> None:
    """Floor tiles alternate from white at 0,0; doors, obstacles and the robot are where they should be."""
    pixels = 410  # 50 a cell, and 5 around
    twin.stage(Cell(6, 6), SOUTH, [Obstacle("O", "cube", Cell(0, 2), "large", "#00ff00")])
    above = twin.overview(pixels).astype(int)

    def colour(cell: Cell, right: float = 0.0) -> NDArray[np.int64]:
        x, y = centre(cell)
        scale = pixels / 8.2
        return above[int((-y + 0.1) * scale), int((x + right + 0.1) * scale)]

    assert colour(Cell(0, 0)).min() > 200
    red, _, blue = colour(Cell(0, 1))
    assert blue > 2 * red
    assert colour(Cell(1, 1)).min() > 200
    red, green, blue = colour(Cell(0, 2))
    assert green > 2 * max(red, blue)
    assert colour(Cell(6, 6), right=0.1).max() < 100
    red, green, blue = colour(Cell(2, 3), right=0.5)
    assert red > 2 * max(green, blue)


def test_facing_turns_the_robot_at_once(twin: Twin) -> None:
    """`face` moves nothing, and shows the next side."""
    episode = example_run()
    twin.begin(episode)
    before = twin.where()
    north = twin.frame()
    twin.face(SOUTH)
    assert twin.where() == before
    rows, cols = np.nonzero(visible(twin.frame(), north))
    assert rows.size
    assert cols.size
    twin.face(NORTH)
    assert np.array_equal(twin.frame(), north)
