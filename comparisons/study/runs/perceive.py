"""Runs of kind "perceive": one backend looks at frames, clean or spoilt, and is held to the scenes' truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np

from comparisons.learnt import frame_backend
from comparisons.outputs import untracked
from comparisons.perception_study import Score, look, render_frames, score
from comparisons.study.kinds import Kind, Measure, Result
from comparisons.study.runs.settings import NO_CORRUPTION, Setting, check_corruption, completed
from comparisons.study.spec import Value
from perception.calibration import Reliability, reliability
from perception.corruptions import CORRUPTIONS, SEVERITIES, corrupt
from perception.data import SPLITS
from perception.protocol import LABELS, Backend
from perception.pushed import PushedFrames
from perception.registry import backend_names
from perception.variation import CLEAN, Variation
from worlds import UserError
from worlds.camera import Camera

CAMOUFLAGE: Final = "camouflage"
"""A corruption of the scene: obstacles take on the floor's colour."""
_MOST_KEPT: Final = 5000
"""Frames that this process keeps, of 28 kB each; one set may be larger."""
_KEPT: Final[dict[tuple[int, int, Variation], PushedFrames]] = {}
_SCENES: Final = {"clean": CLEAN, "varied": Variation()}
_SETTINGS: Final = {
    "backend": Setting("hough", choices=lambda: [name for name in backend_names() if name != "truth"]),
    "corruption": Setting(NO_CORRUPTION, choices=lambda: (NO_CORRUPTION, CAMOUFLAGE, *CORRUPTIONS)),
    "severity": Setting(0, 0, max(SEVERITIES)),
    "frames": Setting(300, len(LABELS), 10_000),
    "scenes": Setting("clean", choices=lambda: tuple(_SCENES)),
}

MEASURES: Final = (
    Measure("accuracy", "share of frames whose likeliest label is the true one", "", "more", LABELS),
    Measure("abstained", "share of frames on which the backend would rather not tell the shape"),
    Measure(
        "answered_accuracy",
        "share of frames told right, among those on which it does not abstain",
        "",
        "more",
    ),
    Measure("calibration_error", "expected calibration error", "", "less"),
    Measure("wrong_distance", "share of obstacles told a wrong distance, among those told right", "", "less"),
)


def complete(given: Mapping[str, Value]) -> Mapping[str, Value]:
    """Return all settings, checked.

    Raises
    ------
    UserError
        If one is not possible; the message begins with its name.

    Examples
    --------
    >>> complete({"corruption": "jpeg", "severity": 3})["frames"]
    300
    >>> complete({"severity": 3})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: severity: 3 of no corruption; name a corruption, or give 0
    """
    settings = completed(_SETTINGS, given)
    check_corruption(settings)
    try:
        _backend(str(settings["backend"]))
    except UserError as error:
        raise UserError(f"backend: {error}") from error
    return settings


def files(_: Mapping[str, Value]) -> Sequence[str]:
    """Return which settings name files: none."""
    return ()


def run(settings: Mapping[str, Value], seed: int) -> Result:
    """Render a seed's frames, spoil them, let the backend look, and score it.

    Seed n names the test frames of seed 200 + n, which no backend was trained or tuned on.
    """
    wanted = str(settings["corruption"]), int(settings["severity"])
    data = _frames(str(settings["scenes"]), int(settings["frames"]), _test_seed(seed), *wanted)
    seen = look(_backend(str(settings["backend"])), data.frames)
    scored = score(str(settings["backend"]), *wanted, data, seen)
    bins = reliability(seen.probabilities, data.labels)
    columns = _columns(bins)
    details = {"labels": list(LABELS), "confusion": [list(row) for row in scored.confusion]}
    return Result(_measures(scored), {"reliability": columns}, {**details, "reliability": columns})


PERCEIVE: Final = Kind("perceive", 1, MEASURES, complete, files, run, last_seed=len(SPLITS["test"]) - 1)


@cache
def _backend(name: str) -> Backend:
    """Return a backend; loading some takes longer than a run."""
    return frame_backend(name, Camera())


def _test_seed(seed: int) -> int:
    """Return the seed of the frames; there are as many as are kept for tests."""
    seeds = SPLITS["test"]
    if not 0 <= seed < len(seeds):
        raise UserError(f"seed {seed}: there are frames for tests of seeds 0 to {len(seeds) - 1}; use these")
    return seeds[seed]


def _frames(scenes: str, frames: int, seed: int, corruption: str, severity: int) -> PushedFrames:
    """Return frames with the labels of their scenes; severity 0 leaves them as they are."""
    variation = _SCENES[scenes]
    if corruption == CAMOUFLAGE:
        return _rendered(frames, seed, replace(variation, camouflage=severity))
    data = _rendered(frames, seed, variation)
    if not severity:
        return data
    return replace(data, frames=corrupt(corruption, data.frames, severity, seed))


def _rendered(frames: int, seed: int, variation: Variation) -> PushedFrames:
    """Return a set of frames, from the last ones rendered if it is there.

    Rendering takes longest, and every backend and corruption sees the same frames.
    """
    key = frames, seed, variation
    if key not in _KEPT:
        data = render_frames(frames, seed, variation, untracked, "frames").as_described()
        while _KEPT and sum(len(kept) for kept in _KEPT.values()) + frames > _MOST_KEPT:
            del _KEPT[next(iter(_KEPT))]
        _KEPT[key] = data
    return _KEPT[key]


def _measures(scored: Score) -> dict[str, float | None]:
    answered = scored.frames - scored.abstained
    measures: dict[str, float | None] = {
        "accuracy": scored.accuracy,
        "abstained": scored.abstained / scored.frames,
        "answered_accuracy": scored.answered_right / answered if answered else None,
        "calibration_error": scored.calibration_error,
        "wrong_distance": 1 - scored.distance_right / scored.found if scored.found else None,
    }
    for i, (label, row) in enumerate(zip(LABELS, scored.confusion, strict=True)):
        measures[f"accuracy.{label}"] = row[i] / sum(row) if sum(row) else None
    return measures


def _columns(found: Reliability) -> dict[str, list[float | None]]:
    """Return a reliability diagram's bins; None in an empty one."""

    def shown(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float | None]:
        return [None if np.isnan(value) else float(value) for value in values]

    return {
        "middle": ((found.edges[:-1] + found.edges[1:]) / 2).tolist(),
        "confidence": shown(found.confidence),
        "accuracy": shown(found.accuracy),
        "frames": found.counts.tolist(),
    }
