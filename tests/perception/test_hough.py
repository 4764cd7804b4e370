"""Sobel and Hough: synthetic pictures, what it makes of fresh frames, and what its confidence means."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from perception import Detection, Frame, View, load_backend, measure
from perception.corruptions import corrupt
from perception.frames import fresh_views
from perception.hough import Hough, cleared
from perception.hough_drawing import draw
from perception.protocol import LABELS, Explains
from perception.shapes import Points, cube_corners, sphere_outline
from perception.tuning import TuningSet, fit_weights, worsened
from perception.weighing import weigh
from worlds import ACTIONS, Cell, Kind, Obstacle, UserError, load_layout
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
    """A square front with a top is a cube at its distance, and where it stands, whatever its size."""
    corners = cube_corners(CAMERA, distance, radius)
    frame = paint(checker(), corners, tuple(c * 3 // 4 for c in colour))
    paint(frame, corners[3:], colour)
    evidence = HOUGH.explain(frame)
    assert (evidence.detection.label, evidence.detection.distance) == ("cube", distance)
    # It may be taken for a cube that is turned a little, and has other corners about the same middle.
    off = np.array(evidence.box).mean(axis=0) - corners.mean(axis=0)
    assert np.abs(off).max() < 4 + 0.15 * np.ptp(corners, axis=0).max()


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
    """The fainter the shape beside the contrast elsewhere, the less evidence for it, down to none."""
    plain = np.full((128, 128, 3), 100, np.uint8)
    plain[:8], plain[8:16] = 0, 255
    shape = cube_corners(CAMERA, 1, 0.25) if kind == "cube" else sphere_outline(CAMERA, 1, 0.25)
    seen = [HOUGH.explain(paint(plain.copy(), shape, (100 + step,) * 3)) for step in (2, 4, 6, 8, 12, 40)]
    evidence = [getattr(one, kind) for one in seen]
    assert evidence == sorted(evidence)
    assert evidence[0] < evidence[-1]
    assert seen[0].detection.label == "none"
    assert seen[-1].detection.label == kind


evidence = st.floats(0, 1)


def trust(cube: float, sphere: float, cell: int) -> NDArray[np.float64]:
    """Return the probabilities for proposed shapes in one cell, and next to nothing elsewhere."""
    features = np.tile(np.array([1.0, 0.2, 0.0, 0.2, 0.0, 0.1]), (1, 2, 1))
    features[0, cell, 1:5] = cube, cube, sphere, sphere
    return HOUGH.judge(features).probabilities[0]


@given(cube=evidence, more=evidence, sphere=evidence, less=evidence, cell=st.integers(0, 1))
def test_confidence_is_monotone(cube: float, more: float, sphere: float, less: float, cell: int) -> None:
    """No kind gets less likely with more evidence for it, nor likelier with more for its rival."""
    seen = trust(cube, sphere, cell)
    assert trust(max(cube, more), sphere, cell)[1] >= seen[1] - 1e-9
    assert trust(cube, max(sphere, more), cell)[2] >= seen[2] - 1e-9
    assert trust(cube, min(sphere, less), cell)[1] >= seen[1] - 1e-9
    assert trust(min(cube, less), sphere, cell)[2] >= seen[2] - 1e-9


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
    """On fresh frames at least 99 % of labels and of the distances with them are right."""
    camera = Camera(pixels=pixels)
    result = measure(load_backend("hough", camera), fresh_views(MAZE, 300, seed=2015, camera=camera))
    assert result.accuracy >= 0.99
    assert result.distance_accuracy >= 0.99
    assert min(group["right"] / group["frames"] for group in result.groups.values()) >= 0.97


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
    with pytest.raises(ValueError if frame is None else UserError, match="frame"):
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


@pytest.mark.parametrize("yaw", range(0, 90, 15))
@pytest.mark.parametrize("distance", [1, 2])
def test_turned_cubes_are_cubes(yaw: int, distance: int) -> None:
    """However a cube is turned and however large it is, it is a cube, and its outline is found."""
    with Twin(MAZE, CAMERA) as twin:
        for size, radius in RADIUS.items():
            cube = Obstacle("ahead", "cube", Cell(7 - distance, 1), size, "#c03020")
            twin.stage(Cell(7, 1), ACTIONS.index("North"), [cube], yaws={"ahead": float(yaw)})
            seen = HOUGH.explain(twin.frame())
            assert (seen.detection.label, seen.detection.distance) == ("cube", distance)
            # The bodies' yaw counts to the left, the outline's to the right.
            outline = cube_corners(CAMERA, distance, radius, -yaw % 90)
            low, high = np.array(seen.box).min(axis=0), np.array(seen.box).max(axis=0)
            assert np.abs(outline.min(axis=0) - low).max() < 6
            assert np.abs(outline.max(axis=0) - high).max() < 6


@given(yaw=st.floats(0, 90), radius=radii, distance=distances)
def test_corners_go_round_the_cube(yaw: float, radius: float, distance: int) -> None:
    """The corners are the convex hull of all eight, and turning by a right angle changes nothing."""
    corners = cube_corners(CAMERA, distance, radius, yaw)
    turns = np.radians(yaw + 45 + 90 * np.arange(4))
    every = [
        CAMERA.project(distance + radius * 2**0.5 * np.cos(t), radius * 2**0.5 * np.sin(t), height)
        for t in turns
        for height in (0.0, 2 * radius)
    ]
    hull = cv2.contourArea(cv2.convexHull(np.array(every, np.float32)))
    assert cv2.contourArea(corners.astype(np.float32)) == pytest.approx(hull, rel=1e-3)
    again = cube_corners(CAMERA, distance, radius, yaw + 90)
    assert cv2.contourArea(again.astype(np.float32)) == pytest.approx(hull, rel=1e-3)


@pytest.mark.parametrize("name", ["dim_light", "low_contrast", "salt_and_pepper"])
def test_poor_frames(name: str) -> None:
    """Little light, little contrast and specks, of middling severity, cost at most 3 %."""
    views = list(fresh_views(MAZE, 90, seed=11))
    frames = corrupt(name, np.stack([view.frame for view in views]), 3, seed=11)
    truth = [LABELS.index(view.truth.label) for view in views]
    assert (Hough(Camera()).perceive(frames).labels == truth).mean() >= 0.97


def test_perceiving_a_batch_is_explaining_each_frame() -> None:
    """A batch gives what its frames give alone, and probabilities sum to 1."""
    frames = np.stack([view.frame for view in fresh_views(MAZE, 6, seed=5, camera=CAMERA)])
    seen = HOUGH.perceive(frames)
    assert seen.detections() == [HOUGH.explain(frame).detection for frame in frames]
    assert np.allclose(seen.probabilities.sum(axis=1), 1)
    assert not seen.abstains.any()


def test_clearing_keeps_what_needs_none() -> None:
    """A frame of full contrast without specks is left as it is; a stretch of 1 only shifts colours."""
    frame = np.zeros((30, 30, 3), np.uint8)
    frame[10:] = 120
    frame[20:] = 255
    assert np.array_equal(cleared(frame, 3, 8.0), frame)
    assert np.array_equal(cleared(frame // 2 + 20, 1, 1.0), frame // 2)


def noisy_features(n: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return features in which evidence for what is there runs high, with overlap, and the truth."""
    random = np.random.default_rng(seed)
    labels, distances = np.arange(n) % 3, 1 + np.arange(n) // 3 % 2
    features = np.zeros((n, 2, 6))
    features[..., 0] = 1
    features[..., 1::2] = random.normal(0.4, 0.1, (n, 2, 3)).clip(0, 1)
    there = labels > 0
    features[np.flatnonzero(there), distances[there] - 1, 2 * labels[there] - 1] += 0.25
    features[..., 2] = features[..., 1] * (features[..., 1] > 0.5)
    features[..., 4] = features[..., 3] * (features[..., 3] > 0.5)
    features[..., 5] = random.uniform(0, 1, (n, 2))
    return features, labels.astype(np.int64), distances.astype(np.int64)


