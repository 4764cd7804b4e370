"""The task graph of the four rooms: the hallway options of Sutton, Precup and Singh (1999, section 2)."""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from operator import or_

from hierarchy.graph import Task, TaskGraph
from hierarchy.predicates import Predicate
from hierarchy.terms import Param, ValueSet
from worlds import ACTIONS
from worlds.four_rooms import AREAS, DOORS, HALLWAYS, four_rooms_variables

# Worse than the ways through a room; but where moves slip, the more it is feared, the longer are the detours.
_ELSEWHERE = -20.0


def four_rooms_graph() -> TaskGraph:
    """Return Root -> LeaveNW, LeaveNE, LeaveSW, LeaveSE (each by a hallway), GotoGoal -> moves.

    Leave goes from anywhere in a room, its other hallway included, to one of its two hallways: the eight
    published options. It ends there, and where a slip carries the robot out of the room; to be carried out by
    the hallway it was to take is well, by the other one it is not. GotoGoal goes to the goal while goal and
    robot are in one room, hallways included. Only the root and GotoGoal know of the goal, so that moving it
    leaves the way to every hallway as it was learnt.

    Examples
    --------
    >>> from hierarchy import check
    >>> from worlds.four_rooms import four_rooms_model
    >>> graph = four_rooms_graph()
    >>> for call in graph.root.do[:3]:
    ...     print(call, "when", call.guard)
    LeaveNW(hallway=north) when robot in area NW
    LeaveNW(hallway=west) when robot in area NW
    LeaveNE(hallway=north) when robot in area NE
    >>> check(graph, four_rooms_model())
    ()
    """
    graph = TaskGraph("four_rooms", four_rooms_variables(), ACTIONS)
    robot, goal = graph.variables
    areas = {room: ValueSet(f"area {room}", cells) for room, cells in AREAS.items()}
    moves = " ".join(ACTIONS)

    def leave(room: str) -> Task:
        hallway = Param.over("hallway", {name: HALLWAYS[name] for name in DOORS[room]})
        # A room and the one beyond share a hallway.
        beyond = {name: next(to for to in DOORS if to != room and name in DOORS[to]) for name in DOORS[room]}
        return graph.task(
            f"Leave{room}",
            hallway,
            until=robot.eq(hallway) | ~robot.isin(areas[room]),
            goal=_any(hallway.eq(HALLWAYS[name]) & robot.isin(areas[to]) for name, to in beyond.items()),
            pseudo_reward=_ELSEWHERE,
            uses=[robot],
            do=moves,
        )

    leaves = {room: leave(room) for room in DOORS}
    together = _any(robot.isin(area) & goal.isin(area) for area in areas.values())
    goto_goal = graph.task(
        "GotoGoal",
        until=robot.eq(goal) | ~together,
        goal=robot.eq(goal),
        pseudo_reward=_ELSEWHERE,
        uses=[robot, goal],
        do=moves,
    )
    graph.task(
        "Root",
        until=robot.eq(goal),
        uses=[robot, goal],
        do=[
            *(
                leaves[room](hallway=HALLWAYS[name]).when(robot.isin(areas[room]))
                for room, names in DOORS.items()
                for name in names
            ),
            goto_goal().when(together),
        ],
    )
    return graph


def _any(parts: Iterable[Predicate]) -> Predicate:
    return reduce(or_, parts)
