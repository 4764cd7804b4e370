"""results.json: everything that an experiment found, as plain numbers and words."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from importlib.metadata import requires, version
from platform import python_version
from typing import TYPE_CHECKING, Any

from packaging.requirements import Requirement

from comparisons.dynamic import Tally
from comparisons.experiment import Example, Experiment, Learnt, Spec
from comparisons.learning import Table
from comparisons.robot import Run
from comparisons.snapshots import Shortfall, SnapshotTally, judge_all
from hierarchy import GroundGraph, ValueCounts
from perception.accuracy import Accuracy
from perception.pushing import Agreement
from planners import Gap
from planners.dynamics import Fault, Reading
from worlds import ACTIONS, Layout, Outcome

if TYPE_CHECKING:
    from comparisons.neural import Neural


@dataclass(frozen=True, eq=False)
class Findings:
    """What every part of the experiment found."""

    counts: ValueCounts
    gaps: tuple[Gap, Gap]
    pushes: Agreement
    seen: Accuracy
    pairs: tuple[Learnt, ...]
    tables: dict[str, Table]
    example: Example
    dynamic: Tally
    globally_optimal: int
    snapshots: dict[Reading, SnapshotTally]
    local_rule: dict[Outcome, int]
    neural: Neural | None


def find(experiment: Experiment) -> Findings:
    """Run every part of an experiment, in order."""
    pushes, seen, pairs = experiment.pushing(), experiment.seeing(), experiment.learning()
    shown = experiment.learners[experiment.layout.trigger, experiment.layout.goal]
    dynamic = experiment.dynamic()
    return Findings(
        counts=experiment.counts(),
        gaps=experiment.gaps(),
        pushes=pushes,
        seen=seen,
        pairs=pairs,
        tables={task: shown.step_table(task) for task in shown.subtasks()},
        example=experiment.example(),
        dynamic=dynamic,
        globally_optimal=dynamic.globally_optimal(experiment.oracle),
        snapshots=judge_all(experiment.oracle, dynamic.verdicts),
        local_rule=experiment.local_rule(),
        neural=experiment.neural(dynamic),
    )


def results(spec: Spec, layout: Layout, grounded: GroundGraph, found: Findings) -> dict[str, Any]:
    """Return the content of results.json; the same seed gives the same content."""
    return {
        "seed": spec.seed,
        "quick": spec.quick,
        "layout": spec.layout,
        "versions": _versions(),
        "value_counts": _value_counts(found.counts),
        "static": {
            "pushes": found.pushes.trials,
            "sphere_iff_rolls": found.pushes.rotation,
            "sphere_iff_displaced": found.pushes.displacement,
            "counts": {kind: dict(labels) for kind, labels in found.pushes.counts.items()},
        },
        "perception": {"backend": spec.perception, **asdict(found.seen)},
        "step_counts": found.tables,
        "pairs": [
            {
                "trigger": pair.trigger,
                "goal": pair.goal,
                "optimal": pair.optimal,
                "wrong_grids": pair.wrong_grids,
                "wrong_starts": pair.wrong_starts,
                "runs": pair.runs,
                "optimal_runs": pair.optimal_runs,
            }
            for pair in found.pairs
        ],
        "doors": {"as_parameter": asdict(found.gaps[0]), "one_task": asdict(found.gaps[1])},
        "affordances": affordances(layout, grounded, found.example.with_obstacles),
        "affordances_replanned": affordances(layout, grounded, found.example.replanned),
        "trajectories": {
            "without_obstacles": [list(cell) for cell in found.example.without.cells],
            "with_obstacles": [list(cell) for cell in found.example.with_obstacles.cells],
        },
        "dynamic": _dynamic(found),
        "snapshots": _snapshots(layout, grounded, found),
        "option_critic": _neural(layout, grounded, found.neural),
    }


def affordances(layout: Layout, grounded: GroundGraph, run: Run) -> list[dict[str, str | None]]:
    """Return what each obstacle of the example run afforded (table 4): None where it needed no care.

    An obstacle that was met in several subtasks has a row for each.
    """
    rows: list[dict[str, str | None]] = []
    for obstacle in sorted(layout.obstacles, key=lambda o: o.name):
        met = [e for e in run.encounters if e.obstacle == obstacle.name and e.affordance.on_route]
        rows += [
            {
                "obstacle": obstacle.name,
                "subtask": grounded.nodes[e.task].task,
                "action": None if e.affordance.action is None else ACTIONS[e.affordance.action],
                "shape": e.affordance.shape,
            }
            for e in met
        ]
        if not met:
            rows.append({"obstacle": obstacle.name, "subtask": None, "action": None, "shape": obstacle.kind})
    return rows


def _neural(layout: Layout, grounded: GroundGraph, found: Neural | None) -> dict[str, Any] | None:
    if found is None:
        return None
    numbers = ("steps", "starts", "optimal_starts", "asked", "optimal", "same")
    return {
        **{name: getattr(found, name) for name in numbers},
        "affordances": affordances(layout, grounded, found.example),
    }


def _versions() -> dict[str, str]:
    """Return the versions of Python, of affordant, and of everything that it requires."""
    wanted = [Requirement(text) for text in requires("affordant") or ()]
    names = sorted({need.name for need in wanted if need.marker is None})
    return {"python": python_version(), **{name: version(name) for name in ("affordant", *names)}}


def _value_counts(counts: ValueCounts) -> dict[str, int]:
    return {
        "flat_q": counts.flat,
        "flat_q_with_doors": counts.flat_markov,
        "unabstracted_as_printed": counts.unabstracted_tasks,
        "unabstracted_four_subtasks": counts.unabstracted_subtasks,
        **counts.per_task,
        **{f"{task}_live": n for task, n in counts.per_task_live.items()},
        "primitive_actions": counts.leaves,
        "maxq_abstracted": counts.abstracted,
        "root": counts.root,
    }


def _dynamic(found: Findings) -> dict[str, Any]:
    tally = found.dynamic
    return {
        "episodes": tally.episodes,
        "affordances": len(tally.verdicts),
        "optimal_local_rule": tally.local_optimal,
        "local_rule_by_situation": {
            situation: {"affordances": asked, "optimal": optimal}
            for situation, (asked, optimal) in tally.local_rule_by().items()
        },
        "optimal_replanning": tally.replanned_optimal,
        "globally_optimal_replanning": found.globally_optimal,
        "without_a_way": tally.boxed_in,
        "outcomes": {outcome.value: tally.outcomes[outcome] for outcome in Outcome},
        "outcomes_local_rule_alone": {outcome.value: n for outcome, n in found.local_rule.items()},
        "no_route_in_the_whole_maze": tally.hopeless,
        "steps": tally.steps,
        "looks": tally.looks,
        "misread": tally.misread,
    }


def _snapshots(layout: Layout, grounded: GroundGraph, found: Findings) -> dict[str, Any]:
    return {
        reading.value: {
            "affordances": tally.asked,
            **{fault.value: tally.faults[fault] for fault in Fault},
            "optimal_in_all_that_it_holds_optimal": tally.alike,
            "steps_lost": tally.lost,
            "most_steps_lost": tally.most,
            "smallest": None if tally.smallest is None else _shortfall(layout, grounded, tally.smallest),
        }
        for reading, tally in found.snapshots.items()
    }


def _shortfall(layout: Layout, grounded: GroundGraph, found: Shortfall) -> dict[str, Any]:
    state, judgement = found.state, found.judgement
    assert found.task is not None, "the robot was carrying out a task"
    assert judgement is not None, "and its affordance was judged"
    return {
        "subtask": grounded.nodes[found.task].name,
        "robot": str(layout.cells[state.robot]),
        "cubes": [str(layout.cells[cell]) for cell in sorted(state.cubes)],
        "spheres": [str(layout.cells[cell]) for cell in sorted(state.spheres)],
        "snapshot": [ACTIONS[action] for action in sorted(judgement.snapshot)],
        "optimal": [ACTIONS[action] for action in sorted(judgement.exact)],
        "loss": judgement.loss,
    }
