"""The paper's experiment, section 6, in its parts; each returns what it found as data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeVar

from comparisons.dynamic import Tally, judge, random_episode
from comparisons.eyes import Sight
from comparisons.learning import Curve, PairLearner
from comparisons.outputs import Track
from comparisons.robot import Moment, Robot, Run
from hierarchy import GroundGraph, ValueCounts, checked, two_rooms, value_counts
from perception.accuracy import Accuracy, measure
from perception.frames import fresh_scene, fresh_views
from perception.protocol import Backend, Frame, View
from perception.pushing import Agreement, agreement, push_trials
from perception.registry import load_backend
from planners import Gap, LocalRule, Replanner, Replanning, gap, recursive_optimum
from worlds import Episode, Layout, Outcome, load_layout, maze_model
from worlds.camera import Camera
from worlds.twin import Twin

if TYPE_CHECKING:
    from comparisons.neural import Neural

T = TypeVar("T")

RUNS: Final = 100
"""Runs of every pair, each with a seed of its own; the first has the experiment's."""


@dataclass(frozen=True)
class Spec:
    """What to run.

    Parameters
    ----------
    seed
        Names every random stream of the experiment.
    perception
        Name of the perception backend.
    quick
        Fewer frames, pushes and random episodes; the learning is the same.
    layout
        The maze.
    """

    seed: int = 0
    perception: str = "hough"
    quick: bool = False
    layout: str = "two_rooms"

    @property
    def frames(self) -> int:
        """Fresh frames that measure the backend."""
        return 150 if self.quick else 1000

    @property
    def pushes(self) -> int:
        """Push trials; 120 are every condition once."""
        return 60 if self.quick else 120

    @property
    def episodes(self) -> int:
        """Random episodes of the dynamic part."""
        return 30 if self.quick else 500


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One step of the example run: pictures of it, and what the robot saw and decided."""

    moment: Moment
    overview: Frame
    view: Frame


@dataclass(frozen=True, eq=False)
class Example:
    """The example run of section 6.3.

    Parameters
    ----------
    without, with_obstacles
        The run without and with obstacles, under the paper's local rule.
    replanned
        The run with obstacles under replanning.
    snapshots
        Every step of `with_obstacles`, and its end.
    end
        The last picture from above.
    """

    without: Run
    with_obstacles: Run
    replanned: Run
    snapshots: tuple[Snapshot, ...]
    end: Frame


@dataclass(frozen=True)
class Learnt:
    """What a pair learnt: grids and starts in which it differs from the oracle.

    Parameters
    ----------
    trigger, goal
        The pair.
    wrong_grids, wrong_starts
        Of the run with the experiment's seed.
    runs, optimal_runs
        How many runs learnt, with this and the seeds after it, and how many equal the oracle everywhere.
    """

    trigger: str
    goal: str
    wrong_grids: int
    wrong_starts: int
    runs: int
    optimal_runs: int

    @property
    def optimal(self) -> bool:
        """Whether the pair equals the oracle everywhere."""
        return self.wrong_grids == 0 and self.wrong_starts == 0


class Experiment:
    """The parts of section 6, run in order on one maze.

    Parameters
    ----------
    spec
        What to run.
    track
        Shows the progress of every long part.
    """

    def __init__(self, spec: Spec, track: Track) -> None:
        self.spec = spec
        self.track = track
        self.layout: Layout = load_layout(spec.layout)
        self.camera = Camera()
        self.backend: Backend = load_backend(spec.perception, self.camera)
        self.model = maze_model(self.layout)
        self.grounded: GroundGraph = checked(two_rooms(self.layout), self.model)
        self.oracle = Replanner(self.layout, self.grounded)
        self.learners: dict[tuple[str, str], PairLearner] = {}
        self.curves: dict[str, Curve] = {}

    def subgoal(self, task: str) -> str:
        """Return the mark that ends a ground subtask, such as T4 for GotoTrigger(T4)."""
        ((_, value),) = self.grounded.node(task).binding
        return str(value)

    def counts(self) -> ValueCounts:
        """Count the values of every representation; the paper leaves the doors out."""
        return value_counts(self.grounded, ignoring=["doors"])

    def gaps(self) -> tuple[Gap, Gap]:
        """Return what the hierarchy loses with the door as a parameter, and with one GotoDoor."""
        single = checked(two_rooms(self.layout, one_door_task=True), self.model)
        both = (self.grounded, single)
        first, second = (gap(grounded, recursive_optimum(grounded)) for grounded in both)
        return first, second

    def pushing(self) -> Agreement:
        """Push obstacles and tell which roll (section 6.1)."""
        trials = push_trials(self.spec.seed, self.spec.pushes)
        return agreement(list(self._show(trials, len(trials), "pushing obstacles")))

    def seeing(self) -> Accuracy:
        """Measure the backend on fresh frames."""
        views = self._fresh_views()
        return measure(self.backend, self._show(views, self.spec.frames, "looking at fresh frames"))

    def learning(self) -> tuple[Learnt, ...]:
        """Learn every pair and hold it to the oracle (section 6.2)."""
        pairs = [(t, g) for t in self.layout.triggers for g in self.layout.goals]
        found = []
        for trigger, goal in self._show(pairs, len(pairs), "learning the pairs"):
            learner = PairLearner(self.layout, self.grounded, trigger, goal, seed=self.spec.seed, runs=RUNS)
            shown = (trigger, goal) == (self.layout.trigger, self.layout.goal)
            curves = learner.learn(curves=shown)
            self.curves = curves if shown else self.curves
            self.learners[trigger, goal] = learner
            grids, starts = learner.wrong_grids(), learner.wrong_starts()
            optimal = int(((grids == 0) & (starts == 0)).sum())
            found.append(Learnt(trigger, goal, int(grids[0]), int(starts[0]), RUNS, optimal))
        return tuple(found)

    def example(self) -> Example:
        """Carry out the example run of table 4 and figure 15, in physics, with the camera."""
        layout = self.layout
        learner = self.learners[layout.trigger, layout.goal].learner
        local = LocalRule(layout, learner)
        with Twin(layout, self.camera) as twin:
            sight = Sight(layout, self.backend, twin)
            snapshots: list[Snapshot] = []

            def watch(moment: Moment) -> None:
                twin.face(moment.action)
                snapshots.append(Snapshot(moment, twin.overview(), twin.frame()))

            episode = self._example_episode(obstacles=True)
            with_obstacles = Robot(layout, self.grounded, local, sight).run(episode, watch)
            end = twin.overview()
            without = Robot(layout, self.grounded, local, sight).run(self._example_episode(obstacles=False))
            strategy = Replanning(self.oracle, learner)
            replanned = Robot(layout, self.grounded, strategy, sight).run(
                self._example_episode(obstacles=True)
            )
        return Example(without, with_obstacles, replanned, tuple(snapshots), end)

    def dynamic(self) -> Tally:
        """Run random episodes under replanning, holding every affordance to the oracle."""
        if not self.backend.needs_frames:
            return self._dynamic(Sight(self.layout, self.backend))
        with Twin(self.layout, self.camera) as twin:
            return self._dynamic(Sight(self.layout, self.backend, twin))

    def local_rule(self) -> dict[Outcome, int]:
        """Run the same episodes under the paper's local rule alone, told the truth about shapes."""
        sight = Sight(self.layout, load_backend("truth", self.camera))
        outcomes = dict.fromkeys(Outcome, 0)
        for number in self._show(range(self.spec.episodes), self.spec.episodes, "the local rule alone"):
            episode, *pair = random_episode(self.layout, self.spec.seed, number)
            local = LocalRule(self.layout, self.learners[pair[0], pair[1]].learner)
            outcomes[Robot(self.layout, self.grounded, local, sight).run(episode).outcome] += 1
        return outcomes

    def neural(self, tally: Tally) -> Neural | None:
        """Let an option-critic learn the same graph, and ask it for the same affordances; not if quick."""
        if self.spec.quick:
            return None
        # TorchRL takes longer to load than a quick run takes.
        from comparisons.neural import ask_neural, learn_neural  # noqa: PLC0415

        learner = learn_neural(self.grounded, self.spec.seed, self.track)
        return ask_neural(self.layout, self.oracle, learner, tally.verdicts)

    def _dynamic(self, sight: Sight) -> Tally:
        tally = Tally()
        for number in self._show(range(self.spec.episodes), self.spec.episodes, "random episodes"):
            episode, *pair = random_episode(self.layout, self.spec.seed, number)
            learner = self.learners[pair[0], pair[1]].learner
            robot = Robot(self.layout, self.grounded, Replanning(self.oracle, learner), sight)
            run = robot.run(episode)
            local = LocalRule(self.layout, learner)
            met = [encounter for encounter in run.encounters if encounter.affordance.on_route]
            tally.add(run, [judge(self.oracle, local, encounter) for encounter in met], self.oracle)
        return tally

    def _example_episode(self, *, obstacles: bool) -> Episode:
        layout = self.layout
        shown = layout.obstacles if obstacles else ()
        return Episode(layout, layout.trigger, layout.goal, layout.start, shown)

    def _fresh_views(self) -> Iterator[View]:
        if self.backend.needs_frames:
            yield from fresh_views(self.layout, self.spec.frames, self.spec.seed, self.camera)
            return
        for number in range(self.spec.frames):
            yield View(None, fresh_scene(self.layout, self.spec.seed, number).truth)

    def _show(self, items: Iterable[T], total: int, description: str) -> Iterable[T]:
        return self.track(items, total=total, description=description)
