"""Small graphs with a fault each; what refutes them is computed again here."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hierarchy import (
    GroundGraph,
    Param,
    TaskGraph,
    Witness,
    discounted_funnels,
    ground,
    prove_abstraction,
    two_rooms,
)
from hierarchy.hdg import hdg_graph
from hierarchy.taxi import taxi_graph
from planners import recursive_optimum
from worlds import Cell, StateIndex, TransitionModel, Variable, load_layout, maze_model
from worlds.hdg import LandmarkMaze, landmark_model
from worlds.taxi import taxi_model

CELLS = 5
WET = StateIndex((Variable("x", tuple(range(CELLS))), Variable("wet", (0, 1))))
X, RAIN = WET.column("x"), WET.column("wet")


def corridor(*, cost: float = 1.0, stick: float = 0.0) -> TransitionModel:
    """Return a corridor with one action, right, that costs more and sticks more where it is wet."""
    right = np.minimum(X + 1, CELLS - 1) * 2 + RAIN
    outcomes = np.stack([right, np.arange(WET.size)], axis=1)[:, None, :]
    chances = np.stack([1 - stick * RAIN, stick * RAIN], axis=1)[:, None, :]
    rewards = np.where(RAIN, -cost, -1.0)[:, None, None] * np.ones((1, 1, 2))
    return TransitionModel(WET, ("right",), outcomes, rewards, X == 0, probabilities=chances)


def one_task(model: TransitionModel, *, guarded: bool = False) -> GroundGraph:
    """Return Root -> Go -> right, in which Go knows x alone; guarded, it may move only where it is dry."""
    graph = TaskGraph("corridor", WET.variables, model.actions)
    x, wet = graph.variables
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    if guarded:
        graph.tasks["Go"] = go = replace(go, do=(go.do[0].when(wet.eq(0)),))
    graph.task("Root", until=x.eq(4), uses=[x, wet], do=[go().using()])
    return ground(graph, model)


def agrees(witness: Witness | None, *names: str, index: StateIndex = WET) -> tuple[int, int]:
    """Return a witness's states, having checked that they agree on the variables named."""
    assert witness is not None
    rows = index.project(names)
    assert rows[witness.states[0]] == rows[witness.states[1]]
    return witness.states


def test_an_irrelevant_variable_is_proved_so() -> None:
    """The weather changes nothing: every condition of Go holds for every policy and at the only one."""
    grounded = one_task(corridor())
    report = prove_abstraction(grounded, recursive_optimum(grounded).choice)
    edge = report.edge("Go", "right")
    assert edge.max_node.always.proved
    assert edge.max_node.at_policy is not None
    assert edge.max_node.at_policy.proved
    assert report.safe
    assert report.safe_at_policy


def test_max_node_irrelevance_is_refuted_by_a_reward() -> None:
    """Where it is wet a step costs 3: two states with the same x, worth -1 and -3."""
    model = corridor(cost=3.0)
    edge = prove_abstraction(one_task(model)).edge("Go", "right")
    assert edge.max_node.always.refuted
    assert edge.table.always.refuted
    witness = edge.max_node.always.witness
    one, other = agrees(witness, "x")
    assert witness is not None
    assert witness.numbers == (model.rewards[one, 0], model.rewards[other, 0])
    assert sorted(witness.numbers) == [-3.0, -1.0]


def test_max_node_irrelevance_is_refuted_by_a_move() -> None:
    """Where it is wet the robot sticks in one of four cases: the chance to reach the same x is 1 or 0.75."""
    model = corridor(stick=0.25)
    edge = prove_abstraction(one_task(model)).edge("Go", "right")
    witness = edge.max_node.always.witness
    one, other = agrees(witness, "x")
    assert witness is not None
    assert "x = " in witness.what
    named = int(witness.what.rsplit(" ", 1)[1])
    chances = [model.expectation(np.equal(X, named).astype(np.float64))[state, 0] for state in (one, other)]
    assert witness.numbers == pytest.approx(chances)
    assert chances[0] != chances[1]


def test_max_node_irrelevance_is_refuted_by_a_guard() -> None:
    """A call that depends on the weather cannot be decided by x alone."""
    grounded = one_task(corridor(), guarded=True)
    witness = prove_abstraction(grounded).edge("Go", "right").max_node.always.witness
    one, other = agrees(witness, "x")
    available = grounded.node("Go").calls[0].available
    assert witness is not None
    assert witness.numbers == (float(available[one]), float(available[other]))
    assert available[one] != available[other]


