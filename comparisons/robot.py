"""The robot in its maze: look, believe, ask for the affordance, act, until the episode has an end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Protocol

from comparisons.belief import Belief
from comparisons.eyes import truth_ahead
from hierarchy import GroundGraph
from perception.protocol import Detection
from planners import Affordance, Strategy
from worlds import Cell, Change, Episode, Layout, MazeState, Outcome, Push, state_number

MAX_STEPS = 100
"""Primitive steps after which an episode in the paper's maze is truncated; the longest optimal way is under a
third of it."""


class Eye(Protocol):
    """What the robot sees with."""

    def begin(self, episode: Episode) -> None:
        """Take up an episode."""

    def look(self, episode: Episode, action: int) -> Detection:
        """Turn towards `action` and tell what stands ahead."""

    def follow(self, episode: Episode, change: Change) -> None:
        """Follow a step that the episode has made."""


@dataclass(frozen=True)
class Encounter:
    """An obstacle seen in a subtask, and what it affords.

    Parameters
    ----------
    step
        Primitive steps before it.
    obstacle
        The obstacle's name; None where nothing really is.
    cell
        Its cell.
    task
        The current subtask's place in the ground graph.
    belief
        What the robot knows, the obstacle included.
    distance
        How many cells ahead it is.
    affordance
        What the strategy says.
    """

    step: int
    obstacle: str | None
    cell: int
    task: int
    belief: MazeState
    distance: int
    affordance: Affordance

    @property
    def known(self) -> int:
        """How many obstacles the robot knows of."""
        return len(self.belief.cubes | self.belief.spheres)


@dataclass(frozen=True)
class Moment:
    """The robot about to act, and what it saw in the direction of its action."""

    step: int
    task: int
    action: int
    detection: Detection
    encounters: tuple[Encounter, ...]


@dataclass
class Run:
    """One episode, carried through.

    Parameters
    ----------
    outcome
        How it ended.
    cells
        The robot's cells, the start first.
    tasks
        The subtask of each step, as places in the ground graph.
    encounters
        Each obstacle once a subtask: when first seen, and again if it later comes to stand on the route.
    pushes
        The spheres' rolls.
    looks, misread
        Looks ahead, and those that told a wrong shape or distance.
    belief
        What the robot knew in the end.
    """

    belief: MazeState
    outcome: Outcome = Outcome.TRUNCATED
    cells: list[Cell] = field(default_factory=list)
    tasks: list[int] = field(default_factory=list)
    encounters: list[Encounter] = field(default_factory=list)
    pushes: list[Push] = field(default_factory=list)
    looks: int = 0
    misread: int = 0

    @property
    def steps(self) -> int:
        """Primitive steps taken."""
        return len(self.cells) - 1

    @property
    def blocked(self) -> int:
        """Steps that left the robot where it was: each is a mistake that it felt."""
        return sum(here == there for here, there in pairwise(self.cells))


class Robot:
    """Carries episodes through with one strategy and one eye.

    Parameters
    ----------
    layout, grounded
        The maze and its ground graph.
    strategy
        Decides.
    eye
        Sees.
    max_steps
        Primitive steps after which an episode is truncated.
    """

    def __init__(
        self,
        layout: Layout,
        grounded: GroundGraph,
        strategy: Strategy,
        eye: Eye,
        *,
        max_steps: int = MAX_STEPS,
    ) -> None:
        self.layout = layout
        self.grounded = grounded
        self.strategy = strategy
        self.eye = eye
        self.max_steps = max_steps

    def run(self, episode: Episode, watch: Callable[[Moment], None] | None = None) -> Run:
        """Carry an episode to its end; `watch` is called before every step."""
        belief = Belief(self.layout, episode)
        run = Run(belief.state, cells=[self.layout.cells[episode.state.robot]])
        self.eye.begin(episode)
        task: int | None = None
        while not episode.reached and episode.steps < self.max_steps:
            decided = self._decide(episode, belief, task, run)
            if decided is None:
                break
            task = decided.task
            if watch is not None:
                watch(decided)
            change = episode.step(decided.action)
            self.eye.follow(episode, change)
            belief.feel(change, episode.state.robot, doors_open=episode.state.doors_open)
            run.cells.append(self.layout.cells[episode.state.robot])
            run.tasks.append(task)
            if change.push is not None:
                run.pushes.append(change.push)
        run.belief = belief.state
        if episode.reached:
            run.outcome = Outcome.REACHED
        else:
            failure = Outcome.TRUNCATED if episode.steps >= self.max_steps else Outcome.NO_ROUTE
            run.outcome = self._blame(belief, episode, failure)
        return run

    def _decide(self, episode: Episode, belief: Belief, task: int | None, run: Run) -> Moment | None:
        """Choose the next action, looking in its direction first; None if no way is left."""
        if task is None or not self._runs(task, belief.state):
            task = self.strategy.choose(belief.state)
        looked: dict[int, Detection] = {}
        met: list[Encounter] = []
        insisted: int | None = None
        while True:
            if task is None:
                # Before it gives up, it tries by touch what it is least sure of.
                if not belief.doubt():
                    return None
                task, insisted = self.strategy.choose(belief.state), None
                continue
            route = self.strategy.route(task, belief.state)
            if route is None:
                other = self.strategy.choose(belief.state)
                task = None if other == task else other
                insisted = None
                continue
            action = route[0] if insisted is None else insisted
            if action in looked:
                if belief.fails(action):
                    # It would fail again. With that learnt there may be another way.
                    if not belief.rule_out(action) and insisted is None:
                        return None
                    insisted = None
                    continue
                return Moment(episode.steps, task, action, looked[action], tuple(met))
            looked[action] = self._look(episode, action, run)
            cell = belief.see(action, looked[action])
            encounter = None if cell is None else self._meet(episode, belief, task, cell, run)
            if encounter is not None:
                met.append(encounter)
                insisted = encounter.affordance.action

    def _look(self, episode: Episode, action: int, run: Run) -> Detection:
        detection = self.eye.look(episode, action)
        truth = truth_ahead(self.layout, episode.state, action)
        run.looks += 1
        run.misread += (detection.label, detection.distance) != (truth.label, truth.distance)
        return detection

    def _meet(self, episode: Episode, belief: Belief, task: int, cell: int, run: Run) -> Encounter | None:
        """Ask what an obstacle in view affords, unless it was asked for in this subtask already."""
        name = episode.name_at(cell)
        before = [e for e in run.encounters if e.task == task and (e.obstacle, e.cell) == (name, cell)]
        if any(e.affordance.on_route for e in before):
            return None
        affordance = self.strategy.affordance(task, cell, belief.state)
        if before and not affordance.on_route:
            return None
        here, there = self.layout.cells[belief.state.robot], self.layout.cells[cell]
        distance = abs(here.row - there.row) + abs(here.col - there.col)
        encounter = Encounter(episode.steps, name, cell, task, belief.state, distance, affordance)
        run.encounters.append(encounter)
        return encounter

    def _runs(self, task: int, state: MazeState) -> bool:
        number = state_number(self.layout, self.grounded.model.index, state)
        return bool(self.grounded.nodes[task].live[number])

    def _blame(self, belief: Belief, episode: Episode, otherwise: Outcome) -> Outcome:
        """Name a failure after a wrong belief if there would be a way with every known shape right."""
        if not belief.misjudges(episode.state):
            return otherwise
        corrected = belief.corrected(episode.state)
        task = self.strategy.choose(corrected)
        has_way = task is not None and self.strategy.route(task, corrected) is not None
        return Outcome.WRONG_SHAPE if has_way else otherwise
