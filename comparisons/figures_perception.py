"""Figures of perception: confusion, push trials, and what a backend saw (figure 11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from comparisons.style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, SKY, VERMILION, grid_of, styled

Detection = tuple[str, NDArray[np.uint8], NDArray[np.uint8]]
"""A title, a frame, and the frame with what was found drawn on it; frames have shape (H, W, 3)."""

_SHARE = LinearSegmentedColormap.from_list("share", ["#F7FBFF", "#2C7FB8"])


@styled
def confusion_figure(matrix: Sequence[Sequence[int]], labels: Sequence[str]) -> Figure:
    r"""Draw a confusion matrix: counts, and each row's shares.

    Parameters
    ----------
    matrix
        Frames by true class (rows) and seen class (columns), shape (n, n).
    labels
        The n classes' names.

    Examples
    --------
    >>> figure = confusion_figure([[9, 1], [0, 10]], ["cube", "sphere"])
    >>> [text.get_text().replace("\n", " ") for text in figure.axes[0].texts]
    ['9 90.0 %', '1 10.0 %', '0 0.0 %', '10 100.0 %']
    """
    counts = np.asarray(matrix)
    totals = counts.sum(axis=1, keepdims=True)
    shares = counts / np.maximum(totals, 1)
    n = len(labels)
    figure = Figure((1.4 + 0.85 * n, 0.9 + 0.7 * n), layout="constrained")
    axes = figure.add_subplot()
    edges = np.arange(n + 1) - 0.5
    axes.pcolormesh(edges, edges, shares, cmap=_SHARE, vmin=0, vmax=1, edgecolors="white", linewidth=1.5)
    for row, col in np.ndindex(n, n):
        share = float(shares[row, col])
        axes.text(
            col,
            row,
            f"{counts[row, col]}\n{100 * share:.1f} %",
            ha="center",
            va="center",
            fontweight="bold" if row == col else "normal",
            color="white" if share > 0.6 else INK,
        )
    axes.set_xticks(range(n), labels, color=INK)
    axes.set_yticks(range(n), [f"{name}\n({int(t)})" for name, t in zip(labels, totals[:, 0], strict=True)])
    axes.tick_params(length=0, labelcolor=INK)
    axes.invert_yaxis()
    axes.set_xlabel("seen as")
    axes.set_ylabel("is in truth (frames)")
    axes.spines[:].set_visible(False)
    return figure


@styled
def push_figure(counts: Mapping[str, Mapping[str, int]]) -> Figure:
    """Draw what pushed obstacles did: a panel for each kind, a bar for each behaviour.

    Parameters
    ----------
    counts
        Per kind, trials by behaviour (rolls, slides, topples, stays).

    Examples
    --------
    >>> figure = push_figure({"cube": {"rolls": 0, "slides": 5}, "sphere": {"rolls": 6}})
    >>> [axes.get_title(loc="left") for axes in figure.axes]
    ['cube (5 trials)', 'sphere (6 trials)']
    """
    labels = list(dict.fromkeys(label for by_label in counts.values() for label in by_label))
    palette = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION)
    colours = [palette[i % len(palette)] for i in range(len(labels))]
    rows, columns = grid_of(len(counts), 3)
    figure = Figure((0.6 + 2.9 * columns, rows * (0.75 + 0.27 * len(labels))), layout="constrained")
    most = max((max(by_label.values(), default=0) for by_label in counts.values()), default=0)
    places = np.arange(len(labels))
    for i, (kind, by_label) in enumerate(counts.items()):
        axes = figure.add_subplot(rows, columns, i + 1)
        trials = [by_label.get(label, 0) for label in labels]
        bars = axes.barh(places, trials, height=0.68, color=colours)
        axes.bar_label(bars, padding=3, color=INK)
        axes.set_yticks(places, labels if i % columns == 0 else [""] * len(labels), color=INK)
        axes.invert_yaxis()
        axes.set_xlim(0, 1.14 * max(most, 1))
        axes.set_title(f"{kind} ({sum(trials)} trials)", loc="left")
        axes.tick_params(axis="y", length=0)
        if i // columns == rows - 1:
            axes.set_xlabel("trials")
    return figure


@styled
def detections_figure(items: Sequence[Detection]) -> Figure:
    """Draw frames above the same frames with what the backend found on them (figure 11).

    Parameters
    ----------
    items
        Title, frame and drawn frame of each; frames are uint8 RGB, shape (H, W, 3).

    Examples
    --------
    >>> frame = np.zeros((8, 8, 3), dtype=np.uint8)
    >>> figure = detections_figure([("small cube", frame, frame)])
    >>> len(figure.axes), figure.axes[0].get_title()
    (2, 'small cube')
    """
    bands, columns = grid_of(len(items), 6)
    close = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03, wspace=0, hspace=0)
    figure = Figure((0.25 + 1.25 * columns, 2.75 * bands), layout=close)
    for i, (title, frame, found) in enumerate(items):
        band, column = divmod(i, columns)
        for below, image in enumerate((frame, found)):
            place = (2 * band + below) * columns + column + 1
            axes = figure.add_subplot(2 * bands, columns, place)
            axes.imshow(image, interpolation="nearest")
            axes.set_xticks([])
            axes.set_yticks([])
            axes.spines[:].set(visible=True, color=GREY, linewidth=0.5)
            if not below:
                axes.set_title(title, fontsize=7.5, pad=3)
            if not column:
                axes.set_ylabel("found" if below else "frame", fontsize=8)
    return figure
