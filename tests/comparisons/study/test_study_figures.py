"""Figures of studies: what is drawn where, and which figures a study has."""

from collections.abc import Callable
from itertools import product
from math import inf, isfinite, nan
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import trim_mean

from comparisons.study.figures import draw_curves, draw_estimates, draw_heat, draw_reliability
from comparisons.study.figures.choosing import MAKERS, plates_of
from comparisons.study.figures.curves import iqm_bands, step_aligned
from comparisons.study.figures.draw_curves import Curve, Curves, convergence_figure, profiles_figure
from comparisons.study.figures.draw_estimates import (
    Estimates,
    estimates_figure,
    improvement_matrix_figure,
    over_figure,
)
from comparisons.study.figures.draw_heat import Heat, heat_figure
from comparisons.study.figures.draw_reliability import Bins, reliability_figure
from comparisons.study.figures.grouping import FIGURES, About
from comparisons.study.figures.plate import Plate
from comparisons.study.figures.saving import (
    FORMATS,
    ONE_COLUMN,
    TWO_COLUMNS,
    Spot,
    marks,
    save_three,
    scale_of,
)
from comparisons.study.kinds import Kind, Measure, Result
from comparisons.study.results.rows import Row
from comparisons.study.results.samples import samples_of
from comparisons.study.results.statistics import estimate
from worlds import Cell, UserError, load_layout
from worlds.layout_writing import layout_text

MAZE = load_layout("two_rooms")
STEPS = Measure("steps_to_optimal", "steps until every start is optimal", "steps", "less")
SHARE = Measure("share_optimal", "starts that are optimal", "", "more")
OPTIMAL = Measure("optimal", "affordances that are optimal", "", "more")
X = np.array([0.0, 10.0, 20.0])
LINE = Curve(X, np.array([0.0, 50.0, 100.0]), np.array([0.0, 40.0, 90.0]), np.array([5.0, 60.0, 100.0]))
SPOTS = {
    "maxq-0": {"1": Spot(900, 800, 1000), "0.9": Spot(1300, 1100, inf)},
    "flat-q": {"1": Spot(9000, 8000, 9500), "0.9": Spot(inf, 9900, inf)},
}
DRAWINGS: dict[str, Callable[[], Figure]] = {
    "estimates": lambda: estimates_figure([Estimates("steps", SPOTS)]),
    "over": lambda: over_figure([Estimates("steps", SPOTS, title="a"), Estimates("x", SPOTS)], "gamma"),
    "improvement_matrix": lambda: improvement_matrix_figure(["a", "b"], {("a", "b"): Spot(80, 70, 90)}),
    "convergence": lambda: convergence_figure([Curves("", "optimal, %", {"maxq-0": LINE}, True)]),
    "profiles": lambda: profiles_figure([Curves("", "runs, %", {"maxq-0": LINE}, True)], "steps"),
    "heat": lambda: heat_figure(MAZE, [Heat("maxq-0", dict.fromkeys(MAZE.cells, 1.5))], "steps"),
    "reliability": lambda: reliability_figure(
        [("hough", {"clean": Bins(np.array([0.5]), np.array([0.4]), np.array([7]))})]
    ),
}


def kind(*measures: Measure) -> Kind:
    """Return a kind that is never run."""
    return Kind("mine", 1, measures, dict, lambda _: (), lambda *_: Result({}))


