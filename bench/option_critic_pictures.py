"""The two figures of `bench_option_critic`: learning curves, and the sweep over the deliberation cost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from comparisons.style import BLUE, GREEN, GREY, ORANGE, PLUM, SKY, VERMILION, panel, styled

Rows = Mapping[str, list[dict[str, Any]]]

_CUT: Final = 200  # steps after which a route is left
_LOOKS: Final = {
    "given": (BLUE, "-"),
    "prior": (GREEN, "-"),
    "learnt, no prior": (PLUM, "-."),
    "flat PPO": (VERMILION, "--"),
    "flat DQN": (GREY, ":"),
    "tabular option-critic (as published)": (SKY, "-."),
    "4 pairs, abstracted": (BLUE, "-"),
    "4 pairs, full": (ORANGE, "-."),
    "4 pairs, flat PPO": (VERMILION, "--"),
}


@styled
def curves_figure(learners: Rows) -> Figure:
    """Draw the share of optimal cases over steps: median over seeds, least and most.

    Left those that learn from all starts, right the unseen pairs of those that learn from four pairs.
    """
    figure = Figure((7.2, 3.3), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, four, title in ((left, False, "all 512 cases"), (right, True, "12 pairs never trained on")):
        axes.set_title(panel(int(four), title), loc="left")
        axes.set_xlabel("environment steps (thousands)")
        for name, rows in learners.items():
            if rows[0]["four"] == four:
                _band(axes, name, [[(step, *shares) for step, _, *shares in row["curve"]] for row in rows])
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3)
        axes.set_xlim(left=0)
    left.set_ylabel("cases with an optimal greedy route (%)")
    left.set_ylim(-2, 102)
    return figure


def _band(axes: Axes, name: str, curves: list[list[tuple[float, ...]]]) -> None:
    """Draw a learner; a run that ended early, all optimal, keeps its last value."""
    column = 2 if name.startswith("4 pairs") else 1
    longest = max(curves, key=len)
    steps = np.array([0.0, *(row[0] for row in longest)]) / 1000
    shares = np.zeros((len(curves), len(steps)))
    for i, curve in enumerate(curves):
        shares[i, 1 : len(curve) + 1] = [100 * row[column] for row in curve]
        shares[i, len(curve) + 1 :] = 100 * curve[-1][column]
    colour, line = _LOOKS[name]
    axes.plot(
        steps,
        np.median(shares, axis=0),
        line,
        color=colour,
        label=name.removeprefix("4 pairs, ").partition(" (")[0],
    )
    axes.fill_between(steps, shares.min(0), shares.max(0), color=colour, alpha=0.15, linewidth=0)


@styled
def sweep_figure(costs: Rows) -> Figure:
    """Draw duration, changes, terminations and optimal cases over the deliberation cost, a dot a seed."""
    figure = Figure((7.2, 4.4), layout="constrained")
    ticks = [f"{rows[0]['cost']:g}" for rows in costs.values()]
    panels = (
        ("steps an option runs", lambda row: row["options"]["duration"], BLUE),
        ("mean beta away from subgoals", lambda row: row["options"]["beta_elsewhere"], GREEN),
        ("steps that change the option (%)", lambda row: 100 * row["options"]["switch_rate"], PLUM),
        ("cases with an optimal route (%)", lambda row: 100 * row["optimal"] / row["cases"], VERMILION),
    )
    for i, (axes, (label, value, colour)) in enumerate(zip(figure.subplots(2, 2).flat, panels, strict=True)):
        found = [[value(row) for row in rows] for rows in costs.values()]
        for place, values in enumerate(found):
            axes.plot(
                [place] * len(values), values, "o", color=colour, markersize=4, alpha=0.8, clip_on=False
            )
        axes.plot([float(np.median(values)) for values in found], color=colour)
        axes.set_title(panel(i, label), loc="left")
        axes.set_xticks(range(len(ticks)), ticks)
        if i == 0:
            axes.set_yscale("log")
            marks = (1, 2, 5, 10, 20, 50, 100, 200)
            axes.set_yticks(marks, [str(mark) for mark in marks], minor=False)
            axes.minorticks_off()
            axes.set_ylim(0.9, 240)
            for height, words in ((1, "one step"), (_CUT, "cut off here")):
                axes.axhline(height, color=SKY, linestyle="--", linewidth=0.9, zorder=0)
                axes.annotate(words, (2.5, height), (0, -9 if height > 1 else 3), textcoords="offset points")
        else:
            axes.set_ylim(bottom=0)
        if i > 1:
            axes.set_xlabel("deliberation cost (rewards of a step)")
    return figure
