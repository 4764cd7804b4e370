"""The paper's task graph with a single GotoDoor, as text."""

from hierarchy import two_rooms
from hierarchy.text import graph_text, load_graph, maze_world
from worlds import load_layout


def test_its_text_is_the_graph_of_the_maze() -> None:
    """But for its name, by which studies tell it from the one whose door is a parameter."""
    layout = load_layout("two_rooms")
    graph, world = load_graph("two_rooms-one_door")
    assert (graph.name, world.name) == ("two_rooms-one_door", "two_rooms")
    graph.name = "two_rooms"
    assert graph_text(graph, world) == graph_text(two_rooms(layout, one_door_task=True), maze_world(layout))
    assert graph_text(graph, world) != graph_text(two_rooms(layout), maze_world(layout))
