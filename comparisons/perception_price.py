"""The price of mistakes: what a backend's errors cost the robot in its task.

A cube taken for a sphere costs a blocked step, a sphere taken for a cube a detour, and either may cost the
goal. Every backend plays the same random episodes, and so does the truth, to which it is held.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from comparisons.dynamic import random_episode
from comparisons.eyes import Sight, truth_ahead
from comparisons.intervals import bootstrapped, wilson
from comparisons.learning import PairLearner
from comparisons.outputs import Track
from comparisons.perception_spec import StudySpec
from comparisons.robot import Encounter, Moment, Robot, Run
from hierarchy import checked, two_rooms
from perception.corruptions import corrupt
from perception.protocol import Backend, Detection, View
from perception.truth import Truth
from planners import Replanner, Replanning, prove
from worlds import Episode, MazeState, Outcome, Stream, load_layout, maze_model
from worlds.camera import Camera
from worlds.twin import Twin

PRICED: Final = (("clean", 0), ("gaussian_noise", 4), ("occlusion", 4))
"""Conditions under which the episodes are played, and their severities."""
_LENS: Final = 21  # names the stream of the spoilt lens


@dataclass(frozen=True)
class Played:
    """One episode, as a backend played it.

    Parameters
    ----------
    outcome, steps, blocked
        How it ended, after how many primitive steps, and how many of these led nowhere.
    asked, wrong
        Affordances that had an optimal first action by the real shapes, and those that named another one.
    looks
        Looks by (true label, seen label).
    """

    outcome: Outcome
    steps: int
    blocked: int
    asked: int
    wrong: int
    looks: Mapping[tuple[str, str], int]


@dataclass(frozen=True)
class Price:
    """What one backend's mistakes cost.

    Parameters
    ----------
    backend, condition, severity
        Which; what its frames suffered, "clean" if nothing, and how severely.
    episodes, reached
        Episodes, and those whose goal was reached.
    outcomes
        Episodes by the name of their end.
    both, extra, extra_low, extra_high
        Episodes that this backend and the truth both end at the goal; in these the mean of the steps
        more than under the truth, and its 95 % bootstrap interval.
    blocked
        Steps that led nowhere, in all episodes.
    asked, wrong
        Affordances, and those that are no optimal first action by the real shapes.
    looks, cube_as_sphere, sphere_as_cube, missed, imagined
        Looks, and those that erred so: an obstacle taken for none, and none for an obstacle.
    """

    backend: str
    condition: str
    severity: int
    episodes: int
    reached: int
    outcomes: Mapping[str, int]
    both: int
    extra: float
    extra_low: float
    extra_high: float
    blocked: int
    asked: int
    wrong: int
    looks: int
    cube_as_sphere: int
    sphere_as_cube: int
    missed: int
    imagined: int

    @property
    def success(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the share of episodes that reach the goal."""
        return wilson(self.reached, self.episodes)


class Spoilt:
    """A backend behind a spoilt lens: each frame is corrupted before it is looked at.

    Parameters
    ----------
    backend
        Looks.
    corruption, severity, seed
        As `perception.corruptions.corrupt` has them; every frame gets random numbers of its own.
    """

    needs_frames = True

    def __init__(self, backend: Backend, corruption: str, severity: int, seed: int) -> None:
        self.name = backend.name
        self.backend = backend
        self.corruption, self.severity = corruption, severity
        self._seeds = Stream(seed, _LENS)

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Corrupt the frames, and pass them on."""
        return self.backend.detect([self._spoilt(view) for view in views])

    def _spoilt(self, view: View) -> View:
        assert view.frame is not None, "the backend needs frames, so they are rendered"
        seed = self._seeds.bits()
        return replace(view, frame=corrupt(self.corruption, view.frame[None], self.severity, seed)[0])


class _CountingSight(Sight):
    """A robot's eye that counts what it saw by what there was."""

    looks: Counter[tuple[str, str]]

    def begin(self, episode: Episode) -> None:
        """Take up an episode, and count anew."""
        self.looks = Counter()
        super().begin(episode)

    def look(self, episode: Episode, action: int) -> Detection:
        """Look, and count."""
        seen = super().look(episode, action)
        self.looks[truth_ahead(self.layout, episode.state, action).label, seen.label] += 1
        return seen


