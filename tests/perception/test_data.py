"""Data sets: labels by pushing, the same bytes however they are made, and no damage unnoticed."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception import LABELS, pushed
from perception.data import CLEAN, SPLITS, PushedFrames, Variation, load_data, make_data, split_of
from perception.pushed import COLUMNS, odometry, pushed_frames
from perception.variation import FAMILIES, MAZES, maze, push_scene
from worlds import MazeState, UserError, ahead
from worlds.bullet import UNKNOWN_FORMS
from worlds.camera import RADIUS


def same(a: PushedFrames, b: PushedFrames) -> bool:
    """Return whether two data sets are equal in every column."""
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in COLUMNS)


@pytest.fixture(scope="module")
def data() -> PushedFrames:
    """Return thirty frames in which everything varies."""
    return pushed_frames(range(30), 250, Variation())


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 299), number=st.integers(0, 10_000), distract=st.booleans())
def test_only_what_the_scene_says_is_within_reach(seed: int, number: int, distract: bool) -> None:
    """On the free cells ahead stands what the scene names; others are off the way or beyond reach."""
    scene = push_scene(seed, number, Variation(distractors=distract))
    layout = maze(scene.maze)
    state = MazeState(layout.number(scene.robot), 0, 0, scene.doors_open)
    at = {layout.number(obstacle.cell): obstacle for obstacle in scene.obstacles}
    assert len(at) == len(scene.obstacles)
    assert state.robot not in at
    reach = [ahead(layout, state, scene.action, distance) for distance in (1, 2)]
    found = [(scene.forms[at[cell].name], k) for k, cell in enumerate(reach, 1) if cell in at]
    assert found == ([] if scene.family is None else [(scene.family, scene.distance)])


def test_everything_varies() -> None:
    """Over 600 scenes, thirds are exact and each thing that may vary does."""
    scenes = [push_scene(3, number, Variation()) for number in range(600)]
    families = [scene.family for scene in scenes]
    assert [families.count(f) for f in (None, "cube", "sphere")] == [200, 200, 200]
    there = [scene for scene in scenes if scene.family is not None]
    assert {(s.family, s.distance, s.obstacles[0].size) for s in there} == {
        (family, distance, size) for family in ("cube", "sphere") for distance in (1, 2) for size in RADIUS
    }
    assert {scene.maze for scene in scenes} == set(range(MAZES))
    assert len({scene.look for scene in scenes}) == 600
    assert {len(s.obstacles) - (s.family is not None) for s in scenes} >= {0, 1, 2, 3}
    assert min(s.friction for s in there) < 0.1
    assert max(s.friction for s in there) > 0.8


def test_clean_scenes_are_the_papers() -> None:
    """Without variation there is one maze, one look, no turned cube and nothing beside the way."""
    scenes = [push_scene(3, number, CLEAN) for number in range(90)]
    assert {(scene.maze, scene.look) for scene in scenes} == {(0, scenes[0].look)}
    assert all(len(scene.obstacles) == (scene.family is not None) for scene in scenes)
    assert {yaw for scene in scenes for yaw in scene.yaws.values()} == {0.0}


def test_one_kind_of_variation_leaves_the_others_alone() -> None:
    """Turning rotation off keeps place, paint and push: what differs between the two sets is the turn."""
    for number in range(30):
        turned, square = (push_scene(3, number, Variation(rotation=on)) for on in (True, False))
        assert (turned.robot, turned.look, turned.obstacles) == (square.robot, square.look, square.obstacles)
        assert turned.friction == square.friction


@pytest.mark.parametrize("severity", [1, 5])
def test_camouflage_brings_the_colour_near_the_floors(severity: int) -> None:
    """At severity 5 every channel is within 8 of one of the floor's colours, at 1 it need not be."""
    near = []
    for number in range(60):
        scene = push_scene(3, number, Variation(camouflage=severity))
        if scene.family is not None:
            own = np.array(list(bytes.fromhex(scene.obstacles[0].colour[1:])), int)
            floors = [np.array(list(bytes.fromhex(colour[1:])), int) for colour in scene.look.floor]
            near.append(min(np.abs(own - floor).max() for floor in floors))
    assert max(near) <= 8 if severity == 5 else max(near) > 40


def test_labels_are_what_the_push_did(data: PushedFrames) -> None:
    """What rolls is a sphere, what does not a cube, what is not met none; the scene's word is not asked."""
    by_push = {"rolls": "sphere", "slides": "cube", "topples": "cube", "stays": "cube", "nothing": "none"}
    assert [LABELS[label] for label in data.labels] == [by_push[push] for push in data.pushes.tolist()]
    assert ((data.kinds == "none") == (data.pushes == "nothing")).all()
    assert ((data.distances == 0) == (data.labels == 0)).all()


