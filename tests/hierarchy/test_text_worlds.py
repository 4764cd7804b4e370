"""Worlds by name: ours, mazes from files, and those that other packages add."""

import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from hierarchy import check, table_sizes, text_worlds, two_rooms
from hierarchy.check import checked
from hierarchy.hdg import hdg_graph
from hierarchy.taxi import taxi_graph
from hierarchy.text import TextWorld, graph_text, load_graph, load_world, parse_graph, world_names
from worlds import TransitionModel, UserError, Variable
from worlds.generate import generate_layout
from worlds.hdg import LandmarkMaze
from worlds.layout_writing import layout_text
from worlds.taxi import taxi_model

MAZE = "name small\ngrid\n.  T1 | .\n.  .  : D1\nG1 .  | .\nstart 0,0\ntrigger T1\ngoal G1\n"
TEXT = "graph: g\nworld: small.maze\ntasks:\n  Root: {until: robot = trigger, uses: [robot], do: [North]}\n"


def test_every_world_of_ours_agrees_with_its_model() -> None:
    """Variables and actions are the model's, and sets hold values of some variable."""
    assert {"two_rooms", "taxi", "taxi-rainy-fickle", "hdg-slippery"} <= set(world_names())
    for name in world_names():
        world = load_world(name)
        model = world.model()
        assert (model.index.variables, model.actions) == (world.variables, world.actions), name
        for values in world.sets:
            assert any(all(v in variable for v in values.values) for variable in world.variables), values


def test_a_maze_file_is_a_world(tmp_path: Path) -> None:
    """It is looked for beside the text that names it; a world that is given comes first."""
    (tmp_path / "small.maze").write_text(MAZE)
    (tmp_path / "g.yaml").write_text(TEXT)
    graph, world = load_graph(tmp_path / "g.yaml")
    assert world.name == "small.maze"
    assert len(graph.index.variable("robot")) == 9
    assert len(load_graph(tmp_path / "g.yaml", load_world("two_rooms")).graph.index.variable("robot")) == 64
    assert load_world(str(tmp_path / "small.maze")).model().index.size == 18
    with pytest.raises(
        UserError, match=r"line 2, world: .*gone.maze: no layout of this name and no such file"
    ):
        parse_graph(TEXT.replace("small", "gone"))


def test_the_shipped_taxi_is_dietterichs() -> None:
    """taxi.yaml says what taxi_graph declares; it passes the check, and stores 632 values."""
    graph, world = load_graph("taxi")
    model = world.model()
    assert graph.tasks == taxi_graph(model).tasks
    assert list(graph.tasks) == list(taxi_graph(model).tasks)
    assert check(graph, model) == ()
    assert table_sizes(checked(graph, model)).total == 632


def test_the_shipped_hdg_is_kaelblings() -> None:
    """hdg.yaml says what hdg_graph declares for the maze of ten by ten, and passes the check."""
    graph, world = load_graph("hdg")
    assert graph.tasks == hdg_graph(LandmarkMaze()).tasks
    assert check(graph, world.model()) == ()


@pytest.mark.parametrize(
    ("name", "rain", "fickle"),
    [("taxi-rainy", 0.2, 0.0), ("taxi-fickle", 0.0, 0.3), ("taxi-rainy-fickle", 0.2, 0.3)],
)
def test_taxis_weather_and_passenger_have_names(name: str, rain: float, fickle: float) -> None:
    """The model is that of section 7.1; the passenger's mind is a variable where it is fickle."""
    world, model = load_world(name), taxi_model(rain=rain, fickle=fickle)
    assert (world.model().probabilities == model.probabilities).all()
    assert ("mind" in [variable.name for variable in world.variables]) == (fickle > 0)


LAKE = """\
graph: lake
world: gym:FrozenLake-v1,is_slippery=False
tasks:
  Root:
    until: cell in ends
    uses: [cell]
    do: [Left, Down, Right, Up]
"""


