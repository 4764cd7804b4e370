"""The task graph of the paper (figures 4 and 7), and the variant that its parameter avoids."""

from __future__ import annotations

from collections.abc import Mapping

from hierarchy.graph import Task, TaskGraph, TaskGraphError
from hierarchy.terms import Param, ValueSet
from worlds import ACTIONS, Cell, Layout, maze_variables


def two_rooms(layout: Layout, *, one_door_task: bool = False) -> TaskGraph:
    """Return Root -> GotoTrigger, GotoDoor, GotoGoal -> North, South, West, East.

    Parameters
    ----------
    layout
        A maze with two rooms: the robot starts in one, the goals are in the other.
    one_door_task
        False binds GotoDoor to each door, as the paper does, so that the root can choose one. True
        gives the single GotoDoor that ends at either door; what it loses is told by the oracle.

    Raises
    ------
    TaskGraphError
        If the layout has no door.

    Examples
    --------
    >>> from worlds import load_layout
    >>> graph = two_rooms(load_layout("two_rooms"))
    >>> for call in graph.root.do:
    ...     print(call, "when", call.guard)
    GotoTrigger(target=trigger) when doors = closed
    GotoDoor(target=D1) when doors = open and robot in room A
    GotoDoor(target=D2) when doors = open and robot in room A
    GotoGoal(target=goal) when robot in room B
    """
    if not layout.thresholds:
        raise TaskGraphError(f"layout {layout.name} has no door; write ':' between two cells and mark one D1")
    graph = TaskGraph(layout.name, maze_variables(layout), ACTIONS)
    robot, trigger, goal, doors = graph.variables
    first = layout.room(layout.start)
    second = frozenset(layout.cells) - layout.solid - first
    room_a, room_b = ValueSet("room A", first), ValueSet("room B", second)
    moves = " ".join(ACTIONS)

    def goto(name: str, marks: Mapping[str, Cell], room: ValueSet) -> Task:
        target = Param.over("target", marks)
        within = robot.isin(room)
        return graph.task(name, target, until=robot.eq(target), within=within, uses=[robot], do=moves)

    goto_trigger = goto("GotoTrigger", layout.triggers, room_a)
    if one_door_task:
        any_door = robot.isin(ValueSet("doors' grids", frozenset(layout.thresholds.values())))
        goto_door = graph.task("GotoDoor", until=any_door, within=robot.isin(room_a), uses=[robot], do=moves)
        to_doors = [goto_door()]
    else:
        goto_door = goto("GotoDoor", layout.thresholds, room_a)
        to_doors = [goto_door(target=cell) for cell in layout.thresholds.values()]
    goto_goal = goto("GotoGoal", layout.goals, room_b)
    through = [door.when(doors.eq("open")).when(robot.isin(room_a)) for door in to_doors]
    if not one_door_task:
        through = [door.using(goal) for door in through]  # it ends at its door, wherever it began
    graph.task(
        "Root",
        until=doors.eq("open") & robot.eq(goal),
        uses=[robot, trigger, goal, doors],
        do=[
            goto_trigger(target=trigger).when(doors.eq("closed")).using(trigger, goal),
            *through,
            goto_goal(target=goal).when(robot.isin(room_b)).using(),  # it ends the root: no completion
        ],
    )
    return graph