def test_a_sphere_that_skids_is_labelled_as_it_behaves(monkeypatch: pytest.MonkeyPatch) -> None:
    """On ice at 1 m/s a sphere slides, so the robot calls it a cube; agreement counts it as wrong."""
    real = push_scene
    monkeypatch.setattr(
        pushed, "push_scene", lambda *args: replace(real(*args), friction=0.02, speed=1.0, offset=0.0)
    )
    iced = pushed.pushed_frames(range(6), 0, CLEAN)
    spheres = iced.kinds == "sphere"
    assert spheres.sum() == 2
    assert (iced.pushes[spheres] == "slides").all()
    assert (iced.labels[spheres] == LABELS.index("cube")).all()
    assert iced.agreement == pytest.approx(4 / 6)


@given(size=st.sampled_from(sorted(RADIUS)), cells=st.integers(1, 2), slip=st.floats(-0.03, 0.03))
def test_odometry_finds_the_cell(size: str, cells: int, slip: float) -> None:
    """Touching an obstacle of any size tells its cell, though the wheels count up to 3 % wrong."""
    assert odometry(cells - RADIUS[size] - 0.22, slip) == cells  # type: ignore[index]


def test_solids_never_seen_do_not_roll() -> None:
    """Cylinders, cones and the like come as often as each other, and every push calls them unrollable."""
    unknown = pushed_frames(range(36), 201, Variation(families=UNKNOWN_FORMS))
    there = unknown.kinds[unknown.kinds != "none"].tolist()
    assert {kind: there.count(kind) for kind in there} == dict.fromkeys(UNKNOWN_FORMS, 4)
    assert set(unknown.labels[unknown.kinds != "none"].tolist()) == {LABELS.index("cube")}
    assert unknown.agreement == 1.0


def test_frame_i_is_its_own(data: PushedFrames) -> None:
    """Frames 20 to 29 alone are those of the thirty, and another seed's are different."""
    assert same(pushed_frames(range(20, 30), 250, Variation()), data[20:])
    other = pushed_frames(range(20, 22), 251, Variation())
    assert not np.array_equal(other.frames, data.frames[20:22])


def test_shards_change_nothing(tmp_path: Path, data: PushedFrames) -> None:
    """In shards of 30, 7 or 4, the data loaded are the same."""
    for shard in (30, 7, 4):
        made: list[int] = []
        make_data(tmp_path / str(shard), 30, 250, shard=shard, progress=made.append)
        assert same(load_data(tmp_path / str(shard)), data)
        assert made[-1] == 30
        assert len(made) == -(-30 // shard)


def bytes_of(folder: Path) -> dict[str, bytes]:
    """Return every file of a folder that is not hidden."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if not path.name.startswith(".")}


def test_killed_and_resumed(tmp_path: Path) -> None:
    """A run killed outright in the middle goes on where it stood and ends with the same files."""
    make_data(tmp_path / "whole", 60, 0, shard=6)
    code = f"from perception.data import make_data; make_data({str(tmp_path / 'killed')!r}, 60, 0, shard=6)"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.DEVNULL)  # noqa: S603
    until = time.monotonic() + 60
    while not (tmp_path / "killed" / "shard-000002.npz").exists():
        assert time.monotonic() < until
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    with pytest.raises(UserError, match="of 60 frames are made"):
        load_data(tmp_path / "killed")
    made: list[int] = []
    make_data(tmp_path / "killed", 60, 0, shard=6, progress=made.append)
    assert made[0] > 6  # the first shard at least was kept
    assert bytes_of(tmp_path / "killed") == bytes_of(tmp_path / "whole")


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Return the folder of a data set of six frames in two shards."""
    make_data(tmp_path / "set", 6, 100, shard=3)
    return tmp_path / "set"


def test_damage_is_noticed_and_mended(small: Path) -> None:
    """A changed byte or a missing shard is an error when loading, and making goes on from there."""
    whole = bytes_of(small)
    shard = small / "shard-000001.npz"
    shard.write_bytes(whole[shard.name][:-5000] + bytes(5000))
    with pytest.raises(UserError, match="damaged"):
        load_data(small)
    make_data(small, 6, 100, shard=3)
    assert bytes_of(small) == whole
    shard.unlink()
    with pytest.raises(UserError, match="damaged"):
        load_data(small)


@pytest.mark.parametrize("pickled", [True, False])
def test_a_hostile_shard_is_refused(small: Path, pickled: bool) -> None:
    """A shard of pickled objects, or of the wrong shape, is refused though its checksum is right."""
    shard = small / "shard-000000.npz"
    whole = dict(np.load(shard))
    whole["labels"] = np.array([object()] * 3) if pickled else whole["labels"][:2]
    np.savez(shard, **whole)
    manifest = json.loads((small / "manifest.json").read_text())
    manifest["shards"][0]["sha256"] = hashlib.sha256(shard.read_bytes()).hexdigest()
    (small / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(UserError, match="damaged"):
        load_data(small)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frames": 0}, "frames: Input should be greater"),
        ({"seed": "a"}, "seed: Input should be a valid integer"),
        ({"format": "other"}, "format"),
        ({"shards": [{"file": "../shard-000000.npz", "sha256": "0" * 64}]}, r"shards\.0\.file"),
        ({"shards": [{"file": "shard-000001.npz", "sha256": "0" * 64}]}, "not numbered from 0"),
        ({"surplus": 1}, "surplus"),
    ],
)
def test_a_wrong_manifest_is_refused(small: Path, change: dict[str, object], message: str) -> None:
    """A manifest that is not what make_data writes is an error that names the place."""
    manifest = json.loads((small / "manifest.json").read_text())
    (small / "manifest.json").write_text(json.dumps(manifest | change))
    with pytest.raises(UserError, match=message):
        load_data(small)