class Task:
    """The maze, its oracle and what was learnt of it: the same for every backend.

    Parameters
    ----------
    spec
        How many episodes, of which seed.
    track
        Shows progress.
    """

    def __init__(self, spec: StudySpec, track: Track) -> None:
        self.spec, self.track = spec, track
        self.layout = load_layout("two_rooms")
        self.camera = Camera()
        self.grounded = checked(two_rooms(self.layout), maze_model(self.layout))
        self.oracle = Replanner(self.layout, self.grounded)
        self.strategies: dict[tuple[str, str], Replanning] = {}
        pairs = [(t, g) for t in self.layout.triggers for g in self.layout.goals]
        for trigger, goal in track(pairs, total=len(pairs), description="learning the pairs"):
            # The learner decides which subtask comes first; learning has nothing to do with seeing.
            learner = PairLearner(self.layout, self.grounded, trigger, goal, seed=0)
            learner.learn()
            self.strategies[trigger, goal] = Replanning(self.oracle, learner.learner)

    def prices(self, backends: Mapping[str, Backend]) -> tuple[Price, ...]:
        """Play every episode with the truth, and with each backend on clean and on spoilt frames."""
        seed = self.spec.seed
        told = self._play("truth", _CountingSight(self.layout, Truth()))
        prices = [price("truth", ("clean", 0), told, told, seed)]
        with Twin(self.layout, self.camera) as twin:
            for condition, severity in PRICED:
                for name, backend in backends.items():
                    eye = Spoilt(backend, condition, severity, seed) if severity else backend
                    played = self._play(f"{name}, {condition}", _CountingSight(self.layout, eye, twin))
                    prices.append(price(name, (condition, severity), played, told, seed))
        return tuple(prices)

    def _play(self, name: str, sight: _CountingSight) -> list[Played]:
        numbers = range(self.spec.episodes)
        shown = self.track(numbers, total=len(numbers), description=f"episodes with {name}")
        return [self._episode(number, sight) for number in shown]

    def _episode(self, number: int, sight: _CountingSight) -> Played:
        episode, *pair = random_episode(self.layout, self.spec.seed, number)
        judged: list[bool] = []

        def judge(moment: Moment) -> None:
            for met in moment.encounters:
                if met.affordance.on_route:
                    judged.extend(self._right(met, episode.state))

        robot = Robot(self.layout, self.grounded, self.strategies[pair[0], pair[1]], sight)
        run = robot.run(episode, judge)
        return Played(
            run.outcome, run.steps, _blocked(run), len(judged), judged.count(False), dict(sight.looks)
        )

    def _right(self, met: Encounter, truth: MazeState) -> list[bool]:
        """Return whether an affordance is an optimal first action with every known shape as it really is.

        Nothing where the subtask has no way then.
        """
        known = met.belief.cubes | met.belief.spheres
        real = replace(met.belief, cubes=known & truth.cubes, spheres=known & truth.spheres)
        if self.oracle.plan(met.task, real) is None:
            return []
        if met.affordance.action is None:
            return [False]
        proof = prove(self.oracle, met.task, real, met.affordance.action)
        return [proof is not None and proof.optimal]


def _blocked(run: Run) -> int:
    return sum(before == after for before, after in pairwise(run.cells))


def price(
    backend: str, condition: tuple[str, int], played: Sequence[Played], told: Sequence[Played], seed: int
) -> Price:
    """Hold the episodes of one backend to the same episodes under the truth.

    Parameters
    ----------
    backend, condition
        Its name; what the frames suffered, and how severely.
    played, told
        The same episodes with the backend, and with the truth.
    seed
        Of the bootstrap.

    Raises
    ------
    ValueError
        If the two differ in length.

    Examples
    --------
    >>> slow, fast = (Played(Outcome.REACHED, n, 0, 1, 0, {("cube", "sphere"): 1}) for n in (14, 12))
    >>> found = price("mine", ("clean", 0), [slow, slow], [fast, slow], seed=1)
    >>> found.extra, found.extra_low, found.extra_high, found.cube_as_sphere
    (1.0, 0.0, 2.0, 2)
    """
    both = [
        float(mine.steps - true.steps)
        for mine, true in zip(played, told, strict=True)
        if mine.outcome is Outcome.REACHED and true.outcome is Outcome.REACHED
    ]
    looks: Counter[tuple[str, str]] = Counter()
    for one in played:
        looks.update(one.looks)
    outcomes = Counter(one.outcome for one in played)
    low, high = bootstrapped(both, seed)
    return Price(
        backend,
        *condition,
        episodes=len(played),
        reached=outcomes[Outcome.REACHED],
        outcomes={outcome.value: outcomes[outcome] for outcome in Outcome},
        both=len(both),
        extra=float(np.mean(both)) if both else 0.0,
        extra_low=low,
        extra_high=high,
        blocked=sum(one.blocked for one in played),
        asked=sum(one.asked for one in played),
        wrong=sum(one.wrong for one in played),
        looks=looks.total(),
        cube_as_sphere=looks["cube", "sphere"],
        sphere_as_cube=looks["sphere", "cube"],
        missed=looks["cube", "none"] + looks["sphere", "none"],
        imagined=looks["none", "cube"] + looks["none", "sphere"],
    )
