import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import FancyBboxPatch

from comparisons import figures
from comparisons.figures_maze import Drawn, lanes
from comparisons.figures_routes import drawn
from comparisons.style import picture
from worlds import ACTIONS, DELTAS, Cell, MazeState, load_layout

MAZE = load_layout("two_rooms")
TABLES = {
    "GotoTrigger(T4)": [[abs(row - 6) + abs(col - 1) for col in range(4)] for row in range(8)],
    "GotoDoor(D1)": [[abs(row - 2) + 4 - col for col in range(4)] for row in range(8)],
}
OPTIMA = {"a": 6, "b": 7, "c": 4, "d": 4, "e": 12}


def walk(start: Cell, letters: str) -> list[Cell]:
    """Return the cells of a walk given as the actions' first letters."""
    cells = [start]
    for letter in letters:
        dr, dc = DELTAS["NSWE".index(letter)]
        cells.append(Cell(cells[-1].row + dr, cells[-1].col + dc))
    return cells


def texts(axes: Axes) -> list[str]:
    """Return every text drawn on the axes."""
    return [text.get_text() for text in axes.texts]


def line(axes: Axes, gid: str) -> list[tuple[float, float]]:
    """Return the points of the one line of this group id."""
    (found,) = [each for each in axes.lines if each.get_gid() == gid]
    return [(float(x), float(y)) for x, y in np.asarray(found.get_xydata())]


def task_graph() -> nx.DiGraph:
    """Return the paper's task graph, with guards of two lines."""
    graph = nx.DiGraph()
    graph.add_node("Root", label="Root", kind="root")
    guards = [
        "doors = closed",
        *["doors = open and\nrobot in room A"] * 2,
        "doors = open and\nrobot in room B",
    ]
    for task, guard in zip(("T", "D1", "D2", "G"), guards, strict=True):
        graph.add_node(task, label=f"Goto\nt = {task}", kind="task")
        graph.add_edge("Root", task, label=guard)
        for action in ACTIONS:
            graph.add_node(action, label=action, kind="action")
            graph.add_edge(task, action)
    return graph


def trajectories() -> Figure:
    """Return figure 15 with made-up routes."""
    without, around = walk(Cell(1, 0), "SSSSSE"), walk(Cell(1, 0), "SSSESS")
    obstacles = [drawn(obstacle) for obstacle in MAZE.obstacles]
    return figures.trajectories_figure(MAZE, without, around, obstacles, [(Cell(3, 0), Cell(7, 0))])


def counterexample() -> Figure:
    """Return a made-up counter-example: the local rule stays in a pocket."""
    state = MazeState(robot=17, trigger=49, goal=31, cubes=frozenset({25, 32}), spheres=frozenset({43}))
    local, best = walk(Cell(2, 1), "WSN"), walk(Cell(2, 1), "EESSSSWW")[:9]
    return figures.counterexample_figure(
        MAZE, state, [Cell(6, 1)], local, best, texts=("in a pocket", "round it")
    )


def detections() -> Figure:
    """Return figure 11 with eight made-up frames."""
    frames = np.arange(8 * 6 * 6 * 3, dtype=np.uint8).reshape(8, 6, 6, 3)
    return figures.detections_figure([(f"item {i}", frame, 255 - frame) for i, frame in enumerate(frames)])


DRAWINGS: dict[str, Callable[[], Figure]] = {
    "layout": lambda: figures.layout_figure(MAZE),
    "convergence": lambda: figures.convergence_figure(
        {name: {"training": figures.band([[30, 9, best]])} for name, best in OPTIMA.items()}, OPTIMA
    ),
    "step_tables": lambda: figures.step_tables_figure(TABLES, {"GotoDoor(D1)": Cell(2, 4)}),
    "trajectories": trajectories,
    "confusion": lambda: figures.confusion_figure(
        [[9, 1, 0], [0, 10, 0], [1, 1, 8]], ["none", "cube", "sphere"]
    ),
    "push": lambda: figures.push_figure({"cube": {"rolls": 0, "slides": 5}, "sphere": {"rolls": 6}}),
    "detections": detections,
    "counterexample": counterexample,
    "task_graph": lambda: figures.task_graph_figure(task_graph()),
    "value_counts": lambda: figures.value_counts_figure([("flat Q", 4096), ("leaves", 4)]),
}


@pytest.mark.parametrize("name", DRAWINGS)
def test_the_same_data_gives_the_same_files(name: str, tmp_path: Path) -> None:
    """Two drawings of the same data, and two files of one figure, are equal byte by byte."""
    first, second = DRAWINGS[name](), DRAWINGS[name]()
    kept = [path.read_bytes() for path in figures.save_figure(first, tmp_path, name)]
    assert [path.read_bytes() for path in figures.save_figure(second, tmp_path, name)] == kept
    assert [path.read_bytes() for path in figures.save_figure(first, tmp_path, name)] == kept