def learnt(seeds: int = 6) -> tuple[About, list[Row]]:
    """Return runs of two learners with two discounts, with curves and maps; one of four never gets there."""
    rows = []
    cells = [str(cell) for cell in MAZE.cells[:4]]
    for gamma, learner, seed in product(("1", "0.9"), ("maxq-0", "flat-q"), range(seeds)):
        never = (gamma, learner) == ("0.9", "flat-q")
        steps = 1000.0 * (1 + (learner == "flat-q")) + 10 * seed
        curve = {
            "steps": [0.0, steps / 2, steps],
            "share_optimal": [0.0, 0.5, 0.9 if never else 1.0],
            "share_ending": [0.5, 1.0, 1.0],
            "mean_return": [-3.0, -20.0, -10.0],
        }
        heat = {"layout": layout_text(MAZE), "trigger": "T4", "goal": "G2", "cells": cells}
        gaps = [0.0, 0.0, float(never), None if never else 0.0]
        heat |= {"steps": [1.0, 2.0, 3.0, None if never else 4.0], "gaps": gaps}
        heat["way"] = [] if never else ["0,0", "0,1", "1,1"] if seed % 2 else ["0,0", "1,0", "1,1"]
        measures = {STEPS.name: None if never else steps, SHARE.name: curve["share_optimal"][-1]}
        result = Result(measures, {"learning": curve}, {"heat": heat})
        rows.append(Row({"gamma": gamma, "learner": learner}, seed, f"{gamma}{learner}{seed}", result))
    factors = {"gamma": ("1", "0.9"), "learner": ("maxq-0", "flat-q")}
    return About(kind(STEPS, SHARE), factors, STEPS, "gamma", "1"), rows


def episodes(seeds: int = 5) -> tuple[About, list[Row]]:
    """Return runs of two strategies among more and more obstacles."""
    rows = [
        Row(
            {"obstacles": count, "strategy": strategy},
            seed,
            f"{count}{strategy}{seed}",
            Result({"optimal": share, "optimal.Goto": share, "optimal.Leave": None}),
        )
        for count, strategy, seed in product(
            ("1", "2", "10", "3"), ("local-rule", "replanning"), range(seeds)
        )
        for share in [1.0 if strategy == "replanning" else 0.9 - 0.01 * seed]
    ]
    factors = {"obstacles": ("1", "2", "10", "3"), "strategy": ("local-rule", "replanning")}
    return About(kind(OPTIMAL), factors, OPTIMAL, "strategy", "replanning", "mean"), rows


def named(plates: list[Plate]) -> dict[str, Plate]:
    """Return plates by name."""
    return {plate.name: plate for plate in plates}


def points(axes: Axes, gid: str) -> list[tuple[float, float]]:
    """Return the points of the one line of this group id."""
    (found,) = [each for each in axes.lines if each.get_gid() == gid]
    return [(float(x), float(y)) for x, y in np.asarray(found.get_xydata())]


@pytest.mark.parametrize("name", DRAWINGS)
def test_the_same_data_gives_the_same_three_files(name: str, tmp_path: Path) -> None:
    """Two drawings of the same data are equal byte by byte as SVG, PDF and PNG."""
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        save_three(DRAWINGS[name](), tmp_path / folder, name)
    for ending in FORMATS:
        one, two = ((tmp_path / folder / f"{name}.{ending}").read_bytes() for folder in ("one", "two"))
        assert one == two
    assert (tmp_path / "one" / f"{name}.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize("module", [draw_curves, draw_estimates, draw_heat, draw_reliability])
def test_every_figure_is_drawn_here(module: ModuleType) -> None:
    """A new figure function joins the test of equal bytes."""
    found = {name.removesuffix("_figure") for name in vars(module) if name.endswith("_figure")}
    assert found <= set(DRAWINGS)


@pytest.mark.parametrize("name", DRAWINGS)
def test_a_figure_is_as_wide_as_a_column_or_two(name: str) -> None:
    """Nothing has to be scaled to fit a paper's columns."""
    assert DRAWINGS[name]().get_figwidth() in (ONE_COLUMN, TWO_COLUMNS)


def test_an_estimate_stands_at_its_number_and_its_line_spans_the_interval() -> None:
    """Marks stand at the estimates, one row for each level from above, and lines from bound to bound."""
    axes = DRAWINGS["estimates"]().axes[0]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["1", "0.9"]
    spans = [sorted(map(float, line.get_xdata())) for line in axes.lines if len(line.get_xdata()) == 2]
    assert [800.0, 1000.0] in spans
    first = next(line for line in axes.lines if list(line.get_xdata()) == [900.0])
    assert round(float(first.get_ydata()[0])) == 0
    assert axes.yaxis_inverted()


def test_what_was_never_reached_is_hollow_at_the_end_and_said_so() -> None:
    """An infinite estimate has a hollow mark at the axis's end, and the axis's label tells what it means."""
    axes = DRAWINGS["estimates"]().axes[0]
    end = axes.get_xlim()[1]
    hollow = [line for line in axes.lines if line.get_markerfacecolor() == "white"]
    assert [list(map(float, line.get_xdata())) for line in hollow] == [[end]]
    assert "never reached" in axes.get_xlabel()


def test_long_labels_leave_room_for_the_data() -> None:
    """Labels of any length are cut, and no figure's axes collapse."""
    long = {"a label that never ends " * 20: {"line\nbreak " * 30: Spot(5, 4, 6), "b": Spot(6, 5, 7)}}
    other = {f"{i} {'long ' * 40}": by_level for i in range(6) for by_level in long.values()}
    for figure in (
        estimates_figure([Estimates("steps", long, title="t" * 300), Estimates("steps", other)]),
        improvement_matrix_figure(["a" * 200, "b" * 200], {}),
        heat_figure(MAZE, [Heat("t" * 300, {MAZE.cells[0]: 1.0})] * 2, "steps"),
    ):
        for axes in figure.axes:
            assert axes.get_position().width > 0.1 or axes.get_label() == "<colorbar>"
            assert axes.get_position().height > 0.1


def test_an_interval_that_cannot_be_told_is_not_drawn() -> None:
    """A single run has a mark and no line."""
    axes = estimates_figure([Estimates("steps", {"": {"1": Spot(5.0, nan, nan)}})]).axes[0]
    spans = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) == 2]
    assert np.isnan(spans).all()
    assert "never" not in axes.get_xlabel()


