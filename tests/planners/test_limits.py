"""Where every learner's updates come to rest, averaged over chance: at dynamic programming's values alone."""

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy import GroundGraph, TaskGraph, ground
from planners import HSMQ, FlatQ, Learner, MaxQ, MaxQQ, Settings, flat_optimum, recursive_optimum
from planners.learner import Step
from worlds import StateIndex, TransitionModel, Variable


@st.composite
def _one_way(draw: st.DrawFn, *, taught: bool) -> GroundGraph:
    """Draw a world that only goes on, by chance by one cell or by more, and a graph of three levels on it.

    Root -> Mid, Two, a; Mid -> One, b; One -> a, or b and a; Two -> b, a. If taught, a task may end short of
    the last cell for a pseudo-reward. Rewards and chances are sums of powers of 2: no rounding.
    """
    states = draw(st.integers(3, 6))
    index, last, shape = StateIndex((Variable("x", tuple(range(states))),)), states - 1, (states, 2, 2)
    outcomes, rewards, chances = np.full(shape, last), np.zeros(shape), np.zeros(shape)
    for state, action in np.ndindex(last, 2):
        cells, reward = st.integers(state + 1, last), st.integers(-4, 4)
        outcomes[state, action] = draw(cells), draw(cells)
        rewards[state, action] = draw(reward), draw(reward)
        chances[state, action, 0] = draw(st.sampled_from([0.25, 0.5, 1.0]))
    chances[..., 1] = 1 - chances[..., 0]
    model = TransitionModel(
        index, ("a", "b"), outcomes, rewards, np.arange(states) < last, probabilities=chances
    )
    graph = TaskGraph("one way", index.variables, model.actions)
    (x,) = graph.variables
    some = st.sets(st.integers(0, last)).map(lambda ends: sorted(ends | {last}))
    pseudo = st.sampled_from([None, -3.0, 1.0]) if taught else st.none()

    def task(name: str, *do: Any) -> Any:
        words = {"goal": x.eq(last), "pseudo_reward": draw(pseudo)}
        return graph.task(name, until=x.isin(draw(some)), uses=[x], do=do, **words)

    one, two = task("One", *draw(st.sampled_from(["a", "ba"]))), task("Two", "b", "a")
    graph.task("Root", until=x.eq(last), uses=[x], do=[task("Mid", one(), "b")(), two(), "a"])
    return ground(graph, model)


def _ways(learner: Learner, task: int, state: int) -> Iterator[tuple[float, list[Step], int]]:
    """Yield each way in which a node may go when it is run greedily: its probability, steps and end."""
    node, model = learner.grounded.nodes[task], learner.grounded.model
    if not node.calls:
        columns = model.probabilities, model.outcome_rewards, model.outcomes
        found = zip(*(column[state, task].tolist() for column in columns), strict=True)
        yield from ((chance, [Step(state, reward)], after) for chance, reward, after in found if chance)
    elif node.terminal[state]:
        yield 1.0, [], state
    else:
        k = learner.greedy(task, state)
        for chance, steps, between in _ways(learner, node.calls[k].child, state):
            seen = learner._seen_by_caller(task, k, steps)
            for share, rest, after in _ways(learner, task, between):
                yield chance * share, seen + rest, after


def _rows(learner: Learner, task: int, k: int) -> list[list[float]]:
    """Return the rows of a task's child in each of the learner's tables."""
    names = "completion", "inner_completion", "table"
    return [getattr(learner, name)[task][k] for name in names if hasattr(learner, name)]


UNTOUCHED = 1024.0


def _aims(learner: Learner, task: int, k: int, state: int) -> dict[tuple[int, int], float]:
    """Return what updates after calling a child in a state aim at on average, by table and state updated.

    The tables stay as they were. In this world's tables a row is a state.
    """
    tables = _rows(learner, task, k)
    found: defaultdict[tuple[int, int], list[tuple[float, float]]] = defaultdict(list)
    for chance, steps, after in _ways(learner, learner.grounded.nodes[task].calls[k].child, state):
        kept = [list(values) for values in tables]
        for values in tables:
            values[:after] = [UNTOUCHED] * after  # no way leads back there, so nothing reads it
        learner._learn(task, k, steps, after, 1.0)
        for number, values in enumerate(tables):
            for at, value in enumerate(values[:after]):
                if value != UNTOUCHED:
                    found[number, at].append((chance, value))
            values[:] = kept[number]
    return {key: sum(p * v for p, v in all_) / sum(p for p, _ in all_) for key, all_ in found.items()}


def _settle(learner: Learner) -> None:
    """Set every table to what its updates aim at: children before callers, later states before earlier."""
    model = learner.grounded.model
    for place, node in enumerate(learner.grounded.nodes):
        for state in reversed(range(model.index.size)):
            if not node.calls:
                learner._learn_reward(place, state, float(model.rewards[state, place]), 1.0)
            for k in learner.choices(place, state) if node.calls else ():
                for (number, at), aim in _aims(learner, place, k, state).items():
                    if at == state:
                        _rows(learner, place, k)[number][at] = aim


@pytest.mark.parametrize("kind", [MaxQ, MaxQQ, HSMQ, FlatQ])
@pytest.mark.parametrize("all_states", [False, True])
@given(data=st.data(), gamma=st.sampled_from([1.0, 0.5]))
@settings(max_examples=60, deadline=None)
def test_updates_come_to_rest_at_the_exact_values_alone(
    kind: type[Learner], all_states: bool, data: st.DataObject, gamma: float
) -> None:
    """Averaged over chance, each update's aim from the last state back is dynamic programming's value.

    V, C and Q of every task, child and state, on stochastic worlds, to the last digits: what sampling comes
    near to. In all-states updating the states on the way are drawn to the same values.
    """
    given_graph = data.draw(_one_way(taught=kind is not MaxQ))
    learner = kind(given_graph, (0,), Settings(gamma=gamma, tie=1e-9, all_states=all_states))
    _settle(learner)
    grounded, solution = learner.grounded, recursive_optimum(learner.grounded, gamma)
    own = solution.taught if isinstance(learner, HSMQ) else solution.value
    for place, node in enumerate(grounded.nodes):
        for state in np.flatnonzero(node.live).tolist() if node.calls else ():
            assert learner.value(place, state) == pytest.approx(own[place, state])
            for k in learner.choices(place, state):
                exits = solution.exits[node.calls[k].child]
                after = exits.kernel[[state]].toarray()[0]
                assert learner.q(place, state, k) == pytest.approx(exits.value[state] + after @ own[place])
                if isinstance(learner, MaxQ):
                    assert learner.c(place, state, k) == pytest.approx(after @ solution.value[place])
                if isinstance(learner, MaxQQ):
                    inner = exits.value[state] + after @ solution.taught[place]
                    assert learner.inner_q(place, state, k) == pytest.approx(inner)
                for (number, at), aim in _aims(learner, place, k, state).items():
                    stored = _rows(learner, place, k)[number][at]
                    assert aim == pytest.approx(stored), (node.name, state, k, at)
    if kind is FlatQ:
        best = flat_optimum(grounded.model, grounded.nodes[grounded.root].terminal, gamma).value
        assert own[grounded.root] == pytest.approx(best)
