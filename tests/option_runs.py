"""Call and return as a book would have it, one state at a time, to hold options and their masks to."""

from __future__ import annotations

from functools import lru_cache

from graphs import graphs, grids
from hypothesis import strategies as st

from hierarchy import GroundGraph, ground, two_rooms
from hierarchy.hdg import hdg_graph
from hierarchy.taxi import taxi_graph
from worlds import load_layout, maze_model
from worlds.hdg import LandmarkMaze, landmark_model
from worlds.taxi import taxi_model

Path = tuple[int, ...]
"""Places of the nodes called, from the root's child on."""


@lru_cache
def named(name: str) -> GroundGraph:
    """Return a ground graph that comes with the project: two_rooms, taxi, rainy taxi, hdg, slippery hdg."""
    if name == "two_rooms":
        maze = load_layout("two_rooms")
        return ground(two_rooms(maze), maze_model(maze))
    if "taxi" in name:
        model = taxi_model(rain=0.2) if "rainy" in name else taxi_model()
        return ground(taxi_graph(model), model)
    slippery = "slippery" in name
    maze_of_landmarks = LandmarkMaze(side=5)
    model = landmark_model(maze_of_landmarks, slip=0.2 if slippery else 0.0)
    return ground(hdg_graph(maze_of_landmarks, may_leave=slippery), model)


NAMES = ("two_rooms", "taxi", "rainy taxi", "hdg", "slippery hdg")


@st.composite
def sound_graphs(draw: st.DrawFn) -> GroundGraph:
    """Draw a ground graph that passes every check, on a world of chance."""
    grid = draw(grids())
    return ground(draw(graphs(grid)), grid.model)


def chooses_actions(grounded: GroundGraph, place: int) -> bool:
    """Return whether a node other than the root is a task that never calls a task."""
    node = grounded.nodes[place]
    return (
        place != grounded.root
        and bool(node.calls)
        and not any(grounded.nodes[c.child].calls for c in node.calls)
    )


def choices(grounded: GroundGraph, caller: int, state: int) -> set[Path]:
    """Return the ways to go on when control is with a caller: calls down to what acts."""
    found: set[Path] = set()
    for call in grounded.nodes[caller].calls:
        if call.available[state]:
            if not grounded.nodes[call.child].calls or chooses_actions(grounded, call.child):
                found.add((call.child,))
            else:
                found |= {(call.child, *rest) for rest in choices(grounded, call.child, state)}
    return found


def allowed(grounded: GroundGraph, path: Path, state: int) -> set[int]:
    """Return the primitive actions that what stands on top may take."""
    top = grounded.nodes[path[-1]]
    return {call.child for call in top.calls if call.available[state]} if top.calls else {path[-1]}


def left_of(grounded: GroundGraph, path: Path, state: int) -> Path:
    """Return what is left of a stack of calls: whatever ended first takes all that it called with it."""
    for depth, place in enumerate(path):
        node = grounded.nodes[place]
        if not node.calls or node.terminal[state]:
            return path[:depth]
    return path