def test_a_numeric_factor_is_in_order_of_its_numbers() -> None:
    """Levels 1, 2, 10, 3 are drawn at 1, 2, 3, 10."""
    about, rows = episodes()
    axes = named(plates_of(about, rows, ["over"])[0])["over"].figure.axes[0]
    assert [x for x, _ in points(axes, "local-rule")] == [1, 2, 3, 10]
    assert {y for _, y in points(axes, "replanning")} == {100}


def test_a_growing_share_is_drawn_from_each_number_on_and_a_falling_one_back() -> None:
    """Of steps, a share holds until the next number; of what should be much, from the one before."""
    panel = Curves("", "runs, %", {"a": LINE}, True)
    less, more = (profiles_figure([panel], "x", less=less).axes[0].lines[0] for less in (True, False))
    assert (less.get_drawstyle(), more.get_drawstyle()) == ("steps-post", "steps-pre")


def test_a_heat_map_has_its_numbers_and_crosses() -> None:
    """Each cell shows its number, and a cross where the robot does not arrive."""
    values = {Cell(0, 0): 3.0, Cell(0, 1): 0.25, Cell(1, 0): inf}
    axes = heat_figure(MAZE, [Heat("a", values)], "steps").axes[0]
    shown = {text.get_position(): text.get_text() for text in axes.texts}
    assert shown == {(0, 0): "3", (1, 0): "0.25", (0, 1): "\N{MULTIPLICATION SIGN}"}


@given(st.integers(1, 18))
def test_looks_differ(count: int) -> None:
    """Up to eighteen levels are told apart, by more than their colour."""
    looks = marks([str(i) for i in range(count)])
    assert len(set(looks.values())) == count
    assert len({(look.marker, look.dashes) for look in looks.values()}) == count


numbers = st.floats(-1e6, 1e6) | st.just(inf)


@given(st.lists(st.tuples(numbers, numbers, numbers), min_size=1), st.booleans())
def test_a_scale_shows_every_number(bounds: list[tuple[float, float, float]], share: bool) -> None:
    """Every finite number lies inside the axis (shares between 0 and 100), and infinite ones at its end."""
    spots = [
        Spot(*(min(max(b, 0.0), 100.0) if share and isfinite(b) else b for b in each)) for each in bounds
    ]
    scale = scale_of(spots, share=share)
    assert scale.low < scale.high
    for value in (value for spot in spots for value in spot):
        if isfinite(value):
            assert scale.inside(value) == value
        else:
            assert scale.inside(value) == scale.high


runs = st.lists(
    st.lists(
        st.tuples(st.integers(0, 50), st.floats(0, 1)), min_size=1, max_size=6, unique_by=lambda p: p[0]
    ),
    min_size=1,
    max_size=5,
)


