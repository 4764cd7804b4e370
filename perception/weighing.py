"""From evidence for cubes and spheres to probabilities: the softmax that ends the Hough recogniser.

The nearer cell is looked at first, for what stands there is in the way, however well a farther obstacle is
seen; what is not there may be in the next cell. In each cell a softmax weighs none, cube and sphere. Its
constants are fitted by `perception.tuning`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

FEATURES: Final = ("one", "cube", "proposed cube", "sphere", "proposed sphere", "noise")
"""What is weighed in a cell: a constant, the best evidence for each kind, the best of what Hough transforms
propose (0 without a proposal), and the frame's noise, the median gradient over 100."""
Weights = tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]
"""For each distance, nearest first, what each of `FEATURES` adds to the logits of cube and sphere; that of
none is 0. Shape (distances, 2, features)."""


def weigh(features: NDArray[np.float64], weights: Weights) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the probabilities of none, cube and sphere, and where the obstacle most likely is.

    Parameters
    ----------
    features
        `FEATURES` of each cell ahead, shape (frames, distances, features).
    weights
        The softmax's constants.

    Returns
    -------
    probabilities
        Shape (frames, 3); each row sums to 1.
    distances
        Cells to what is most likely in the way, or would be if anything were, shape (frames,).

    Examples
    --------
    >>> weights = (((-5.0, 8, 0, 0, 0, 0), (-5.0, 0, 0, 8, 0, 0)),) * 2
    >>> far_sphere = np.array([[[1, 0.1, 0, 0.2, 0, 0], [1, 0.2, 0, 0.95, 0, 0]]])
    >>> probabilities, distances = weigh(far_sphere, weights)
    >>> probabilities.round(2), distances
    (array([[0.07, 0.02, 0.92]]), array([2]))
    """
    logits = np.einsum("ndf,dkf->ndk", features, np.array(weights))
    logits = np.concatenate([np.zeros((*logits.shape[:2], 1)), logits], axis=2)
    odds = np.exp(logits - logits.max(axis=2, keepdims=True))
    here = odds / odds.sum(axis=2, keepdims=True)
    free = np.ones(len(features))  # the chance that no nearer cell holds anything
    found = np.zeros((*here.shape[:2], 2))
    for cell in range(here.shape[1]):
        found[:, cell] = free[:, None] * here[:, cell, 1:]
        free = free * here[:, cell, 0]
    probabilities = np.column_stack([free, found.sum(axis=1)])
    label = probabilities.argmax(axis=1)
    # Without an obstacle, the distance is that at which either kind is likeliest.
    cube_or_sphere = np.take_along_axis(found, (label.clip(1) - 1)[:, None, None], axis=2)[:, :, 0]
    either = np.where((label == 0)[:, None], found.sum(axis=2), cube_or_sphere)
    return probabilities / probabilities.sum(axis=1, keepdims=True), either.argmax(axis=1) + 1
