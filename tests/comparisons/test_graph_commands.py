"""`affordant check` and `affordant draw`: what they print and write, and their exit status."""

import os
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from command_line import affordant
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from matplotlib.transforms import Bbox

from comparisons.figures_graph import task_graph_figure
from comparisons.graph_drawing import draw_graph
from hierarchy import TaskGraph, mermaid
from hierarchy.drawing import dot, task_graph_picture
from hierarchy.text import LoadedGraph, load_graph
from worlds import UserError, Variable

WRONG = """\
graph: wrong
world: two_rooms
tasks:
  Root:
    until: robot = goal
    uses: [robot]
    do: [North, South, West, East]
"""


def test_check_tells_a_graph_and_its_counts(capsys: pytest.CaptureFixture[str]) -> None:
    """Tasks with parameters, terminations and guarded children; the paper's counts; the proof; status 0."""
    status, out, err = affordant(capsys, "check", "two_rooms")
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == "task graph two_rooms on world two_rooms: 4 tasks, 4 primitive actions, 2048 states"
    assert "  until  doors = open and robot = goal" in lines
    assert "  params target in {D1, D2}" in lines
    assert "         GotoDoor(target=D2) when doors = open and robot in room A, uses goal" in lines
    assert "findings: none" in lines
    counts = [line.split() for line in lines]
    assert ["values:", "stored", "ever", "read"] in counts
    assert ["completions", "of", "GotoTrigger", "512", "496"] in counts  # read nowhere: at the triggers
    assert ["primitive", "actions", "4", "4"] in counts
    assert ["all", "of", "these", "1308", "1266"] in counts  # the paper's 1284, and 24 of the root
    proved, _, of, *rest = lines[lines.index("state abstraction:") + 1].split()
    assert proved == of
    assert rest[:3] == ["tables", "proved", "safe"]