def test_a_gymnasium_environment_is_a_world() -> None:
    """Its arguments follow its id; the values that end an episode are a named set."""
    graph, world = parse_graph(LAKE)
    assert check(graph, world.model()) == ()
    assert world.model().is_deterministic
    assert not load_world("gym:FrozenLake-v1").model().is_deterministic
    (ends,) = world.sets
    assert sorted(map(str, ends.values)) == ["1,1", "1,3", "2,3", "3,0", "3,3"]
    assert [str(values) for values in load_world("gym:Taxi-v4").sets] == ["sites"]
    assert load_graph("taxi", load_world("gym:Taxi-v4,is_rainy=True")).graph.root.name == "Root"


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("gym:FrozenLak-v1", "has no environment 'FrozenLak-v1'; did you mean 'FrozenLake-v1'?"),
        ("gym:Taxi-v3", "has no environment 'Taxi-v3'; did you mean 'Taxi-v4'?"),
        ("gym:Zebra-v0", "has no environment 'Zebra-v0'; with a model there are"),
        ("gym:", "cannot be made .*; name another, or install what it needs"),
        ("gym:nowhere_at_all:Env-v0", "No module named 'nowhere_at_all'"),
        ("gym:FrozenLake-v1,slippery", "'slippery' is no argument; write KEY=VALUE"),
        ("gym:FrozenLake-v1,slip=1", "cannot be made .*TypeError.*; mend its arguments"),
        ("gym:CartPole-v1", "CartPoleEnv exposes no model P"),
        ("taxi_rainy", "no world 'taxi_rainy'; did you mean 'taxi-rainy'?"),
        ("zebra", r"no world 'zebra'; name a .maze file, gym:ID, or one of two_rooms, taxi"),
        ("a" * 300 + ".maze", "it cannot be read .File name too long"),
    ],
)
def test_a_world_that_is_not_there_is_told_with_a_mend(name: str, told: str) -> None:
    """Whatever keeps it from being made, it is a user's error in one line."""
    with pytest.raises(UserError, match=told) as caught:
        load_world(name)
    assert "\n" not in str(caught.value)


def test_only_gymnasiums_worlds_load_gymnasium() -> None:
    """Reading a graph and asking for its worlds' names stays light."""
    code = (
        "import sys; from hierarchy.text import load_graph, world_names; world_names(); load_graph('taxi'); "
        "print('gymnasium' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.strip() == "False"


def _no_model() -> TransitionModel:
    raise AssertionError("text needs no model")


def lamp() -> TextWorld:
    """Return a world as another package would."""
    return TextWorld("lamp", (Variable("lamp", ("off", "on")),), ("press",), _no_model)


@pytest.fixture
def _others(monkeypatch: pytest.MonkeyPatch) -> None:
    def others(*, group: str) -> tuple[EntryPoint, ...]:
        return (
            EntryPoint("lamp", f"{__name__}:lamp", group),
            EntryPoint("broken", "nowhere_at_all:world", group),
        )

    monkeypatch.setattr(text_worlds, "entry_points", others)
    monkeypatch.setattr(EntryPoint, "load", lambda point: lamp if point.name == "lamp" else _import(point))


def _import(point: EntryPoint) -> object:
    raise ImportError(f"No module named {point.module!r}")


@pytest.mark.usefixtures("_others")
def test_another_packages_world_has_a_name() -> None:
    """Its entry point is found, and used by a text that names it."""
    assert world_names()[-2:] == ("broken", "lamp")
    text = "graph: light\nworld: lamp\ntasks:\n  Root: {until: lamp = on, uses: [lamp], do: [press]}\n"
    assert str(parse_graph(text).graph.root.until) == "lamp = on"


@pytest.mark.usefixtures("_others")
def test_a_world_that_cannot_be_loaded_says_why() -> None:
    """The entry point is named, with what is missing."""
    with pytest.raises(
        UserError, match=r"world 'broken' \(nowhere_at_all:world\) cannot be loaded: No module"
    ):
        load_world("broken")


def test_the_paper_s_graph_fits_other_mazes(tmp_path: Path) -> None:
    """Its doors are those of the world that it is read for, so that it is sound on a maze of any size."""
    maze = generate_layout(6, 10, seed=2)
    (tmp_path / "drawn.maze").write_text(layout_text(maze))
    graph, world = load_graph("two_rooms", load_world(str(tmp_path / "drawn.maze")))
    assert graph.tasks == two_rooms(maze).tasks
    assert check(graph, world.model()) == ()
    assert "values: [D1, D2]" in graph_text(graph, world)


def test_a_door_that_is_not_there_is_told() -> None:
    """A mark that the world lacks is an unknown value, with those that there are."""
    text = graph_text(*load_graph("two_rooms")).replace("[D1, D2]", "[D1, D3]")
    with pytest.raises(UserError, match=r"unknown value 'D3' of robot; its values: D1, D2, 0,0"):
        parse_graph(text)