def test_leaf_irrelevance_is_refuted_by_a_row_of_two_rewards() -> None:
    """One value for an action that costs 1 or 3 is one too few; the graph is then unsafe."""
    grounded = one_task(corridor(cost=3.0))
    leaf = grounded.nodes[0].leaf
    assert leaf is not None
    assert prove_abstraction(grounded).edge("Go", "right").leaf.always.proved
    merged = replace(leaf, projection=np.zeros_like(leaf.projection), rows=1)
    wrong = replace(grounded, nodes=(replace(grounded.nodes[0], leaf=merged), *grounded.nodes[1:]))
    report = prove_abstraction(wrong)
    witness = report.edge("Go", "right").leaf.always.witness
    one, other = agrees(witness)
    assert witness is not None
    assert witness.numbers == (wrong.model.rewards[one, 0], wrong.model.rewards[other, 0])
    assert not report.safe


def stepping_stones() -> GroundGraph:
    """Return Root -> Go, right, where Go ends at x = 1 or 3 and Root forgets at which."""
    model = corridor()
    graph = TaskGraph("stones", WET.variables, model.actions)
    x, _ = graph.variables
    go = graph.task("Go", until=x.isin([1, 3]), within=x.lt(3), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().using(), "right"])
    return ground(graph, model)


def test_result_distribution_irrelevance_is_refuted() -> None:
    """From 0 Go ends at 1, three steps short; from 2 it ends at 3, one step short."""
    grounded = stepping_stones()
    edge = prove_abstraction(grounded, recursive_optimum(grounded).choice).edge("Root", "Go")
    assert edge.result.always.refuted
    at_policy = edge.table.at_policy
    assert at_policy is not None
    assert at_policy.refuted
    assert at_policy.witness is not None
    by_hand = [{0: -3.0, 2: -1.0}[int(X[state])] for state in at_policy.witness.states]
    assert at_policy.witness.numbers == pytest.approx(by_hand)
    ends = edge.result.always.witness
    assert ends is not None
    named = int(ends.what.rsplit(" ", 1)[1])
    assert list(ends.numbers) == [float({0: 1, 2: 3}[int(X[s])] == named) for s in ends.states]


def test_termination_is_refuted_by_an_end_of_the_child_alone() -> None:
    """Go called at 0 surely ends at 1, or called at 2 at 3, where Root goes on; Go to 4 would end Root."""
    edge = prove_abstraction(stepping_stones()).edge("Root", "Go")
    witness = edge.termination.always.witness
    assert witness is not None
    called, ended = witness.states
    assert (int(X[called]), int(X[ended])) in {(0, 1), (2, 3)}
    assert witness.numbers == (1.0, 0.0)
    assert prove_abstraction(one_task(corridor())).edge("Root", "Go").termination.always.proved


def test_a_pseudo_reward_keeps_a_bad_end_from_counting_as_termination() -> None:
    """An end short of the goal is worth the pseudo-reward, so that the completion before it is not 0."""
    model = corridor()
    graph = TaskGraph("short", WET.variables, model.actions)
    x, _ = graph.variables
    go = graph.task("Go", until=x.eq(2), uses=[x], do="right")
    root = graph.task(
        "Root", until=x.isin([2, 4]), goal=x.eq(4), pseudo_reward=-9.0, uses=[x], do=[go().using()]
    )
    assert prove_abstraction(ground(graph, model)).edge("Root", "Go").termination.always.refuted
    graph.tasks["Root"] = replace(root, pseudo_reward=None)
    assert prove_abstraction(ground(graph, model)).edge("Root", "Go").termination.always.proved


def test_shielding_is_refuted_where_a_child_runs_past_its_callers_end() -> None:
    """Root ends at 2 or 4 and Go at 4 alone: called at 0 it runs on past 2, call and return."""
    model = corridor()
    graph = TaskGraph("past", WET.variables, model.actions)
    x, _ = graph.variables
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.isin([2, 4]), uses=[x], do=[go()])
    grounded = ground(graph, model)
    shielding = prove_abstraction(grounded).edge("Go", "right").shielding.always
    assert shielding.refuted
    assert shielding.witness is not None
    before, past = shielding.witness.states
    root, child = grounded.node("Root"), grounded.node("Go")
    assert child.live[past]
    assert root.terminal[past]
    assert not root.terminal[before]
    assert shielding.witness.numbers == (float(root.terminal[before]), float(root.terminal[past]))