def test_other_data_are_not_overwritten(small: Path) -> None:
    """Another seed, number or variation in the same folder is refused, and nothing there changes."""
    whole = bytes_of(small)
    for n, seed, variation in ((6, 101, Variation()), (9, 100, Variation()), (6, 100, CLEAN)):
        with pytest.raises(UserError, match="holds other data"):
            make_data(small, n, seed, variation, shard=3)
    assert bytes_of(small) == whole


def test_no_data_is_an_error(tmp_path: Path) -> None:
    """A folder without a manifest is no data set, and a file is no folder."""
    with pytest.raises(UserError, match="give a folder that make_data made"):
        load_data(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="can be written"):
        make_data(tmp_path / "file", 3, 0)


def test_parts_share_no_seed(small: Path) -> None:
    """Training, tuning and test seeds are apart, and data of one part are refused as another's."""
    seeds = [seed for part in SPLITS.values() for seed in part]
    assert len(seeds) == len(set(seeds)) == 300
    assert len(load_data(small, "tuning")) == 6
    with pytest.raises(UserError, match="give data of the test part"):
        load_data(small, "test")
    for seed in (-1, 300):
        with pytest.raises(UserError, match="belongs to no part"):
            split_of(seed)


@pytest.mark.parametrize(("n", "shard"), [(0, 5), (5, 0), (2_000_000, 5)])
def test_wrong_numbers_are_refused(tmp_path: Path, n: int, shard: int) -> None:
    """No frames, too many, or empty shards are refused."""
    with pytest.raises(UserError, match="a data set has 1 to"):
        make_data(tmp_path, n, 0, shard=shard)


@pytest.mark.parametrize(
    "wrong", [{"camouflage": 6}, {"camouflage": -1}, {"families": ()}, {"families": ("egg",)}]
)
def test_wrong_variation_is_refused(wrong: dict[str, object]) -> None:
    """Severities out of range and solids that nobody knows are refused."""
    with pytest.raises(UserError, match=r"camouflage is 0|use one or more of"):
        Variation(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("share", [0.0, 0.1, 0.2, 1.0])
def test_wrong_labels_are_as_many_as_asked(data: PushedFrames, share: float) -> None:
    """The share of labels changed is the share asked for, the same for a seed, another for another."""
    wrong = data.mislabelled(share, 1)
    assert (wrong.labels != data.labels).sum() == round(30 * share)
    assert ((wrong.distances == 0) == (wrong.labels == 0)).all()
    assert np.array_equal(wrong.labels, data.mislabelled(share, 1).labels)
    assert np.array_equal(wrong.frames, data.frames)
    if share == 0.2:
        assert not np.array_equal(wrong.labels, data.mislabelled(share, 2).labels)


def test_described_frames_are_labelled_by_the_scene(data: PushedFrames) -> None:
    """Whatever the pushes said, labels and distances are then what stands there."""
    described = data.mislabelled(0.5, 1).as_described()
    assert described.agreement == 1.0
    assert [LABELS[label] for label in described.labels.tolist()] == data.kinds.tolist()
    assert np.array_equal(described.distances, data.true_distances)
    assert np.array_equal(described.pushes, data.pushes)


def test_a_share_beyond_all_is_refused(data: PushedFrames) -> None:
    """More wrong labels than labels cannot be."""
    with pytest.raises(UserError, match="from 0 to 1"):
        data.mislabelled(1.1, 0)


def test_families_begin_with_the_kinds() -> None:
    """What layouts know comes first; the rest has never been seen."""
    assert tuple(FAMILIES) == ("cube", "sphere", *UNKNOWN_FORMS)
