"""Small worlds and graphs that learners are held to, and an exact solver that shares no code with them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundGraph, TaskGraph, ground
from worlds import StateIndex, TransitionModel, Variable

Array = NDArray[np.float64]


def corridor(cells: int, actions: str = "left right", *, slip: float = 0.0) -> TransitionModel:
    """Return a corridor; with chance `slip` a step goes the other way, and then it costs 2 instead of 1."""
    index, x = StateIndex((Variable("x", tuple(range(cells))),)), np.arange(cells)
    moves = {"left": np.maximum(x - 1, 0), "right": np.minimum(x + 1, cells - 1)}
    other = {"left": "right", "right": "left"}
    names = actions.split()
    successors = np.stack([np.stack([moves[a], moves[other[a]]], axis=1) for a in names], axis=1)
    rewards, chances = (
        np.tile([-1.0, -2.0], (cells, len(names), 1)),
        np.tile([1 - slip, slip], (cells, len(names), 1)),
    )
    if slip == 0:
        successors, rewards, chances = successors[..., :1], rewards[..., :1], chances[..., :1]
    starts = np.ones(cells, dtype=np.bool_)
    return TransitionModel(index, tuple(names), successors, rewards, starts, probabilities=chances)


def two_exits(cells: int = 6, *, slip: float = 0.0, pseudo_reward: float | None = -30.0) -> GroundGraph:
    """Return Root -> Out, which ends at either end of a corridor, and Back, from 0 to 3.

    The root wants the last cell, which is Out's goal, too; ending at 0 is ending short.
    """
    model = corridor(cells, slip=slip)
    graph = TaskGraph("two exits", model.index.variables, model.actions)
    (x,) = graph.variables
    goal, moves = x.eq(cells - 1), model.actions
    out = graph.task(
        "Out", until=x.isin([0, cells - 1]), goal=goal, pseudo_reward=pseudo_reward, uses=[x], do=moves
    )
    back = graph.task("Back", until=x.eq(3), within=x.isin([0, 1, 2]), uses=[x], do=moves)
    graph.task("Root", until=goal, uses=[x], do=[out(), back().when(x.eq(0))])
    return ground(graph, model)


def legs(cells: int, *stops: int) -> GroundGraph:
    """Return Root -> Leg0, Leg1, ... -> right: from the left end to each stop in turn, then to the end."""
    model = corridor(cells, "right")
    graph = TaskGraph("legs", model.index.variables, model.actions)
    (x,) = graph.variables
    ends = [0, *stops, cells - 1]
    calls = []
    for i, (begin, end) in enumerate(pairwise(ends)):
        leg = graph.task(f"Leg{i}", until=x.eq(end), within=x.isin(range(begin, end)), uses=[x], do="right")
        calls.append(leg())
    graph.task("Root", until=x.eq(cells - 1), uses=[x], do=calls)
    return ground(graph, model)


@dataclass(frozen=True)
class Exact:
    """A recursively optimal policy, ties to the first child.

    Parameters
    ----------
    values
        Expected discounted real rewards of each node, shape (nodes, states).
    inner
        The same with the node's own pseudo-rewards, shape (nodes, states).
    choice
        The child that each task calls, shape (nodes, states); -1 where none.
    """

    values: Array
    inner: Array
    choice: NDArray[np.int64]


def exact(grounded: GroundGraph, gamma: float = 1.0, *, pseudo_rewards: bool = True) -> Exact:
    """Solve each node in turn: value iteration for its policy, then linear equations for that policy.

    A node's kernel K holds the expected gamma**N of ending in each state, shape (states, states).
    """
    model, states = grounded.model, np.arange(grounded.model.index.size)
    values, inner = np.zeros((2, len(grounded.nodes), states.size))
    choice = np.full(values.shape, -1)
    kernels: list[Array] = []
    for place, node in enumerate(grounded.nodes):
        if not node.calls:
            kernel = np.zeros((states.size, states.size))
            for state in states:
                np.add.at(
                    kernel[state], model.outcomes[state, place], gamma * model.probabilities[state, place]
                )
            kernels.append(kernel)
            values[place] = inner[place] = model.rewards[:, place]
            continue
        children = [call.child for call in node.calls]
        own, step = values[children], np.stack([kernels[child] for child in children])
        available = np.stack([call.available for call in node.calls])
        runs = ~node.terminal & available.any(axis=0)
        end = np.where(node.terminal & ~node.goal, (node.pseudo_reward or 0.0) * pseudo_rewards, 0.0)
        ahead = end.copy()
        for _ in range(5000):
            q = np.where(available, own + step @ ahead, -np.inf)
            new = np.where(runs, q.max(axis=0), end)
            done, ahead = np.abs(new - ahead).max() < 1e-12, new
            if done:
                break
        best = (q >= q.max(axis=0) - 1e-9).argmax(axis=0)
        choice[place] = np.where(runs, best, -1)
        taken, reward = step[best, states] * runs[:, None], own[best, states] * runs
        solver = np.linalg.inv(np.eye(states.size) - taken * ~node.terminal)
        values[place], inner[place] = solver @ reward, ahead * runs
        kernels.append(solver @ (taken * node.terminal))
    return Exact(values, inner, choice)