def test_a_policy_that_reads_what_its_caller_does_not_is_refuted() -> None:
    """Go may hurry where it is wet; Root, which does not know the weather, then knows no value of it."""
    index = WET
    right = np.minimum(X + 1, CELLS - 1) * 2 + RAIN
    model = TransitionModel(
        index, ("walk", "run"), np.stack([right, right], 1), np.tile([-1.0, -2.0], (index.size, 1)), X == 0
    )
    graph = TaskGraph("hurry", index.variables, model.actions)
    x, wet = graph.variables
    go = graph.task("Go", until=x.eq(4), uses=[x, wet], do="walk run")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    grounded = ground(graph, model)
    edge = prove_abstraction(grounded, recursive_optimum(grounded).choice).edge("Root", "Go")
    assert edge.max_node.always.refuted
    assert edge.max_node.at_policy is not None
    assert edge.max_node.at_policy.proved, "it always walks"
    assert edge.table.always.proved, "its completion is 0 nevertheless"
    agrees(edge.max_node.always.witness, "x")


def distance(grounded: GroundGraph, witness: Witness | None, child: str) -> list[float]:
    """Return the steps that a child takes from a witness's states under the optimal policy."""
    assert witness is not None
    steps = recursive_optimum(grounded, 0.95).steps[grounded.place(child)]
    return [float(steps[state]) for state in witness.states]


def test_taxi_is_safe_without_discounting() -> None:
    """Dietterich's sets are proved for every policy, in rain too, and hold at the optimal one."""
    for rain in (0.0, 0.2):
        model = taxi_model(rain=rain)
        grounded = ground(taxi_graph(model), model)
        report = prove_abstraction(grounded, recursive_optimum(grounded).choice)
        assert report.safe
        assert report.safe_at_policy
        assert report.edge("Root", "Put").termination.always.proved
        assert report.edge("Put", "Navigate(R)").result.always.proved
        assert report.edge("Navigate(R)", "North").shielding.always.proved


def test_taxi_s_funnels_are_refuted_with_discounting() -> None:
    """At gamma = 0.95 what Pickup costs is discounted by the way to it: two taxis at different distances."""
    model = taxi_model()
    grounded = ground(taxi_graph(model), model)
    report = prove_abstraction(grounded, recursive_optimum(grounded, 0.95).choice, gamma=0.95)
    assert not report.safe
    assert not report.safe_at_policy
    for site in "RGYB":
        table = report.edge("Get", f"Navigate({site})").table.at_policy
        assert table is not None
        assert table.refuted
        assert table.witness is not None
        agrees(table.witness, "passenger", index=model.index)
        steps = distance(grounded, table.witness, f"Navigate({site})")
        assert table.witness.numbers == pytest.approx([-(0.95**n) for n in steps])
    refuted = {edge.task for edge in report.unsafe()}
    assert refuted == {"Get", "Put", "Root"}, "Navigate, Pickup and Putdown forget no time"


def test_the_paper_s_sets_are_safe() -> None:
    """Equations 5 to 7 for the graph of the paper, with doors as parameters and with one task for both."""
    layout = load_layout("two_rooms")
    model = maze_model(layout)
    for one_door_task in (False, True):
        grounded = ground(two_rooms(layout, one_door_task=one_door_task), model)
        report = prove_abstraction(grounded, recursive_optimum(grounded).choice)
        assert report.safe
        assert report.safe_at_policy


def test_one_door_task_cannot_forget_where_it_lands() -> None:
    """A GotoDoor that ends at either door, stored by the goal alone: refuted by robots nearer to either."""
    layout = load_layout("two_rooms")
    graph = two_rooms(layout, one_door_task=True)
    root = graph.tasks["Root"]
    _, _, goal, _ = graph.variables
    calls = tuple(call.using(goal) if call.child == "GotoDoor" else call for call in root.do)
    graph.tasks["Root"] = replace(root, do=calls)
    grounded = ground(graph, maze_model(layout))
    solution = recursive_optimum(grounded)
    table = prove_abstraction(grounded, solution.choice).edge("Root", "GotoDoor").table.at_policy
    assert table is not None
    assert table.witness is not None
    agrees(table.witness, "goal", index=grounded.model.index)
    root_place, door = grounded.root, grounded.place("GotoDoor")
    values = [float(solution.value[root_place, solution.landing[door, s]]) for s in table.witness.states]
    assert list(table.witness.numbers) == values


CORNERS = LandmarkMaze(side=5, landmarks={"L1": Cell(0, 0), "L2": Cell(2, 2), "L3": Cell(4, 4)})


