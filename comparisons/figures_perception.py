"""Figures of perception: confusion, what a backend saw (figure 11), and backends compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from comparisons.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PLUM,
    SKY,
    VERMILION,
    grid_of,
    styled,
)

Detection = tuple[str, NDArray[np.uint8], NDArray[np.uint8]]
"""A title, a frame, and the frame with what was found drawn on it; frames have shape (H, W, 3)."""
Bar = tuple[float, float, float, float]
"""A severity, and the share of right frames with the bounds of its 95 % interval."""
Bins = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]
"""Mean confidence, share of right labels, and frames of each bin."""

_MARKERS = "osD^vP"  # a backend is told by its marker as well as by its colour
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


@styled
def robustness_figure(panels: Mapping[str, Mapping[str, Sequence[Bar]]]) -> Figure:
    """Draw accuracy over severity: a panel for each corruption, a line for each backend.

    Parameters
    ----------
    panels
        By corruption and backend, (severity, share, low, high) of each severity in turn; low and high
        bound the 95 % interval.

    Examples
    --------
    >>> line = [(0, 1.0, 0.9, 1.0), (1, 0.8, 0.7, 0.9)]
    >>> figure = robustness_figure({"blur": {"hough": line, "mine": line}, "noise": {"hough": line}})
    >>> [axes.get_title(loc="left") for axes in figure.axes]
    ['blur', 'noise']
    """
    rows, columns = grid_of(len(panels), 3)
    names = list(dict.fromkeys(name for lines in panels.values() for name in lines))
    lowest = min(low for lines in panels.values() for line in lines.values() for *_, low, _ in line)
    figure = Figure((0.5 + 2.6 * columns, 0.6 + 1.75 * rows), layout="constrained")
    for i, (title, lines) in enumerate(panels.items()):
        axes = figure.add_subplot(rows, columns, i + 1)
        for name, line in lines.items():
            severity, share, low, high = (np.array(values, dtype=float) for values in zip(*line, strict=True))
            colour = _colour(names.index(name))
            axes.fill_between(severity, 100 * low, 100 * high, color=colour, alpha=0.15, linewidth=0)
            marker = _MARKERS[names.index(name) % len(_MARKERS)]
            axes.plot(severity, 100 * share, color=colour, marker=marker, markersize=3.5, label=name)
        axes.set_title(title, loc="left")
        axes.set_ylim(100 * lowest - 2, 101)
        axes.grid(visible=True, axis="y", color=PALE, linewidth=0.6)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        if i % columns == 0:
            axes.set_ylabel("right, %")
        if i // columns == rows - 1:
            axes.set_xlabel("severity")
    handles, shown = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, shown, loc="outside upper center", ncols=len(shown))
    return figure


@styled
def scenes_figure(bars: Mapping[str, Mapping[str, Bar]]) -> Figure:
    """Draw accuracy on sets of scenes: a group for each set, a dot with its interval for each backend.

    Parameters
    ----------
    bars
        By set and backend, (severity, share, low, high); the severity is not shown.

    Examples
    --------
    >>> figure = scenes_figure({"clean": {"hough": (0, 0.98, 0.97, 0.99)}})
    >>> [label.get_text() for label in figure.axes[0].get_yticklabels()]
    ['clean']
    """
    names = list(dict.fromkeys(name for group in bars.values() for name in group))
    figure = Figure((6.6, 1.0 + len(bars) * (0.22 + 0.13 * len(names))), layout="constrained")
    axes = figure.add_subplot()
    for i, name in enumerate(names):
        places = np.arange(len(bars)) + (i - (len(names) - 1) / 2) * 0.8 / len(names)
        _, share, low, high = (
            np.array(v) for v in zip(*(group[name] for group in bars.values()), strict=True)
        )
        error = 100 * np.stack([np.maximum(share - low, 0), np.maximum(high - share, 0)])
        marker = _MARKERS[i % len(_MARKERS)]
        axes.errorbar(
            100 * share,
            places,
            xerr=error,
            fmt=marker,
            color=_colour(i),
            markersize=4.5,
            capsize=2,
            label=name,
        )
    axes.set_yticks(range(len(bars)), list(bars), color=INK)
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.6)
    axes.set_xlabel("right, % (95 % interval)")
    figure.legend(loc="outside upper center", ncols=len(names))
    return figure


@styled
def reliability_figure(panels: Mapping[str, Mapping[str, Bins]]) -> Figure:
    """Draw how often backends are right by how sure they are; on the diagonal they mean what they say.

    Parameters
    ----------
    panels
        By backend, and within it by set of frames: mean confidence, share of right labels and frames of
        each bin, each of shape (bins,); NaN in empty bins.

    Examples
    --------
    >>> bins = (np.array([0.5, 0.9]), np.array([0.4, 1.0]), np.array([10, 90]))
    >>> figure = reliability_figure({"hough": {"scenes": bins}})
    >>> figure.axes[0].get_title(loc="left"), len(figure.axes[0].lines)
    ('hough', 2)
    """
    rows, columns = grid_of(len(panels), 4)
    figure = Figure((0.4 + 2.1 * columns, 0.5 + 2.15 * rows), layout="constrained")
    for i, (name, sets) in enumerate(panels.items()):
        axes = figure.add_subplot(rows, columns, i + 1)
        axes.plot([0, 100], [0, 100], color=GREY, linewidth=0.8, linestyle="--")
        for j, (title, (sure, right, frames)) in enumerate(sets.items()):
            full = frames > 0
            axes.plot(100 * sure[full], 100 * right[full], color=_colour(j), linewidth=1.2, label=title)
            area = 4 + 60 * frames[full] / max(frames.sum(), 1)
            axes.scatter(
                100 * sure[full], 100 * right[full], s=area, color=_colour(j), alpha=0.8, linewidth=0
            )
        axes.set_title(name, loc="left")
        axes.set_xlim(0, 103)
        axes.set_ylim(0, 103)
        axes.set_aspect("equal")
        axes.set_xlabel("confidence, %")
        if i % columns == 0:
            axes.set_ylabel("right, %")
    handles, shown = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, shown, loc="outside upper center", ncols=len(shown))
    return figure


@styled
def contact_sheet_figure(items: Sequence[tuple[str, NDArray[np.uint8]]]) -> Figure:
    """Draw many frames, each below its title.

    Parameters
    ----------
    items
        Title and frame of each; frames are uint8 RGB, shape (H, W, 3).

    Examples
    --------
    >>> figure = contact_sheet_figure([("a sphere, seen as cube", np.zeros((8, 8, 3), dtype=np.uint8))])
    >>> figure.axes[0].get_title()
    'a sphere, seen as cube'
    """
    rows, columns = grid_of(len(items), 7)
    close = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.04, wspace=0, hspace=0)
    figure = Figure((1.2 * max(columns, 4), 1.6 * rows), layout=close)
    for i, (title, frame) in enumerate(items):
        axes = figure.add_subplot(rows, max(columns, 4), (i // columns) * max(columns, 4) + i % columns + 1)
        axes.imshow(frame, interpolation="nearest")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set(visible=True, color=GREY, linewidth=0.5)
        axes.set_title(title, fontsize=6.5, pad=2)
    return figure


def _colour(i: int) -> str:
    palette = (BLUE, VERMILION, GREEN, PLUM, ORANGE, SKY)
    return palette[i % len(palette)]
