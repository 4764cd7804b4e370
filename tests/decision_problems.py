"""Small stochastic worlds with task graphs on them: random ones, and two worked out by hand."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from hierarchy import Call, GroundGraph, TaskGraph, checked, ground
from worlds import StateIndex, TransitionModel, Variable


@st.composite
def models(
    draw: st.DrawFn, least: int = -3, most: int = 0, sizes: tuple[int, int] = (2, 5)
) -> TransitionModel:
    """Draw a world of two actions with two outcomes each, and rewards from `least` to `most`."""
    states = draw(st.integers(*sizes))
    shape = (states, 2, 2)
    count = states * 4
    cells = draw(st.lists(st.integers(0, states - 1), min_size=count, max_size=count))
    chances = st.sampled_from([0.0, 0.25, 0.5, 1.0])
    first = np.array(draw(st.lists(chances, min_size=count // 2, max_size=count // 2))).reshape(states, 2, 1)
    rewards = draw(st.lists(st.integers(least, most), min_size=count, max_size=count))
    return TransitionModel(
        StateIndex((Variable("x", tuple(range(states))),)),
        ("a", "b"),
        np.array(cells).reshape(shape),
        np.array(rewards, dtype=float).reshape(shape),
        np.ones(states, np.bool_),
        probabilities=np.concatenate([first, 1 - first], axis=2),
    )


@st.composite
def ground_graphs(
    draw: st.DrawFn, least: int = -3, most: int = 0, sizes: tuple[int, int] = (2, 5)
) -> GroundGraph:
    """Draw Root -> Mid, One, Two, a, b; Mid -> One, Two, b; One, Two -> a, b, with any terminations.

    Two may end short of its goal, for a pseudo-reward. A task may have states from which it never ends.
    """
    model = draw(models(least, most, sizes))
    cells = st.integers(0, model.index.size - 1)
    some = st.sets(cells, min_size=1, max_size=2).map(sorted)
    graph = TaskGraph("random", model.index.variables, model.actions)
    (x,) = graph.variables
    one = graph.task("One", until=x.isin(draw(some)), uses=[x], do=draw(st.sampled_from(["a b", "b a", "a"])))
    ends = draw(some)
    pseudo_reward = draw(st.sampled_from([None, -5.0, 2.0]))
    two = graph.task(
        "Two", until=x.isin(ends), uses=[x], do="a b", goal=x.eq(ends[0]), pseudo_reward=pseudo_reward
    )
    mid = graph.task("Mid", until=x.isin(draw(some)), uses=[x], do=[one(), two().when(x.ne(0)), "b"])
    calls = draw(st.permutations([mid(), one().when(x.ne(1)), two(), "a"]))
    graph.task("Root", until=x.isin(draw(some)), uses=[x], do=calls[: draw(st.integers(1, 4))])
    return ground(graph, model)


def two_triggers(left: int, right: int, goal: int) -> GroundGraph:
    """Return a corridor with triggers `left` cells to the left of the start and `right` cells to the right.

    Root -> GotoTrigger (ends at either trigger), GotoGoal -> left, right. A trigger opens the way; the goal
    is `goal` cells to the right of the start, which is at 0.
    """
    places = tuple(range(-left, goal + 1))
    index = StateIndex((Variable("x", places), Variable("way", ("shut", "open"))))
    successors = np.array(
        [
            [
                index.number((to, "open" if to in (-left, right) else way))
                for to in (max(x - 1, -left), min(x + 1, goal))
            ]
            for x, way in index
        ]
    )
    starts = np.array([state == (0, "shut") for state in index])
    model = TransitionModel(index, ("left", "right"), successors, np.full(successors.shape, -1.0), starts)
    graph = TaskGraph("two triggers", index.variables, model.actions)
    x, way = graph.variables
    goto_trigger = graph.task("GotoTrigger", until=way.eq("open"), uses=[x, way], do="left right")
    goto_goal = graph.task("GotoGoal", until=x.eq(goal), uses=[x], do="left right")
    graph.task(
        "Root",
        until=x.eq(goal) & way.eq("open"),
        uses=[x, way],
        do=[goto_trigger(), goto_goal().when(way.eq("open"))],
    )
    return checked(graph, model)


def two_errands() -> GroundGraph:
    """Return a world in which the best thing to do depends on who asks.

    From a and from b every way leads to c; from c left leads to b and right to end. Root -> First (from a
    to b), Second (from b to end) -> go, Out; Out -> left, right takes them from c to b or to the end.
    """
    index = StateIndex((Variable("place", ("a", "b", "c", "end")),))
    _, b, c, end = range(4)
    successors = np.array([[c, c], [c, c], [b, end], [end, end]])
    rewards, starts = np.full(successors.shape, -1.0), np.array([True, False, False, False])
    model = TransitionModel(index, ("left", "right"), successors, rewards, starts)
    graph = TaskGraph("two errands", index.variables, model.actions)
    (at,) = graph.variables
    out = graph.task("Out", until=at.isin(["b", "end"]), within=at.eq("c"), uses=[at], do="left right")
    first = graph.task("First", until=at.eq("b"), uses=[at], do=[out(), Call("left", guard=at.eq("a"))])
    second = graph.task("Second", until=at.eq("end"), uses=[at], do=[out(), Call("left", guard=at.eq("b"))])
    graph.task(
        "Root",
        until=at.eq("end"),
        uses=[at],
        do=[first().when(at.eq("a")), second().when(at.eq("b"))],
    )
    return ground(graph, model)
