"""How often a backend is right: confusion matrix, accuracy, and the same by size and distance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from perception.protocol import LABELS, Backend, Detection, View

_BATCH = 64  # views held at once, so that a stream of any length fits in memory


@dataclass(frozen=True)
class Accuracy:
    """How a backend did on some views.

    Parameters
    ----------
    frames
        Number of views.
    confusion
        ``confusion[truth][predicted]``: number of views, for every pair of labels.
    accuracy
        Share of views with the right label.
    distance_accuracy
        Share with the right distance among the views whose obstacle got its right label; 1 if there
        are none of these.
    groups
        By "none", "cube small 1", ... (label, size, distance in cells): number of views, and how many
        got the right label.
    """

    frames: int
    confusion: dict[str, dict[str, int]]
    accuracy: float
    distance_accuracy: float
    groups: dict[str, dict[str, int]]


def confusion(truth: Sequence[Detection], predicted: Sequence[Detection]) -> NDArray[np.int64]:
    """Count views by true and predicted label.

    Returns
    -------
    NDArray[np.int64]
        Shape (3, 3): rows are the truth, columns the prediction, both in the order of `LABELS`.

    Raises
    ------
    ValueError
        If the two differ in length.

    Examples
    --------
    >>> seen = Detection("cube", 0.6, 1)
    >>> confusion([Detection("sphere", 1.0, 1), seen], [seen, seen]).tolist()
    [[0, 0, 0], [0, 1, 0], [0, 1, 0]]
    """
    matrix = np.zeros((len(LABELS), len(LABELS)), dtype=np.int64)
    for true, seen in zip(truth, predicted, strict=True):
        matrix[LABELS.index(true.label), LABELS.index(seen.label)] += 1
    return matrix


def score(views: Sequence[View], predicted: Sequence[Detection]) -> Accuracy:
    """Return how right some detections are.

    Raises
    ------
    ValueError
        If there are no views, or not one detection a view.

    Examples
    --------
    >>> result = score([View(None, Detection("cube", 1.0, 2), "small")], [Detection("cube", 0.7, 1)])
    >>> result.accuracy, result.distance_accuracy, result.groups
    (1.0, 0.0, {'cube small 2': {'frames': 1, 'right': 1}})
    """
    if not views:
        raise ValueError("no views to score; give at least one")
    matrix = confusion([view.truth for view in views], predicted)
    groups: dict[str, dict[str, int]] = {}
    found = far = 0
    for view, seen in zip(views, predicted, strict=True):
        right = view.truth.label == seen.label
        group = groups.setdefault(_group(view), {"frames": 0, "right": 0})
        group["frames"] += 1
        group["right"] += right
        if right and seen.label != "none":
            found += 1
            far += view.truth.distance == seen.distance
    rows = zip(LABELS, matrix.tolist(), strict=True)
    return Accuracy(
        frames=len(views),
        confusion={true: dict(zip(LABELS, row, strict=True)) for true, row in rows},
        accuracy=int(np.trace(matrix)) / len(views),
        distance_accuracy=far / found if found else 1.0,
        groups=dict(sorted(groups.items())),
    )


def measure(backend: Backend, views: Iterable[View]) -> Accuracy:
    """Run a backend over a stream of views and return how right it was.

    Frames are let go as soon as they have been looked at.

    Examples
    --------
    >>> from perception.truth import Truth
    >>> measure(Truth(), [View(None, Detection("sphere", 1.0, 1), "large")]).confusion["sphere"]
    {'none': 0, 'cube': 0, 'sphere': 1}
    """
    stream = iter(views)
    seen: list[View] = []
    predicted: list[Detection] = []
    while batch := list(islice(stream, _BATCH)):
        predicted += backend.detect(batch)
        seen += [View(None, view.truth, view.size) for view in batch]
    return score(seen, predicted)


def _group(view: View) -> str:
    truth = view.truth
    if truth.label == "none":
        return "none"
    return f"{truth.label} {view.size or 'any size'} {truth.distance}"
