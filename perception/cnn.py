"""The CNN backend: a small network that learnt from what the robot found out by pushing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import torch
from numpy.typing import NDArray

from perception.calibration import calibration_error, fit_temperature, softmax
from perception.models import Card, Tensors, installed, load_model, save_model
from perception.network import SHAPES, scores
from perception.percepts import Percepts, Sees, checked_frames
from perception.protocol import LABELS, Frames
from perception.training import Labelled, Rows, Training, held_out, one_thread, resized, train
from worlds.camera import Camera

READY_MADE: Final = "weights/cnn.safetensors"
"""The weights that come with the package, within it."""


class Cnn(Sees):
    """A convolutional network as a backend.

    It looks at frames one by one, on one thread: what it makes of a frame is the same to the last bit
    whatever batch the frame comes in.

    Parameters
    ----------
    camera
        The camera that takes the frames; they may be of any size, for they are resized.
    model
        Tensors (`perception.network.SHAPES`) and their card. Defaults to the ready-made ones.
    device
        Where torch computes.

    Examples
    --------
    >>> grey = np.full((1, 96, 96, 3), 128, np.uint8)
    >>> Cnn().perceive(grey).probabilities.shape
    (1, 3)
    """

    name = "cnn"

    def __init__(
        self, camera: Camera | None = None, model: tuple[Tensors, Card] | None = None, *, device: str = "cpu"
    ) -> None:
        self.camera = Camera() if camera is None else camera
        self.device = device
        self._take(*(ready_made(READY_MADE, self.name, SHAPES) if model is None else model))

    def perceive(self, frames: Frames) -> Percepts:
        """Return what stands ahead in each frame, uint8, shape (frames, rows, columns, 3)."""
        found = self.scores(frames)
        probabilities = softmax(found[:, : len(LABELS)], self.card.temperature)
        return Percepts(
            probabilities,
            found[:, len(LABELS) :].argmax(axis=1).astype(np.int64) + 1,
            probabilities.max(axis=1) < self.card.threshold,
        )

    def scores(self, frames: Frames) -> NDArray[np.float32]:
        """Return the network's scores of labels, then of distances, shape (frames, 5)."""
        seen = torch.from_numpy(resized(checked_frames(frames)))
        with one_thread(), torch.inference_mode():
            found = [
                scores(self._tensors, frame.to(self.device).permute(2, 0, 1)[None].float() / 255)
                for frame in seen
            ]
            result: NDArray[np.float32] = torch.cat(found).cpu().numpy()
        return result

    def fit(
        self,
        data: Labelled,
        seed: int,
        *,
        tuning: Labelled | None = None,
        settings: Training | None = None,
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
        settings
            How to train. Defaults to ``Training()``.
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
            If the data are no frames with labels and distances.
        """
        learnt, kept = (Rows.of(data), tuning) if tuning is not None else held_out(data)
        tensors = train(learnt, seed, settings, device=self.device, progress=progress)
        plain = Card(self.name, about or f"{len(learnt.frames)} frames", seed)
        self._take(tensors, plain)
        self._take(tensors, tuned(plain, self.scores(kept.frames)[:, : len(LABELS)], kept.labels))
        return self

    def tempered(self) -> tuple[Tensors, Card]:
        """Return the tensors with the temperature taken into the last layer, and a card that says 1."""
        tensors = {name: tensor.cpu().numpy() for name, tensor in self._tensors.items()}
        for name in ("heads.weight", "heads.bias"):
            tensors[name] = tensors[name].copy()
            tensors[name][: len(LABELS)] /= self.card.temperature
        return tensors, replace(self.card, temperature=1.0)

    def save(self, path: Path | str) -> None:
        """Write the weights, with their card beside them; see `perception.models.save_model`."""
        save_model(path, {name: tensor.cpu().numpy() for name, tensor in self._tensors.items()}, self.card)

    @classmethod
    def load(cls, path: Path | str, camera: Camera | None = None) -> Self:
        """Return the backend that `save` wrote.

        Raises
        ------
        UserError
            If there is no such file, or it is broken or of another kind.
        """
        return cls(camera, load_model(path, cls.name, SHAPES))

    def _take(self, tensors: Mapping[str, NDArray[Any]], card: Card) -> None:
        self.card = card
        self._tensors = {
            name: torch.from_numpy(np.array(array, dtype=np.float32)).to(self.device)
            for name, array in tensors.items()
        }


def tuned(
    card: Card,
    found: NDArray[np.floating],
    labels: NDArray[np.integer],
    packages: tuple[str, ...] = ("numpy", "torch"),
) -> Card:
    """Return a card with the temperature, accuracy and calibration error of scores, shape (frames, 3).

    Examples
    --------
    >>> tuned(Card("cnn", "", 0), np.array([[3.0, 0.0, 0.0]] * 2), np.array([0, 1])).accuracy
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


def ready_made(name: str, backend: str, shapes: Mapping[str, tuple[int, ...]] | None) -> tuple[Tensors, Card]:
    """Return the tensors and card of a file that comes with this package."""
    with as_file(files("perception").joinpath(name)) as path:
        return load_model(path, backend, shapes)
