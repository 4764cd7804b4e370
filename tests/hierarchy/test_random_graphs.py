"""Random task graphs that are sound by construction pass every check; one fault put in is found."""

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hierarchy import ALWAYS, Call, Param, Predicate, Task, TaskGraph, Var, check, ground
from planners import MaxQ
from worlds import StateIndex, TransitionModel, Variable

MOVES = {"North": (-1, 0), "South": (1, 0), "West": (0, -1), "East": (0, 1)}
ACTIONS = (*MOVES, "Press")


@dataclass(frozen=True)
class Fault:
    """A graph with one fault, and its finding: kind, task, and child of the edge, if any."""

    graph: TaskGraph
    kind: str
    task: str
    child: str = ""


@st.composite
def worlds(draw: st.DrawFn) -> TransitionModel:
    """Draw a connected patch of a grid, maybe with a ring in it, and a lamp that Press switches."""
    cells = draw(st.sampled_from([[(0, 0), (0, 1)], [(0, 0), (0, 1), (1, 1), (1, 0)]]))
    for _ in range(draw(st.integers(0, 4))):
        row, col = draw(st.sampled_from(cells))
        down, right = draw(st.sampled_from(list(MOVES.values())))
        cells = list(dict.fromkeys([*cells, (row + down, col + right)]))
    index = StateIndex((Variable("cell", tuple(cells)), Variable("lamp", ("off", "on"))))
    after = np.empty((index.size, len(ACTIONS)), dtype=np.int64)
    for number, (cell, lamp) in enumerate(index):
        assert isinstance(cell, tuple)
        for action, (down, right) in enumerate(MOVES.values()):
            to = (cell[0] + down, cell[1] + right)
            after[number, action] = index.number((to if to in cells else cell, lamp))
        after[number, -1] = index.number((cell, "off" if lamp == "on" else "on"))
    return TransitionModel(index, ACTIONS, after, np.full(after.shape, -1.0), np.ones(index.size, np.bool_))


@st.composite
def graphs(draw: st.DrawFn, index: StateIndex) -> TaskGraph:
    """Draw a graph in which every task can end by itself, and the root, last, calls every other task.

    Light, Goto(to), Via(to) -> Goto(to), Light; up to three tasks that call any that come before them.
    """
    graph = TaskGraph("random", index.variables, ACTIONS)
    cell, lamp = graph.variables
    cells = index.variables[0].values
    some = st.lists(st.sampled_from(cells), min_size=1, max_size=len(cells) - 1, unique=True)
    to = Param(Variable("to", cells))
    light = graph.task("Light", until=lamp.eq("on"), uses=[lamp], do="Press")
    goto = graph.task("Goto", to, until=cell.eq(to), uses=[cell], do=draw(st.permutations(list(MOVES))))
    graph.task("Via", to, until=cell.eq(to), uses=[cell, lamp], do=[goto(to=to), light()])
    for number in range(draw(st.integers(0, 3))):
        until = cell.isin(draw(some))
        if draw(st.booleans()):
            until &= lamp.eq(draw(st.sampled_from(["off", "on"])))
        children = draw(st.lists(st.sampled_from(list(graph.tasks.values())), max_size=3))
        calls = [call for child in children for call in draw(_edges(graph, child, ~until.mask(index)))]
        do = draw(st.permutations([*calls, *ACTIONS]))
        graph.task(f"Mid{number}", until=until, uses=[cell, lamp], do=do)
    until = cell.eq(draw(st.sampled_from(cells))) & lamp.eq("on")
    children = list(graph.tasks.values())
    calls = [call for child in children for call in draw(_edges(graph, child, ~until.mask(index)))]
    graph.task("Root", until=until, uses=[cell, lamp], do=draw(st.permutations([*calls, *ACTIONS])))
    return graph


@st.composite
def _edges(draw: st.DrawFn, graph: TaskGraph, child: Task, live: NDArray[np.bool_]) -> list[Call]:
    """Draw a call of a child, with a guard that holds where both run, or nothing if they never both do."""
    index = graph.index
    cell, lamp = graph.variables
    call = child(**{param.name: draw(st.sampled_from(param.domain.values)) for param in child.params})
    until = child.until.bind(dict(call.binding))
    both = np.flatnonzero(live & ~until.mask(index))
    if not both.size:
        return []
    place, light = index.state(int(draw(st.sampled_from(both.tolist()))))
    other = draw(st.sampled_from(cell.domain.values))
    guards: list[Predicate] = [ALWAYS, cell.isin(list(dict.fromkeys([place, other]))), lamp.eq(light)]
    guard = draw(st.sampled_from(guards))
    return [call if guard == ALWAYS else call.when(guard)]


@st.composite
def faults(draw: st.DrawFn, graph: TaskGraph) -> Fault:
    """Draw one fault: a variable not used, a child misspelt or unbound, or a guard that never holds."""
    task = draw(st.sampled_from(list(graph.tasks.values())))
    kind = draw(st.sampled_from(["hidden variable", "unknown child", "unbound parameter", "never runs"]))
    if kind == "hidden variable":
        name = draw(st.sampled_from(sorted(task.until.variables())))
        return Fault(_with(graph, replace(task, uses=tuple(set(task.uses) - {name}))), kind, task.name)
    edges = [at for at, call in enumerate(task.do) if kind != "unbound parameter" or call.binding]
    assume(edges)
    at = draw(st.sampled_from(edges))
    call = task.do[at]
    if kind == "unknown child":
        call = replace(call, child=call.child + "s")
    elif kind == "unbound parameter":
        call = replace(call, binding=())
    else:
        used = Var(graph.index.variable(task.uses[0]))
        first = used.eq(used.domain.values[0])
        call = call.when(first & ~first)
    do = (*task.do[:at], call, *task.do[at + 1 :])
    return Fault(_with(graph, replace(task, do=do)), kind, task.name, call.child)


def _with(graph: TaskGraph, task: Task) -> TaskGraph:
    """Return the graph with a task in the place of its namesake."""
    changed = TaskGraph(graph.name, graph.index.variables, graph.actions)
    changed.tasks = {**graph.tasks, task.name: task}
    return changed


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_sound_graphs_pass_and_run(data: st.DataObject) -> None:
    """A sound graph has no findings, grounds, and its root ends from every start."""
    model = data.draw(worlds())
    graph = data.draw(graphs(model.index))
    assert check(graph, model) == ()
    grounded = ground(graph, model)
    assert {node.task for node in grounded.nodes} == {*ACTIONS, *graph.tasks}
    learner = MaxQ(grounded, seed=(1,))
    starts = np.flatnonzero(model.starts).tolist()
    steps = np.array([learner.train(grounded.root, [start], episodes=1)[0] for start in starts])
    assert ((steps == 0) == grounded.nodes[-1].terminal[starts]).all()


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_one_fault_is_found(data: st.DataObject) -> None:
    """A sound graph with one fault put in has a finding of that kind, at that task and edge."""
    model = data.draw(worlds())
    fault = data.draw(graphs(model.index).flatmap(faults))
    found = [
        finding.where.partition(" -> ") for finding in check(fault.graph, model) if finding.kind == fault.kind
    ]
    assert any(at.startswith(fault.task) and child.startswith(fault.child) for at, _, child in found)
