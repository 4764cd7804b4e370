"""Mazes, cells and beliefs that several tests speak of."""

from hierarchy import TaskGraph, ValueSet
from worlds import ACTIONS, Layout, MazeState, load_layout, maze_variables

MAZE = load_layout("two_rooms")


def any_maze_graph(layout: Layout) -> TaskGraph:
    """Return a task that reaches the trigger within the start's room, below a root that may do anything."""
    graph = TaskGraph("any maze", maze_variables(layout), ACTIONS)
    robot, trigger, goal, doors = graph.variables
    room = robot.isin(ValueSet("the room", layout.room(layout.start)))
    moves = " ".join(ACTIONS)
    near = graph.task("Near", until=robot.eq(trigger), within=room, uses=[robot, trigger], do=moves)
    end = doors.eq("open") & robot.eq(goal)
    graph.task("Root", until=end, uses=[robot, trigger, goal, doors], do=[near(), *ACTIONS])
    return graph


def number(text: str) -> int:
    """Return the number of a cell of the two-room maze, written row,column."""
    row, col = text.split(",")
    return int(row) * MAZE.cols + int(col)


def numbers(text: str) -> frozenset[int]:
    """Return the numbers of cells written one after another."""
    return frozenset(number(word) for word in text.split())


def knowing(robot: str, cubes: str = "", spheres: str = "", *, doors_open: bool = False) -> MazeState:
    """Return what a robot on its way to T4 and G2 knows."""
    marks = MAZE.number(MAZE.triggers["T4"]), MAZE.number(MAZE.goals["G2"])
    return MazeState(number(robot), *marks, doors_open, numbers(cubes), numbers(spheres))
