"""Polled (non-hierarchical) execution of a hierarchical value function (Dietterich 2000, section 6).

At every primitive step the decision starts from the root anew, so that a subtask is given up as soon as
another is worth more. Taken from the exact values of a hierarchical policy, this is never worse than that
policy, if all the way through a child its callers run, too, and may call it: a guard that no longer holds,
or a caller that has ended, takes away the choice to go on.
"""

from __future__ import annotations

from planners.task_values import TaskValues


def polled_action(learner: TaskValues, task: int, state: int) -> int:
    """Return the primitive action at the end of the best path down from a task in a state.

    The task must not have ended there.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from planners import MaxQ
    >>> from worlds import ACTIONS, load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> learner = MaxQ(grounded, seed=(1,))
    >>> start = grounded.model.index.number((maze.start, maze.triggers["T4"], maze.goals["G2"], "closed"))
    >>> steps = learner.train(grounded.root, [start], episodes=300)
    >>> ACTIONS[polled_action(learner, grounded.root, start)]
    'South'
    """
    while calls := learner.grounded.nodes[task].calls:
        task = calls[learner.greedy(task, state)].child
    return task


def polled_route(
    learner: TaskValues, task: int, state: int, limit: int = 1000
) -> list[tuple[int, int]] | None:
    """Return the (state, primitive action) pairs of polled execution, or None past `limit` steps."""
    route: list[tuple[int, int]] = []
    terminal = learner.grounded.nodes[task].terminal
    while not terminal[state]:
        if len(route) == limit:
            return None
        action = polled_action(learner, task, state)
        route.append((state, action))
        state = learner.follow(action, state)
    return route


def polled_steps(learner: TaskValues, task: int, state: int, limit: int = 1000) -> int | None:
    """Return the primitive steps of polled execution from a state, or None past `limit`."""
    route = polled_route(learner, task, state, limit)
    return None if route is None else len(route)
