"""The CNN backend: a small network that learnt from what the robot found out by pushing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray

from perception.labelled import Labelled, resized
from perception.learnt import Learnt
from perception.models import Card, Tensors
from perception.network import SHAPES, last_map, scores
from perception.percepts import checked_frames
from perception.protocol import LABELS, Frames
from perception.training import Training, one_thread, train
from worlds.camera import Camera


class Cnn(Learnt):
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
    shapes = SHAPES
    packages = ("numpy", "torch")

    def __init__(
        self, camera: Camera | None = None, model: tuple[Tensors, Card] | None = None, *, device: str = "cpu"
    ) -> None:
        self.device = device
        super().__init__(camera, model)

    def scores(self, frames: Frames) -> NDArray[np.float32]:
        """Return the network's scores of labels, then of distances, shape (frames, 5)."""
        seen = torch.from_numpy(resized(checked_frames(frames)))
        with one_thread(), torch.inference_mode():
            found = [
                scores(self._there, frame.to(self.device).permute(2, 0, 1)[None].float() / 255)
                for frame in seen
            ]
            result: NDArray[np.float32] = torch.cat(found).cpu().numpy()
        return result

    def features(self, frames: Frames) -> NDArray[np.float32]:
        """Return what the heads of the network see of frames, shape (frames, `network.FEATURES`)."""
        seen = torch.from_numpy(resized(checked_frames(frames)))
        with one_thread(), torch.inference_mode():
            inputs = (frame.to(self.device).permute(2, 0, 1)[None].float() / 255 for frame in seen)
            result: NDArray[np.float32] = (
                torch.cat([last_map(self._there, one) for one in inputs]).cpu().numpy()
            )
        return result

    def fit(
        self,
        data: Labelled,
        seed: int,
        *,
        tuning: Labelled | None = None,
        settings: Training | None = None,
        effort: float = 1.0,
        about: str | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Self:
        """Learn anew, and forget what was known; see `perception.learnt.Learnt.fit` for what is not here.

        Parameters
        ----------
        settings
            How to train. Defaults to ``Training()``.
        effort
            What the number of updates in `settings` is multiplied by; see `Training.scaled`.
        """
        chosen = (Training() if settings is None else settings).scaled(effort)
        return self._fitted(
            data,
            seed,
            tuning,
            about,
            lambda rows: train(rows, seed, chosen, device=self.device, progress=progress),
        )

    def tempered(self) -> tuple[Tensors, Card]:
        """Return the tensors with the temperature taken into the last layer, and a card that says 1."""
        tensors = dict(self.tensors)
        for name in ("heads.weight", "heads.bias"):
            tensors[name] = tensors[name].copy()
            tensors[name][: len(LABELS)] /= self.card.temperature
        return tensors, replace(self.card, temperature=1.0)

    def _take(self, tensors: Mapping[str, NDArray[Any]], card: Card) -> None:
        super()._take(tensors, card)
        self._there = {name: torch.from_numpy(array).to(self.device) for name, array in self.tensors.items()}
