"""Figures of studies: what is drawn where, and which figures a study has."""

from collections.abc import Callable
from itertools import combinations, product
from math import inf, isfinite, nan
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox
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
from comparisons.study.figures.draw_ways import Ways, ways_figure
from comparisons.study.figures.grouping import FIGURES, About
from comparisons.study.figures.panels import ONE_COLUMN, TWO_COLUMNS, cut_apart, marks
from comparisons.study.figures.plate import Plate, numbers_table
from comparisons.study.figures.saving import FORMATS, save_three
from comparisons.study.figures.scales import Spot, scale_of
from comparisons.study.kinds import Kind, Measure, Result
from comparisons.study.results.rows import Row
from comparisons.study.results.samples import samples_of
from comparisons.study.results.statistics import estimate
from worlds import Cell, UserError, load_layout, parse_layout
from worlds.layout_writing import layout_text

MAZE = load_layout("two_rooms")
LARGE = parse_layout(Path("examples/studies/maze_12x20.maze").read_text())
STEPS = Measure("steps_to_optimal", "steps until every start is optimal", "steps", "less")
SHARE = Measure("share_optimal", "starts that are optimal", "", "more")
OPTIMAL = Measure("optimal", "affordances that are optimal", "", "more", ("Goto", "Leave"))
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
    for gamma, learner, seed in product(("1", "0.9"), ("maxq-0", "flat-q"), range(seeds)):
        never = (gamma, learner) == ("0.9", "flat-q")
        steps = 1000.0 * (1 + (learner == "flat-q")) + 10 * seed
        curve = {
            "steps": [0.0, steps / 2, steps],
            "share_optimal": [0.0, 0.5, 0.9 if never else 1.0],
            "share_ending": [0.5, 1.0, 1.0],
            "mean_return": [None, -20.0, -10.0],
        }
        heat = {"layout": layout_text(MAZE), "trigger": "T4", "goal": "G2"}
        heat["cells"] = [str(cell) for cell in MAZE.cells[:4]]
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
    (never,) = estimates_figure([Estimates("steps", {"": {"1": Spot(inf, inf, inf, 9)}})]).axes
    assert list(never.get_xticks()) == []  # there is no number to read


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
    for value in (value for spot in spots for value in spot[:3]):
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
    assert row[4:] == (found.value, found.low, found.high, found.seeds)
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
    assert len(kept) == 18
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
    ends = [" ".join(title.split()).rpartition(": ")[2] for title in titles]
    assert ends == [*["6 of 6 runs"] * 3, "0 of 6 runs"]
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
    accuracy = Measure("accuracy", "", "", "more")
    about = About(kind(accuracy), {}, accuracy)
    plate = named(plates_of(about, rows, ["reliability"])[0])["reliability"]
    assert np.allclose(np.array(plate.numbers, dtype=float), [[52.5, 50.0, 40], [90.0, 100.0, 5]])
    levels = {"backend": ("a", "b"), "corruption": tuple("abcdefg"), "severity": tuple("abcdefg")}
    told = [Row(dict.fromkeys(levels, "a"), row.seed, row.hash, row.result) for row in rows]
    pooled = named(plates_of(About(kind(accuracy), levels, accuracy, "backend"), told, ["reliability"])[0])
    assert "2 seeds, and of all levels of corruption and severity, are taken" in pooled["reliability"].caption


