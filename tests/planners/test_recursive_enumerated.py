"""The recursive optimum held to every policy of every task, one by one."""

from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest
from decision_problems import ground_graphs
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hierarchy import GroundGraph, GroundTask
from planners import recursive_optimum

Followed = tuple[NDArray[np.float64], NDArray[np.float64]]
"""A node's value, and its discounted chances of ending in each state."""


def _followed(
    node: GroundTask, policy: Sequence[int], children: Sequence[Followed], ends: NDArray[np.float64]
) -> Followed:
    """Follow a task's policy for 4096 calls; `ends` is the worth of ending in each state.

    -inf where by then it may still run, or may have got stuck; discounted it may run for ever.
    """
    size = ends.size
    reward, kernel, stuck = np.zeros(size), np.zeros((size, size)), np.zeros(size)
    for state in np.flatnonzero(node.live):
        value, after = (
            children[node.calls[policy[state]].child] if policy[state] >= 0 else (ends - np.inf, None)
        )
        stuck[state] = np.isneginf(value[state])
        if after is not None and not stuck[state]:
            reward[state], kernel[state] = value[state], after[state]
    still, visits = kernel * node.live, np.eye(size)
    for _ in range(12):  # visits in 1, 2, 4, ... calls
        visits, still = visits + still @ visits, still @ still
    exits = visits @ (kernel * node.terminal) * node.live[:, None]
    failed = node.live & ((still.sum(axis=1) > 1e-6) | (visits @ stuck > 0))
    value = np.where(failed, -np.inf, visits @ reward + exits @ ends)
    return np.where(node.live, value, 0.0), exits * ~failed[:, None]


@settings(max_examples=60, deadline=None)
@given(ground_graphs(sizes=(2, 3)), st.sampled_from([1.0, 0.9]))
def test_each_task_s_policy_is_the_best_of_all(grounded: GroundGraph, gamma: float) -> None:
    """Every policy of every task, one by one, its children's being the solution's; steps may cost nothing."""
    solution, model = recursive_optimum(grounded, gamma), grounded.model
    states = range(model.index.size)
    followed: list[Followed] = []
    for place, node in enumerate(grounded.nodes):
        if not node.calls:
            step = np.zeros((model.index.size, model.index.size))
            for state, k in np.ndindex(model.outcomes[:, place].shape):
                step[state, model.outcomes[state, place, k]] += gamma * model.probabilities[state, place, k]
            followed.append((model.rewards[:, place], step))
            continue
        ends = np.where(node.terminal & ~node.goal, node.pseudo_reward or 0.0, 0.0)
        able = [[k for k, call in enumerate(node.calls) if call.available[s]] or [-1] for s in states]
        values = [_followed(node, policy, followed, ends)[0] for policy in product(*able)]
        assert solution.taught[place][node.live] == pytest.approx(np.max(values, axis=0)[node.live], abs=1e-6)
        value, exits = _followed(node, solution.choice[place].tolist(), followed, np.zeros(ends.size))
        assert solution.value[place][node.live] == pytest.approx(value[node.live], abs=1e-6)
        assert solution.exits[place].kernel.toarray() == pytest.approx(exits, abs=1e-6)
        followed.append((value, exits))