def test_every_figure_is_drawn_here() -> None:
    """A new figure function joins the test of equal bytes."""
    assert {f"{name}_figure" for name in DRAWINGS} == set(figures.__all__) - {"band", "save_figure"}


def test_another_process_and_other_settings_give_the_same_svg() -> None:
    """Neither the process nor the user's own matplotlib settings change a figure."""
    code = (
        "from comparisons.figures import value_counts_figure as draw; from comparisons.style import picture;"
        "print(picture(draw([('flat Q', 4096), ('leaves', 4)])).svg, end='')"
    )
    other = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)  # noqa: S603
    with rc_context({"font.size": 20, "svg.fonttype": "none", "axes.facecolor": "red"}):
        assert picture(DRAWINGS["value_counts"]()).svg == other.stdout


def test_saving_writes_a_png_of_200_dots_an_inch_and_an_svg_without_a_date(tmp_path: Path) -> None:
    """The PNG has the figure's size at 200 dots an inch, and the SVG carries no date or version."""
    figure = DRAWINGS["push"]()
    png, svg = figures.save_figure(figure, tmp_path, "push")
    assert (png.name, svg.name) == ("push.png", "push.svg")
    height, width, _ = imread(png).shape
    inches = figure.get_size_inches()
    assert (width, height) == (int(200 * inches[0]), int(200 * inches[1]))
    assert "<metadata" not in svg.read_text()


def test_the_layout_tells_chosen_marks_from_fixed_ones() -> None:
    """T4, G2, D1 and D2 are bold, the chosen marks and the start italic, and every obstacle is named."""
    axes = figures.layout_figure(MAZE).axes[0]
    looks = {text.get_text(): text.get_fontstyle() for text in axes.texts}
    bold = {text.get_text() for text in axes.texts if text.get_fontweight() == "bold"}
    assert {name for name, style in looks.items() if style == "italic"} == {
        "T1",
        "T2",
        "T3",
        "G1",
        "G3",
        "G4",
        "start",
    }
    assert bold == {"T4", "G2", "D1", "D2", "C1", "C2", "C3", "S1", "S2", "S3"}


def test_marks_stand_in_their_cells() -> None:
    """A mark's text is where its cell is, the row running down."""
    axes = figures.layout_figure(MAZE).axes[0]
    places = {text.get_text(): text.get_position() for text in axes.texts}
    assert places["T4"] == (1, 6)
    assert places["G2"] == (7, 3)
    assert axes.yaxis_inverted()


def test_convergence_draws_every_band_and_optimum() -> None:
    """Five panels hold medians and quartiles of training and greedy steps, and a line at the optimum."""
    runs = [[40.0, 9.0, 8.0, 7.0], [44.0, 9.0, 9.0, 8.0], [50.0, 9.5, 9.0, 9.0]]
    curves = {
        name: {"training": figures.band(runs), "greedy": figures.band([[9.0, best], [np.inf, best]])}
        for name, best in OPTIMA.items()
    }
    figure = figures.convergence_figure(curves, OPTIMA)
    panels = [axes for axes in figure.axes if axes.lines]
    assert [axes.get_title(loc="left") for axes in panels] == ["(a) a", "(b) b", "(c) c", "(d) d", "(e) e"]
    for axes, best in zip(panels, OPTIMA.values(), strict=True):
        assert line(axes, "training") == [(1, 44), (2, 9), (3, 9), (4, 8)]
        assert line(axes, "greedy") == [(2, 9), (4, best)]
        assert {y for _, y in line(axes, "optimum")} == {best}
        assert axes.get_ylim() == (0, max(10, best + 2))
        (shade,) = (patch for patch in axes.collections if patch.get_gid() == "training-band")
        heights = {tuple(point) for point in shade.get_paths()[0].vertices.tolist()}
        assert {(1, 40), (1, 50), (4, 7), (4, 9)} <= heights


def test_training_may_stand_alone() -> None:
    """Bands of training alone are drawn, and six panels keep their legend."""
    training = figures.band([[5, 4]])
    figure = figures.convergence_figure({str(i): {"training": training} for i in range(6)}, {})
    assert line(figure.axes[0], "training") == [(1, 5), (2, 4)]
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == ["training episodes: median", "training episodes: interquartile range"]