@given(runs, st.integers(0, 80))
def test_alignment_takes_the_last_value_that_was_known(
    curves: list[list[tuple[int, float]]], end: int
) -> None:
    """At each place a run has the value of its last evaluation so far; it keeps it after its end."""
    ordered = [sorted(curve) for curve in curves]
    pairs = [([float(x) for x, _ in curve], [y for _, y in curve]) for curve in ordered]
    places, values = step_aligned(pairs, float(end))
    assert list(places) == sorted({*(x for xs, _ in pairs for x in xs if x <= end), float(end)})
    for curve, row in zip(ordered, values, strict=True):
        for place, value in zip(places, row, strict=True):
            known = [y for x, y in curve if x <= place]
            assert value == (known[-1] if known else -inf)


@given(st.lists(st.floats(0, 1), min_size=2, max_size=12))
def test_a_band_holds_the_interquartile_mean(column: list[float]) -> None:
    """The line is scipy's trimmed mean, and no bound lies beyond what the runs had."""
    value, low, high = iqm_bands(np.array(column)[:, None])[:, 0]
    assert value == pytest.approx(trim_mean(column, 0.25))
    assert min(column) - 1e-9 <= low <= high <= max(column) + 1e-9


def test_a_band_is_as_wide_as_the_tables_interval() -> None:
    """The band of a curve's last value is the interval that the table has for it, but for resampling."""
    column = np.linspace(0, 1, 20) ** 2
    found = estimate(
        samples_of([Row({}, i, "", Result({"m": v})) for i, v in enumerate(column)], Measure("m", ""))
    )
    assert found is not None
    _, low, high = iqm_bands(column[:, None])[:, 0]
    assert low == pytest.approx(found.low, abs=0.02)
    assert high == pytest.approx(found.high, abs=0.02)


def test_a_band_is_honest_about_what_is_infinite() -> None:
    """Where the middle runs have no value there is no line, and a single run has no band."""
    values = np.array([[-inf, 1.0], [-inf, 2.0], [5.0, 3.0], [5.0, 4.0]])
    assert iqm_bands(values)[0].tolist() == [-inf, 2.5]
    assert not np.isnan(iqm_bands(values)).any()
    value, low, high = iqm_bands(np.array([[7.0]]))[:, 0]
    assert value == 7
    assert np.isnan([low, high]).all()


def test_figures_choose_themselves() -> None:
    """Curves, maps and few levels give one set of figures; a numeric factor and parts give another."""
    found, missing = plates_of(*learnt())
    assert set(named(found)) == {
        *("estimates", "improvement", "learning", "returns", "efficiency", "steps_map", "gaps_map", "ways"),
    }
    assert missing == ()
    assert set(named(plates_of(*episodes())[0])) == {"over", "parts", "improvement", "profiles"}


def test_returns_are_drawn_where_they_tell_something() -> None:
    """Where every run ends optimal, its returns are drawn only if they are asked for."""
    about, rows = learnt()
    optimal = [row for row in rows if row.levels != {"gamma": "0.9", "learner": "flat-q"}]
    assert "returns" not in named(plates_of(about, optimal)[0])
    assert [plate.name for plate in plates_of(about, optimal, ["returns"])[0]] == ["returns"]


def test_a_study_file_restricts_the_figures() -> None:
    """Only figures that are asked for are drawn; those that cannot be are named; unknown ones are refused."""
    found, missing = plates_of(*learnt(), ["reliability", "learning", "estimates"])
    assert [plate.name for plate in found] == ["estimates", "learning"]
    assert missing == ("reliability",)
    with pytest.raises(UserError, match="did you mean 'learning'"):
        plates_of(*learnt(), ["learnin"])


def test_every_figure_has_its_name_told() -> None:
    """The names that commands check are those of the figures there are, in their order."""
    assert tuple(MAKERS) == FIGURES


