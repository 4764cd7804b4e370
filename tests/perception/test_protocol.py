"""Detections, the backend that is told the truth, and backends by name."""

import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import EntryPoint
from types import ModuleType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception import (
    LABELS,
    NOTHING,
    Backend,
    Detection,
    Label,
    Truth,
    View,
    backend_names,
    load_backend,
    registry,
)
from worlds import UserError
from worlds.camera import Camera

OURS = ("truth", "hough", "cnn", "hog", "ensemble")


class Pessimist:
    """A backend that sees cubes everywhere."""

    name = "pessimist"
    needs_frames = False

    def __init__(self, camera: Camera) -> None:
        self.camera = camera

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Return a cube for each view."""
        return [Detection("cube", 1.0, 1) for _ in views]


def with_entry_points(monkeypatch: pytest.MonkeyPatch, *points: EntryPoint) -> None:
    """Let the registry find these entry points beside ours."""
    monkeypatch.setattr(registry, "entry_points", lambda group: [p for p in points if p.group == group])


@given(
    label=st.sampled_from([*LABELS, "pyramid"]),
    confidence=st.floats(allow_nan=True),
    distance=st.integers(-1, 4),
)
def test_detection_refuses_contradictions(label: Label, confidence: float, distance: int) -> None:
    """A detection exists exactly if label, confidence and distance fit each other."""
    sound = label in LABELS and 0 <= confidence <= 1 and distance in ((0,) if label == "none" else (1, 2))
    if sound:
        assert Detection(label, confidence, distance).distance == distance
    else:
        with pytest.raises(ValueError, match=r"label|confidence|distance"):
            Detection(label, confidence, distance)


@pytest.mark.parametrize(
    ("label", "confidence", "chances", "problem"),
    [
        ("cube", 0.5, (0.2, 0.5, 0.2), "sum to 1"),
        ("cube", 0.5, (0.5, 0.5), "must be 3 numbers"),
        ("cube", 0.5, (0.75, 0.5, -0.25), "from 0 to 1"),
        ("cube", 0.5, (float("nan"), 0.5, 0.5), "from 0 to 1"),
        ("cube", 0.9, (0.2, 0.6, 0.2), "confidence 0.9 is not the probability of 'cube', 0.6"),
        ("cube", 0.2, (0.2, 0.2, 0.6), "'cube' is not the likeliest"),
    ],
)
def test_probabilities_that_contradict_the_detection_are_refused(
    label: Label, confidence: float, chances: Any, problem: str
) -> None:
    """They sum to 1, give the confidence, and make the label the likeliest."""
    with pytest.raises(ValueError, match=problem):
        Detection(label, confidence, 1, chances)


def test_a_backend_that_abstains_may_name_any_label() -> None:
    """Its label is a guess, and is shown to be one."""
    guess = Detection("cube", 0.25, 1, (0.25, 0.25, 0.5), abstains=True)
    assert guess.chances == (0.25, 0.25, 0.5)
    assert eval(repr(guess), {"Detection": Detection}) == guess  # noqa: S307 - our own words


@given(label=st.sampled_from(LABELS), confidence=st.floats(0, 1))
def test_chances_of_a_bare_confidence_keep_the_label(label: Label, confidence: float) -> None:
    """They sum to 1, the label is the likeliest, and a confidence of a half or more is its chance."""
    chances = Detection(label, confidence, 0 if label == "none" else 1).chances
    own = chances[LABELS.index(label)]
    assert sum(chances) == pytest.approx(1)
    assert all(own > chance for other, chance in zip(LABELS, chances, strict=True) if other != label)
    assert confidence < 0.5 or own == confidence


def test_truth_needs_no_frames_and_never_errs() -> None:
    """Ground truth is returned view by view, without a frame."""
    truths = [NOTHING, Detection("sphere", 1.0, 2), Detection("cube", 1.0, 1)]
    backend = Truth()
    assert not backend.needs_frames
    assert backend.detect([View(None, truth) for truth in truths]) == truths


def test_every_backend_keeps_the_protocol() -> None:
    """Each registered backend is loaded under its own name and has the protocol's members."""
    assert backend_names()[: len(OURS)] == OURS
    for name in backend_names():
        backend = load_backend(name, Camera(pixels=96))
        assert isinstance(backend, Backend)
        assert backend.name == name
        assert backend.detect([]) == []


@pytest.mark.parametrize(
    ("name", "mend"), [("huogh", "did you mean 'hough'?"), ("zebra", f"backends: {', '.join(OURS)}")]
)
def test_unknown_backend_is_told_with_a_mend(name: str, mend: str) -> None:
    """An unknown name is repeated, with the nearest one if there is any, and else all that there are."""
    with pytest.raises(UserError) as caught:
        load_backend(name)
    assert str(caught.value) == f"no perception backend {name!r}; {mend}"


def test_entry_point_adds_a_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another package's factory is found by its entry point and gets the camera."""
    with_entry_points(monkeypatch, EntryPoint("pessimist", "plugin:Pessimist", registry.GROUP))
    plugin = ModuleType("plugin")
    vars(plugin)["Pessimist"] = Pessimist
    monkeypatch.setitem(sys.modules, "plugin", plugin)
    camera = Camera(pixels=32)
    assert backend_names() == (*OURS, "pessimist")
    backend = load_backend("pessimist", camera)
    assert backend.camera is camera
    assert backend.detect([View(None, NOTHING)])[0].label == "cube"


def test_entry_point_cannot_replace_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    """A package that calls its backend 'truth' does not get in the place of ours."""
    with_entry_points(monkeypatch, EntryPoint("truth", "nowhere:Liar", registry.GROUP))
    assert isinstance(load_backend("truth"), Truth)


def test_broken_entry_point_is_a_user_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """A backend that cannot be imported is named with its entry point."""
    with_entry_points(monkeypatch, EntryPoint("broken", "no_such_module_at_all:X", registry.GROUP))
    with pytest.raises(UserError, match=r"'broken' \(no_such_module_at_all:X\)"):
        load_backend("broken")


def test_import_is_light() -> None:
    """Importing the package, and ground truth, loads neither OpenCV nor PyBullet."""
    code = (
        "import sys, perception; perception.load_backend('truth'); "
        "heavy = {'cv2', 'pybullet', 'torch', 'matplotlib', 'sklearn', 'skimage', 'pydantic'}; "
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.strip() == "[]"
