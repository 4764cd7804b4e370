"""The report on affordances: the example run and the random episodes (figure 15, tables 3 and 4)."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from comparisons.dynamic import Verdict
from comparisons.experiment import Experiment, Snapshot
from comparisons.figures import counterexample_figure, trajectories_figure
from comparisons.figures_routes import drawn
from comparisons.report import Replay, ReplayFrame, Section, Table
from comparisons.results import Findings, affordances
from comparisons.snapshots import SnapshotTally
from comparisons.story_parts import Part, share
from hierarchy import GroundGraph
from planners import Proof
from planners.dynamics import Fault, Reading
from worlds import ACTIONS, Cell, Layout, MazeState, Outcome, step


def example(experiment: Experiment, found: Findings) -> Part:
    """Report the example run (table 4, figure 15)."""
    layout, shown = experiment.layout, found.example
    run = shown.with_obstacles
    rows = affordances(layout, experiment.grounded, run)
    same = rows == affordances(layout, experiment.grounded, shown.replanned)
    text = (
        f"The pair ({layout.trigger}, {layout.goal}) from {layout.start} under the paper's local rule; "
        f"{len(layout.obstacles)} obstacles appear. Without them the robot takes {shown.without.steps} steps "
        f"({shown.without.outcome}), with them {run.steps} ({run.outcome}). Replanning finds "
        f"{'the same' if same else 'other'} affordances. An obstacle off the route needs no care and affords "
        "nothing."
    )
    section = Section(
        "Dynamic affordances: the example run",
        (text,),
        (("trajectories", "The robot's way (a) without and (b) with obstacles (figure 15)."),),
        (
            Table(
                "Affordances of the example run (table 4)",
                ("obstacle", "shape", "subtask", "action"),
                tuple((row["obstacle"], row["shape"], row["subtask"], row["action"]) for row in rows),
            ),
        ),
    )
    rolls = [(layout.cells[push.start], layout.cells[push.end]) for push in run.pushes]
    obstacles = [drawn(obstacle) for obstacle in layout.obstacles]
    figure = trajectories_figure(layout, shown.without.cells, run.cells, obstacles, rolls)
    return Part(section, {"trajectories": figure})


def dynamic(experiment: Experiment, found: Findings) -> Part:
    """Report the random episodes, each affordance proved or refuted."""
    tally, alone = found.dynamic, found.local_rule
    judged = len(tally.verdicts)
    how = (
        f"{tally.episodes} episodes: a random pair, a random start, and one to six obstacles that appear "
        "on the way. The robot replans its current subtask. For each affordance a search finds the "
        "fewest steps under what the robot knows at that moment, and a check that does no searching "
        "accepts its certificate."
    )
    rule = (
        "The paper's local rule (static values, beside a cube the next best action) picks an optimal first "
        f"action in {tally.local_optimal} of {judged} cases, replanning in {tally.replanned_optimal} of "
        f"{judged}; {found.globally_optimal} of the latter are optimal for the whole task too. In "
        f"{tally.boxed_in} more cases the obstacle leaves the subtask no way, and the root chooses another."
    )
    left = (
        "Left to itself, even told every shape, the local rule forgets what it gave up and may walk to and "
        f"fro: it brings {alone[Outcome.REACHED]} of the same {tally.episodes} episodes to the goal, "
        f"replanning {tally.outcomes[Outcome.REACHED]}. Of the {tally.outcomes[Outcome.NO_ROUTE]} episodes "
        f"that end with no route left, {tally.hopeless} have none in the whole maze, whatever the subtasks."
    )
    snapshots = _snapshot_text(found)
    ends = tuple((outcome.value, tally.outcomes[outcome], alone[outcome]) for outcome in Outcome)
    looks = ((tally.looks, tally.misread, share(tally.misread, tally.looks)),)
    situations = tuple(
        (situation, asked, optimal, share(optimal, asked))
        for situation, (asked, optimal) in tally.local_rule_by().items()
    )
    tables = (
        _snapshot_table(found),
        Table("The local rule by situation", ("obstacle", "affordances", "optimal", "share"), situations),
        Table("How the episodes ended", ("end", "replanning", "local rule, told every shape"), ends),
        Table("Looks ahead while replanning", ("looks", "misread", "share"), looks),
    )
    refuted = tally.counterexample()
    if refuted is None:
        return Part(Section("Dynamic affordances: random episodes", (how, rule, snapshots, left), (), tables))
    caption = "A counter-example to the local rule: the obstacles that the robot knew of, and both ways on."
    captions = (("counterexample", caption),)
    section = Section("Dynamic affordances: random episodes", (how, rule, snapshots, left), captions, tables)
    return Part(section, {"counterexample": _counterexample(experiment, refuted)})


def neural(experiment: Experiment, found: Findings) -> Part:
    """Report what an option-critic of the same graph affords; it is there unless the run was quick."""
    critic, tally = found.neural, found.dynamic
    assert critic is not None, "asked for only where it is there"
    rows = affordances(experiment.layout, experiment.grounded, critic.example)
    same = rows == affordances(experiment.layout, experiment.grounded, found.example.with_obstacles)
    text = (
        "The same graph, compiled to an option-critic (Bacon, Harb and Precup, 2017): one set of networks "
        f"for all pairs, after {critic.steps} steps. Its greedy policy takes a shortest way from "
        f"{critic.optimal_starts} of {critic.starts} pairs and starting cells. Asked for the affordances of "
        f"the example run it gives {'the same as' if same else 'others than'} MAXQ's values; among the "
        f"{critic.asked} of the random episodes the local rule picks an action that is proved optimal in "
        f"{critic.optimal} by its values and in {tally.local_optimal} by MAXQ's, the same one in "
        f"{critic.same}."
    )
    head = ("obstacle", "shape", "subtask", "action")
    table = Table(
        "Affordances of the example run by the option-critic's values",
        head,
        tuple(tuple(row[name] for name in head) for row in rows),
    )
    return Part(Section("Affordances by an option-critic", (text,), tables=(table,)))


def _snapshot_text(found: Findings) -> str:
    """Say how often a search that lets no sphere move would have been right."""
    standing = found.snapshots[Reading.STANDING]
    return (
        f"The robot knew of a sphere in {standing.asked} of them. There a snapshot, in which every sphere "
        "stays where it is seen, need not show the optimum: a pushed sphere rolls, may close the way that it "
        "was pushed along, or may open another. Read as they stand (passable in the directions in which they "
        f"could roll just now), spheres let the snapshot miss an optimal first action {_missed(standing)} "
        f"times, {standing.faults[Fault.TRAP]} of them for one that leaves no way."
    )


def _missed(tally: SnapshotTally) -> int:
    return tally.asked - tally.faults[Fault.NONE]


def _snapshot_table(found: Findings) -> Table:
    rows = tuple(
        (
            reading.value,
            *(tally.faults[fault] for fault in Fault),
            share(_missed(tally), tally.asked),
            tally.lost,
        )
        for reading, tally in found.snapshots.items()
    )
    head = ("spheres", *(fault.value for fault in Fault), "not optimal", "steps lost")
    return Table("Snapshots, in which no sphere moves, against the exact planner", head, rows)


def replay(experiment: Experiment, found: Findings) -> Replay:
    """Return the example run, step by step."""
    shown = found.example
    frames = [
        ReplayFrame(snapshot.overview, snapshot.view, tuple(_lines(experiment.grounded, snapshot)))
        for snapshot in shown.snapshots
    ]
    end = f"After {shown.with_obstacles.steps} steps: {shown.with_obstacles.outcome}"
    return Replay((*frames, ReplayFrame(shown.end, None, (end,))), "Replay of the example run")


def _lines(grounded: GroundGraph, snapshot: Snapshot) -> list[str]:
    moment = snapshot.moment
    seen = moment.detection
    what = seen.label if seen.label == "none" else f"{seen.label}, {seen.distance} ahead"
    lines = [
        f"Step {moment.step + 1}: {grounded.nodes[moment.task].name}, {ACTIONS[moment.action]}",
        f"sees {what} (confidence {seen.confidence:.2f})",
    ]
    for met in moment.encounters:
        action = met.affordance.action
        says = "needs no care" if action is None else f"affords {ACTIONS[action]}"
        lines.append(f"{met.obstacle or 'what is seen'} ({met.affordance.shape}) {says}")
    return lines


def _counterexample(experiment: Experiment, refuted: Verdict) -> Figure:
    proof, met = refuted.local, refuted.encounter
    assert proof is not None, "a refuted rule has an action"
    layout, node = experiment.layout, experiment.grounded.nodes[met.task]
    after = () if proof.after is None else proof.after.actions
    return counterexample_figure(
        layout,
        met.belief,
        [layout.marks[experiment.subgoal(node.name)]],
        _passed(layout, met.belief, (proof.action, *after)),
        _passed(layout, met.belief, proof.best.actions),
        texts=(
            f"{node.name}: {_cost(proof)}",
            f"{len(proof.best.actions)} steps; none fewer, by its certificate",
        ),
    )


def _passed(layout: Layout, belief: MazeState, actions: Sequence[int]) -> list[Cell]:
    """Return the cells that the robot passes by the maze's own dynamics."""
    state, cells = belief, [layout.cells[belief.robot]]
    for action in actions:
        state, _ = step(layout, state, action)
        cells.append(layout.cells[state.robot])
    return cells


def _cost(proof: Proof) -> str:
    action = ACTIONS[proof.action]
    if proof.loss is None:
        return f"after {action} there is no way left"
    return f"{action} costs {proof.loss} more than needed"
