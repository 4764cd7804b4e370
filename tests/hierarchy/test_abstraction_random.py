"""Random small graphs: what is proved safe loses nothing, and what is refuted differs as it says."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hierarchy import (
    Exits,
    GroundCall,
    GroundGraph,
    TaskGraph,
    Var,
    evaluate,
    ground,
    primitive_exits,
    prove_abstraction,
    task_exits,
)
from hierarchy.abstraction_scope import scopes
from worlds import StateIndex, Stream, TransitionModel, Variable

INDEX = StateIndex((Variable("x", (0, 1, 2, 3)), Variable("y", (0, 1)), Variable("z", (0, 1))))
X, Y, Z = (INDEX.column(name) for name in "xyz")
Values = NDArray[np.float64]
SEEDS = st.integers(0, 2**32)
GAMMAS = st.sampled_from([1.0, 0.9])


def random_graph(seed: int) -> GroundGraph:
    """Return Root -> Go, a, b and Go -> a, b, in which what depends on what is drawn, and so are the sets.

    From everywhere every action leads to every x now and then, so that every task surely ends.
    """
    stream = Stream(seed)

    def some(names: str, share: float) -> list[str]:
        return [name for name in names if stream.uniform() < share]

    def drawn(names: list[str], low: float, high: float) -> Values:
        rows = INDEX.project(names)
        table = np.array([stream.between(low, high) for _ in range(int(rows.max()) + 1)])
        return table[rows]

    outcomes, chances, rewards = [], [], []
    for _ in "ab":
        reads = ["x", *some("yz", 0.15)]
        ahead = (drawn(reads, 0, 4)).astype(int)
        wet = (drawn(["y", *some("z", 0.2)], 0, 2)).astype(int)
        dark = (drawn(["z", *some("xy", 0.2)], 0, 2)).astype(int)
        likely = np.column_stack([ahead, *np.broadcast_arrays(*range(4), X)[:4]])
        outcomes.append((likely * 2 + wet[:, None]) * 2 + dark[:, None])
        chances.append(np.tile([0.6, 0.1, 0.1, 0.1, 0.1], (INDEX.size, 1)))
        reward = drawn(["x", *some("yz", 0.15)], -3, -1)
        rewards.append(np.tile(reward[:, None], (1, 5)))
    model = TransitionModel(
        INDEX,
        ("a", "b"),
        np.stack(outcomes, 1),
        np.stack(rewards, 1),
        np.ones(INDEX.size, bool),
        probabilities=np.stack(chances, 1),
    )
    graph = TaskGraph("random", INDEX.variables, model.actions)
    x, y, z = graph.variables
    by_name: dict[str, Var] = {"x": x, "y": y, "z": z}
    go = graph.task(
        "Go", until=x.eq(stream.below(3)), uses=[x, *(by_name[n] for n in some("yz", 0.8))], do="a b"
    )
    call = go().using(*(by_name[name] for name in some("xyz", 0.7)))
    graph.task("Root", until=x.eq(3), uses=[x, *(by_name[n] for n in some("yz", 0.8))], do=[call, "a", "b"])
    return ground(graph, model)


def solve(grounded: GroundGraph, gamma: float, *, projected: bool) -> tuple[list[Values], NDArray[np.int64]]:
    """Return the value of every node and every choice, by sweeps over completion tables.

    A table has a row for each state, or if `projected` for each row of the declared abstraction, which
    then holds the mean of what its states say. Near equals go to the first call.
    """
    where = scopes(grounded)
    exits: list[Exits] = []
    values: list[Values] = []
    choices = np.full((len(grounded.nodes), INDEX.size), -1)
    for place, node in enumerate(grounded.nodes):
        if not node.calls:
            exits.append(primitive_exits(grounded.model, place, gamma))
            values.append(exits[place].value)
            continue
        rows = [_rows(call, projected=projected) for call in node.calls]
        asked = [where[place].decides & call.available for call in node.calls]
        tables = [np.zeros(INDEX.size) for _ in node.calls]
        value = np.zeros(INDEX.size)
        q = np.zeros((len(node.calls), INDEX.size))
        for _ in range(2000):
            before = value
            for k, call in enumerate(node.calls):
                found = np.asarray(exits[call.child].kernel @ value)
                total = np.bincount(rows[k][asked[k]], found[asked[k]], INDEX.size)
                tables[k] = total / np.maximum(np.bincount(rows[k][asked[k]], minlength=INDEX.size), 1)
                q[k] = np.where(call.available, values[call.child] + tables[k][rows[k]], -np.inf)
            value = np.where(node.terminal, 0.0, q.max(axis=0))
            if np.abs(value - before).max() < 1e-11:
                break
        best = (q >= q.max(axis=0) - 1e-7).argmax(axis=0)
        choices[place] = np.where(node.live, best, -1)
        exits.append(task_exits(node, choices[place], exits))
        values.append(value)
    return values, choices


def _rows(call: GroundCall, *, projected: bool) -> NDArray[np.int64]:
    return call.projection if projected else np.arange(INDEX.size)


@settings(max_examples=60, deadline=None)
@given(SEEDS, GAMMAS)
def test_a_safe_abstraction_loses_nothing(seed: int, gamma: float) -> None:
    """Tables by the declared rows converge to the values of tables by the state, wherever they are asked."""
    grounded = random_graph(seed)
    plain, choices = solve(grounded, gamma, projected=False)
    report = prove_abstraction(grounded, choices, gamma)
    if not report.safe:
        return
    assert report.safe_at_policy
    abstract, _ = solve(grounded, gamma, projected=True)
    for place, scope in enumerate(scopes(grounded)):
        np.testing.assert_allclose(abstract[place][scope.decides], plain[place][scope.decides], atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(SEEDS, GAMMAS)
def test_a_refuted_table_differs_as_its_witness_says(seed: int, gamma: float) -> None:
    """At the policy given the two completions are those of dense matrices, in one row of the table."""
    grounded = random_graph(seed)
    _, choices = solve(grounded, gamma, projected=False)
    exits = evaluate(grounded, choices, gamma)
    for edge in prove_abstraction(grounded, choices, gamma).edges:
        table = edge.table.at_policy
        assert table is not None
        if table.witness is None:
            continue
        one, other = table.witness.states
        rows = INDEX.project(edge.relevant)
        assert rows[one] == rows[other]
        value = exits[grounded.place(edge.task)].value
        dense = exits[grounded.place(edge.child)].kernel.toarray() @ value
        np.testing.assert_allclose(table.witness.numbers, dense[[one, other]])


@settings(max_examples=60, deadline=None)
@given(SEEDS)
def test_what_is_proved_for_every_policy_holds_at_one_that_reads_no_more(seed: int) -> None:
    """A policy drawn here, deterministic and by the declared variables alone, refutes nothing proved."""
    grounded = random_graph(seed)
    stream = Stream(seed, 1)
    choices = np.full((len(grounded.nodes), INDEX.size), -1)
    for place, node in enumerate(grounded.nodes):
        if node.calls:
            rows = INDEX.project(grounded.graph.tasks[node.task].uses)
            odds = np.array([[stream.uniform() for _ in range(INDEX.size)] for _ in node.calls])[:, rows]
            available = np.stack([call.available for call in node.calls])
            choices[place] = np.where(node.live, np.where(available, odds, -1.0).argmax(axis=0), -1)
    for edge in prove_abstraction(grounded, choices).edges:
        for name in ("max_node", "result", "termination"):
            judgement = getattr(edge, name)
            if judgement.always.proved:
                assert judgement.at_policy.proved, (edge.task, edge.child, name)


def test_random_graphs_are_of_every_kind() -> None:
    """The tests above have something to say: of 40 graphs some are safe and some are not."""
    for gamma in (1.0, 0.9):
        safe = [prove_abstraction(random_graph(seed), gamma=gamma).safe for seed in range(40)]
        assert 5 <= sum(safe) <= 35