@given(st.lists(st.lists(st.integers(1, 30), min_size=3, max_size=3), min_size=1, max_size=9))
def test_bands_are_quartiles_that_occurred(runs: list[list[int]]) -> None:
    """Every quartile is some run's steps; a quarter, half and three quarters of the runs reach it."""
    quartiles = figures.band(runs)
    for episode, (low, middle, high) in enumerate(quartiles.T):
        steps = [run[episode] for run in runs]
        for share, value in ((0.25, low), (0.5, middle), (0.75, high)):
            assert value in steps
            assert sum(step <= value for step in steps) >= share * len(steps)
            assert sum(step < value for step in steps) < share * len(steps) or share == 0


def test_step_tables_hold_their_numbers_and_the_subgoal_in_red() -> None:
    """Each number stands in its grid; only zeros are red; a door's grid stands beside its table."""
    figure = figures.step_tables_figure(TABLES, {"GotoDoor(D1)": Cell(2, 4)})
    for axes, table in zip(figure.axes, TABLES.values(), strict=True):
        numbers = {text.get_position(): text.get_text() for text in axes.texts}
        assert all(numbers[col, row] == str(table[row][col]) for row in range(8) for col in range(4))
        red = {text.get_text() for text in axes.texts if text.get_color() != "#1F2933"}
        assert red == {"0"}
    assert [text.get_position() for text in figure.axes[1].texts if text.get_text() == "0"] == [(4, 2)]


def test_a_step_table_may_start_elsewhere_and_have_unreachable_grids() -> None:
    """A table is placed at its origin in the maze, and a negative count is a dash."""
    axes = figures.step_tables_figure({"x": [[-1, 2]]}, origins={"x": Cell(3, 4)}).axes[0]
    assert {text.get_position(): text.get_text() for text in axes.texts} == {
        (4, 3): "\N{EN DASH}",
        (5, 3): "2",
    }


def test_trajectories_draw_both_routes_and_the_roll() -> None:
    """The lines pass through the centres of the routes' cells; the roll runs to where it ended."""
    plain, around = trajectories().axes
    assert line(plain, "route") == [(0, 1), (0, 2), (0, 3), (0, 4), (0, 5), (0, 6), (1, 6)]
    assert line(around, "route") == [(0, 1), (0, 2), (0, 3), (0, 4), (1, 4), (1, 5), (1, 6)]
    assert line(around, "roll") == [(0, 3), (0, 7)]
    assert {"S1", "S2", "S3", "C1", "C2", "C3"} <= set(texts(around))
    assert not {"S1", "C1"} & set(texts(plain))


def test_a_sphere_pushed_twice_keeps_its_colour() -> None:
    """The second roll of a sphere, from where the first ended, has the sphere's colour."""
    sphere: Drawn = ("S1", "sphere", Cell(3, 0), "#112233", "small")
    rolls = [(Cell(3, 0), Cell(5, 0)), (Cell(5, 0), Cell(5, 3))]
    route = [Cell(1, 0), Cell(2, 0)]
    around = figures.trajectories_figure(MAZE, route, route, [sphere], rolls).axes[1]
    assert [each.get_color() for each in around.lines if each.get_gid() == "roll"] == ["#112233"] * 2


def test_a_counterexample_crosses_out_the_route_that_fails() -> None:
    """Only the route that does not end in a subgoal gets a cross, at its end, and says so."""
    figure = counterexample()
    local, best = figure.axes
    assert len(line(local, "stuck")) == 1
    assert not [each for each in best.lines if each.get_gid() == "stuck"]
    assert local.get_title(loc="left") == "(a) the paper's local rule: not there after 3 steps"
    assert best.get_title(loc="left") == "(b) an optimal strategy: 8 steps"
    assert [local.get_xlabel(), best.get_xlabel()] == ["in a pocket", "round it"]
    cubes = [patch for patch in local.patches if isinstance(patch, FancyBboxPatch)]
    assert sorted(
        (round(p.get_x() + p.get_width() / 2), round(p.get_y() + p.get_height() / 2)) for p in cubes
    ) == [
        (0, 4),
        (1, 3),
    ]


def test_a_route_taken_back_is_seen_beside_itself() -> None:
    """The way out and the way back along one edge keep apart, each to its right."""
    points, heads = lanes([Cell(0, 0), Cell(0, 1), Cell(0, 0)])
    assert points.tolist() == [[0, 0.11], [1, 0.11], [1, -0.11], [0, -0.11]]
    assert heads == {(1, 0): [(0.5, 0.11)], (-1, 0): [(0.5, -0.11)]}


