"""The table and the figure of `bench_transfer`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from comparisons.style import BLUE, GREEN, GREY, INK, ORANGE, SKY, VERMILION, panel, styled

Found = Mapping[str, list[dict[str, Any]]]

NEAR: Final = 1.05
"""Within 5 % of the optimum."""
_LOOKS: Final = {
    "option-critic, carried": (BLUE, "-"),
    "option-critic, fresh": (ORANGE, "-"),
    "option-critic, all carried": (SKY, "--"),
    "tabular option-critic, as published": (VERMILION, "-."),
    "flat Q": (GREY, ":"),
    "MAXQ-Q": (GREEN, "--"),
}
_SCALE: Final = (1, 1.5, 2, 3, 5, 10, 20, 50, 100)


def table(found: Found) -> str:
    """Return the Markdown table: medians over seeds, in brackets the least and the most.

    Steps are told as multiples of the optimum.
    """
    head = (
        "learner",
        f"first goal, greedy after {_episodes(found, 'before'):.0f}",
        "moved, as run, episodes 1 to 200",
        "within 5 %, seeds",
        "episodes",
        "steps",
        f"greedy after {_episodes(found, 'after'):.0f}",
        "as run, the last 500",
        "CPU seconds",
    )
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    for name, runs in found.items():
        near = [within(run["after"], run["optimum_after"]) for run in runs]
        counts = [
            _median([np.inf if row is None else row[what] for row in near]) for what in ("episodes", "steps")
        ]
        cells = (
            name,
            _spread([run["before"][-1]["greedy"] / run["optimum_before"] for run in runs]),
            _spread([_as_run(run, 0, 200) for run in runs]),
            f"{sum(row is not None for row in near)} of {len(runs)}",
            *counts,
            _spread([run["after"][-1]["greedy"] / run["optimum_after"] for run in runs]),
            _spread([_as_run(run, 1000, 1500) for run in runs]),
            f"{np.median([run['before'][-1]['cpu'] + run['after'][-1]['cpu'] for run in runs]):.2g}",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _as_run(run: dict[str, Any], begin: int, end: int) -> float:
    """Return the mean steps of the episodes between two evaluations after the move, over the optimum."""
    first, last = (next(row for row in run["after"] if row["episodes"] >= at) for at in (begin, end))
    mean: float = (last["steps"] - first["steps"]) / (last["episodes"] - first["episodes"])
    return mean / float(run["optimum_after"])


def within(rows: list[dict[str, float]], optimum: float) -> dict[str, float] | None:
    """Return the first evaluation within 5 % of the optimum, or None."""
    return next((row for row in rows if row["greedy"] <= NEAR * optimum), None)


def _episodes(found: Found, when: str) -> float:
    """Return after how many episodes the last evaluation was, to the nearest hundred."""
    return round(float(np.median([run[when][-1]["episodes"] for runs in found.values() for run in runs])), -2)


def _median(values: list[float]) -> str:
    middle = float(np.median(values))
    return f"{middle:,.0f}" if np.isfinite(middle) else "-"


def _spread(ratios: list[float]) -> str:
    return f"{np.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"


@styled
def transfer_figure(found: Found) -> Figure:
    """Draw steps over episodes, as multiples of the optimum: as episodes were run, and greedily."""
    figure = Figure((7.2, 6.2), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True)
    titles = ("steps of an episode as it was run", "exact expected steps of the greedy policy")
    for i, (one, what) in enumerate(zip(axes, ("as_run", "greedy"), strict=True)):
        one.set_title(panel(i, titles[i]), loc="left")
        for name in _LOOKS:
            if name in found:
                _draw(one, name, found[name], what)
        _frame(one, found)
    # Below, where many lines begin, words would lie on them.
    axes[0].annotate("the goal moves", (1000, 100), (4, 0), textcoords="offset points", va="top")
    axes[1].set_xlabel("episodes; the goal moves after 1000")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _draw(axes: Axes, name: str, runs: list[dict[str, Any]], what: str) -> None:
    """Draw the median over seeds and its quartiles, before the move and after it."""
    colour, line = _LOOKS[name]
    moved = _episodes({name: runs}, "before")
    for when in ("before", "after"):
        if when == "before" and name in ("option-critic, carried", "option-critic, all carried"):
            continue  # one run leads up to all three
        grid = np.arange(0.0 if what == "greedy" else 50.0, _episodes({name: runs}, when) + 1, 50.0)
        optimum = f"optimum_{when}"
        curves = []
        for run in runs:
            rows = [row for row in run[when] if what in row]
            at = [row["episodes"] for row in rows]
            curves.append(np.interp(grid, at, [row[what] / run[optimum] for row in rows]))
        low, middle, high = np.quantile(curves, (0.25, 0.5, 0.75), axis=0)
        x = grid + (moved if when == "after" else 0.0)
        axes.plot(x, middle, line, color=colour, linewidth=1.5, label=name if when == "after" else None)
        if name in ("option-critic, carried", "option-critic, fresh"):
            axes.fill_between(x, low, high, color=colour, alpha=0.18, linewidth=0)


def _frame(axes: Axes, found: Found) -> None:
    axes.set_yscale("log")
    axes.set_yticks(_SCALE, [f"{mark:g}" for mark in _SCALE], minor=False)
    axes.minorticks_off()
    axes.set_ylim(0.66, 130)
    axes.set_xlim(0, _episodes(found, "before") + _episodes(found, "after"))
    axes.set_ylabel("times the optimum")
    axes.axhline(1.0, color=INK, linewidth=0.9, zorder=0)
    axes.annotate("optimum", (axes.get_xlim()[1], 1.0), (-2, -10), textcoords="offset points", ha="right")
    axes.axvline(1000, color=INK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=0)
