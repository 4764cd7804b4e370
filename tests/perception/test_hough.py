"""Sobel and Hough: synthetic pictures, what it makes of fresh frames, and what its confidence means."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception import Detection, Frame, View, load_backend, measure
from perception.frames import fresh_views
from perception.hough import Hough, _Best, draw
from perception.protocol import Explains
from perception.shapes import Points, cube_corners, sphere_outline
from worlds import ACTIONS, Cell, Kind, Obstacle, load_layout
from worlds.camera import RADIUS, Camera
from worlds.twin import Twin

Colour = tuple[int, int, int]
CAMERA = Camera(pixels=128)
HOUGH = Hough(CAMERA)
MAZE = load_layout("two_rooms")


def checker() -> Frame:
    """Return a floor of blue and white tiles up to the horizon, a plain wall above."""
    frame = np.full((CAMERA.pixels, CAMERA.pixels, 3), (120, 100, 80), np.uint8)
    for row in range(-1, 4):
        for col in range(-4, 4):
            corners = [(row + 0.5 + a, col + 0.5 + b, 0.0) for a, b in ((0, 0), (0, 1), (1, 1), (1, 0))]
            points = np.round([CAMERA.project(*corner) for corner in corners]).astype(np.int32)
            cv2.fillConvexPoly(frame, points, (40, 90, 200) if (row + col) % 2 else (240, 240, 240))
    return frame


def paint(frame: Frame, points: Points, colour: Colour) -> Frame:
    """Fill a polygon."""
    cv2.fillPoly(frame, [np.round(points - 0.5).astype(np.int32)], colour)
    return frame


radii = st.floats(0.1, 0.4)
distances = st.sampled_from([1, 2])
colours = st.tuples(st.integers(150, 255), st.integers(0, 60), st.integers(0, 60))


@settings(max_examples=40, deadline=None)
@given(radius=radii, distance=distances, colour=colours)
def test_disc_on_a_checker_is_a_sphere(radius: float, distance: int, colour: Colour) -> None:
    """A disc as large as a sphere of any radius at either distance is a sphere at that distance."""
    frame = paint(checker(), sphere_outline(CAMERA, distance, radius), colour)
    evidence = HOUGH.explain(frame)
    assert (evidence.detection.label, evidence.detection.distance) == ("sphere", distance)
    col, row, _ = evidence.circle
    at = sphere_outline(CAMERA, distance, radius).mean(axis=0)
    assert np.hypot(col - at[0], row - at[1]) < 4


@settings(max_examples=40, deadline=None)
@given(radius=radii, distance=distances, colour=colours)
def test_box_on_a_checker_is_a_cube(radius: float, distance: int, colour: Colour) -> None:
    """A square front with a top is a cube at its distance, whatever its size."""
    corners = cube_corners(CAMERA, distance, radius)
    frame = paint(checker(), corners, tuple(c * 3 // 4 for c in colour))
    paint(frame, corners[2:], colour)
    evidence = HOUGH.explain(frame)
    assert (evidence.detection.label, evidence.detection.distance) == ("cube", distance)
    assert np.abs(np.array(evidence.box) - corners).max() < 5


@pytest.mark.parametrize("frame", [np.full((128, 128, 3), 90, np.uint8), checker()], ids=["blank", "checker"])
def test_nothing_is_none(frame: Frame) -> None:
    """A blank frame and a bare floor hold nothing, and that is sure."""
    evidence = HOUGH.explain(frame)
    assert evidence.detection.label == "none"
    assert evidence.detection.confidence > 0.95
    assert evidence.box == ()
    assert evidence.circle is None


@pytest.mark.parametrize("shift", [-25, 25])
def test_disc_beside_the_way_is_none(shift: int) -> None:
    """What is not straight ahead is not in the way."""
    outline = sphere_outline(CAMERA, 1, 0.2) + np.array([shift, 0])
    assert HOUGH.explain(paint(checker(), outline, (220, 30, 30))).detection.label == "none"


@pytest.mark.parametrize("lift", [-22, 14])
def test_disc_off_the_floor_is_none(lift: int) -> None:
    """A disc that no sphere resting at one or two cells could look like is refused."""
    outline = sphere_outline(CAMERA, 1, 0.15) + np.array([0, lift])
    assert HOUGH.explain(paint(checker(), outline, (220, 30, 30))).detection.label == "none"


@pytest.mark.parametrize("kind", ["cube", "sphere"])
def test_evidence_grows_with_contrast(kind: Kind) -> None:
    """The fainter the shape on a plain floor, the less evidence for it, down to none."""
    shape = cube_corners(CAMERA, 1, 0.25) if kind == "cube" else sphere_outline(CAMERA, 1, 0.25)
    seen = [
        HOUGH.explain(paint(np.full((128, 128, 3), 100, np.uint8), shape, (100 + step,) * 3))
        for step in (2, 4, 6, 8, 12, 40)
    ]
    evidence = [getattr(one, kind) for one in seen]
    assert evidence == sorted(evidence)
    assert evidence[0] < evidence[-1]
    assert seen[0].detection.label == "none"
    assert seen[-1].detection.label == kind


@given(cube=st.floats(0, 1), sphere=st.floats(0, 1))
def test_detection_is_the_best_evidence(cube: float, sphere: float) -> None:
    """The label is that with the most evidence, and no confidence is below one in three."""
    seen = HOUGH._judge(_Best(cube, 0, 1), _Best(sphere, 0, 2))
    enough = HOUGH.settings.enough
    best = max(cube, sphere, enough)
    assert {"none": enough, "cube": cube, "sphere": sphere}[seen.label] == best
    assert 1 / 3 - 1e-9 <= seen.confidence <= 1


@given(own=st.floats(0.8, 1), more=st.floats(0, 0.2), rival=st.floats(0, 0.7), less=st.floats(0, 0.7))
def test_confidence_is_monotone(own: float, more: float, rival: float, less: float) -> None:
    """Confidence never falls with more evidence for what is seen, nor rises with more for its rival."""

    def trust(cube: float, sphere: float) -> float:
        return HOUGH._judge(_Best(cube, 0, 1), _Best(sphere, None, 1)).confidence

    assert trust(own, rival) <= trust(min(own + more, 1.0), rival)
    assert trust(own, rival) <= trust(own, max(rival - less, 0.0))


@pytest.mark.parametrize("kind", ["cube", "sphere"])
def test_obstacles_three_cells_ahead_are_none(kind: Kind) -> None:
    """An obstacle beyond reach is not taken for one within it."""
    with Twin(MAZE, CAMERA) as twin:
        for size in RADIUS:
            obstacle = Obstacle("far", kind, Cell(4, 1), size, "#e0c020")
            twin.stage(Cell(7, 1), ACTIONS.index("North"), [obstacle])
            assert HOUGH.explain(twin.frame()).detection.label == "none"


@pytest.mark.parametrize("near", ["cube", "sphere"])
@pytest.mark.parametrize("far", ["cube", "sphere"])
def test_the_nearer_of_two_obstacles_is_reported(near: Kind, far: Kind) -> None:
    """Of two obstacles in a row the nearer one is in the way, though the farther one is seen as well."""
    with Twin(MAZE, CAMERA) as twin:
        obstacles = [
            Obstacle("near", near, Cell(6, 1), "small", "#2040c0"),
            Obstacle("far", far, Cell(5, 1), "large", "#e0c020"),
        ]
        twin.stage(Cell(7, 1), ACTIONS.index("North"), obstacles)
        seen = HOUGH.explain(twin.frame()).detection
        assert (seen.label, seen.distance) == (near, 1)


@pytest.mark.parametrize("pixels", [96, 128])
def test_fresh_frames(pixels: int) -> None:
    """On fresh frames at least 95 % of labels, and 97 % of the distances with them, are right."""
    camera = Camera(pixels=pixels)
    result = measure(load_backend("hough", camera), fresh_views(MAZE, 300, seed=2015, camera=camera))
    assert result.accuracy >= 0.95
    assert result.distance_accuracy >= 0.97
    assert min(group["right"] / group["frames"] for group in result.groups.values()) >= 0.85


def test_noisy_frames() -> None:
    """Noise of 8 % of the colour range costs next to nothing, for thresholds rise with it."""
    random = np.random.default_rng(0)
    views = [
        View(
            np.clip(view.frame + random.normal(0, 20, view.frame.shape), 0, 255).astype(np.uint8),
            view.truth,
            view.size,
        )
        for view in fresh_views(MAZE, 90, seed=7, camera=CAMERA)
    ]
    assert measure(HOUGH, views).accuracy >= 0.95


def test_detection_is_a_function_of_the_frame() -> None:
    """The same frame gives the same detection, from the same and from another instance."""
    view = next(fresh_views(MAZE, 1, seed=3, camera=CAMERA))
    first = HOUGH.explain(view.frame)
    Hough(CAMERA).explain(checker())
    assert HOUGH.explain(view.frame) == first == Hough(CAMERA).explain(view.frame)
    assert HOUGH.detect([view]) == [first.detection]


def test_draw_marks_the_frame_without_touching_it() -> None:
    """The drawing is an enlarged copy, with the recognised outline in its colour."""
    frame = paint(checker(), sphere_outline(CAMERA, 1, 0.3), (200, 20, 20))
    before = frame.copy()
    picture = draw(frame, HOUGH.explain(frame), zoom=2)
    assert picture.shape == (256, 256, 3)
    assert np.array_equal(frame, before)
    assert (picture == (255, 230, 0)).all(axis=2).sum() > 50
    box = paint(checker(), cube_corners(CAMERA, 1, 0.3), (200, 20, 20))
    assert (draw(box, HOUGH.explain(box)) == (255, 0, 255)).all(axis=2).sum() > 50


@pytest.mark.parametrize(
    "frame",
    [None, np.zeros((64, 64, 3), np.uint8), np.zeros((128, 128, 3), np.float32)],
    ids=["none", "size", "type"],
)
def test_frames_that_do_not_fit_are_refused(frame: Frame | None) -> None:
    """A missing frame, and one that is not the camera's, are errors that say so."""
    with pytest.raises(ValueError, match="frame"):
        HOUGH.detect([View(frame, Detection("none", 1.0, 0))])


def test_a_sketch_shows_more_than_the_frame() -> None:
    """The backend explains itself: its sketch is the enlarged frame with something drawn upon it."""
    view = next(view for view in fresh_views(MAZE, 3, seed=3, camera=CAMERA) if view.truth.label == "cube")
    assert view.frame is not None
    assert isinstance(HOUGH, Explains)
    sketch = HOUGH.sketch(view.frame)
    plain = cv2.resize(view.frame, sketch.shape[1::-1], interpolation=cv2.INTER_NEAREST)
    changed = (sketch != plain).any(axis=2).mean()
    assert 0 < changed < 0.3
