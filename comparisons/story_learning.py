"""The report on the task graph, its value counts and subtask learning (figures 4, 12 and 13)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from comparisons.experiment import Experiment
from comparisons.figures import (
    band,
    convergence_figure,
    step_tables_figure,
    task_graph_figure,
    value_counts_figure,
)
from comparisons.learning import EPISODES, Curve
from comparisons.learning import Table as StepTable
from comparisons.report import Section, Table, Verdict
from comparisons.results import Findings
from comparisons.story_parts import Part
from hierarchy import task_graph_picture
from worlds import Cell

PAPER_VALUES: Final[Mapping[str, int]] = {
    "flat Q": 4096,
    "three tasks, no abstraction": 12288,
    "GotoTrigger": 512,
    "GotoDoor": 256,
    "GotoGoal": 512,
    "primitive actions": 4,
    "MAXQ, abstracted": 1284,
}
"""The numbers of values that section 5.3 of the paper prints."""
_WINDOW: Final = 20
"""Episodes that a run's steps are averaged over in the figure of convergence."""


def graph(experiment: Experiment, found: Findings) -> Part:
    """Report the task graph and how many values each representation stores (section 5.3)."""
    counts = found.counts
    rows = (
        ("flat Q", counts.flat),
        ("flat Q with the doors", counts.flat_markov),
        ("three tasks, no abstraction", counts.unabstracted_tasks),
        ("four subtasks, no abstraction", counts.unabstracted_subtasks),
        *counts.per_task.items(),
        ("primitive actions", counts.leaves),
        ("MAXQ, abstracted", counts.abstracted),
    )
    printed = (
        "Every count comes from the task graph. Without abstraction the paper prints 12288, which is "
        "64 x 4 x 4 x 4 values for each of three tasks; its text counts four subtasks (GotoDoor once for "
        f"each door) and says four times a flat table, which is {counts.unabstracted_subtasks}."
    )
    more = (
        "Flat Q over robot, trigger and goal alone is not Markov, since the doors decide what an action "
        f"does; with them it stores {counts.flat_markov}. The paper counts no values of the root; "
        f"choosing a door takes {counts.root} completion values there."
    )
    section = Section(
        "Task graph and state abstraction",
        (printed, more),
        (
            ("task_graph", "Root, its subtasks with their guards, and the primitive actions (figure 4)."),
            ("value_counts", "Values stored by each representation."),
        ),
        (
            Table(
                "Values by representation",
                ("representation", "values", "in the paper"),
                tuple((name, n, PAPER_VALUES.get(name)) for name, n in rows),
            ),
        ),
    )
    figures = {
        "task_graph": task_graph_figure(task_graph_picture(experiment.grounded.graph)),
        "value_counts": value_counts_figure(rows),
    }
    return Part(section, figures)


def learning(experiment: Experiment, found: Findings) -> Part:
    """Report subtask learning and hold it to the oracle (section 6.2)."""
    doors, single = found.gaps
    how = (
        f"MAXQ-0 learns each of the {len(found.pairs)} pairs of trigger and goal by itself: every subtask "
        f"for {EPISODES} episodes from random grids of its room, the root at last. The pair shown learns "
        f"each subtask for {EPISODES} episodes before that from the grid that figure 12 measures it from, "
        "GotoGoal from D1 and then from D2. The learning rate is 0.9, multiplied by 0.9 every 40 episodes; "
        "gamma is 1."
    )
    runs = sum(pair.runs for pair in found.pairs)
    seeds = (
        f"Every pair learns with {found.pairs[0].runs} seeds. Of the {runs} runs, "
        f"{sum(pair.optimal_runs for pair in found.pairs)} take the oracle's steps from every grid and every "
        "start; the figures and tables of single runs show the first."
    )
    lost = (
        "With GotoDoor bound to each door, the recursively optimal policy is globally optimal from "
        f"{doors.starts - doors.short} of {doors.starts} starts (all triggers and goals). One GotoDoor "
        f"without a parameter takes the nearer door and falls short from {single.short} of "
        f"{single.starts}, by up to {single.worst} steps."
    )
    rows = tuple(
        (
            p.trigger,
            p.goal,
            p.wrong_grids,
            p.wrong_starts,
            f"{p.optimal_runs} of {p.runs}",
            Verdict(p.optimal, "optimal" if p.optimal else "not"),
        )
        for p in found.pairs
    )
    header = (
        "trigger",
        "goal",
        "grids unlike the oracle",
        "starts unlike the oracle",
        "optimal runs",
        "verdict",
    )
    section = Section(
        "Subtask learning",
        (how, seeds, lost),
        (
            (
                "convergence",
                "Steps from the start to the subgoal as each subtask is learnt (figure 12): median and "
                f"interquartile range of {found.pairs[0].runs} runs (training: means of {_WINDOW} episodes).",
            ),
            ("step_counts", "Learnt steps from every grid to the subgoal (figure 13)."),
        ),
        (Table("Every learnt pair against the oracle", header, rows),),
    )
    figures = {
        "convergence": _convergence(experiment.curves),
        "step_counts": _steps(experiment, found.tables),
    }
    return Part(section, figures)


def _convergence(curves: Mapping[str, Curve]) -> Figure:
    drawn = {
        name: {"training": band(_means(curve.training)), "greedy": band(_or_never(curve.greedy))}
        for name, curve in curves.items()
    }
    return convergence_figure(drawn, {name: curve.optimum for name, curve in curves.items()})


def _means(steps: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return each run's mean steps of every `_WINDOW` episodes: single episodes jump to and fro."""
    means: NDArray[np.float64] = steps.reshape(len(steps), -1, _WINDOW).mean(axis=2)
    return means


def _or_never(steps: NDArray[np.int64]) -> NDArray[np.float64]:
    return np.where(steps < 0, np.inf, steps)


def _steps(experiment: Experiment, tables: Mapping[str, StepTable]) -> Figure:
    layout, learner = experiment.layout, next(iter(experiment.learners.values()))
    rooms = {name: learner.room(name) for name in tables}
    return step_tables_figure(
        {name: [[-1 if n is None else n for n in row] for row in table] for name, table in tables.items()},
        subgoals={name: layout.marks[experiment.subgoal(name)] for name in tables},
        origins={
            name: Cell(min(cell.row for cell in room), min(cell.col for cell in room))
            for name, room in rooms.items()
        },
    )
