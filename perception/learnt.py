"""What all backends that learn have in common: weights with a card, scores, a temperature, save and load."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from perception.calibration import calibration_error, fit_temperature, softmax
from perception.labelled import Labelled, Rows, checked_data, held_out
from perception.models import Card, Tensors, installed, load_model, save_model
from perception.percepts import Percepts, Sees
from perception.protocol import LABELS, REACH, Frames
from worlds import UserError
from worlds.camera import Camera

SCORES: Final = len(LABELS) + REACH
"""Scores a frame: of each label, then of each distance."""
MOST_EFFORT: Final = 10.0
"""A training may be so many times as long as usual."""


class Learnt(Sees):
    """A backend that is a function of some tensors: write `name`, `shapes`, `packages`, `scores` and `fit`.

    `name` is the registry's; `shapes` names the tensors and gives their shapes; `packages` are those whose
    versions go onto the card of what `fit` learns.

    Parameters
    ----------
    camera
        The camera that takes the frames; they may be of any size, for they are resized.
    model
        Tensors and their card. Defaults to the ready-made ones.

    Examples
    --------
    >>> class Bright(Learnt):
    ...     name, shapes, packages = "bright", {"weight": (5,)}, ("numpy",)
    ...
    ...     def scores(self, frames):
    ...         return frames.mean((1, 2, 3))[:, None] * self.tensors["weight"]
    ...
    ...     def fit(self, data, seed, *, tuning=None, effort=1.0, about=None, progress=None):
    ...         return self._fitted(data, seed, tuning, about, lambda rows: {"weight": np.ones(5)})
    >>> model = {"weight": np.array([0.0, 0.0, 1.0, 0.0, 1.0])}, Card("bright", "nothing", 0)
    >>> Bright(model=model).perceive(np.full((1, 8, 8, 3), 99, np.uint8)).detections()[0].label
    'sphere'
    """

    shapes: ClassVar[Mapping[str, tuple[int, ...]]]
    packages: ClassVar[tuple[str, ...]]

    def __init__(self, camera: Camera | None = None, model: tuple[Tensors, Card] | None = None) -> None:
        self.camera = Camera() if camera is None else camera
        self._take(*(self.ready_made() if model is None else model))

    @abstractmethod
    def scores(self, frames: Frames) -> NDArray[np.floating]:
        """Return scores of labels, then of distances, shape (frames, 5)."""

    @abstractmethod
    def fit(
        self,
        data: Labelled,
        seed: int,
        *,
        tuning: Labelled | None = None,
        effort: float = 1.0,
        about: str | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Self:
        """Learn anew, and forget what was known.

        Parameters
        ----------
        data
            What to learn from.
        seed
            Names the run: the same data, seed and settings give the same bits on one machine.
        tuning
            Frames to set the temperature by. Defaults to every tenth of `data`, not learnt from then.
        effort
            Length of the training as a share of the usual one, above 0 and at most `MOST_EFFORT`.
        about
            What the card says of the data. Defaults to the number of frames.
        progress
            Called with the share of the work that is done.

        Returns
        -------
        Self
            This backend.

        Raises
        ------
        UserError
            If the data are no frames with labels and distances, or the effort is out of range.
        """

    def perceive(self, frames: Frames) -> Percepts:
        """Return what stands ahead in each frame, uint8, shape (frames, rows, columns, 3)."""
        found = self.scores(frames)
        probabilities = softmax(found[:, : len(LABELS)], self.card.temperature)
        return Percepts(
            probabilities,
            found[:, len(LABELS) :].argmax(axis=1).astype(np.int64) + 1,
            probabilities.max(axis=1) < self.card.threshold,
        )

    def save(self, path: Path | str) -> None:
        """Write the weights, with their card beside them; see `perception.models.save_model`."""
        save_model(path, self.tensors, self.card)

    @classmethod
    def load(cls, path: Path | str, camera: Camera | None = None) -> Self:
        """Return the backend that `save` wrote.

        Raises
        ------
        UserError
            If there is no such file, or it is broken or of another kind.
        """
        return cls(camera, load_model(path, cls.name, cls.shapes))

    @classmethod
    def ready_made(cls) -> tuple[Tensors, Card]:
        """Return the tensors and the card that come with this package under the backend's name."""
        with as_file(files("perception").joinpath("weights", f"{cls.name}.safetensors")) as path:
            return load_model(path, cls.name, cls.shapes)

    def _fitted(
        self,
        data: Labelled,
        seed: int,
        tuning: Labelled | None,
        about: str | None,
        learn: Callable[[Rows], Mapping[str, NDArray[Any]]],
    ) -> Self:
        """Take over what `learn` makes of the data, calibrated on frames that it is not given."""
        learnt, kept = (Rows.of(data), tuning) if tuning is not None else held_out(data)
        checked_data(learnt)
        checked_data(kept)
        tensors = learn(learnt)
        plain = Card(self.name, about or f"{len(learnt.frames)} frames", seed)
        self._take(tensors, plain)
        found = self.scores(kept.frames)[:, : len(LABELS)]
        self._take(tensors, tuned(plain, found, kept.labels, self.packages))
        return self

    def _take(self, tensors: Mapping[str, NDArray[Any]], card: Card) -> None:
        self.card = card
        self.tensors: Tensors = {name: np.array(tensor, dtype=np.float32) for name, tensor in tensors.items()}


def tuned(
    card: Card, found: NDArray[np.floating], labels: NDArray[np.integer], packages: tuple[str, ...]
) -> Card:
    """Return a card with the temperature, accuracy and calibration error of scores, shape (frames, 3).

    Examples
    --------
    >>> tuned(Card("cnn", "", 0), np.array([[3.0, 0.0, 0.0]] * 2), np.array([0, 1]), ("numpy",)).accuracy
    0.5
    """
    temperature = fit_temperature(found, labels)
    probabilities = softmax(found, temperature)
    return replace(
        card,
        accuracy=float((probabilities.argmax(axis=1) == labels).mean()),
        calibration_error=min(calibration_error(probabilities, labels), 1.0),
        temperature=temperature,
        versions=installed(*packages),
    )


def checked_effort(effort: float) -> float:
    """Return the share of the usual length that a training may take, or say what is wrong with it.

    Raises
    ------
    UserError
        If it is not above 0 and at most `MOST_EFFORT`.

    Examples
    --------
    >>> checked_effort(0.5)
    0.5
    """
    if not 0 < effort <= MOST_EFFORT:
        raise UserError(
            f"effort {effort}: give a share of the usual training, above 0 and at most {MOST_EFFORT:g}"
        )
    return effort
