"""Runs of kind "episodes": random obstacles appear, and every affordance is held to the oracle.

The robot learns its subtasks without obstacles, once for each pair of trigger and goal; a run's seed names
what it learns and its episodes alike. With more obstacles the same episodes gain obstacles.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from typing import Final

from comparisons.dynamic import random_episode
from comparisons.eyes import Sight
from comparisons.learning import PairLearner
from comparisons.perception_price import Spoilt
from comparisons.robot import MAX_STEPS, Robot, Run
from comparisons.study.kinds import Kind, Measure, Result
from comparisons.study.runs.episode_settings import check_room, complete, files, layout_of, settle
from comparisons.study.runs.judging import Judged, Ledger, Once, counterexample_data, judged, smallest
from comparisons.study.spec import Value
from hierarchy import GroundGraph, checked, two_rooms
from perception.registry import load_backend
from planners import LocalRule, MaxQ, Replanning, Strategy
from planners.resweep import Experience, Remembering, ValueSweep
from worlds import Outcome, maze_model, parse_layout
from worlds.appearing import shortest_way
from worlds.camera import Camera
from worlds.layout_writing import layout_text
from worlds.twin import Twin

MEASURES: Final = (
    Measure(
        "optimal",
        "share of affordances that are proved optimal first actions of their subtask",
        "",
        "more",
        ("GotoTrigger", "GotoDoor", "GotoGoal", "cube", "sphere"),
    ),
    Measure("fatal", "share of affordances after which the subtask has no way left", "", "less"),
    Measure("silent", "share of affordances without any action, though there is a way", "", "less"),
    Measure("cost_per_mistake", "steps that a mistake costs which leaves a way", "steps"),
    Measure("cost_per_episode", "steps that such mistakes cost an episode", "steps", "less"),
    Measure("reached", "share of episodes that reach the goal", "", "more"),
    Measure(
        "steps_over_best",
        "steps more than the shortest way without obstacles, in episodes that reach the goal",
        "steps",
        "less",
    ),
    Measure("asked", "affordances of obstacles on the route, where there is a way", "affordances"),
    Measure("boxed_in", "obstacles on the route that leave the subtask no way", "obstacles"),
    Measure("misread", "share of looks ahead that tell a wrong shape or distance", "", "less"),
    Measure(
        "unlearnt", "grids from which a learnt subtask takes other than the fewest steps", "grids", "less"
    ),
)


def run(settings: Mapping[str, Value], seed: int) -> Result:
    """Carry out the episodes of a run, and judge each affordance.

    Parameters
    ----------
    settings
        Complete settings.
    seed
        Names what is learnt, and the episodes.

    Returns
    -------
    Result
        Besides the measures a curve ``by_known``, by the number of obstacles that the robot knew of, and
        details: the ``counts`` of every group of affordances (`Ledger`), the ``losses`` as pairs of steps
        and how many mistakes cost them, the ``outcomes``, the smallest ``counterexample`` or None, and the
        smallest ``counterexamples`` by shape.

    Examples
    --------
    >>> found = run(complete({"episodes": 4, "obstacles": 6}), seed=0)
    >>> found.measures["asked"], found.measures["reached"]
    (12, 1.0)
    """
    return Episodes(settings, seed).result()


EPISODES: Final = Kind("episodes", 1, MEASURES, complete, files, run, settle)


@dataclass
class Found:
    """What the episodes of a run came to.

    Parameters
    ----------
    ledger
        The affordances.
    outcomes
        Episodes by the name of their end.
    over
        Steps over the shortest way without obstacles, of each episode that reaches the goal.
    looks, misread
        Looks ahead, and those that told a wrong shape or distance.
    """

    ledger: Ledger = field(default_factory=Ledger)
    outcomes: Counter[Outcome] = field(default_factory=Counter)
    over: list[int] = field(default_factory=list)
    looks: int = 0
    misread: int = 0


class Episodes:
    """The episodes of one run.

    Parameters
    ----------
    settings
        Complete settings.
    seed
        Names what is learnt, and the episodes.
    """

    def __init__(self, settings: Mapping[str, Value], seed: int) -> None:
        self.settings = settings
        self.seed = seed
        self.layout = layout_of(str(settings["layout"]))
        check_room(self.layout, int(settings["obstacles"]))
        self.grounded = _grounded(layout_text(self.layout))
        self.oracle = Once(self.layout, self.grounded)
        self.max_steps = max(MAX_STEPS, len(self.layout.cells))

    def result(self) -> Result:
        """Carry out all episodes, and tell what they came to."""
        found = Found()
        with self._sight() as sight:
            for number in range(int(self.settings["episodes"])):
                self._episode(number, sight, found)
        return Result(self._measures(found), {"by_known": _by_known(found.ledger)}, self._details(found))

    def _episode(self, number: int, sight: Sight, found: Found) -> None:
        wanted = self.settings
        episode, *pair = random_episode(
            self.layout,
            self.seed,
            number,
            int(wanted["obstacles"]),
            spheres=float(wanted["spheres"]),
            on_way=float(wanted["on_way"]),
        )
        self.oracle.forget()
        replanning, strategy = self._strategies[pair[0], pair[1]]
        followed = strategy if wanted["follow"] == "strategy" else replanning
        run = Robot(self.layout, self.grounded, followed, sight, max_steps=self.max_steps).run(episode)
        for met in run.encounters:
            if met.affordance.on_route:
                one = judged(self.oracle, strategy, met, followed=followed is strategy)
                found.ledger.add(one, self.grounded)
        self._count(run, pair, found)

    def _count(self, run: Run, pair: Sequence[str], found: Found) -> None:
        """Count how an episode ended."""
        found.outcomes[run.outcome] += 1
        found.looks += run.looks
        found.misread += run.misread
        if run.outcome is Outcome.REACHED:
            marks = self.layout.triggers[pair[0]], self.layout.goals[pair[1]]
            best = len(shortest_way(self.layout, run.cells[0], *marks)) - 1
            found.over.append(run.steps - best)

    @cached_property
    def _learners(self) -> dict[tuple[str, str], PairLearner]:
        """What has learnt each pair of trigger and goal."""
        pairs = ((trigger, goal) for trigger in self.layout.triggers for goal in self.layout.goals)
        learners = {pair: PairLearner(self.layout, self.grounded, *pair, seed=self.seed) for pair in pairs}
        for learner in learners.values():
            learner.learn()
        return learners

    @cached_property
    def _strategies(self) -> dict[tuple[str, str], tuple[Replanning, Strategy]]:
        """Replanning and the strategy that is judged, by the pair that they have learnt."""
        return {pair: self._strategies_of(learner.learner) for pair, learner in self._learners.items()}

    def _strategies_of(self, learner: MaxQ) -> tuple[Replanning, Strategy]:
        replanning = Replanning(self.oracle, learner)
        match self.settings["strategy"]:
            case "local-rule":
                return replanning, LocalRule(self.layout, learner)
            case "value-sweep":
                experience = _experience(layout_text(self.layout), self.seed)
                return replanning, ValueSweep(self.layout, learner, experience)
            case _:
                return replanning, replanning

    @contextmanager
    def _sight(self) -> Iterator[Sight]:
        """Yield the robot's eye, with a twin that renders frames if it needs them."""
        camera = Camera()
        backend = load_backend(str(self.settings["perception"]), camera)
        if not backend.needs_frames:
            yield Sight(self.layout, backend)
            return
        severity = int(self.settings["severity"])
        if severity:
            backend = Spoilt(backend, str(self.settings["corruption"]), severity, self.seed)
        with Twin(self.layout, camera) as twin:
            yield Sight(self.layout, backend, twin)

    def _measures(self, found: Found) -> dict[str, float | None]:
        ledger, episodes = found.ledger, int(self.settings["episodes"])
        all_ = ledger.total()
        measures: dict[str, float | None] = {
            "optimal": _share(all_.optimal, all_.asked),
            "fatal": _share(all_.fatal, all_.asked),
            "silent": _share(all_.silent, all_.asked),
            "cost_per_mistake": _share(all_.cost, ledger.losses.total()),
            "cost_per_episode": all_.cost / episodes,
            "reached": found.outcomes[Outcome.REACHED] / episodes,
            "steps_over_best": _share(sum(found.over), len(found.over)),
            "asked": all_.asked,
            "boxed_in": ledger.boxed_in,
            "misread": _share(found.misread, found.looks),
            "unlearnt": sum(int(learner.wrong_grids()[0]) for learner in self._learners.values()),
        }
        parts = {"subtask": _subtasks(self.grounded), "shape": ("cube", "sphere")}
        for by, names in parts.items():
            for name in names:
                count = ledger.total(**{by: name})
                measures[f"optimal.{name}"] = _share(count.optimal, count.asked)
        return measures

    def _details(self, found: Found) -> dict[str, object]:
        refuted = found.ledger.refuted()
        shown = {shape: self._shown(one) for shape, one in refuted.items()}
        return {
            "counts": found.ledger.as_data(),
            "losses": [list(pair) for pair in sorted(found.ledger.losses.items())],
            "outcomes": {outcome.value: found.outcomes[outcome] for outcome in Outcome},
            "counterexample": smallest(shown.values()),
            "counterexamples": shown,
        }

    def _shown(self, one: Judged) -> dict[str, object]:
        """Return a counter-example as data, with the strategy that it refutes."""
        data = counterexample_data(self.layout, self.grounded, one)
        return {"strategy": self.settings["strategy"], **data}


