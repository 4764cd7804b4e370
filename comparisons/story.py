"""The report of a reproduction, put together from its parts."""

from __future__ import annotations

from matplotlib.figure import Figure

from comparisons.experiment import Experiment
from comparisons.report import Report
from comparisons.results import Findings
from comparisons.story_dynamic import dynamic, example, neural, replay
from comparisons.story_learning import graph, learning
from comparisons.story_parts import percent, share
from comparisons.story_senses import maze, seeing, static


def tell(experiment: Experiment, found: Findings) -> tuple[Report, dict[str, Figure]]:
    """Return the report and its figures by name."""
    writers = [maze, graph, static, seeing, learning, example, dynamic]
    if found.neural is not None:
        writers.append(neural)
    parts = [write(experiment, found) for write in writers]
    figures = {name: figure for part in parts for name, figure in part.figures.items()}
    tally, optimal = found.dynamic, sum(pair.optimal for pair in found.pairs)
    judged = len(tally.verdicts)
    report = Report(
        title="Affordances from subtasks' optimal strategies",
        lead=(
            "A reproduction of Min et al. (2015), section 6: a robot in a PyBullet maze recognises cubes and "
            "spheres, learns its subtasks with MAXQ-0, meets obstacles and picks affordances; a "
            "breadth-first search under everything that the robot knows verifies each of them."
        ),
        summary=(
            ("Pairs learnt to optimality", f"{optimal} of {len(found.pairs)}", "from every start"),
            (
                "Shapes told right",
                percent(found.seen.accuracy),
                f"of {found.seen.frames} fresh frames, by {experiment.spec.perception}",
            ),
            (
                "Optimal affordances, local rule",
                share(tally.local_optimal, judged),
                f"of {judged}, in {tally.episodes} random episodes",
            ),
            (
                "Optimal affordances, replanning",
                share(tally.replanned_optimal, judged),
                f"of {judged}, each one proved",
            ),
            ("Values stored by MAXQ", found.counts.abstracted, f"flat Q: {found.counts.flat}"),
        ),
        sections=tuple(part.section for part in parts),
        replay=replay(experiment, found),
    )
    return report, figures