def test_a_figures_numbers_are_those_of_the_statistics() -> None:
    """What a figure of estimates tells is what `estimate` gives for the same runs."""
    about, rows = learnt()
    plate = named(plates_of(about, rows, ["estimates"])[0])["estimates"]
    alike = [row for row in rows if row.levels == {"gamma": "0.9", "learner": "maxq-0"}]
    found = estimate(samples_of(alike, STEPS))
    assert found is not None
    (row,) = [row for row in plate.numbers if row[2:4] == ("maxq-0", "0.9") and row[0] == "steps to optimal"]
    assert row[4:] == (found.value, found.low, found.high)
    never = next(row for row in plate.numbers if row[2:4] == ("flat-q", "0.9"))
    assert never[4] == inf


def test_few_seeds_are_not_ranked() -> None:
    """Four seeds give no probability of improvement; five do."""
    assert plates_of(*learnt(4), ["improvement"]) == ([], ("improvement",))
    assert plates_of(*learnt(5), ["improvement"])[1] == ()


def test_a_curve_of_returns_begins_where_every_start_ends() -> None:
    """Returns of policies that do not end from every start are not drawn."""
    plate = named(plates_of(*learnt(), ["returns"])[0])["returns"]
    drawn = points(plate.figure.axes[0], "gamma 1")
    assert {-20.0, -10.0} <= {y for _, y in drawn if np.isfinite(y)}
    assert max(y for _, y in drawn if np.isfinite(y)) == -10
    assert np.isnan(drawn[0][1])


def test_a_map_without_gaps_is_not_drawn() -> None:
    """Where nothing is lost anywhere there is no map of gaps, and one map of steps stands for all alike."""
    about, rows = learnt()
    kept = [row for row in rows if row.levels != {"gamma": "0.9", "learner": "flat-q"}]
    found = named(plates_of(about, kept, ["steps_map", "gaps_map"])[0])
    assert "gaps_map" not in found
    (axes, _) = found["steps_map"].figure.axes
    assert axes.get_title(loc="left") == "every combination"
    four = named(plates_of(about, rows, ["steps_map"])[0])["steps_map"].figure.axes
    assert len(four) == 5  # and the bar of colours
    crosses = [
        text for axes in four[:4] for text in axes.texts if text.get_text() == "\N{MULTIPLICATION SIGN}"
    ]
    assert len(crosses) == 1


def test_ways_tell_how_many_runs_take_them() -> None:
    """Half of the seeds go one way and half the other; a panel says how many arrive at all."""
    plate = named(plates_of(*learnt(), ["ways"])[0])["ways"]
    titles = [axes.get_title(loc="left") for axes in plate.figure.axes]
    assert [title.rpartition(": ")[2] for title in titles] == [*["6 of 6 runs"] * 3, "0 of 6 runs"]
    assert {row[1:] for row in plate.numbers} == {
        *(("0,0", "0,1", 50.0), ("0,1", "1,1", 50.0), ("0,0", "1,0", 50.0), ("1,0", "1,1", 50.0)),
    }
    about, rows = learnt()
    lost = [row for row in rows if row.levels == {"gamma": "0.9", "learner": "flat-q"}]
    assert plates_of(about, lost, ["ways"]) == ([], ("ways",))


def test_a_level_has_the_same_colour_in_every_figure() -> None:
    """The strategy that is compared looks the same beside its baseline and without it."""
    found = named(plates_of(*episodes(), ["over", "improvement"])[0])
    for name in ("over", "improvement"):
        (line,) = [line for line in found[name].figure.axes[0].lines if line.get_gid() == "local-rule"]
        assert line.get_color() == marks(["local-rule"])["local-rule"].colour


def test_reliability_takes_frames_together() -> None:
    """Bins of several seeds are weighted by their frames."""
    tables = [
        {"confidence": [0.5, None], "accuracy": [0.4, None], "frames": [30, 0]},
        {"confidence": [0.6, 0.9], "accuracy": [0.8, 1.0], "frames": [10, 5]},
    ]
    rows = [Row({}, i, str(i), Result({}, {}, {"reliability": t})) for i, t in enumerate(tables)]
    about = About(kind(Measure("accuracy", "", "", "more")), {}, Measure("accuracy", "", "", "more"))
    plate = named(plates_of(about, rows, ["reliability"])[0])["reliability"]
    assert np.allclose(np.array(plate.numbers, dtype=float), [[52.5, 50.0, 40], [90.0, 100.0, 5]])
