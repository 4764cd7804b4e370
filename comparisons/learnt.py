"""Backends by name, as the command line takes them, and `affordant train-perception`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol, Self, runtime_checkable

from rich.console import Console
from rich.progress import Progress, TaskID

from comparisons.outputs import progress_on
from perception.data import load_data, make_data
from perception.models import Card
from perception.protocol import Backend
from perception.registry import backend_names, load_backend
from worlds.camera import Camera
from worlds.errors import UserError

TUNING_SEED: Final = 100
"""The frames that calibrate have this seed plus that of the training."""
_LEAST_TUNING: Final = 30
_STEPS: Final = 1000  # of the bar that shows training


@runtime_checkable
class Learns(Backend, Protocol):
    """A backend that learns from frames, and can be saved."""

    card: Card

    def fit(
        self,
        data: Any,
        seed: int,
        *,
        tuning: Any = None,
        effort: float = 1.0,
        about: str | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Self:
        """Learn anew; `effort` is the length of the training as a share of the usual one."""
        ...

    def save(self, path: Path | str) -> None:
        """Write what was learnt."""
        ...

    @classmethod
    def load(cls, path: Path | str, camera: Camera | None = None) -> Self:
        """Return what was written."""
        ...


@runtime_checkable
class Gates(Learns, Protocol):
    """A backend that is a gate on the CNN: given one that has learnt, it need not train its own."""

    def gate(self, cnn: Any, kept: Any) -> Self:
        """Take over the network, and set the gate by frames that it did not learn from."""
        ...


def frame_backend(name: str, camera: Camera) -> Backend:
    """Return a backend that reads frames: a name, or ``name=FILE`` for weights of one's own.

    Raises
    ------
    UserError
        If there is no such backend, it reads no frames, does not learn, or the file will not do.

    Examples
    --------
    >>> frame_backend("hough", Camera()).name
    'hough'
    >>> frame_backend("hough=mine.safetensors", Camera())
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: backend 'hough' does not learn: it has no weights; leave out =mine.safetensors
    """
    kind, _, weights = name.partition("=")
    backend = load_backend(kind, camera)
    if not backend.needs_frames:
        raise UserError(f"backend {kind!r} reads no frames; name one that does, such as 'hough'")
    if not weights:
        return backend
    if not isinstance(backend, Learns):
        raise UserError(f"backend {kind!r} does not learn: it has no weights; leave out ={weights}")
    return type(backend).load(weights, camera)


def train_perception(name: str, out: Path, frames: int, seed: int, console: Console) -> Path:
    """Render frames, label them by pushing, train a backend on them, and write its weights.

    The frames go to ``data`` and ``tuning`` in the folder as they are made; after a break the same command
    goes on where it stopped.

    Parameters
    ----------
    name
        The backend.
    out
        Folder of the weights and the frames.
    frames
        Number of frames to learn from; a quarter as many more calibrate.
    seed
        Of the frames and of the training, 0 to 99.
    console
        Where progress is shown.

    Returns
    -------
    Path
        The file of weights; its card lies beside it.

    Raises
    ------
    UserError
        If the backend does not learn, the weights exist already, or a number is out of range.
    """
    camera = Camera()
    backend = load_backend(name, camera)
    if not isinstance(backend, Learns):
        learners = [n for n in backend_names() if isinstance(load_backend(n, camera), Learns)]
        raise UserError(f"--backend {name}: it does not learn; choose one of {', '.join(learners)}")
    if not 0 <= seed < TUNING_SEED:
        raise UserError(f"--seed {seed}: training takes 0 to {TUNING_SEED - 1}")
    if frames < _LEAST_TUNING:
        raise UserError(f"--frames {frames}: give at least {_LEAST_TUNING}")
    weights = out / f"{name}.safetensors"
    for path in (weights, weights.with_suffix(".json")):
        if path.exists() or path.is_symlink():
            raise UserError(
                f"--out {out}: {path.name} exists there already; name another folder, or remove it"
            )
    sets = {"data": (frames, seed), "tuning": (max(_LEAST_TUNING, frames // 4), TUNING_SEED + seed)}
    with progress_on(console) as progress:
        for folder, (count, own) in sets.items():
            bar = progress.add_task(f"rendering and pushing: {folder}", total=count)
            make_data(out / folder, count, own, progress=partial(_advance, progress, bar))
            progress.update(bar, completed=count)
        bar = progress.add_task(f"training {name}", total=_STEPS)
        backend.fit(
            load_data(out / "data", "training"),
            seed,
            tuning=load_data(out / "tuning", "tuning"),
            about=f"{frames} frames of seed {seed}, everything varied, labelled by pushing",
            progress=lambda share: _advance(progress, bar, round(_STEPS * share)),
        )
        progress.update(bar, completed=_STEPS)
    backend.save(weights)
    return weights


def _advance(progress: Progress, bar: TaskID, done: int) -> None:
    progress.update(bar, completed=done)
