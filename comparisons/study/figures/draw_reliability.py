"""How often a backend is right by how sure it is, in a paper's width."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from comparisons.study.figures.panels import ONE_COLUMN, TWO_COLUMNS, entitle, legend_above, marks
from comparisons.style import GREY, grid_of, styled


@dataclass(frozen=True, eq=False)
class Bins:
    """Frames by how sure a backend was, full bins only.

    Parameters
    ----------
    confidence, accuracy
        Mean confidence and share of right labels of each bin, shape (bins,).
    frames
        Frames of each bin, shape (bins,).
    """

    confidence: NDArray[np.float64]
    accuracy: NDArray[np.float64]
    frames: NDArray[np.int64]


@styled
def reliability_figure(panels: Sequence[tuple[str, Mapping[str, Bins]]]) -> Figure:
    """Draw reliability diagrams: on the diagonal a backend means what it says; dots grow with the frames.

    Parameters
    ----------
    panels
        A title, and bins by label of the legend; at least one panel.

    Examples
    --------
    >>> bins = Bins(np.array([0.5, 0.9]), np.array([0.4, 1.0]), np.array([10, 90]))
    >>> figure = reliability_figure([("hough", {"clean": bins})])
    >>> figure.axes[0].get_title(loc="left"), figure.axes[0].lines[1].get_ydata().tolist()
    ('hough', [40.0, 100.0])
    """
    rows, columns = grid_of(len(panels), 3)
    width = ONE_COLUMN if columns == 1 else TWO_COLUMNS
    side = (width - 0.5) / columns if columns > 1 else 2.6
    figure = Figure((width, 0.45 + rows * (min(side, 2.6) + 0.25)), layout="constrained")
    looks = marks(list(dict.fromkeys(label for _, sets in panels for label in sets)))
    for i, (title, sets) in enumerate(panels):
        axes = figure.add_subplot(rows, columns, i + 1)
        axes.plot([0, 100], [0, 100], color=GREY, linewidth=0.8, linestyle=(0, (4, 2)), gid="diagonal")
        for label, bins in sets.items():
            x, y, look = 100 * bins.confidence, 100 * bins.accuracy, looks[label]
            axes.plot(x, y, linewidth=1.2, **look.look)
            axes.plot(
                [], [], linewidth=1.2, label=label or None, marker=look.marker, markersize=3.6, **look.look
            )
            area = 9 + 60 * bins.frames / max(int(bins.frames.sum()), 1)
            axes.scatter(x, y, s=area, color=look.colour, marker=look.marker, linewidth=0)
        axes.set_xlim(0, 103)
        axes.set_ylim(0, 103)
        axes.set_aspect("equal")
        if i >= len(panels) - columns:
            axes.set_xlabel("confidence, %")
        if i % columns == 0:
            axes.set_ylabel("right, %")
        entitle(axes, i, len(panels), title, side - 0.3)
    legend_above(figure)
    return figure
