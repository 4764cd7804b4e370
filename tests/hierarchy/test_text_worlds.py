"""Worlds by name: ours, mazes from files, and those that other packages add."""

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from hierarchy import text_worlds
from hierarchy.text import TextWorld, load_graph, load_world, parse_graph, world_names
from worlds import TransitionModel, UserError, Variable

MAZE = "name small\ngrid\n.  T1 | .\n.  .  : D1\nG1 .  | .\nstart 0,0\ntrigger T1\ngoal G1\n"
TEXT = "graph: g\nworld: small.maze\ntasks:\n  Root: {until: robot = trigger, uses: [robot], do: [North]}\n"


def test_every_world_of_ours_agrees_with_its_model() -> None:
    """Variables and actions are the model's, and sets hold values of some variable."""
    assert {"two_rooms", "taxi"} <= set(world_names())
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
