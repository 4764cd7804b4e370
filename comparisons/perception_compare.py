"""`affordant compare-perception`: run the comparison and leave a report, figures and results, or nothing."""

from __future__ import annotations

from pathlib import Path
from statistics import median
from typing import Any

from rich.console import Console

from comparisons.outputs import new_directory, progress_on, refuse_existing, track_with, write_json
from comparisons.perception_learning import Learning, learn, learners
from comparisons.perception_looks import see
from comparisons.perception_price import Task
from comparisons.perception_report import perception_results, tell_perception
from comparisons.perception_spec import StudySpec
from comparisons.perception_study import load_backends
from comparisons.report import write_report
from comparisons.spread import checked_workers
from worlds.camera import Camera


def compare_perception(
    spec: StudySpec, out: Path, console: Console, workers: int | None = None
) -> dict[str, Any]:
    """Compare backends and write what comes of it to a new directory.

    The directory appears only once everything in it is complete: ``report.html``, ``results.json``,
    ``times.json`` (milliseconds, which no two runs share) and ``figures/``.

    Parameters
    ----------
    spec
        What to compare.
    out
        The directory to make; it must not exist.
    console
        Where progress is shown.
    workers
        Processes that train; their number changes nothing in the results. Defaults to one for each core.

    Returns
    -------
    dict
        The content of results.json.

    Raises
    ------
    UserError
        If `out` exists or cannot be made, or the spec names a backend that cannot be compared.
    """
    refuse_existing(out)
    workers = checked_workers(workers)
    backends = load_backends(spec.backends, Camera())
    progress = progress_on(console)
    track = track_with(progress)
    with new_directory(out) as directory, progress:
        seen = see(spec, backends, track)
        prices = Task(spec, track).prices(backends) if spec.episodes else ()
        names = learners(backends) if spec.learning.seeds else ()
        learning = learn(spec, names, track, workers) if names else Learning((), (), {})
        content = perception_results(spec, seen, prices, learning)
        report, figures = tell_perception(spec, seen, prices, learning)
        write_report(report, figures, directory, track)
        write_json(directory / "results.json", content)
        write_json(directory / "times.json", {name: median(times) for name, times in seen.latency.items()})
    return content


def summarise_perception(content: dict[str, Any]) -> str:
    """Return what the terminal shows of a comparison: a line for each backend.

    Examples
    --------
    >>> score = {"backend": "mine", "condition": "clean", "severity": 0, "accuracy": 0.5, "frames": 4}
    >>> print(summarise_perception({"spec": {"backends": ["mine"]}, "scores": [score]}))
    mine: right on 50.0 % of clean frames
    """
    lines = []
    for name in content["spec"]["backends"]:
        own = [s for s in content["scores"] if s["backend"] == name]
        scenes = [f"{100 * s['accuracy']:.1f} % of {s['condition']} frames" for s in own if not s["severity"]]
        spoilt = [s["accuracy"] for s in own if s["severity"]]
        mean = f"; corrupted {100 * sum(spoilt) / len(spoilt):.1f} % in the mean" if spoilt else ""
        lines.append(f"{name}: right on {', '.join(scenes[:1] + scenes[1:][-1:])}{mean}")
    return "\n".join(lines)
