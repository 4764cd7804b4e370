"""How backends learn from pushes: how many they need, how many wrong ones they bear, what they do not see.

Every training is a `Lesson`: which of the robot's trials, how many of their labels are wrong, what is left
out. Lessons are spread over processes; each ends with what the backends make of the same test frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from comparisons.intervals import mean_interval
from comparisons.learnt import Gates, Learns
from comparisons.outputs import Track
from comparisons.perception_spec import StudySpec
from comparisons.perception_study import look, render_frames
from comparisons.spread import reason, spread
from perception.audit import HeldOut, held_out, shared_groups, without
from perception.labelled import held_out as split
from perception.protocol import Backend, Frames
from perception.pushed import PushedFrames
from perception.registry import load_backend
from perception.variation import Variation
from worlds.camera import Camera
from worlds.errors import UserError

Answers = Mapping[str, NDArray[np.int8]]
"""By backend, the likeliest label of each test frame, shape (frames,)."""
_NETWORK: Final = "cnn"  # the network that a backend which `Gates` builds upon


@dataclass(frozen=True)
class Lesson:
    """One training.

    Parameters
    ----------
    seed
        Of the trials, of which labels are wrong, and of the training itself.
    pushes
        The seed's first so many trials are learnt from.
    wrong
        Share of the labels that are wrong.
    left_out
        Group that is kept out (`perception.audit.groups`), "" if none is.

    Examples
    --------
    >>> print(Lesson(0, 100, 0.1), Lesson(1, 50, left_out="colour red"), sep="; ")
    100 pushes of seed 0, 10 % of the labels wrong; 50 pushes of seed 1 without colour red
    """

    seed: int
    pushes: int
    wrong: float = 0.0
    left_out: str = ""

    def __str__(self) -> str:
        wrong = f", {100 * self.wrong:g} % of the labels wrong" if self.wrong else ""
        left_out = f" without {self.left_out}" if self.left_out else ""
        return f"{self.pushes} pushes of seed {self.seed}{left_out}{wrong}"

    def of(self, data: PushedFrames) -> PushedFrames:
        """Return what is learnt from, of the seed's trials."""
        chosen = data[: self.pushes]
        if self.left_out:
            chosen = chosen[without(chosen, self.left_out)]
        return chosen.mislabelled(self.wrong, self.seed) if self.wrong else chosen


@dataclass(frozen=True)
class Point:
    """How one backend did after some pushes.

    Parameters
    ----------
    backend, pushes, wrong
        Which; trials that it learnt from, and the share of wrong labels among them.
    right
        Right ones of the test frames, by training seed.
    frames
        Number of test frames.
    interval
        95 % interval of the accuracy's mean over seeds; see `comparisons.intervals.mean_interval`.
    """

    backend: str
    pushes: int
    wrong: float
    right: tuple[int, ...]
    frames: int
    interval: tuple[float, float]

    @property
    def shares(self) -> tuple[float, ...]:
        """Share of right frames, by training seed."""
        return tuple(right / self.frames for right in self.right)

    @property
    def accuracy(self) -> float:
        """The mean of the shares."""
        return sum(self.right) / (len(self.right) * self.frames)


@dataclass(frozen=True)
class Learning:
    """All that was found out by training anew.

    Parameters
    ----------
    backends
        Names, in the order of every table.
    points
        Accuracy by pushes and wrong labels.
    held_out
        By backend, what became of the groups that were kept out of training, in turn.
    """

    backends: tuple[str, ...]
    points: tuple[Point, ...]
    held_out: Mapping[str, tuple[HeldOut, ...]]


def learners(backends: Mapping[str, Backend]) -> tuple[str, ...]:
    """Return the names of the backends that learn; weights of one's own are forgotten by training anew.

    Examples
    --------
    >>> from comparisons.perception_study import load_backends
    >>> learners(load_backends(["hough", "hog"], Camera()))
    ('hog',)
    """
    kinds = (name.partition("=")[0] for name, backend in backends.items() if isinstance(backend, Learns))
    return tuple(dict.fromkeys(kinds))


