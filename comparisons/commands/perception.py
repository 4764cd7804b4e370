"""Commands on perception: a backend on pictures of one's own, training one, comparing them."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console


def perceive(path: Path, /, *, perception: str = "hough", out: Path | None = None) -> int:
    """Tell what stands ahead in your own pictures: none, cube or sphere, how far, and how surely.

    Exit status 0 says that every file could be read, 1 that some could not (a line each on standard error),
    2 that nothing was looked at.

    Parameters
    ----------
    path
        A picture (PNG, JPEG, BMP or WebP), or a folder of them. The middle square of each is looked at.
    perception
        Backend: hough, cnn, hog, ensemble, one that an installed package adds, or, for weights of your own,
        NAME=FILE such as cnn=mine/cnn.safetensors.
    out
        Directory to make, for percepts.csv and annotated pictures; it must not exist.
    """
    from comparisons.perceive_commands import perceive as run

    found = run(
        path,
        perception,
        out,
        lambda one: print(one, file=sys.stdout if one.detection else sys.stderr, flush=True),
    )
    return 1 if any(one.detection is None for one in found) else 0


def train_perception(*, backend: str = "cnn", out: Path, frames: int = 5000, seed: int = 0) -> int:
    """Train a backend on frames that are rendered, and labelled by pushing what they show.

    Parameters
    ----------
    backend
        Backend that learns: cnn, hog, ensemble, or one that an installed package adds.
    out
        Folder for the weights and the frames. After a break, the same command goes on with the frames.
    frames
        Number of frames to learn from.
    seed
        Of frames and training, 0 to 99.
    """
    from comparisons.learnt import train_perception as run

    weights = run(backend, out, frames, seed, Console(stderr=True))
    print(weights)
    print(weights.with_suffix(".json"))
    return 0


def compare_perception(
    *,
    out: Path,
    backends: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative_iterable=())] = (),
    frames: int | None = None,
    episodes: int | None = None,
    seed: int = 200,
    quick: bool = False,
    learning: bool = True,
    training_seeds: int | None = None,
    effort: float | None = None,
    workers: int | None = None,
) -> int:
    """Compare perception backends: accuracy, calibration, latency, learning, and what mistakes cost.

    Backends that learn are also trained anew, on few pushes and many, on wrong labels, and with colours,
    distances and sizes kept out; --no-learning leaves that out.

    Parameters
    ----------
    out
        Directory to make; it must not exist.
    backends
        Names, or NAME=FILE for weights of your own. Defaults to every backend that reads frames.
    frames
        Frames of every set. Defaults to 1000, or 90 if quick.
    episodes
        Random episodes of the task. Defaults to 200, or 20 if quick.
    seed
        Of the frames, 200 to 299; the seeds below train and tune.
    quick
        Fewer frames, episodes, severities and trainings, and short ones, for a first look.
    learning
        Whether backends are trained anew.
    training_seeds
        How many times each training is done, with other pushes; 0 leaves them out. Defaults to 3, or 1 if
        quick.
    effort
        Length of each training, as a share of the usual number of steps. Defaults to 0.3, or 0.02 if quick.
    workers
        Processes that train; their number changes nothing in the results. Defaults to one for each core.
    """
    from comparisons.perception_compare import compare_perception as run
    from comparisons.perception_compare import summarise_perception
    from comparisons.perception_spec import QUICK, LearningSpec, StudySpec

    usual = QUICK if quick else LearningSpec()
    seeds = usual.seeds if training_seeds is None else training_seeds
    spec = StudySpec(
        backends,
        seed,
        (90 if quick else 1000) if frames is None else frames,
        (20 if quick else 200) if episodes is None else episodes,
        (1, 3, 5) if quick else (1, 2, 3, 4, 5),
        replace(usual, seeds=seeds if learning else 0, effort=usual.effort if effort is None else effort),
    )
    print(summarise_perception(run(spec, out, Console(stderr=True), workers)))
    print(f"report: {out / 'report.html'}")
    return 0
