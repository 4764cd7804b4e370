"""`affordant reproduce`: run the paper's experiment and leave a report, figures and results, or nothing."""

from __future__ import annotations

from pathlib import Path
from time import process_time

from rich.console import Console

from comparisons.experiment import Experiment, Spec
from comparisons.outputs import new_directory, progress_on, refuse_existing, track_with, write_json
from comparisons.report import write_report
from comparisons.results import find, results
from comparisons.story import tell
from hierarchy import mermaid


def reproduce(spec: Spec, out: Path, console: Console) -> dict[str, object]:
    """Run the experiment and write its outputs to a new directory.

    The directory appears only once everything in it is complete: ``report.html``, ``results.json``,
    ``times.json`` (CPU seconds, which no two runs share), ``figures/`` and ``task_graph.mmd`` (Mermaid).

    Parameters
    ----------
    spec
        What to run.
    out
        The directory to make; it must not exist.
    console
        Where progress is shown.

    Returns
    -------
    dict
        The content of results.json.

    Raises
    ------
    UserError
        If `out` exists or cannot be made, or the spec names a layout or backend that there is not.
    """
    refuse_existing(out)
    progress = progress_on(console)
    track = track_with(progress)
    experiment = Experiment(spec, track)
    with new_directory(out) as directory, progress:
        begun = process_time()
        found = find(experiment)
        searched = process_time()
        content = results(spec, experiment.layout, experiment.grounded, found)
        report, figures = tell(experiment, found)
        write_report(report, figures, directory, track)
        (directory / "task_graph.mmd").write_text(mermaid(experiment.grounded.graph), encoding="utf-8")
        times = {"experiment": searched - begun, "report": process_time() - searched}
        write_json(directory / "results.json", content)
        write_json(directory / "times.json", times)
    return content