def test_dropping_the_landing_state_is_safe_with_sure_moves() -> None:
    """HDG with moves that do as they are told: GotoLmk lands at its landmark."""
    grounded = ground(hdg_graph(CORNERS), landmark_model(CORNERS))
    report = prove_abstraction(grounded, recursive_optimum(grounded).choice)
    assert report.safe
    assert report.safe_at_policy
    assert report.edge("GotoGoalLmk(L1)", "GotoLmk(L2)").result.always.proved
    assert report.edge("Root", "GotoGoal").termination.always.proved


def test_dropping_the_landing_state_is_refuted_with_moves_that_slip() -> None:
    """HDG with slips: GotoLmk may land outside its space, and where depends on where it began."""
    grounded = ground(hdg_graph(CORNERS, may_leave=True), landmark_model(CORNERS, slip=0.2))
    solution = recursive_optimum(grounded)
    report = prove_abstraction(grounded, solution.choice)
    edge = report.edge("GotoGoalLmk(L3)", "GotoLmk(L3)")
    assert edge.result.always.refuted
    assert edge.table.always.refuted
    table = edge.table.at_policy
    assert table is not None
    assert table.refuted
    assert table.witness is not None
    kernel = solution.exits[grounded.place("GotoLmk(L3)")].kernel
    value = solution.value[grounded.place("GotoGoalLmk(L3)")]
    for state, number in zip(table.witness.states, table.witness.numbers, strict=True):
        assert (kernel[[state]].toarray() @ value).item() == pytest.approx(number)


def test_what_no_proof_and_no_policy_decides_is_called_undecided() -> None:
    """A fickle passenger makes up his mind on the first move whatever it is: true, beyond these proofs."""
    model = taxi_model(fickle=0.3)
    grounded = ground(taxi_graph(model), model)
    edge = prove_abstraction(grounded, recursive_optimum(grounded).choice).edge("Put", "Navigate(R)")
    assert edge.table.always.status == "undecided"
    assert edge.table.at_policy is not None
    assert edge.table.at_policy.proved


def test_discounted_funnels_are_found_once_per_call() -> None:
    """Taxi with gamma below 1: Get and Put forget their way, Root forgets Get's; without it, nothing."""
    model = taxi_model()
    grounded = ground(taxi_graph(model), model)
    findings = discounted_funnels(grounded, 0.95)
    where = [finding.where for finding in findings]
    get, put = "Get -> Navigate(site=passenger)", "Put -> Navigate(site=destination)"
    assert where == [get, put, "Root -> Get"]
    assert all(finding.kind == "discounted funnel" and "gamma" in finding.mend for finding in findings)
    assert discounted_funnels(grounded, 1.0) == ()


def whole(task: str) -> Callable[[TaskGraph], None]:
    """Return a change that stores every call of a task by all its uses."""

    def change(graph: TaskGraph) -> None:
        declared = graph.tasks[task]
        graph.tasks[task] = replace(declared, do=tuple(replace(call, relevant=None) for call in declared.do))

    return change


def test_the_mend_of_a_discounted_funnel_mends_it() -> None:
    """Stored by all the uses of their tasks, the same calls are safe with discounting."""
    model = taxi_model()
    graph = taxi_graph(model)
    for task in ("Get", "Put", "Root"):
        whole(task)(graph)
    grounded = ground(graph, model)
    assert discounted_funnels(grounded, 0.95) == ()
    assert prove_abstraction(grounded, gamma=0.95).safe


def test_the_report_names_the_calls_it_does_not_have() -> None:
    """A call that cannot be made has no report; the message lists those that can."""
    report = prove_abstraction(one_task(corridor()))
    with pytest.raises(KeyError, match="Go -> right"):
        report.edge("Go", "left")
    assert report.safe_at_policy is None, "no policy was given"


def test_a_parameter_is_proved_for_each_binding() -> None:
    """Bindings are tasks of their own: where one of them never runs it has no report."""
    model = corridor()
    graph = TaskGraph("targets", WET.variables, model.actions)
    x, _ = graph.variables
    to = Param.over("to", {"two": 2, "four": 4})
    go = graph.task("Go", to, until=x.eq(to), uses=[x], within=x.le(to), do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(to=2).when(x.lt(2)), go(to=4).when(x.ge(2))])
    report = prove_abstraction(ground(graph, model))
    assert report.safe
    assert {edge.task for edge in report.edges} == {"Root", "Go(two)", "Go(four)"}