@given(st.text("NSWE", max_size=30))
def test_a_routes_line_stays_near_its_cells(letters: str) -> None:
    """Every step has one arrowhead, near its middle, and the line visits every cell in order."""
    route = walk(Cell(40, 40), letters)
    points, heads = lanes(route)
    assert sum(map(len, heads.values())) == len(letters)
    middles = {((a.col + b.col) / 2, (a.row + b.row) / 2) for a, b in pairwise(route)}
    near = [(x, y) for at in heads.values() for x, y in at]
    assert {(round(2 * x) / 2, round(2 * y) / 2) for x, y in near} == middles
    passed = [Cell(round(y), round(x)) for x, y in points]
    assert [cell for i, cell in enumerate(passed) if i == 0 or cell != passed[i - 1]] == route


def test_the_confusion_matrix_shows_counts_and_shares_of_rows() -> None:
    """Each field holds its count and the share of its row; an empty class gives no share."""
    axes = figures.confusion_figure([[9, 1], [0, 0]], ["cube", "sphere"]).axes[0]
    assert texts(axes) == ["9\n90.0 %", "1\n10.0 %", "0\n0.0 %", "0\n0.0 %"]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["cube\n(10)", "sphere\n(0)"]


def test_push_bars_have_one_order_and_scale() -> None:
    """Every kind shows every behaviour in the same order, a missing one as 0, on one scale."""
    figure = figures.push_figure({"cube": {"rolls": 0, "slides": 5}, "sphere": {"rolls": 6}})
    assert [texts(axes) for axes in figure.axes] == [["0", "5"], ["6", "0"]]
    assert len({axes.get_xlim() for axes in figure.axes}) == 1


def test_detections_show_each_frame_above_what_was_found() -> None:
    """Eight items take two bands of at most six columns, each frame over its drawn frame."""
    figure = detections()
    assert len(figure.axes) == 16
    shown = [np.asarray(axes.images[0].get_array()) for axes in figure.axes]
    assert all((frame == 255 - found).all() for frame, found in zip(shown[::2], shown[1::2], strict=True))
    above, below = (axes.get_position() for axes in figure.axes[:2])
    assert above.x0 == pytest.approx(below.x0)
    assert above.y0 > below.y1


@pytest.mark.parametrize("taxi", [False, True])
def test_nothing_in_a_task_graph_overlaps(*, taxi: bool) -> None:
    """No label overlaps another, every label of a node fits its box, and all is inside the figure."""
    graph = task_graph()
    if taxi:
        graph = nx.DiGraph()
        kinds = {"Root": "root", "Get": "task", "Put": "task", "Navigate(t)": "task"}
        for name in (*kinds, "Pickup", "Putdown", *ACTIONS):
            graph.add_node(name, label=name, kind=kinds.get(name, "action"))
        edges = ["Root Get", "Root Put", "Get Pickup", "Get Navigate(t)", "Put Navigate(t)", "Put Putdown"]
        graph.add_edges_from((edge.split() for edge in edges), label="a guard of some length\nand two lines")
        graph.add_edges_from(("Navigate(t)", action) for action in ACTIONS)
    figure = figures.task_graph_figure(graph)
    axes = figure.axes[0]
    extents = [text.get_window_extent() for text in axes.texts]
    assert len(extents) == len(graph) + sum("label" in data for _, _, data in graph.edges(data=True))
    for i, extent in enumerate(extents):
        assert not any(extent.overlaps(other) for other in extents[i + 1 :])
        assert figure.bbox.fully_containsx(extent.x0)
        assert figure.bbox.fully_containsx(extent.x1)
    boxes = [patch.get_window_extent() for patch in axes.patches if isinstance(patch, FancyBboxPatch)]
    for box, extent in zip(boxes, extents, strict=False):
        assert box.x0 < extent.x0 < extent.x1 < box.x1
        assert box.y0 < extent.y0 < extent.y1 < box.y1
    heights = {text.get_text(): text.get_position()[1] for text in axes.texts}
    assert heights["Root"] == max(heights.values())
    assert len({heights[action] for action in ACTIONS}) == 1
    assert heights["North"] == min(heights.values())


def test_a_cyclic_graph_is_refused() -> None:
    """A graph with a cycle has no layers."""
    graph = nx.DiGraph([("a", "b"), ("b", "a")])
    with pytest.raises(ValueError, match="no cycle"):
        figures.task_graph_figure(graph)


def test_nothing_to_draw_is_refused() -> None:
    """A figure of no panels says that it needs data."""
    for draw in (figures.detections_figure, figures.push_figure, figures.step_tables_figure):
        with pytest.raises(ValueError, match="nothing to draw"):
            draw({})


def test_value_counts_are_bars_from_zero() -> None:
    """Each bar is as long as its count and carries it as a number."""
    axes = figures.value_counts_figure([("flat Q", 4096), ("leaves", 4)]).axes[0]
    assert [patch.get_width() for patch in axes.patches] == [4096, 4]
    assert texts(axes) == ["4096", "4"]
    assert axes.get_xlim()[0] == 0
