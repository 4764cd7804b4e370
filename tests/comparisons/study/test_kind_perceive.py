"""Runs of kind "perceive": the frames they show, and what they tell of a backend."""

from pathlib import Path

import numpy as np
import pytest

from comparisons.learnt import frame_backend
from comparisons.perception_study import look, score
from comparisons.study.declaring.declaration import load_study
from comparisons.study.running.work import Broke, Ran, work
from comparisons.study.runs import perceive as kind_perceive
from comparisons.study.runs.perceive import PERCEIVE, complete, files, run
from comparisons.study.spec import RunSpec
from perception.corruptions import corrupt
from perception.pushed import pushed_frames
from perception.variation import CLEAN, Variation
from worlds import UserError
from worlds.camera import Camera

FEW = {"frames": 24}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"backend": "truth"}, "backend: 'truth' is not possible; use one of hough, cnn, hog, ensemble"),
        ({"corruption": "jpg"}, "corruption: 'jpg' is not possible; did you mean 'jpeg'?"),
        (
            {"severity": 6, "corruption": "jpeg"},
            "severity: 6 is not possible; give a whole number from 0 to 5",
        ),
        ({"severity": 1}, "severity: 1 of no corruption; name a corruption, or give 0"),
        ({"corruption": "jpeg"}, "severity: 0 of jpeg leaves frames as they are; give 1 or more, or"),
        ({"frames": 2}, "frames: 2 is not possible; give a whole number from 3 to 10000"),
        ({"scenes": "dirty"}, "scenes: 'dirty' is not possible; use one of clean, varied"),
    ],
)
def test_settings_that_are_not_possible_are_refused(given: dict[str, int | str], message: str) -> None:
    """The message begins with the setting's name, and says how to mend it."""
    with pytest.raises(UserError) as caught:
        complete(given)
    assert str(caught.value).startswith(message)


def test_no_setting_names_a_file() -> None:
    """Complete settings stay as they are."""
    settings = complete({"corruption": "jpeg", "severity": 1})
    assert files(settings) == ()
    assert complete(settings) == settings


@pytest.mark.parametrize(
    ("scenes", "corruption", "severity"),
    [("clean", "none", 0), ("varied", "none", 0), ("clean", "gaussian_noise", 5)],
)
def test_a_run_is_a_score_of_the_comparison(scenes: str, corruption: str, severity: int) -> None:
    """Frames, corruption and figures are those of `comparisons.perception_study`, of seed 200 on."""
    data = pushed_frames(range(24), 203, CLEAN if scenes == "clean" else Variation()).as_described()
    frames = corrupt(corruption, data.frames, severity, 203) if severity else data.frames
    expected = score("hough", "", 0, data, look(frame_backend("hough", Camera()), frames))
    found = run(complete({**FEW, "scenes": scenes, "corruption": corruption, "severity": severity}), 3)
    assert found.details["confusion"] == [list(row) for row in expected.confusion]
    assert found.measures["accuracy"] == expected.accuracy
    assert found.measures["calibration_error"] == expected.calibration_error
    assert found.measures["abstained"] == expected.abstained / 24
    for i, label in enumerate(found.details["labels"]):
        row = expected.confusion[i]
        assert found.measures[f"accuracy.{label}"] == row[i] / sum(row)


def test_reliability_says_how_sure_every_frame_was() -> None:
    """The bins hold all frames, and their gaps make the calibration error."""
    found = run(complete({**FEW, "scenes": "varied"}), 0)
    bins = found.details["reliability"]
    assert found.curves["reliability"] == bins
    assert sum(bins["frames"]) == 24
    told = [
        (a, c, n) for a, c, n in zip(bins["accuracy"], bins["confidence"], bins["frames"], strict=True) if n
    ]
    error = sum(n * abs(a - c) for a, c, n in told) / 24
    assert error == pytest.approx(found.measures["calibration_error"])
    assert [a is None for a in bins["accuracy"]] == [n == 0 for n in bins["frames"]]


def test_camouflage_is_rendered() -> None:
    """At severity 5 obstacles have the floor's colour."""
    clean = run(complete(FEW), 0)
    data = kind_perceive._frames("clean", 24, 200, "camouflage", 5)
    there = data.kinds != "none"
    colours, floors = data.colours[there].astype(int)[:, None], data.floors[there].astype(int)
    off = np.abs(colours - floors).max(axis=2).min(axis=1)
    assert there.sum() == 16
    assert off.max() <= 8
    hidden = run(complete({**FEW, "corruption": "camouflage", "severity": 5}), 0)
    assert hidden.measures["calibration_error"] != clean.measures["calibration_error"]


def test_a_seed_beyond_the_test_frames_is_refused() -> None:
    """There are 100 seeds of frames that no backend has learnt from; each shows others."""
    spec = RunSpec("perceive", 1, complete(FEW), 100)
    done = work(spec, "local").outcome
    assert isinstance(done, Broke)
    assert done.message == "seed 100: there are frames for tests of seeds 0 to 99; use these"
    with pytest.raises(UserError, match="seed -1"):
        run(complete(FEW), -1)


def test_frames_are_rendered_once_and_few_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs of the same frames share them, unspoilt; the oldest make room for others."""
    monkeypatch.setattr(kind_perceive, "_KEPT", {})
    monkeypatch.setattr(kind_perceive, "_MOST_KEPT", 50)
    kept = kind_perceive._KEPT
    run(complete(FEW), 0)
    before = kept[24, 200, CLEAN].frames.copy()
    run(complete({**FEW, "corruption": "grey", "severity": 5}), 0)
    assert list(kept) == [(24, 200, CLEAN)]
    assert np.array_equal(kept[24, 200, CLEAN].frames, before)
    run(complete(FEW), 1)
    run(complete(FEW), 2)
    assert list(kept) == [(24, 201, CLEAN), (24, 202, CLEAN)]


def test_results_are_plain_and_described() -> None:
    """A store takes them as they are, and each measure has its words."""
    done = work(RunSpec("perceive", 1, complete(FEW), 1), "local").outcome
    assert isinstance(done, Ran)
    assert all(PERCEIVE.measure(name).name == name for name in done.result.measures)


def test_the_ready_study_can_begin() -> None:
    """It compares every backend of ours that reads frames; frames that are not spoilt count once."""
    study = load_study(Path(__file__).parents[3] / "examples" / "studies" / "perception.yaml")
    assert (study.kind, study.runs) == ("perceive", 760)
    levels = [one.levels for one in study.expand()]
    assert {one["backend"] for one in levels} == {"hough", "hog", "cnn", "ensemble"}
    assert {one["severity"] for one in levels} == {"0", "1", "3", "5"}
    assert all((one["severity"] == "0") == (one["corruption"] == "none") for one in levels)
