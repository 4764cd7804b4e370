"""Runs of kind "learn": one learner on one task graph, held to the oracle while it learns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from math import isfinite
from typing import Final, NamedTuple

import numpy as np

from comparisons.learn.line import Line, Measured
from comparisons.learn.registry import Request, Run, StuckError, new_run
from comparisons.study.kinds import Kind, Measure, Result
from comparisons.study.runs.learn_heat import heat_map
from comparisons.study.runs.learn_problem import layout_of, problem, refuse_wrong, settle, stored_values
from comparisons.study.runs.learn_settings import NAMES, ORACLE, files, settings_of, split, text
from comparisons.study.spec import Value
from planners.option_critic.greedy import GreedyPolicy

MEASURES: Final = (
    Measure("steps_to_optimal", "environment steps until every start is optimal", "steps", "less"),
    Measure("episodes_to_optimal", "episodes until every start is optimal", "episodes", "less"),
    Measure("steps_to_level", "environment steps until the mean return is near the best", "steps", "less"),
    Measure("share_optimal", "share of the starts from which the policy is optimal at the end", "", "more"),
    Measure("share_ending", "share of the starts from which the policy surely ends", "", "more"),
    Measure(
        "mean_loss",
        "how much the return falls short of the best at the end, the mean over all starts",
        "reward",
        "less",
    ),
    Measure("mean_return", "return at the end, the mean over all starts", "reward", "more"),
    Measure("steps", "environment steps of the whole run", "steps", None),
    # Neither less nor more of them is better: a learner without tables has none, rather than too many.
    Measure("stored_values", "values that the learner's tables need", "values"),
)
"""What a run of learning measures."""


class Point(NamedTuple):
    """One evaluation.

    Attributes
    ----------
    steps
        Environment steps so far.
    episodes
        Episodes so far; None if the learner does not count them.
    measured
        How near the greedy policy is to the best.
    """

    steps: int
    episodes: int | None
    measured: Measured


@dataclass(frozen=True, eq=False)
class Goals:
    """What a run is to come to, and by what that is measured.

    Parameters
    ----------
    line
        The best there is.
    loss
        The mean return short of the best that counts as near it.
    until
        What ends the run.
    lasting
        How long that must have lasted, as a multiple of the steps until then. Learning goes on where the
        greedy policy is optimal, and often spoils it again.
    limit
        Steps after which an episode of evaluation is over; 0 for none.
    """

    line: Line
    loss: float
    until: str
    lasting: float = 0.0
    limit: int = 0

    def measure(self, policy: GreedyPolicy) -> Measured:
        """Return how near a policy comes; no means where an episode never ends, nor is cut off."""
        measured = self.line.measure(policy)
        if not self.limit:
            # Of the other starts alone they would look the better, the fewer those are.
            endless = measured.share_ending < 1
            return measured._replace(mean_return=np.nan, mean_loss=np.nan) if endless else measured
        returns = policy.returns_within(self.line.starts, self.limit)
        short = self.line.best - returns
        return measured._replace(mean_return=float(returns.mean()), mean_loss=float(short.mean()))

    def optimal(self, point: Point) -> bool:
        """Return whether every start is optimal."""
        return point.measured.share_optimal == 1

    def level(self, point: Point) -> bool:
        """Return whether it comes near enough to the best."""
        return point.measured.mean_loss <= self.loss

    def over(self, points: Sequence[Point]) -> bool:
        """Return whether there is nothing left to learn for: it has come there, and that has lasted."""
        if self.until == "end":
            return False
        reached = self.optimal if self.until == "optimal" else self.level
        since = first_for_good([reached(point) for point in points])
        return since is not None and points[-1].steps >= (1 + self.lasting) * points[since].steps


def complete(given: Mapping[str, Value]) -> dict[str, Value]:
    """Return all settings of a run, checked as far as that goes without files of the user's own.

    Raises
    ------
    UserError
        If one is unknown or not possible; the message begins with its name.

    Examples
    --------
    >>> complete({"graph": "two_rooms", "starts": "goal = G5"})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: starts: ...
    """
    settings = settings_of(given)
    if not files(settings):  # what those hold is for `settle`
        refuse_wrong(settings)
    return settings


def run(settings: Mapping[str, Value], seed: int) -> Result:
    """Carry out a run.

    Parameters
    ----------
    settings
        Complete ones.
    seed
        Of learning.

    Raises
    ------
    UserError
        If the graph, the world or the learner will not do.

    Examples
    --------
    >>> result = run(complete({"graph": "two_rooms", "evaluate": 20}), seed=0)
    >>> result.measures["share_optimal"], result.measures["stored_values"]
    (1.0, 1308.0)
    >>> list(result.curves["learning"]), len(result.details["heat"]["cells"])
    (['steps', 'episodes', 'share_optimal', 'share_ending', 'mean_return', 'mean_loss'], 31)
    """
    asked = split(settings)
    grounded = problem(asked)
    line = Line.of(grounded)
    near = asked.tolerance * float(np.abs(line.best).mean())
    goals = Goals(line, near, asked.until, asked.lasting, asked.limit)
    layout = layout_of(asked, grounded)
    if asked.learner == ORACLE:
        points, learnt, stuck = [Point(0, 0, _perfect(line))], None, ""
    else:
        own = {name: text(value) for name, value in settings.items() if name not in NAMES}
        learner = new_run(Request(asked.learner, grounded, seed, settings=own, steps=asked.steps))
        learning = _Learning(learner, goals)
        points, learnt, stuck = learning.points, learner.greedy(), learning.stuck
    heat = {} if layout is None else heat_map(layout, grounded, learnt)
    details = {**heat, "stuck": stuck} if stuck else heat
    measures = _measures(points, goals, stored_values(grounded, asked.learner), came_through=not stuck)
    return Result(measures, {"learning": _curve(points)}, details)


def first_for_good(held: Sequence[bool]) -> int | None:
    """Return the first place from which something holds to the end; None if it does not at the end.

    Examples
    --------
    >>> first_for_good([False, True, False, True, True]), first_for_good([True, False])
    (3, None)
    """
    if not held or not held[-1]:
        return None
    return len(held) - held[::-1].index(False) if False in held else 0


class _Learning:
    """A learner's way: its evaluations, whenever one is due and at the end.

    A learner whose episode does not end, or whose numbers are none any more, has come to its end, too, as
    `stuck` tells.
    """

    def __init__(self, learner: Run, goals: Goals) -> None:
        self.learner, self.goals = learner, goals
        self.points: list[Point] = []
        self.stuck = ""
        try:
            self._go()
        except StuckError as error:
            self.stuck = str(error).partition("; ")[0]
        if not self.points:
            self._evaluate(0)

    def _go(self) -> None:
        total = int(self.learner.settings["total"])
        with closing(self.learner.learn()) as pieces:
            for steps, measures in pieces:
                for name, value in measures.items():
                    if not isfinite(value):
                        raise StuckError(f"learning went astray: after {steps} steps {name} is {value}")
                if self.learner.due() or steps >= total:
                    self._evaluate(steps)
                    if self.goals.over(self.points):
                        return

    def _evaluate(self, steps: int) -> None:
        episodes = getattr(self.learner, "episodes", None)
        self.points.append(Point(steps, episodes, self.goals.measure(self.learner.greedy())))


def _perfect(line: Line) -> Measured:
    return Measured(1.0, 1.0, float(line.best.mean()), 0.0)


def _measures(
    points: Sequence[Point], goals: Goals, values: int | None, *, came_through: bool
) -> dict[str, float | None]:
    """Return what is measured; a learner that got stuck has reached nothing."""
    optimal = first_for_good([came_through and goals.optimal(point) for point in points])
    level = first_for_good([came_through and goals.level(point) for point in points])
    last = points[-1]
    episodes = None if optimal is None else points[optimal].episodes
    found: dict[str, float | None] = {
        "steps_to_optimal": None if optimal is None else points[optimal].steps,
        **({} if last.episodes is None else {"episodes_to_optimal": episodes}),
        "steps_to_level": None if level is None else points[level].steps,
        **{name: _known(value) for name, value in last.measured._asdict().items()},
        "steps": last.steps,
        "stored_values": values,
    }
    return {name: None if value is None else float(value) for name, value in found.items()}


def _curve(points: Sequence[Point]) -> dict[str, list[float | None]]:
    columns: dict[str, list[float | None]] = {"steps": [float(point.steps) for point in points]}
    if all(point.episodes is not None for point in points):
        columns["episodes"] = [float(point.episodes or 0) for point in points]
    for name in Measured._fields:
        columns[name] = [_known(getattr(point.measured, name)) for point in points]
    return columns


def _known(value: float) -> float | None:
    """Return a number, or None where there was nothing to take the mean of."""
    return None if np.isnan(value) else float(value)


LEARN: Final = Kind("learn", 1, MEASURES, complete, files, run, settle)
"""The kind of run."""