def letters(figure: Figure) -> list[tuple[str, Bbox]]:
    """Return what stands in a figure, and where in its pixels."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    return [
        (text.get_text(), text.get_window_extent(renderer))
        for text in figure.findobj(Text)
        if len(text.get_text().strip()) > 3 and text.get_visible()  # ticks beyond the axis are not drawn
    ]


@pytest.mark.parametrize("length", [8, 30, 60])
def test_no_text_is_cut_off_or_lies_on_another(length: int) -> None:
    """Whatever labels are, each text is whole inside of its figure, and titles and labels keep apart."""
    names = [f"{'a label of many letters' * 3}"[:length] + f" {i}" for i in range(4)]
    spots = {"": {name: Spot(5.0, 4.0, inf, 9) for name in names}}
    estimates = [Estimates("steps to optimal", spots, title=title) for title in ("a", "b", "c")]
    heats = [Heat(name, dict.fromkeys(MAZE.cells, 12.0)) for name in names]
    ways = [Ways(name, [MAZE.cells[:2], []]) for name in names]
    for figure in (
        estimates_figure(estimates, "learner"),
        estimates_figure([Estimates(f"chance to beat {names[0]}, %", spots, True)], "learner", 50.0),
        convergence_figure([Curves(name, "optimal, %", {"a": LINE, "b": LINE}, True) for name in names]),
        heat_figure(MAZE, heats, "steps", ring={"T4": MAZE.marks["T4"]}),
        ways_figure(MAZE, ways, {"T4": MAZE.marks["T4"]}),
    ):
        found = letters(figure)
        for text, box in found:
            assert box.x0 >= 0, text
            assert box.x1 <= figure.bbox.x1, text
            assert box.y0 >= 0, text
            assert box.y1 <= figure.bbox.y1, text
        words = [(text, box) for text, box in found if len(text) > 6]
        for (one, here), (other, there) in combinations(words, 2):
            assert not here.overlaps(there), f"{one} lies on {other}"


def test_maze_letters_can_be_read_in_print() -> None:
    """No letter is smaller than 6 points, also in a maze of many columns, whose colours alone then tell."""
    large = parse_layout("\n".join(["  ".join(["."] * 20)] * 3)) if False else LARGE
    for maze in (MAZE, large):
        panels = [Heat(str(i), dict.fromkeys(maze.cells, 12.0)) for i in range(3)]
        figure = heat_figure(maze, panels, "steps")
        assert min(text.get_fontsize() for text in figure.findobj(Text) if text.get_text()) >= 6
    assert [text.get_text() for text in figure.axes[0].texts] == []


def test_labels_that_are_cut_stay_apart() -> None:
    """Long labels that differ in their first, middle or last letters alone are still different."""
    same = "the same letters over and over again, "
    for labels in ([f"{same}{same}{i}" for i in range(3)], [f"{same}{i}{same}" for i in range(3)]):
        assert len(set(cut_apart(labels).values())) == 3


def test_curves_are_told_apart_without_colour() -> None:
    """Each curve of a panel has a marker of its own, and the legend shows it."""
    curves = dict.fromkeys("abcdef", LINE)
    for figure in (
        convergence_figure([Curves("", "optimal, %", curves, True)]),
        profiles_figure([Curves("", "runs, %", curves, True)], "steps"),
    ):
        markers = [line.get_marker() for line in figure.axes[0].lines]
        assert len(set(markers)) == 6
        assert "None" not in markers
        assert [handle.get_marker() for handle in figure.legends[0].get_lines()] == markers


def test_few_seeds_have_small_marks_and_say_so() -> None:
    """What rests on fewer than five seeds is drawn smaller, is explained, and its seeds are counted."""
    about, rows = learnt(2)
    plate = named(plates_of(about, rows, ["estimates"])[0])["estimates"]
    assert "Small marks rest on fewer than 5 seeds." in plate.caption
    assert {row[-1] for row in plate.numbers} == {2}
    sizes = [
        max(line.get_markersize() for line in found.figure.axes[0].lines if len(line.get_xdata()) == 1)
        for found in (plate, named(plates_of(*learnt(6), ["estimates"])[0])["estimates"])
    ]
    assert sizes[0] < sizes[1]


def test_no_number_is_left_out_of_a_table() -> None:
    """Columns of numbers stay, also where an estimate and both of its bounds are the same in every row."""
    same = [
        Row({"gamma": gamma}, seed, f"{gamma}{seed}", Result({STEPS.name: 1000.0}))
        for gamma, seed in product(("1", "0.9"), range(5))
    ]
    about = About(kind(STEPS), {"gamma": ("1", "0.9")}, STEPS, "gamma", "1")
    plate = named(plates_of(about, same, ["estimates"])[0])["estimates"]
    assert plate.header[-4:] == ("IQM", "95 % from", "to", "seeds")
    assert plate.numbers[0][-4:] == (1000.0, 1000.0, 1000.0, 5)
    assert numbers_table(plate).rows[0][-4:] == ("1,000", "1,000", "1,000", "5")


def test_long_numbers_are_thinned_for_the_page_alone() -> None:
    """The page shows some rows from the first to the last; the file has every one."""
    numbers = tuple((str(i), float(i)) for i in range(1000))
    table = numbers_table(Plate("curve", Figure(), "", ("line", "y"), numbers))
    assert len(table.rows) == 150
    assert (table.rows[0][0], table.rows[-1][0]) == ("0", "999")
    assert "150 of 1,000 rows" in table.note


def test_a_map_of_gaps_shows_what_few_runs_lose() -> None:
    """A loss in one of six runs is on the map, and a run that does not come to the end is a cross."""
    about, rows = learnt()
    kept = [row for row in rows if row.levels != {"gamma": "0.9", "learner": "flat-q"}]
    heat = kept[0].result.details["heat"]
    heat["gaps"] = [3.0, 0.0, 0.0, None]
    plate = named(plates_of(about, kept, ["gaps_map"])[0])["gaps_map"]
    assert [row[-1] for row in plate.numbers if row[0] == "gamma 1, maxq-0"] == [0.5, 0.0, 0.0, inf]
    assert "Mean over 6 seeds" in plate.caption
    assert "where a run or more does not come to the end" in plate.caption


def test_limited_episodes_tell_every_return() -> None:
    """Where evaluations limit episodes, the mean over all starts is known, and drawn, from the first on."""
    about, rows = learnt()
    for row in rows:
        row.result.curves["learning"]["mean_return"][0] = -3.0
    plate = named(plates_of(about, rows, ["returns"])[0])["returns"]
    assert -3.0 in {y for _, y in points(plate.figure.axes[0], "gamma 1")}
    assert "every start" not in plate.caption


def test_a_run_that_keeps_no_way_is_not_said_to_be_lost() -> None:
    """The optimum arrives from the start, and keeps no way: it has no panel, rather than "0 of 6 runs"."""
    about, rows = learnt()
    optimum = {"gamma": "1", "learner": "maxq-0"}
    for row in rows:
        heat = row.result.details["heat"]
        heat["cells"][0] = str(MAZE.start)
        if row.levels == optimum:
            heat["way"] = []
        elif not heat["way"]:
            heat["steps"][0] = None
    plate = named(plates_of(about, rows, ["ways"])[0])["ways"]
    titles = [" ".join(axes.get_title(loc="left").split()) for axes in plate.figure.axes]
    assert titles == [
        *("(a) gamma 1, flat-q: 6 of 6 runs", "(b) gamma 0.9, maxq-0: 6 of 6 runs"),
        "(c) gamma 0.9, flat-q: 0 of 6 runs",
    ]


def test_what_has_no_number_bends_no_axis() -> None:
    """A curve that is never known neither moves the others' ordinate nor shortens its panel's abscissa."""
    never = Curve(X, *np.full((3, 3), -inf))
    below = Curve(X, np.full(3, -50.0), np.full(3, -inf), np.full(3, -40.0))
    panels = [Curves("a", "return", {"x": below}), Curves("b", "return", {"x": never})]
    one, other = convergence_figure(panels, alike=True).axes
    assert one.get_ylim()[1] < -30
    assert one.get_ylim() == other.get_ylim()
    assert one.get_xlim() == other.get_xlim() == (0, 20)


def many(count: int) -> tuple[About, list[Row]]:
    """Return runs of so many levels, each faster than the one before."""
    levels = tuple(f"level {i}" for i in range(count))
    rows = []
    for i, seed in product(range(count), range(5)):
        steps = 1000.0 * (count - i) + 10 * seed
        curve = {"steps": [0.0, steps / 2, steps], "share_optimal": [0.0, 0.5, 1.0]}
        result = Result({STEPS.name: steps}, {"learning": curve})
        rows.append(Row({"level": levels[i]}, seed, f"{i}-{seed}", result))
    return About(kind(STEPS), {"level": levels}, STEPS, "level", levels[0]), rows


def test_more_levels_than_colours_have_panels() -> None:
    """Seven to twelve levels still have learning curves, one in each panel, and no colour comes twice."""
    for count in (7, 12):
        found = named(plates_of(*many(count))[0])
        panels = found["learning"].figure.axes
        assert len(panels) == count
        assert len({axes.get_xlim() for axes in panels}) == 1  # levels that are compared
        assert "axes of its own" not in found["learning"].caption
    assert "learning" not in named(plates_of(*many(13))[0])


def test_figures_that_would_say_nothing_are_not_drawn() -> None:
    """Shares that jump once tell no more than estimates do, and a curve that never moves tells nothing."""
    about, rows = many(3)
    one_seed = [row for row in rows if row.seed == 0]
    assert "efficiency" in named(plates_of(about, rows)[0])
    assert "efficiency" not in named(plates_of(about, one_seed)[0])
    for row in rows:
        row.result.curves["learning"]["share_optimal"][:] = [0.0, 0.0, 0.0]
    assert "learning" not in named(plates_of(about, rows)[0])


def test_an_axis_says_what_it_is() -> None:
    """A logarithmic axis says so, and the factor's name stands by its levels."""
    spots = {"": {"1": Spot(10, 9, 12, 9), "0.9": Spot(9000, 8000, 9900, 9)}}
    (axes,) = estimates_figure([Estimates("steps", spots)], "gamma").axes
    assert axes.get_xlabel() == "steps (log scale)"
    assert "gamma" in [text.get_text() for text in axes.texts]
