"""Commands on task graphs and the mazes that they are for: check, draw, maze."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def check(graph: str, /, *, world: str | None = None, gamma: float = 1.0) -> int:
    """Check a task graph: print it, what is wrong with it, what it stores, and what is proved safe.

    Exit status 0 says that it may run, 1 that there are findings, 2 that it cannot be read.

    Parameters
    ----------
    graph
        A YAML file, or the name of a graph that comes with the package (two_rooms, taxi, hdg, four_rooms).
    world
        World to check it on: a name (also gym:Taxi-v4 and its like), or a .maze file. Defaults to the one
        that the graph names.
    gamma
        Discount factor that it is to be learnt with; below 1, tables that forget time are findings.
    """
    from comparisons.graph_commands import check_graph

    verdict = check_graph(graph, world, gamma)
    print(verdict.text)
    return 0 if verdict.well else 1


def draw(graph: str, /, *, world: str | None = None, out: Path = Path()) -> int:
    """Draw a task graph: Mermaid (.mmd) and Graphviz (.dot) text, and a picture (.png, .svg).

    Parameters
    ----------
    graph
        A YAML file, or the name of a graph that comes with the package (two_rooms, taxi, hdg, four_rooms).
    world
        World that it is for: a name (also gym:Taxi-v4 and its like), or a .maze file. Defaults to the one
        that the graph names.
    out
        Folder of the files. None of them may exist.
    """
    from comparisons.graph_drawing import draw_graph

    for path in draw_graph(graph, world, out):
        print(path)
    return 0


def maze(
    *,
    rows: int,
    cols: int,
    seed: int = 0,
    out: Path | None = None,
    rooms: Annotated[tuple[int, int], Parameter(negative_iterable=())] = (1, 2),
    doors: int = 2,
    triggers: int = 4,
    goals: int = 4,
    obstacles: int = 6,
) -> int:
    """Draw a maze from a seed: rooms, passages, doors, triggers, goals and obstacles. It can be played.

    Parameters
    ----------
    rows
        Rows of cells.
    cols
        Columns of cells.
    seed
        Names the maze: the same seed and numbers give the same one.
    out
        File to write, such as large.maze; it must not exist. Left out, the maze is printed.
    rooms
        Rows and columns of rooms; the wall with the doors stands in the middle of the columns.
    doors
        Number of doors that the trigger opens.
    triggers
        Number of candidate triggers, all before the doors.
    goals
        Number of candidate goals, all behind the doors.
    obstacles
        Number of cubes and spheres that appear in the example run.
    """
    from comparisons.maze_command import draw_maze

    numbers = {"doors": doors, "triggers": triggers, "goals": goals, "obstacles": obstacles}
    print(draw_maze(out, rows, cols, seed, rooms=rooms, **numbers), end="")
    return 0
