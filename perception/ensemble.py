"""The ensemble backend: a CNN that learnt and a Hough recogniser that was built, and a gate between them.

The two err in different ways: on a solid that neither was made for, one calls sphere what the other does not.
So the gate lets a label pass only where both find it likely enough; elsewhere the ensemble abstains, and the
robot pushes and learns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from perception.calibration import softmax
from perception.cnn import Cnn
from perception.hough import Hough
from perception.labelled import Labelled, held_out
from perception.learnt import Learnt, tuned
from perception.models import Card, Tensors
from perception.network import SHAPES
from perception.percepts import Percepts, checked_frames
from perception.protocol import LABELS, Frames
from perception.training import Training
from worlds.camera import Camera

ACCEPTED: Final = 0.93
"""Share of the spheres of the tuning frames that the gate lets pass: more than the 0.9 wanted."""
_LEAST: Final = 1e-9  # of a probability, so that it has a logarithm
_MAJORITY: Final = 0.5
_SPHERE: Final = LABELS.index("sphere")


class Ensemble(Learnt):
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
    shapes = SHAPES
    packages = ("numpy", "opencv-python-headless", "torch")

    def __init__(self, camera: Camera | None = None, model: tuple[Tensors, Card] | None = None) -> None:
        super().__init__(camera, model)
        self.hough = Hough(self.camera)

    def scores(self, frames: Frames) -> NDArray[np.float64]:
        """Return pooled scores of labels, then the network's of distances, shape (frames, 5)."""
        learnt, built = self._both(frames)
        return np.concatenate([pooled(learnt, built), self._cnn.scores(frames)[:, len(LABELS) :]], axis=1)

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
        effort: float = 1.0,
        about: str | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Self:
        """Train the network anew and set the gate; see `perception.cnn.Cnn.fit` for the parameters."""
        learnt, kept = (data, tuning) if tuning is not None else held_out(data)
        cnn = Cnn(self.camera, (self.tensors, replace(self.card, backend=Cnn.name)))
        cnn.fit(learnt, seed, tuning=kept, settings=settings, effort=effort, about=about, progress=progress)
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
        card = tuned(plain, pooled(learnt, built), kept.labels, self.packages)
        agreed = agreement(learnt, built, np.full(len(learnt), _SPHERE))[kept.labels == _SPHERE]
        threshold = float(np.quantile(agreed, 1 - accepted, method="lower")) if len(agreed) else 1.0
        self._take(tensors, replace(card, threshold=threshold))
        return self

    def _both(self, frames: Frames) -> tuple[Percepts, Percepts]:
        frames = checked_frames(frames, self.camera.pixels)
        return self._cnn.perceive(frames), self.hough.perceive(frames)

    def _take(self, tensors: Mapping[str, NDArray[Any]], card: Card) -> None:
        super()._take(tensors, card)
        # The network's own temperature is in its last layer by now (`Cnn.tempered`).
        its = replace(card, backend=Cnn.name, temperature=1.0, threshold=0.0)
        self._cnn = Cnn(self.camera, (self.tensors, its))


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
