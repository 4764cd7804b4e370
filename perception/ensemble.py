"""The ensemble backend: a CNN that learnt and a Hough recogniser that was built, and a gate between them.

The two err in different ways: on a solid that neither was made for, one calls sphere what the other does not.
So the gate lets a label pass only where both find it likely enough; elsewhere the ensemble abstains, and the
robot pushes and learns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from perception.calibration import softmax
from perception.cnn import Cnn, ready_made, tuned
from perception.hough import Hough
from perception.models import Card, Tensors, load_model, save_model
from perception.network import SHAPES
from perception.percepts import Percepts, Sees, checked_frames
from perception.protocol import LABELS, Frames
from perception.training import Labelled, Rows, Training, held_out
from worlds.camera import Camera

READY_MADE: Final = "weights/ensemble.safetensors"
ACCEPTED: Final = 0.93
"""Share of the spheres of the tuning frames that the gate lets pass: more than the 0.9 wanted."""
_LEAST: Final = 1e-9  # of a probability, so that it has a logarithm
_MAJORITY: Final = 0.5
_SPHERE: Final = LABELS.index("sphere")


class Ensemble(Sees):
    """CNN and Hough as one backend, which abstains where they do not agree.

    Its probabilities are the product of the two, which take each other for independent witnesses, tempered by
    what the tuning frames say. `card.threshold` is the probability that each must give a sphere, on which
    alone the robot would go ahead and push; of none and cube each must be convinced by more than half.

    Parameters
    ----------
    camera
        The camera that takes the frames; they must be of its size.
    model
        The network's tensors and the ensemble's card. Defaults to the ready-made ones.

    Examples
    --------
    >>> grey = np.full((1, 96, 96, 3), 128, np.uint8)
    >>> Ensemble().perceive(grey).probabilities.shape
    (1, 3)
    """

    name = "ensemble"

    def __init__(self, camera: Camera | None = None, model: tuple[Tensors, Card] | None = None) -> None:
        self.camera = Camera() if camera is None else camera
        self.hough = Hough(self.camera)
        self._take(*(ready_made(READY_MADE, self.name, SHAPES) if model is None else model))

    def perceive(self, frames: Frames) -> Percepts:
        """Return what stands ahead in each frame, uint8, shape (frames, rows, columns, 3).

        Raises
        ------
        UserError
            If the frames are none, or not of the camera's size.
        """
        learnt, built = self._both(frames)
        probabilities = softmax(pooled(learnt, built), self.card.temperature)
        labels = probabilities.argmax(axis=1)
        wanted = np.where(labels == _SPHERE, self.card.threshold, min(self.card.threshold, _MAJORITY))
        abstains = agreement(learnt, built, labels) < wanted
        return Percepts(probabilities, learnt.distances, abstains)

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
        """Train the network anew and set the gate; see `perception.cnn.Cnn.fit` for the parameters."""
        learnt, kept = (Rows.of(data), tuning) if tuning is not None else held_out(data)
        cnn = Cnn(self.camera, (self._tensors, replace(self.card, backend=Cnn.name)))
        cnn.fit(learnt, seed, tuning=kept, settings=settings, about=about, progress=progress)
        return self.gate(cnn, kept)

    def gate(self, cnn: Cnn, kept: Labelled, accepted: float = ACCEPTED) -> Self:
        """Take over a network, and set the gate by frames that it did not learn from.

        Parameters
        ----------
        cnn
            The network.
        kept
            Frames to tune on.
        accepted
            Share of their spheres that passes.

        Returns
        -------
        Self
            This ensemble.
        """
        tensors, card = cnn.tempered()
        plain = replace(card, backend=self.name, temperature=1.0, threshold=0.0)
        self._take(tensors, plain)
        learnt, built = self._both(kept.frames)
        card = tuned(plain, pooled(learnt, built), kept.labels, ("numpy", "opencv-python-headless", "torch"))
        agreed = agreement(learnt, built, np.full(len(learnt), _SPHERE))[kept.labels == _SPHERE]
        threshold = float(np.quantile(agreed, 1 - accepted, method="lower")) if len(agreed) else 1.0
        self._take(tensors, replace(card, threshold=threshold))
        return self

    def save(self, path: Path | str) -> None:
        """Write the network's weights, with the ensemble's card beside them."""
        save_model(path, self._tensors, self.card)

    @classmethod
    def load(cls, path: Path | str, camera: Camera | None = None) -> Self:
        """Return the backend that `save` wrote.

        Raises
        ------
        UserError
            If there is no such file, or it is broken or of another kind.
        """
        return cls(camera, load_model(path, cls.name, SHAPES))

    def _both(self, frames: Frames) -> tuple[Percepts, Percepts]:
        frames = checked_frames(frames, self.camera.pixels)
        return self._cnn.perceive(frames), self.hough.perceive(frames)

    def _take(self, tensors: Tensors, card: Card) -> None:
        self.card, self._tensors = card, tensors
        # The network's own temperature is in its last layer by now (`Cnn.tempered`).
        self._cnn = Cnn(
            self.camera, (tensors, replace(card, backend=Cnn.name, temperature=1.0, threshold=0.0))
        )


def pooled(one: Percepts, other: Percepts) -> NDArray[np.float64]:
    """Return scores of labels whose softmax is the product of two backends' probabilities, shape (frames, 3).

    Examples
    --------
    >>> seen = Percepts(np.array([[0.5, 0.25, 0.25]]), np.ones(1), np.zeros(1))
    >>> softmax(pooled(seen, seen)).round(3).tolist()
    [[0.667, 0.167, 0.167]]
    """
    total: NDArray[np.float64] = sum(
        (np.log(np.maximum(seen.probabilities, _LEAST)) for seen in (one, other)), np.zeros((len(one), 3))
    )
    return total


def agreement(one: Percepts, other: Percepts, labels: NDArray[np.integer]) -> NDArray[np.float64]:
    """Return how likely the less convinced of two backends finds some labels, shape (frames,).

    Examples
    --------
    >>> one = Percepts(np.array([[0.0, 0.25, 0.75]]), np.ones(1), np.zeros(1))
    >>> other = Percepts(np.array([[0.5, 0.0, 0.5]]), np.ones(1), np.zeros(1))
    >>> agreement(one, other, np.array([2])).tolist()
    [0.5]
    """
    rows = np.arange(len(labels))
    least: NDArray[np.float64] = np.minimum(
        one.probabilities[rows, labels], other.probabilities[rows, labels]
    )
    return least
