"""Files that a study names: read with it, checked with it, and part of its runs."""

import os
from pathlib import Path

import pytest
from study_texts import TEXT, fake_kind

from comparisons.study.declaring.declaration import StudyError, load_study, parse_study
from comparisons.study.running.work import Ran, work
from worlds import UserError, load_layout
from worlds.layout_writing import layout_text

fake = pytest.fixture(autouse=True, scope="module")(fake_kind)


def test_texts_of_files_travel_with_the_study(tmp_path: Path) -> None:
    """They are read beside the study's file, once, and what was read gives the same study elsewhere."""
    (tmp_path / "worlds").mkdir()
    (tmp_path / "worlds" / "mine.maze").write_bytes("#é\r\n".encode())
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT.replace("steps: 20", "world: worlds/mine.maze"), encoding="utf-8-sig")
    study = load_study(path)
    assert study.files == {"worlds/mine.maze": "#é\r\n"}
    assert all(each.spec.files == study.files for each in study.expand())
    assert parse_study(study.text, str(path), study.files) == study
    other = parse_study(study.text, files={"worlds/mine.maze": "other", "unused": "x"})
    assert list(other.files) == ["worlds/mine.maze"]
    assert {each.spec.hash for each in other.expand()}.isdisjoint(each.spec.hash for each in study.expand())


def test_a_file_that_is_not_there_is_told_at_its_setting(tmp_path: Path) -> None:
    """With the path that was looked for."""
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT.replace("{learner: plain}", "{learner: plain, world: mine.maze}"), encoding="utf-8")
    with pytest.raises(StudyError) as caught:
        load_study(path)
    expected = f"{path}, line 9, vary.learner.plain.world: {tmp_path}{os.sep}mine.maze: there is no such file"
    assert str(caught.value).startswith(expected)


def test_a_study_that_is_not_there_is_told(tmp_path: Path) -> None:
    """A missing file, a folder, and one that is no text."""
    with pytest.raises(UserError, match="there is no such file; check the path"):
        load_study(tmp_path / "none.yaml")
    with pytest.raises(UserError, match="this is a folder"):
        load_study(tmp_path)
    (tmp_path / "bin.yaml").write_bytes(b"study: \xff")
    with pytest.raises(UserError, match="cannot be read as UTF-8 text"):
        load_study(tmp_path / "bin.yaml")


# A task graph and a maze of the user's own

GRAPH = """\
graph: mine
world: house.maze
tasks:
  Home:
    until: robot = goal
    uses: [robot, goal]
    do: [North, South, West, East]
"""
MAZE = """\
name house
grid
.  T1  .  G1
start 0,0
trigger T1
goal G1
"""
LEARN = """\
study: mine
question: How soon is the way home learnt?
kind: learn
seeds: 5
settings: {graph: graphs/mine.yaml}
vary: {gamma: [1, 0.9]}
"""


def study_file(folder: Path, study: str = LEARN, graph: str = GRAPH, maze: str = MAZE) -> Path:
    """Write a study, a task graph in a folder beside it, and a maze beside that; return the study's path."""
    (folder / "graphs").mkdir()
    (folder / "graphs" / "mine.yaml").write_text(graph, encoding="utf-8")
    (folder / "graphs" / "house.maze").write_text(maze, encoding="utf-8")
    (folder / "study.yaml").write_text(study, encoding="utf-8")
    return folder / "study.yaml"


def test_a_maze_that_a_graph_names_is_part_of_each_run(tmp_path: Path) -> None:
    """It is the runs' world, its text goes with them, and they can be done where there is no such file."""
    study = load_study(study_file(tmp_path))
    assert study.files == {"graphs/mine.yaml": GRAPH, "graphs/house.maze": MAZE}
    assert parse_study(study.text, "study.yaml", study.files).combinations == study.combinations
    planned = study.expand()[0]
    assert planned.spec.settings["world"] == "graphs/house.maze"
    outcome = work(planned.spec, "local").outcome
    assert isinstance(outcome, Ran)
    assert outcome.result.measures["share_optimal"] == 1
    named = LEARN.replace("mine.yaml}", "mine.yaml, world: graphs/house.maze}")
    assert parse_study(named, "study.yaml", study.files).combinations == study.combinations


def test_a_world_that_a_study_gives_comes_before_the_graph_s(tmp_path: Path) -> None:
    """The graph's own maze is not even looked for."""
    study = LEARN.replace("mine.yaml}", "mine.yaml, world: two_rooms}")
    path = study_file(tmp_path, study, GRAPH.replace("house", "nowhere"))
    assert list(load_study(path).files) == ["graphs/mine.yaml"]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("house.maze", "hut.maze", "graph: graphs/mine.yaml names the world hut.maze: "),
        ("house.maze", "../../hut.maze", "../../hut.maze: the file ../hut.maze may lie elsewhere on another"),
        ("robot = goal", "robot = gaol", "graph: graphs/mine.yaml, line 5, tasks.Home.until: column 9 of "),
        ("until", "untl", "graph: graphs/mine.yaml, line 4, tasks.Home: 'until' is missing; add until: ..."),
        ("graph: mine", "graph: [", "graph: graphs/mine.yaml, line 3: this is no YAML at column 6"),
        ("[North, South, West, East]", "[North]", "graph: task graph mine cannot run:"),
        (
            ".  T1",
            ".  T",
            "graph: graphs/mine.yaml names the world house.maze: graphs/house.maze, line 5: miss",
        ),
    ],
)
def test_a_mistake_in_a_file_is_told_before_anything_is_run(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    """At the setting that names the file, by the name that the study gives it."""
    graph, maze = GRAPH.replace(old, new), MAZE.replace(old, new)
    with pytest.raises(StudyError) as caught:
        load_study(study_file(tmp_path, graph=graph, maze=maze))
    (fault,) = caught.value.faults
    assert fault.line == 5
    assert expected in f"{fault.path.removeprefix('settings.')}: {fault.problem}; {fault.mend}"


EPISODES = """\
study: mine
question: Is there room?
kind: episodes
seeds: 5
settings: {layout: graphs/house.maze}
vary: {obstacles: [1, 20]}
"""


def test_obstacles_without_room_in_a_layout_of_one_s_own_are_told(tmp_path: Path) -> None:
    """At the level that has too many; and a layout without two rooms, at its setting."""
    path = study_file(tmp_path, EPISODES)
    with pytest.raises(StudyError, match=r"line 5, settings\.layout: layout house has no door"):
        load_study(path)
    maze = tmp_path / "graphs" / "house.maze"
    maze.write_text("name house\ngrid\n. . T1 : D1 . G1\nstart 0,0\ntrigger T1\ngoal G1\n", encoding="utf-8")
    with pytest.raises(StudyError, match=r"line 6, vary.obstacles\[1\]: layout house has room for 3 besides"):
        load_study(path)
    maze.write_text(layout_text(load_layout("two_rooms")), encoding="utf-8")
    assert load_study(path).runs == 10


def test_a_study_may_name_the_figures_there_are(tmp_path: Path) -> None:
    """Another one is told by its line; who only runs studies lets any pass."""
    path = study_file(tmp_path, f"{LEARN}figures: [heat, hete]\n")
    with pytest.raises(StudyError, match=r"line 7, figures\[1\]: there is no figure 'hete'; did you mean"):
        load_study(path, ["heat"])
    assert load_study(path).figures == ("heat", "hete")
