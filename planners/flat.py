"""Flat Q-learning, the baseline without a hierarchy (Watkins, 1989)."""

from __future__ import annotations

from collections.abc import Sequence

from hierarchy import GroundGraph, TaskGraph, ground
from planners.hsmq import HSMQ
from planners.learner import Settings


def flattened(grounded: GroundGraph) -> GroundGraph:
    """Return the root alone, above every primitive action, with every state variable relevant to it.

    Its name, termination, goal, pseudo-reward, working space and initiation stay.

    Examples
    --------
    >>> from hierarchy import two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> flat = flattened(ground(two_rooms(maze), maze_model(maze)))
    >>> print(*[node.name for node in flat.nodes])
    North South West East Root
    """
    root = grounded.graph.root
    graph = TaskGraph(f"{grounded.graph.name} flat", grounded.model.index.variables, grounded.model.actions)
    graph.task(
        root.name,
        until=root.until,
        uses=graph.variables,
        do=graph.actions,
        within=root.within,
        start=root.start,
        goal=root.goal,
        pseudo_reward=root.pseudo_reward,
    )
    return ground(graph, grounded.model)


class FlatQ(HSMQ):
    """Q-learning on the world's states and primitive actions, until the root of a graph ends.

    With primitive actions alone, `HSMQ` is Q-learning. The learner's own ground graph is the flattened
    one: its task is ``learner.grounded.root``, which is not the root's place in the graph that was given.

    Parameters
    ----------
    grounded
        The ground graph whose root is to be learnt without the tasks below it.
    seed
        Names the random stream; every integer part counts.
    settings
        Schedules, discount and tie break; those of single tasks can name the root alone.

    Examples
    --------
    >>> from hierarchy import two_rooms
    >>> from worlds import maze_model, parse_layout
    >>> rows = "grid", ". . : D1 G1", "T1 . | . .", "start 0,0", "trigger T1", "goal G1"
    >>> maze = parse_layout(chr(10).join(rows))
    >>> learner = FlatQ(ground(two_rooms(maze), maze_model(maze)), seed=(1,))
    >>> root, model = learner.grounded.root, learner.grounded.model
    >>> start = model.index.number((maze.start, maze.triggers["T1"], maze.goals["G1"], "closed"))
    >>> steps = learner.train(root, [start], episodes=500)
    >>> learner.greedy_steps(root, start), round(learner.value(root, start), 2)
    (5, -5.0)
    """

    def __init__(self, grounded: GroundGraph, seed: Sequence[int], settings: Settings | None = None) -> None:
        super().__init__(flattened(grounded), seed, settings)