def _by_known(ledger: Ledger) -> dict[str, list[float | None]]:
    """Return the counts by the number of obstacles that the robot knew of."""
    numbers = sorted({known for _, _, known, _ in ledger.groups})
    counts = [ledger.total(known=known) for known in numbers]
    return {
        "known": list(numbers),
        "optimal": [_share(count.optimal, count.asked) for count in counts],
        "fatal": [_share(count.fatal, count.asked) for count in counts],
        "cost": [_share(count.cost, count.asked) for count in counts],
        "asked": [count.asked for count in counts],
    }


def _share(part: float, whole: int) -> float | None:
    return part / whole if whole else None


def _subtasks(grounded: GroundGraph) -> tuple[str, ...]:
    """Return the names of the root's subtasks, parameters left out, in order."""
    calls = grounded.nodes[grounded.root].calls
    return tuple(dict.fromkeys(grounded.nodes[call.child].task for call in calls))


@cache
def _grounded(text: str) -> GroundGraph:
    layout = parse_layout(text)
    return checked(two_rooms(layout), maze_model(layout))


# Learning in Python takes much longer than the compiled learner, and runs that differ in their episodes alone
# have learnt the same.
@lru_cache(maxsize=200)
def _experience(text: str, seed: int) -> Experience:
    """Return what a robot has tried by the time that it has learnt every pair."""
    layout, grounded = parse_layout(text), _grounded(text)
    tried: dict[tuple[int, int], int] = {}
    for trigger in layout.triggers:
        for goal in layout.goals:
            compiled = PairLearner(layout, grounded, trigger, goal, seed=seed)
            learner = Remembering(grounded, compiled.runs.seeds[0])
            for phase in compiled.phases():
                learner.train(*phase)
            tried |= learner.tried
    return Experience.of(layout, grounded, tried)
