"""What a tabular learner would do in every state, all states at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from planners import HSMQ, Learner, MaxQ, MaxQQ
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.options import NONE, Options

Row = NDArray[np.int64]
Values = NDArray[np.float64]


def greedy_tables(learner: Learner, options: Options) -> GreedyPolicy:
    """Return what a tabular learner would do in every state, as tables over its graph's options.

    Control comes back as far as tasks on top of the stack have ended, and each caller then takes its best
    child, down to a primitive action.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from planners import MaxQ
    >>> from planners.option_critic.options import compile_options
    >>> from worlds import maze_model, parse_layout
    >>> rows = "grid", ". . : D1 G1", "T1 . | . .", "start 0,0", "trigger T1", "goal G1"
    >>> maze = parse_layout(chr(10).join(rows))
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> learner = MaxQ(grounded, seed=(0,))
    >>> start = grounded.model.index.number((maze.start, maze.triggers["T1"], maze.goals["G1"], "closed"))
    >>> _ = learner.train(grounded.root, [start], episodes=300)
    >>> greedy_tables(learner, compile_options(grounded)).returns(np.array([start]))
    array([-5.])
    """
    best = best_children(learner)
    states, count = options.grounded.model.index.size, len(options)
    places = {tuple(edge.child for edge in stack): k for k, stack in enumerate(options.stacks)}
    anew: dict[tuple[int, ...], Row] = {(): _chosen((), options.grounded.root, best, places)}
    option = np.empty((states, count + 1), dtype=np.int64)
    for k, stack in enumerate(options.stacks):
        option[:, k] = k
        for level in reversed(range(len(stack))):  # what ends further down counts more
            below = tuple(edge.child for edge in stack[:level])
            if below not in anew:
                anew[below] = _chosen(below, stack[level].caller, best, places)
            back = options.ended[:, level : len(stack), k].all(axis=1) & (anew[below] != NONE)
            option[:, k] = np.where(back, anew[below], option[:, k])
    option[:, count] = np.maximum(anew[()], 0)  # nothing is chosen where the root has ended
    tops = [stack[-1].child for stack in options.stacks]
    action = np.stack([np.maximum(best.get(top, np.full(states, top)), 0) for top in tops], axis=1)
    return GreedyPolicy(options, option, action)


def best_children(learner: Learner) -> dict[int, Row]:
    """Return the best child of every task in every state, by the task's place, each of shape (states,).

    It is the child that the learner's own `greedy` names, `NONE` where the task has ended or has no child.
    """
    if not isinstance(learner, HSMQ | MaxQ):
        return one_by_one(learner)
    found = {}
    for place, preferences in _preferences(learner):
        node = learner.grounded.nodes[place]
        children = np.array([call.child for call in node.calls])
        runs = ~node.terminal & np.isfinite(preferences).any(axis=0)
        found[place] = np.where(runs, children[_first_best(preferences, learner.tie)], NONE)
    return found


def one_by_one(learner: Learner) -> dict[int, Row]:
    """Return the same as `best_children`, by asking the learner, whatever its kind, state by state."""
    found = {}
    for place, node in enumerate(learner.grounded.nodes):
        if node.calls:
            best = np.full(node.terminal.size, NONE)
            for state in np.flatnonzero(~node.terminal).tolist():
                if learner.choices(place, state):
                    best[state] = node.calls[learner.greedy(place, state)].child
            found[place] = best
    return found


def _first_best(preferences: Values, tie: float) -> Row:
    """Return the first child in order that is within `tie` of the best, shape (states,)."""
    first: Row = (preferences >= preferences.max(axis=0) - tie).argmax(axis=0)
    return first


def _preferences(learner: HSMQ | MaxQ) -> Iterator[tuple[int, Values]]:
    """Yield each task's place and what it compares its children by, shape (children, states).

    It is -inf where a child cannot be called. The sums are those of the learner, in the same order, so that
    they are the same to the last bit.
    """
    if isinstance(learner, HSMQ):
        tasks, index = learner.grounded.graph.tasks, learner.grounded.model.index
        for place, node in enumerate(learner.grounded.nodes):
            if node.calls:
                row = index.project(tasks[node.task].uses)
                yield place, _callable(learner, place, [np.array(t)[row] for t in learner.table[place]])
        return
    inner = learner.inner_completion if isinstance(learner, MaxQQ) else None
    values: dict[int, Values] = {}
    for place, node in enumerate(learner.grounded.nodes):
        if node.leaf is not None:
            values[place] = np.array(learner.reward[place])[node.leaf.projection]
            continue
        q = _q(learner, place, learner.completion[place], values)
        if inner is None:
            values[place] = np.where(node.terminal, 0.0, q.max(axis=0))
            yield place, q
            continue
        preferences = _q(learner, place, inner[place], values)
        # A task that is taught shows callers the child that it takes; another one its very best.
        tie = learner.tie if node.pseudo_reward else 0.0
        chosen = _first_best(preferences, tie)
        values[place] = np.where(node.terminal, 0.0, q[chosen, np.arange(chosen.size)])
        yield place, preferences


def _q(
    learner: MaxQ, place: int, completion: Sequence[Sequence[float]], values: Mapping[int, Values]
) -> Values:
    """Return V(child, state) + C(task, state, child), shape (children, states)."""
    calls = learner.grounded.nodes[place].calls
    rows = [
        values[call.child] + np.array(table)[call.projection]
        for call, table in zip(calls, completion, strict=True)
    ]
    return _callable(learner, place, rows)


def _callable(learner: Learner, place: int, rows: Sequence[Values]) -> Values:
    """Return rows of values, one a child, -inf where the child cannot be called."""
    available = np.stack([call.available for call in learner.grounded.nodes[place].calls])
    return np.where(available, np.stack(rows), -np.inf)


def _chosen(
    below: tuple[int, ...], caller: int, best: Mapping[int, Row], places: Mapping[tuple[int, ...], int]
) -> Row:
    """Return the option that begins in every state when a caller on top of `below` has control."""
    found = np.full(len(best[caller]), NONE)
    for child in np.unique(best[caller][best[caller] != NONE]).tolist():
        stack = (*below, child)
        option = places[stack] if stack in places else _chosen(stack, child, best, places)
        found = np.where(best[caller] == child, option, found)
    return found