def test_check_tells_findings(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A graph that cannot run is printed all the same; status 1."""
    (tmp_path / "wrong.yaml").write_text(WRONG)
    status, out, _ = affordant(capsys, "check", str(tmp_path / "wrong.yaml"))
    assert status == 1
    assert "findings: 1\n  Root: until (robot = goal) reads 'goal'" in out
    assert "values:" not in out


def test_check_tells_what_a_task_may_say(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Goal, initiation and pseudo-reward appear where there are any."""
    more = "    goal: doors = open\n    start: doors = closed\n    pseudo_reward: -2.5\n    uses: [robot]"
    (tmp_path / "more.yaml").write_text(WRONG.replace("    uses: [robot]", more))
    _, out, _ = affordant(capsys, "check", str(tmp_path / "more.yaml"), "--world", "two_rooms")
    for line in ("  goal   doors = open", "  start  doors = closed", "  else   pseudo-reward -2.5"):
        assert line in out.splitlines()


@pytest.mark.parametrize(
    ("tokens", "expected"),
    [
        (("check", "two_room"), "no task graph of this name and no such file; did you mean 'two_rooms'?"),
        (("check", "two_rooms", "--world", "txi"), "no world 'txi'; did you mean 'taxi'?"),
        (
            ("check", "two_rooms", "--world", "taxi"),
            "tasks.GotoTrigger.params.target.of: unknown state variable",
        ),
        (
            ("check", "text.yaml"),
            "text.yaml, line 5, tasks.Root.until: column 9 of 'robot = gaol': unknown value",
        ),
        (("draw", "text.yaml"), "did you mean 'goal'?"),
        (("draw", "ring.yaml"), "tasks call each other in a ring, Root -> Root; remove one of its edges"),
        (("draw", "two_rooms", "--out", "text.yaml"), "--out text.yaml: the drawings cannot be written"),
    ],
)
def test_a_users_mistake_is_one_message(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    tokens: tuple[str, ...],
    expected: str,
) -> None:
    """Status 2, no output and no file."""
    monkeypatch.chdir(tmp_path)
    Path("text.yaml").write_text(WRONG.replace("= goal", "= gaol"))
    Path("ring.yaml").write_text(WRONG.replace("East]", "Root]"))
    status, out, err = affordant(capsys, *tokens)
    assert (status, out) == (2, "")
    assert err.startswith("affordant: ")
    assert expected in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ring.yaml", "text.yaml"]


def test_draw_writes_four_files_once(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Mermaid, Graphviz and two pictures; a second time nothing is replaced or added."""
    out_dir = tmp_path / "new" / "folder"
    status, out, _ = affordant(capsys, "draw", "two_rooms", "--out", str(out_dir))
    names = [f"two_rooms.{kind}" for kind in ("mmd", "dot", "png", "svg")]
    assert status == 0
    assert [Path(line).name for line in out.splitlines()] == names
    graph = load_graph("two_rooms").graph
    assert (out_dir / "two_rooms.mmd").read_text(encoding="utf-8") == mermaid(graph)
    assert (out_dir / "two_rooms.dot").read_text(encoding="utf-8") == dot(graph)
    assert (out_dir / "two_rooms.png").read_bytes()[1:4] == b"PNG"
    assert "GotoGoal" not in names
    assert (out_dir / "two_rooms.svg").read_text(encoding="utf-8").startswith("<?xml")
    for name in names[1:]:
        (out_dir / name).unlink()
    status, out, err = affordant(capsys, "draw", "two_rooms", "--out", str(out_dir))
    assert (status, out) == (2, "")
    assert "two_rooms.mmd: it exists already; name another folder" in err
    assert [path.name for path in out_dir.iterdir()] == ["two_rooms.mmd"]


def test_drawings_appear_all_or_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A disk that fails at the third file leaves none, hidden ones included."""
    link = os.link

    def failing(source: Path, target: Path) -> None:
        if target.suffix == ".png":
            raise OSError(28, "No space left on device", str(target))
        link(source, target)

    monkeypatch.setattr("comparisons.graph_drawing.os.link", failing)
    with pytest.raises(UserError, match="No space left on device"):
        draw_graph("two_rooms", None, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_check_with_discounting_finds_funnels(capsys: pytest.CaptureFixture[str]) -> None:
    """Below gamma 1 the paper's root forgets time in three of its calls; at 1 it does not matter."""
    status, out, _ = affordant(capsys, "check", "two_rooms", "--gamma", "0.9")
    assert status == 1
    assert "findings: 3" in out
    assert "Root -> GotoTrigger(target=trigger): with gamma = 0.9" in out
    assert "44 of 50 tables proved safe" in out
    status, _, err = affordant(capsys, "check", "two_rooms", "--gamma", "1.5")
    assert status == 2
    assert "lies above 0 and up to 1" in err


def test_check_tells_taxis_632_values(capsys: pytest.CaptureFixture[str]) -> None:
    """The graph and the world come with the package; Dietterich's counts, and every table proved."""
    status, out, err = affordant(capsys, "check", "taxi")
    assert (status, err) == (0, "")
    counts = [line.split()[:-1] for line in out.splitlines()]  # less those ever read
    for row in ("completions of Navigate 400", "completions of Root 16", "all of these 632", "flat Q 3000"):
        assert row.split() in counts
    assert "28 of 28 tables proved safe for every policy" in out


def test_check_takes_another_world(capsys: pytest.CaptureFixture[str]) -> None:
    """Rain proves less, a fickle passenger refutes, and Gymnasium's Taxi has the same variables."""
    status, out, _ = affordant(capsys, "check", "taxi", "--world", "taxi-fickle")
    assert status == 0
    assert "Put -> Putdown, stored by taxi, destination: refuted" in out
    status, out, _ = affordant(capsys, "check", "taxi", "--world", "gym:Taxi-v4")
    assert status == 0
    assert "task graph taxi on world gym:Taxi-v4: 4 tasks, 6 primitive actions, 600 states" in out


def _hostile() -> TaskGraph:
    labels = ('"', "\\", "<b>&amp;", "#1;", "a\nb", "[{(|)}]", "\x00\x07\x1b", "$x^2$", "-->", "\u732b")
    graph = TaskGraph("hostile", [Variable("x", tuple(range(10)), labels)], ["go"])
    (x,) = graph.variables
    calls = []
    for value, label in enumerate(labels):
        task = graph.task(f"Task {label}", until=x.eq(9 - value), uses=[x], do="go")
        calls.append(task().when(x.eq(value)))
    graph.task("Root", until=x.eq(0) & x.eq(1), uses=[x], do=calls)
    return graph


def test_hostile_labels_are_drawn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """All four files are written, and the SVG is XML, whatever the labels hold; nothing is warned of."""
    graph, world = _hostile(), load_graph("two_rooms").world
    monkeypatch.setattr(
        "comparisons.graph_drawing.load_graph", lambda _name, _world: LoadedGraph(graph, world)
    )
    paths = draw_graph("hostile", None, tmp_path)
    assert [path.suffix for path in paths] == [".mmd", ".dot", ".png", ".svg"]
    assert ET.parse(paths[3]).getroot().tag.endswith("svg")  # noqa: S314 # we wrote it


@pytest.mark.parametrize("name", ["two_rooms", "taxi", "hdg"])
def test_edges_cross_no_box_and_no_label(name: str) -> None:
    """Between its ends, each edge of the picture keeps clear of every box and every label."""
    figure = task_graph_figure(task_graph_picture(load_graph(name).graph))
    axes = figure.axes[0]
    boxes = [patch.get_window_extent() for patch in axes.patches if isinstance(patch, FancyBboxPatch)]
    blocks = boxes + [text.get_window_extent() for text in axes.texts if text.get_text().startswith("when")]
    for i, block in enumerate(blocks):
        assert not any(block.overlaps(other) for other in blocks[i + 1 :])
    arrows = [patch for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
    assert len(arrows) > len(boxes)
    for arrow in arrows:
        points = arrow.get_path().interpolated(20).vertices[:-1]  # in pixels; the head may touch its box
        inner = arrow.get_transform().transform(points)
        for block in blocks:
            inside = Bbox.from_extents(block.x0 + 1, block.y0 + 1, block.x1 - 1, block.y1 - 1)
            assert not any(inside.contains(*point) for point in inner)
