"""The dynamic part (section 6.3): the example run of table 4, and random episodes held to the oracle."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from comparisons.robot import Encounter, Run
from planners import LocalRule, Proof, Replanner, Strategy, prove
from worlds import Episode, Layout, Outcome, Stream
from worlds.appearing import ON_THE_WAY, random_obstacles, shortest_way

MOST_OBSTACLES = 6


def random_episode(
    layout: Layout,
    seed: int,
    number: int,
    obstacles: int | None = None,
    *,
    spheres: float = 0.5,
    on_way: float = ON_THE_WAY,
) -> tuple[Episode, str, str]:
    """Return random episode `number` of a seed, and its pair: random pair, start, and obstacles on the way.

    None appears on the start, the trigger or the goal. With more obstacles the pair, the start and the
    obstacles that there were stay the same.

    Parameters
    ----------
    layout
        The maze.
    seed, number
        Name the episode.
    obstacles
        How many there are. Defaults to one to six, drawn.
    spheres, on_way
        As in `worlds.appearing.random_obstacles`.

    Raises
    ------
    ValueError
        If the maze has too few free cells.

    Examples
    --------
    >>> from worlds import load_layout
    >>> episode, trigger, goal = random_episode(load_layout("two_rooms"), seed=1, number=0)
    >>> 1 <= len(episode.obstacles) <= 6
    True
    """
    stream = Stream(seed, number)
    trigger, goal = stream.choose(list(layout.triggers)), stream.choose(list(layout.goals))
    marks = layout.triggers[trigger], layout.goals[goal]
    start = stream.choose(sorted(layout.room(layout.start) - {marks[0]}))
    way = shortest_way(layout, start, *marks)
    drawn = 1 + stream.below(MOST_OBSTACLES)
    count = drawn if obstacles is None else obstacles
    ends = frozenset({start, *marks})
    appear = random_obstacles(layout, stream, count, way, ends, spheres=spheres, on_way=on_way)
    return Episode(layout, trigger, goal, start, appear), trigger, goal


@dataclass(frozen=True)
class Verdict:
    """One affordance, held to the oracle under what the robot knew.

    Parameters
    ----------
    encounter
        The obstacle, the subtask and the belief.
    local
        The proof about the paper's local rule: about its affordance, or its route's first action; None
        where the rule has no action at all.
    replanned
        The proof about the affordance under replanning.
    """

    encounter: Encounter
    local: Proof | None
    replanned: Proof


def judge(oracle: Replanner, local: LocalRule, encounter: Encounter) -> Verdict | None:
    """Hold one affordance to the oracle, and ask the local rule in the same situation.

    None where the subtask has no way left, so that the obstacle affords nothing in it.
    """
    task, belief = encounter.task, encounter.belief
    action = encounter.affordance.action
    replanned = None if action is None else prove(oracle, task, belief, action)
    if replanned is None:
        return None
    choice = choice_of(local, encounter)
    return Verdict(encounter, None if choice is None else prove(oracle, task, belief, choice), replanned)


def choice_of(strategy: Strategy, encounter: Encounter) -> int | None:
    """Return the action that a strategy takes in the situation of another's affordance.

    It is the affordance, or where the obstacle is not on this strategy's route, the route's first action;
    None where the strategy has no action at all.
    """
    task, belief = encounter.task, encounter.belief
    answer = strategy.affordance(task, encounter.cell, belief)
    if answer.on_route:
        return answer.action
    route = strategy.route(task, belief)
    return None if route is None else route[0]


@dataclass
class Tally:
    """What the random episodes came to.

    Parameters
    ----------
    outcomes
        Episodes by the name of their end.
    verdicts
        The affordances of obstacles on the route that have a way left.
    boxed_in
        Those that leave none: the subtask is given up, and the root chooses anew.
    hopeless
        Ends with no route left in which the whole maze has no way either, by a search that knows what
        the robot knows and is bound to no subtask.
    steps
        Primitive steps in all.
    looks, misread
        Looks ahead, and those that told a wrong shape or distance.
    """

    episodes: int = 0
    outcomes: Counter[Outcome] = field(default_factory=Counter)
    verdicts: list[Verdict] = field(default_factory=list)
    boxed_in: int = 0
    hopeless: int = 0
    steps: int = 0
    looks: int = 0
    misread: int = 0

    def add(self, run: Run, verdicts: Iterable[Verdict | None], oracle: Replanner) -> None:
        """Count one episode."""
        if run.outcome is Outcome.NO_ROUTE:
            self.hopeless += oracle.plan(oracle.grounded.root, run.belief) is None
        self.episodes += 1
        self.outcomes[run.outcome] += 1
        self.steps += run.steps
        self.looks += run.looks
        self.misread += run.misread
        for verdict in verdicts:
            if verdict is None:
                self.boxed_in += 1
            else:
                self.verdicts.append(verdict)

    @property
    def local_optimal(self) -> int:
        """Affordances in which the local rule's action is proved optimal."""
        return sum(v.local is not None and v.local.optimal for v in self.verdicts)

    @property
    def replanned_optimal(self) -> int:
        """Affordances in which replanning's action is proved optimal."""
        return sum(v.replanned.optimal for v in self.verdicts)

    def globally_optimal(self, oracle: Replanner) -> int:
        """Count replanning's affordances that also begin a shortest way of the whole task."""
        root = oracle.grounded.root
        plans = (oracle.plan(root, verdict.encounter.belief) for verdict in self.verdicts)
        return sum(
            plan is not None and verdict.replanned.action in plan.first_actions
            for plan, verdict in zip(plans, self.verdicts, strict=True)
        )

    def local_rule_by(self) -> dict[str, tuple[int, int]]:
        """Return by shape and distance how often the local rule was asked, and proved optimal."""
        asked = Counter(_situation(verdict) for verdict in self.verdicts)
        optimal = Counter(_situation(v) for v in self.verdicts if v.local is not None and v.local.optimal)
        return {situation: (asked[situation], optimal[situation]) for situation in sorted(asked)}

    def counterexample(self) -> Verdict | None:
        """Return a verdict that refutes the local rule, by a near cube and few obstacles if it can."""
        refuted = [v for v in self.verdicts if v.local is not None and not v.local.optimal]
        return min(refuted, key=lambda v: _telling(v.encounter), default=None)


def _telling(met: Encounter) -> tuple[bool, int, int]:
    return met.affordance.shape != "cube", met.distance, met.known


def _situation(verdict: Verdict) -> str:
    met = verdict.encounter
    return f"{met.affordance.shape}, {met.distance} ahead"