def test_fitted_probabilities_are_calibrated() -> None:
    """On features drawn like those that it was fitted to, the softmax is as often right as it says."""
    weights = fit_weights(*noisy_features(3000, seed=1))
    features, labels, _ = noisy_features(3000, seed=2)
    probabilities, _ = weigh(features, weights)
    right = probabilities.argmax(axis=1) == labels
    assert 0.6 < right.mean() < 0.98
    assert abs(probabilities.max(axis=1).mean() - right.mean()) < 0.03
    sure = probabilities.max(axis=1) > 0.9
    assert abs(probabilities[sure].max(axis=1).mean() - right[sure].mean()) < 0.03


def test_fitted_constants_keep_their_signs() -> None:
    """Even where the labels are drawn at random, evidence speaks for its kind and against its rival."""
    features, _, distances = noisy_features(600, seed=3)
    labels = np.random.default_rng(4).integers(0, 3, 600)
    for cube, sphere in fit_weights(features, labels, distances):
        assert min(cube[1:3] + sphere[3:5]) >= 0
        assert max(cube[3:5] + sphere[1:3]) <= 0


def test_worsened_frames_follow_their_originals() -> None:
    """A tuning set is doubled by corrupted copies in the same order, the same ones each time."""
    frames = np.stack([view.frame for view in fresh_views(MAZE, 6, seed=5)])
    data = TuningSet(frames, np.array([0, 1, 2, 0, 1, 2]), np.array([1, 1, 2, 1, 2, 1]))
    twice = worsened(data, seed=3)
    assert np.array_equal(twice.frames[:6], frames)
    assert twice.labels[6:].tolist() == data.labels.tolist()
    assert twice.distances[6:].tolist() == data.distances.tolist()
    assert all((a != b).any() for a, b in zip(frames, twice.frames[6:], strict=True))
    assert np.array_equal(worsened(data, seed=3).frames, twice.frames)
    assert np.array_equal(worsened(TuningSet(*(x[:3] for x in data)), seed=3).frames[3:], twice.frames[6:9])
