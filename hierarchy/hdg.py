"""The task graph of Kaelbling's landmark maze, after Dietterich (2000, section 7.2)."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from functools import reduce
from operator import or_

from hierarchy.graph import Call, Task, TaskGraph
from hierarchy.predicates import Predicate
from hierarchy.terms import Param, ValueSet, Var
from worlds import ACTIONS
from worlds.hdg import LandmarkMaze, landmark_variables


def hdg_graph(maze: LandmarkMaze, *, may_leave: bool = False) -> TaskGraph:
    """Return Root -> GotoGoalLmk(landmark), GotoGoal; GotoGoalLmk -> GotoLmk(landmark); both -> moves.

    GotoGoalLmk goes to the landmark of the goal's region, from landmark to landmark; GotoGoal goes to the
    goal inside its region. GotoLmk(landmark) works in the landmark's region and those beside it.

    What GotoGoalLmk stores of a completion after GotoLmk is one value for each pair of landmarks: where
    GotoLmk lands is dropped. That is right as long as it always lands at its landmark. docs/hdg.md has the
    published counts beside these, and every difference.

    Parameters
    ----------
    maze
        The maze.
    may_leave
        False: GotoLmk and GotoGoal cannot leave their working spaces; a move that might is not available.
        True, as published: they end where they leave, as with moves that slip they must; ending so is no
        goal of theirs.

    Examples
    --------
    >>> from hierarchy import check
    >>> from worlds.hdg import landmark_model
    >>> maze = LandmarkMaze(side=5)
    >>> graph = hdg_graph(maze)
    >>> print(graph.tasks["GotoGoalLmk"].do[0], "when", graph.tasks["GotoGoalLmk"].do[0].guard)
    GotoLmk(landmark=L1) when robot in around L1
    >>> check(graph, landmark_model(maze))
    ()
    >>> check(hdg_graph(maze, may_leave=True), landmark_model(maze, slip=0.2))
    ()
    """
    graph = TaskGraph("hdg", landmark_variables(maze), ACTIONS)
    robot, goal = graph.variables
    landmark = Param.over("landmark", maze.landmarks)
    regions = {name: ValueSet(f"region {name}", cells) for name, cells in maze.regions.items()}
    around = {name: ValueSet(f"around {name}", cells) for name, cells in maze.around.items()}
    near = _any(landmark.eq(maze.landmarks[name]) & robot.isin(area) for name, area in around.items())
    together = _any(robot.isin(region) & goal.isin(region) for region in regions.values())

    def goto(
        name: str, params: tuple[Param, ...], there: Predicate, space: Predicate, uses: list[Var]
    ) -> Task:
        moves = " ".join(ACTIONS)
        if not may_leave:
            return graph.task(name, *params, until=there, within=space, uses=uses, do=moves)
        quitting = -20.0 * maze.side  # worse than any way there
        return graph.task(
            name, *params, until=there | ~space, goal=there, pseudo_reward=quitting, uses=uses, do=moves
        )

    goto_lmk = goto("GotoLmk", (landmark,), robot.eq(landmark), near, [robot])
    goto_goal = goto("GotoGoal", (), robot.eq(goal), together, [robot, goal])
    goto_goal_lmk = graph.task(
        "GotoGoalLmk",
        landmark,
        until=robot.eq(landmark),
        uses=[robot],
        do=[
            goto_lmk(landmark=cell).when(robot.isin(around[name])).using()
            for name, cell in maze.landmarks.items()
        ],
    )
    graph.task(
        "Root",
        until=robot.eq(goal),
        uses=[robot, goal],
        do=[
            goto_goal().when(together) if may_leave else goto_goal().when(together).using(),
            *(_to_region(goto_goal_lmk, cell, goal, regions[name]) for name, cell in maze.landmarks.items()),
        ],
    )
    return graph


def _to_region(task: Task, cell: Hashable, goal: Var, region: ValueSet) -> Call:
    """Return the call that goes to the landmark of the goal's region; it always lands there."""
    return task(landmark=cell).when(goal.isin(region)).using(goal)


def _any(parts: Iterable[Predicate]) -> Predicate:
    return reduce(or_, parts)
