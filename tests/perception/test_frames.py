"""Fresh scenes: their truth holds in the maze, and they depend on seed and number alone."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from perception import Detection
from perception.frames import fresh_scene, fresh_views
from worlds import Cell, MazeState, Obstacle, UserError, ahead, load_layout, parse_layout
from worlds.bullet import Form, turned_mesh
from worlds.camera import Camera
from worlds.scene import Look
from worlds.twin import Twin

MAZE = load_layout("two_rooms")


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**40), number=st.integers(0, 10_000))
def test_truth_is_what_stands_first_on_the_way(seed: int, number: int) -> None:
    """What the maze's own geometry finds on the free cells ahead is what the scene says, and no more."""
    scene = fresh_scene(MAZE, seed, number)
    state = MazeState(MAZE.number(scene.robot), 0, 0, scene.doors_open)
    kinds = {MAZE.number(obstacle.cell): obstacle.kind for obstacle in scene.obstacles}
    assert len(kinds) == len(scene.obstacles)
    assert state.robot not in kinds
    line = [ahead(MAZE, state, scene.action, distance) for distance in range(1, 8)]
    seen = [(kinds[cell], distance) for distance, cell in enumerate(line, 1) if cell in kinds]
    expected = [] if scene.truth.label == "none" else [(scene.truth.label, scene.truth.distance)]
    assert seen == expected


def test_thirds_sizes_and_doors() -> None:
    """Labels come in exact thirds; sizes, distances, doors, headings and others all vary."""
    scenes = [fresh_scene(MAZE, 3, number) for number in range(300)]
    labels = [scene.truth.label for scene in scenes]
    assert {label: labels.count(label) for label in labels} == {"none": 100, "cube": 100, "sphere": 100}
    there = [scene for scene in scenes if scene.truth.label != "none"]
    assert {(s.truth.label, s.truth.distance, s.obstacles[0].size) for s in there} == {
        (kind, distance, size)
        for kind in ("cube", "sphere")
        for distance in (1, 2)
        for size in ("small", "middle", "large")
    }
    assert {scene.doors_open for scene in scenes} == {True, False}
    assert {scene.action for scene in scenes} == {0, 1, 2, 3}
    assert {len(s.obstacles) - (s.truth.label != "none") for s in scenes} == {0, 1, 2}
    assert len({scene.obstacles[0].colour for scene in there}) > 190


def test_views_show_their_scenes_and_repeat() -> None:
    """The first views of a longer stream are the stream's, bit by bit; another seed gives others."""
    camera = Camera(pixels=48)
    few, many = list(fresh_views(MAZE, 4, 5, camera)), list(fresh_views(MAZE, 7, 5, camera))
    for number, (one, other) in enumerate(zip(few, many, strict=False)):
        assert np.array_equal(one.frame, other.frame)
        assert one.truth == other.truth == fresh_scene(MAZE, 5, number).truth
        assert (one.size is None) == (one.truth.label == "none")
    assert not any(np.array_equal(a.frame, b.frame) for a, b in pairwise(many))
    other_seed = next(fresh_views(MAZE, 1, 6, camera))
    assert not np.array_equal(other_seed.frame, many[0].frame)


def test_narrow_maze() -> None:
    """Where no two cells lie ahead in a row, obstacles stand one cell ahead."""
    pair = parse_layout("name pair\ngrid\nT1 G1\nstart 0,1\ntrigger T1\ngoal G1\n")
    distances = {fresh_scene(pair, 1, number).truth.distance for number in range(30)}
    assert distances == {0, 1}
    row = parse_layout("name row\ngrid\nT1 . G1\nstart 0,1\ntrigger T1\ngoal G1\n")
    assert Detection("cube", 1.0, 2) in {fresh_scene(row, 1, number).truth for number in range(30)}


def test_maze_without_room_is_refused() -> None:
    """A maze of one free cell has no way ahead at all."""
    pair = parse_layout("name pair\ngrid\nT1 G1\nstart 0,1\ntrigger T1\ngoal G1\n")
    lone = replace(pair, solid=frozenset([pair.triggers["T1"]]))
    with pytest.raises(UserError, match="two free cells"):
        [fresh_scene(lone, 1, number) for number in range(3)]


CUBE = Obstacle("box", "cube", Cell(3, 1))


def staged(twin: Twin, yaw: float = 0.0, form: Form = "cube") -> NDArray[np.uint8]:
    """Return what the robot sees of a cube, or another solid, two cells ahead."""
    twin.stage(Cell(5, 1), 0, [CUBE], yaws={"box": yaw}, forms={"box": form})
    return twin.frame()


def test_paint_light_turn_and_form_show_and_go_again() -> None:
    """Each changes the frame; painted as the paper has it, the twin shows what a new one shows."""
    with Twin(MAZE, Camera(pixels=48)) as twin:
        plain = staged(twin)
        looks = [
            Look(floor=("#f0f0f0", "#20c83c")),
            Look(floor=("#101010", "#2e5cc8")),
            Look(walls="#ff0000"),
            Look(ambient=0.3),
            Look(diffuse=0.2),
            Look(tint=(1.0, 0.5, 0.5)),
            Look(lamp=(-0.5, -0.9, 1.0)),
        ]
        seen = [plain, staged(twin, yaw=30.0), staged(twin, form="dome")]
        for look in looks:
            twin.paint(look)
            seen.append(staged(twin))
        assert len({frame.tobytes() for frame in seen}) == len(seen)
        twin.paint(Look())
        assert np.array_equal(staged(twin), plain)


def test_the_floor_has_the_colours_it_is_given() -> None:
    """In full ambient light the two cells ahead are of just the two colours, cell (0, 0) the first."""
    with Twin(MAZE, Camera(pixels=48)) as twin:
        twin.paint(Look(floor=("#c80000", "#006400"), ambient=1.0, diffuse=0.0))
        twin.stage(Cell(5, 1), 0, [])  # (4, 1) ahead is odd, (3, 1) even
        frame = twin.frame()
        near, far = frame[-2, 24], frame[22, 24]
        assert near.tolist() == pytest.approx([0, 100, 0], abs=3)
        assert far.tolist() == pytest.approx([200, 0, 0], abs=3)


def test_a_turned_solid_is_closed_and_its_normals_look_outwards() -> None:
    """A cylinder's triangles add up to its volume, counted outwards, as the divergence theorem has it."""
    mesh = turned_mesh([(0.5, -1.0), (0.5, 1.0)], 64)
    corners = np.array(mesh.vertices)[np.array(mesh.indices).reshape(-1, 3)]
    normals = np.array(mesh.normals)[np.array(mesh.indices).reshape(-1, 3)[:, 0]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (across * normals).sum(axis=1).min() > 0
    volume = (corners[:, 0] * across).sum() / 6
    assert volume == pytest.approx(np.pi * 0.25 * 2, rel=0.01)