def learn(spec: StudySpec, names: Sequence[str], track: Track, workers: int | None = None) -> Learning:
    """Train backends anew, on few pushes and many, on wrong labels, and on all but one group.

    Parameters
    ----------
    spec
        What to compare.
    names
        Backends that learn.
    track
        Shows progress.
    workers
        Number of processes, which changes nothing in what is found. Defaults to one for each core.

    Raises
    ------
    UserError
        If a training fails; the message names it.
    """
    its = spec.learning
    most = max(its.pushes)
    data = {
        seed: render_frames(most, seed, Variation(), track, f"pushes to learn from, seed {seed}")
        for seed in range(its.seeds)
    }
    shown = render_frames(spec.frames, spec.seed, Variation(), track, "frames to be told after training")
    test = shown.as_described()
    groups = shared_groups(data[0], test)
    reference = Lesson(0, most)
    apart = {group: Lesson(0, most, left_out=group) for group in groups}
    curve = [Lesson(seed, n, wrong) for n in its.pushes for wrong in its.wrong for seed in range(its.seeds)]
    lessons = list(dict.fromkeys([*curve, reference, *apart.values()]))
    given = (tuple(names), data, test.frames, its.effort)
    answers = spread(teach, lessons, given, workers=workers, track=track, description="training")
    told = dict(zip(lessons, answers, strict=True))
    return Learning(
        tuple(names),
        tuple(point for name in names for point in _points(spec, name, told, test.labels)),
        {
            name: tuple(
                held_out(test, group, len(lesson.of(data[0])), told[lesson][name], told[reference][name])
                for group, lesson in apart.items()
            )
            for name in names
        },
    )


def teach(
    lesson: Lesson, names: Sequence[str], data: Mapping[int, PushedFrames], frames: Frames, effort: float
) -> dict[str, NDArray[np.int8]]:
    """Train backends, and return what they make of frames: likeliest labels by name, shape (frames,).

    Parameters
    ----------
    lesson
        The training.
    names
        The backends.
    data
        The trials of each seed.
    frames
        What to look at in the end, shape (frames, rows, columns, 3).
    effort
        Share of the usual number of training steps.

    Raises
    ------
    UserError
        If a backend cannot learn from the data; the message names it.
    """
    rows = lesson.of(data[lesson.seed])
    taught: dict[str, Learns] = {}
    seen: dict[str, NDArray[np.int8]] = {}
    for name in sorted(names, key=lambda name: name != _NETWORK):  # the CNN first, for what is built on it
        try:
            taught[name] = _taught(name, rows, lesson.seed, effort, taught.get(_NETWORK))
            seen[name] = look(taught[name], frames).labels.astype(np.int8)
        except Exception as error:
            raise UserError(f"{name}: {reason(error)}") from error
    return seen


def _taught(name: str, rows: PushedFrames, seed: int, effort: float, network: Learns | None) -> Learns:
    """Return a backend that learnt anew."""
    backend = load_backend(name, Camera())
    assert isinstance(backend, Learns), "only backends that learn are taught"
    if network is not None and isinstance(backend, Gates):
        # It would train the very same network again: its gate is set by the frames that `fit` sets it by.
        return backend.gate(network, split(rows)[1])
    return backend.fit(rows, seed, effort=effort)


def _points(
    spec: StudySpec, name: str, told: Mapping[Lesson, Answers], labels: NDArray[np.int64]
) -> Iterator[Point]:
    for pushes, wrong in product(spec.learning.pushes, spec.learning.wrong):
        lessons = (Lesson(seed, pushes, wrong) for seed in range(spec.learning.seeds))
        right = tuple(int((told[lesson][name] == labels).sum()) for lesson in lessons)
        yield Point(name, pushes, wrong, right, len(labels), mean_interval(right, len(labels), spec.seed))
