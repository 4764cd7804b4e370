"""The part of the comparison that looks at frames: every backend at every set, one set at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from comparisons.outputs import Track
from comparisons.perception_spec import StudySpec
from comparisons.perception_study import (
    CAMOUFLAGE,
    SCENES,
    UNKNOWN,
    VARIED,
    Group,
    Mistake,
    Score,
    Seen,
    Strangers,
    look,
    render_frames,
    score,
)
from perception.audit import hues
from perception.calibration import Reliability, reliability
from perception.corruptions import CORRUPTIONS, corrupt
from perception.percepts import Percepts
from perception.protocol import LABELS, Backend
from perception.pushed import PushedFrames
from perception.variation import CLEAN, Variation

_TIMED: Final = 60  # frames looked at one by one for the latency
_NONE, _SPHERE = LABELS.index("none"), LABELS.index("sphere")


@dataclass(eq=False)
class _Ledger:
    """What is found out while looking."""

    scores: list[Score] = field(default_factory=list)
    groups: list[Group] = field(default_factory=list)
    strangers: list[Strangers] = field(default_factory=list)
    mistakes: list[Mistake] = field(default_factory=list)
    sure: dict[tuple[str, bool], list[tuple[NDArray[np.float64], NDArray[np.int64]]]] = field(
        default_factory=dict
    )

    def add(self, name: str, condition: str, severity: int, data: PushedFrames, seen: Percepts) -> None:
        """Take in one backend's look at one set."""
        self.scores.append(score(name, condition, severity, data, seen))
        self.sure.setdefault((name, severity > 0), []).append((seen.probabilities, data.labels))
        wrong = np.flatnonzero((seen.labels != data.labels) & ~seen.abstains)
        if len(wrong):
            worst = int(wrong[np.argmax(seen.confidence[wrong])])
            truth, told = LABELS[data.labels[worst]], LABELS[seen.labels[worst]]
            sure = float(seen.confidence[worst])
            self.mistakes.append(Mistake(name, condition, severity, data.frames[worst], truth, told, sure))

    def reliability(self, name: str, corrupted: bool) -> Reliability:
        """Return how right a backend is by how sure it is, on scenes or on corrupted frames."""
        looks = self.sure[name, corrupted]
        return reliability(
            np.concatenate([p for p, _ in looks]), np.concatenate([truth for _, truth in looks])
        )


def see(spec: StudySpec, backends: Mapping[str, Backend], track: Track) -> Seen:
    """Let every backend look at every set of scenes, every corruption, and solids that none has learnt.

    Parameters
    ----------
    spec
        How many frames, of which seed, at which severities.
    backends
        By name; all read frames.
    track
        Shows progress.
    """
    ledger = _Ledger()
    latency: dict[str, tuple[float, ...]] = {}
    agreement = 1.0
    for condition, severity, data in _sets(spec, track):
        told = data.as_described()
        for name, backend in backends.items():
            seen = look(backend, data.frames)
            ledger.add(name, condition, severity, told, seen)
            if condition == VARIED:
                ledger.groups += audit(name, told, seen)
                ledger.strangers.append(stranger(name, "sphere", data, seen))
                latency[name] = timed(backend, data.frames[:_TIMED])
        if condition == VARIED:
            agreement = data.agreement
    for family in UNKNOWN:
        variation = Variation(families=(family,))
        data = render_frames(spec.frames // 2, spec.seed, variation, track, f"solids never learnt, {family}")
        for name, backend in backends.items():
            ledger.strangers.append(stranger(name, family, data, look(backend, data.frames)))
    return Seen(
        tuple(backends),
        tuple(ledger.scores),
        tuple(ledger.groups),
        tuple(ledger.strangers),
        tuple(ledger.mistakes),
        {name: (ledger.reliability(name, False), ledger.reliability(name, True)) for name in backends},
        agreement,
        latency,
    )


def _sets(spec: StudySpec, track: Track) -> Iterator[tuple[str, int, PushedFrames]]:
    """Yield each condition, its severity (0 for scenes) and its frames."""
    clean = None
    for condition, variation in SCENES.items():
        data = render_frames(spec.frames, spec.seed, variation, track, condition)
        clean = data if variation == CLEAN else clean
        yield condition, 0, data
    assert clean is not None, "the clean scenes are among the sets"
    for severity in spec.severities:
        near = replace(CLEAN, camouflage=severity)
        yield CAMOUFLAGE, severity, render_frames(spec.frames, spec.seed, near, track, CAMOUFLAGE)
    spoilt = [(name, severity) for name in CORRUPTIONS for severity in spec.severities]
    for name, severity in track(spoilt, total=len(spoilt), description="looking at corrupted frames"):
        yield name, severity, replace(clean, frames=corrupt(name, clean.frames, severity, spec.seed))


def audit(backend: str, data: PushedFrames, seen: Percepts) -> list[Group]:
    """Break accuracy down by what an obstacle's label must not hang on: colour, size and distance.

    Obstacles alone are counted. A backend that took a short cut is right about one group and wrong about
    another.
    """
    ahead = data.labels != _NONE
    right = seen.labels == data.labels
    columns = {
        "colour": hues(data.colours),
        "size": data.sizes,
        "distance": np.array([f"{cells} ahead" for cells in data.distances.tolist()]),
        "shape": np.array([LABELS[label] for label in data.labels.tolist()]),
    }
    return [
        Group(backend, by, str(group), int((here := ahead & (column == group)).sum()), int(right[here].sum()))
        for by, column in columns.items()
        for group in sorted(set(column[ahead].tolist()))
    ]


def stranger(backend: str, family: str, data: PushedFrames, seen: Percepts) -> Strangers:
    """Count what a backend would have the robot push, among the frames with one family in the way."""
    here = data.kinds == family
    rolled = here & (data.labels == _SPHERE)
    called = here & (seen.labels == _SPHERE) & ~seen.abstains
    return Strangers(
        backend,
        family,
        frames=int(here.sum()),
        rolled=int(rolled.sum()),
        false_rollable=int((called & ~rolled).sum()),
        accepted=int((called & rolled).sum()),
    )


def timed(backend: Backend, frames: NDArray[np.uint8]) -> tuple[float, ...]:
    """Return the milliseconds that each frame takes alone, after one that warms the backend up."""
    look(backend, frames[:1])
    times = []
    for i in range(len(frames)):
        begun = perf_counter()
        look(backend, frames[i : i + 1])
        times.append(1000 * (perf_counter() - begun))
    return tuple(times)
