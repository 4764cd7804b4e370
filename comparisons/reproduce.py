"""`affordant reproduce`: run the paper's experiment and leave a report, figures and results, or nothing."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import process_time
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from comparisons.experiment import Experiment, Spec, Track
from comparisons.report import render
from comparisons.results import find, results
from comparisons.story import tell
from comparisons.style import picture
from hierarchy import mermaid
from worlds import UserError

T = TypeVar("T")


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
    _refuse_existing(out)
    progress = _progress(console)
    experiment = Experiment(spec, _track(progress))
    with _new_directory(out) as directory, progress:
        begun = process_time()
        found = find(experiment)
        searched = process_time()
        content = results(spec, experiment.layout, experiment.grounded, found)
        report, figures = tell(experiment, found)
        (directory / "figures").mkdir()
        pictures = {}
        for name in progress.track(figures, description="drawing figures"):
            pictures[name] = picture(figures[name])
            pictures[name].save(directory / "figures", name)
        (directory / "task_graph.mmd").write_text(mermaid(experiment.grounded.graph), encoding="utf-8")
        (directory / "report.html").write_text(render(report, pictures), encoding="utf-8")
        times = {"experiment": searched - begun, "report": process_time() - searched}
        for name, data in (("results", content), ("times", times)):
            text = json.dumps(data, indent=2, ensure_ascii=False) + "\n"
            (directory / f"{name}.json").write_text(text, encoding="utf-8")
    return content


def _refuse_existing(out: Path) -> None:
    if out.exists() or out.is_symlink():
        raise UserError(f"--out {out}: it exists already; name a new directory, or remove this one")


@contextmanager
def _new_directory(out: Path) -> Iterator[Path]:
    """Yield a directory that takes the name `out` if all goes well, and vanishes if not."""
    try:
        parent = out.absolute().parent
        parent.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=parent))
    except OSError as error:
        raise UserError(f"--out {out}: it cannot be made ({error.strerror}); name another place") from error
    try:
        yield made
        made.chmod(0o755)
        _refuse_existing(out)
        made.rename(out)
    finally:
        shutil.rmtree(made, ignore_errors=True)


def _track(progress: Progress) -> Track:
    def track(items: Iterable[T], *, total: int, description: str) -> Iterable[T]:
        return progress.track(items, total=total, description=description)

    return track


def _progress(console: Console) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=console)
