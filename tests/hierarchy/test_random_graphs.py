"""Random task graphs that are sound by construction pass every check; one fault put in is found."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from decision_problems import ground_graphs
from graphs import ACTIONS, Grid, graphs, grids, ways_to_end
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hierarchy import (
    ALWAYS,
    Call,
    Constant,
    GroundGraph,
    GroundTask,
    Param,
    Predicate,
    Task,
    TaskGraph,
    Var,
    check,
    ground,
)
from hierarchy.abstraction_scope import course
from hierarchy.check_reach import Origins
from planners import MaxQ, MaxQQ
from worlds import Variable

GHOST = Var(Variable("ghost", (0, 1)))
BRIGHTNESS = Var(Variable("lamp", ("dim", "bright")))
OTHER = Param(Variable("other", ("off", "on")))


@dataclass(frozen=True)
class Fault:
    """A graph with one fault, and where it is: the task, and the child of the edge, if any."""

    graph: TaskGraph
    task: str
    child: str = ""


@st.composite
def runs(draw: st.DrawFn) -> tuple[Grid, TaskGraph]:
    """Draw a world and a sound graph."""
    grid = draw(grids())
    return grid, draw(graphs(grid))


def _with(graph: TaskGraph, *tasks: Task) -> TaskGraph:
    """Return the graph with tasks in the place of their namesakes, or before all others."""
    changed = TaskGraph(graph.name, graph.index.variables, graph.actions)
    new = {task.name: task for task in tasks}
    changed.tasks = {**{name: new[name] for name in new if name not in graph.tasks}, **graph.tasks, **new}
    return changed


def _never(graph: TaskGraph, task: Task) -> Predicate:
    """Return a predicate that never holds, of what a task uses."""
    used = Var(graph.index.variable(task.uses[0]))
    return used.isin([])


def _a_task(draw: st.DrawFn, graph: TaskGraph) -> Task:
    return draw(st.sampled_from(list(graph.tasks.values())))


def _on_an_edge(
    draw: st.DrawFn, graph: TaskGraph, change: Callable[[Task, Call], Call], *, bound: bool = False
) -> Fault:
    """Change a call of some task, one with a binding if `bound`."""
    edges = [(t, at) for t in graph.tasks.values() for at, c in enumerate(t.do) if c.binding or not bound]
    task, at = draw(st.sampled_from(edges))
    call = change(task, task.do[at])
    do = (*task.do[:at], call, *task.do[at + 1 :])
    return Fault(_with(graph, replace(task, do=do)), task.name, call.child)


def _on_a_predicate(draw: st.DrawFn, graph: TaskGraph, atom: Callable[[Task], Predicate]) -> Fault:
    """Add an atom to a predicate of some task, or to the guard of one of its edges."""
    key = draw(st.sampled_from(["until", "within", "start", "goal", "when"]))
    if key == "when":
        return _on_an_edge(draw, graph, lambda task, call: call.when(atom(task)))
    task = _a_task(draw, graph)
    wrong = getattr(task, key) | ~atom(task)
    return Fault(_with(graph, replace(task, **{key: wrong})), task.name)


def _hidden_variable(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    task = _a_task(draw, graph)
    name = draw(st.sampled_from(sorted(task.until.variables())))
    uses = tuple(used for used in task.uses if used != name)
    return Fault(_with(graph, replace(task, uses=uses)), task.name)


def _unknown_variable(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    if draw(st.booleans()):
        return _on_a_predicate(draw, graph, lambda _: GHOST.eq(1))
    task = _a_task(draw, graph)
    return Fault(_with(graph, replace(task, uses=(*task.uses, "ghost"))), task.name)


def _mistyped_variable(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    return _on_a_predicate(draw, graph, lambda _: BRIGHTNESS.eq("dim"))


def _mistyped_comparison(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    cell, lamp, _mark = graph.variables
    atom = draw(st.sampled_from([cell.eq(lamp), lamp.eq(cell), cell.lt(lamp), cell.ge("on"), lamp.gt(3)]))
    return _on_a_predicate(draw, graph, lambda _: atom)


def _unknown_parameter(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    match draw(st.sampled_from(["read", "bound", "bound to"])):
        case "read":
            return _on_a_predicate(draw, graph, lambda _: OTHER.eq("on"))
        case "bound":
            extra = (("other", Constant("on")),)
            return _on_an_edge(draw, graph, lambda _, call: replace(call, binding=call.binding + extra))
        case _:
            return _rebound(draw, graph, OTHER)


def _rebound(draw: st.DrawFn, graph: TaskGraph, to: Var | Param | Constant) -> Fault:
    binding = (("to", to),)
    return _on_an_edge(draw, graph, lambda _, call: replace(call, binding=binding), bound=True)


def _mistyped_parameter(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    mine = Param(Variable("to", ("here",)))
    if draw(st.booleans()):
        return _rebound(draw, graph, Constant("nowhere"))
    task = draw(st.sampled_from([task for task in graph.tasks.values() if task.params]))
    return Fault(_with(graph, replace(task, start=mine.eq("here"))), task.name)


def _unbound_parameter(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    if draw(st.booleans()):
        return _on_an_edge(draw, graph, lambda _, call: replace(call, binding=()), bound=True)
    return Fault(_with(graph, replace(graph.root, params=(OTHER,))), "Root")


def _unknown_child(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    return _on_an_edge(draw, graph, lambda _, call: replace(call, child=call.child + "s"))


def _no_children(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    task = _a_task(draw, graph)
    return Fault(_with(graph, replace(task, do=())), task.name)


def _cycle(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    """Let some task call the root, which calls it, or a task itself."""
    task = _a_task(draw, graph)
    if draw(st.booleans()):
        return Fault(_with(graph, replace(task, do=(*task.do, Call(task.name)))), task.name)
    return Fault(_with(graph, replace(task, do=(*task.do, Call("Root")))), "")


def _unreachable(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    task = replace(_a_task(draw, graph), name="Forgotten")
    return Fault(_with(graph, task), "Forgotten")


def _never_runs(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    return _on_an_edge(draw, graph, lambda task, call: call.when(_never(graph, task)))


def _never_starts(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    task = _a_task(draw, graph)
    return Fault(_with(graph, replace(task, start=_never(graph, task))), task.name)


def _never_ends(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    task = _a_task(draw, graph)
    return Fault(_with(graph, replace(task, until=_never(graph, task))), task.name)


def _no_goal(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    task = _a_task(draw, graph)
    return Fault(_with(graph, replace(task, goal=_never(graph, task))), task.name)


def _but_for(graph: TaskGraph, task: Task, state: int) -> Predicate:
    """Return a predicate that fails in a state and in those that a task does not tell from it."""
    values = dict(zip(graph.index.names, graph.index.state(state), strict=True))
    here = ALWAYS
    for name in task.uses:
        here &= Var(graph.index.variable(name)).eq(values[name])
    return ~here


def _a_node(draw: st.DrawFn, grounded: GroundGraph) -> GroundTask:
    return draw(st.sampled_from([node for node in grounded.nodes if node.calls]))


def _stuck(draw: st.DrawFn, graph: TaskGraph, grid: Grid) -> Fault:
    """Guard all children of a task against a state in which it runs."""
    node = _a_node(draw, ground(graph, grid.model))
    task = graph.tasks[node.task]
    guard = _but_for(graph, task, int(draw(st.sampled_from(np.flatnonzero(node.live).tolist()))))
    return Fault(_with(graph, replace(task, do=tuple(call.when(guard) for call in task.do))), task.name)


def _ends_short(draw: st.DrawFn, graph: TaskGraph, grid: Grid) -> Fault:
    """Take from a task's goal a state in which it may end, and whatever it had to say of ending short."""
    grounded = ground(graph, grid.model)
    node = _a_node(draw, grounded)
    place, task = grounded.place(node.name), graph.tasks[node.task]
    called = node.live & grid.model.starts if place == grounded.root else _called(grounded, place)
    at = int(draw(st.sampled_from(np.flatnonzero(course(grounded, place, called).ends).tolist())))
    goal = _but_for(graph, task, at)
    return Fault(_with(graph, replace(task, goal=goal, pseudo_reward=None)), task.name)


def _called(grounded: GroundGraph, place: int) -> np.typing.NDArray[np.bool_]:
    calls = [call.available for node in grounded.nodes for call in node.calls if call.child == place]
    return np.logical_or.reduce(calls)


def _out_of_reach(draw: st.DrawFn, graph: TaskGraph, _: Grid) -> Fault:
    """Let Light walk instead of pressing, so that it cannot end, or not at its goal."""
    cell, lamp, _mark = graph.variables
    light = replace(graph.tasks["Light"], do=tuple(map(Call, ACTIONS[:-1])), uses=("cell", "lamp"))
    if draw(st.booleans()):
        places = list(cell.domain.values)
        some = draw(st.lists(st.sampled_from(places), min_size=1, max_size=len(places) - 1, unique=True))
        until = lamp.eq("on") | cell.isin(some)
        light = replace(light, until=until, goal=lamp.eq("on"), pseudo_reward=-9.0)
    return Fault(_with(graph, light), "Light")


def _strays(draw: st.DrawFn, graph: TaskGraph, grid: Grid) -> Fault:
    """Add a task that works in some cells and calls Goto with another."""
    outside = draw(st.sampled_from(grid.cells))
    cell = graph.variables[0]
    within = cell.ne(outside)
    root, goto = graph.root, graph.tasks["Goto"]
    start = draw(st.sampled_from([place for place in grid.cells if place != outside]))
    low = Task("Low", (), cell.eq(start), within, ("cell",), (goto(to=outside), *map(Call, ACTIONS)))
    assume(len(grid.cells) > 2)
    root = replace(root, do=(Call("Low"), *root.do))
    return Fault(_with(graph, low, root), "Low", "Goto")


FAULTS = {
    "hidden variable": _hidden_variable,
    "unknown variable": _unknown_variable,
    "mistyped variable": _mistyped_variable,
    "mistyped comparison": _mistyped_comparison,
    "unknown parameter": _unknown_parameter,
    "mistyped parameter": _mistyped_parameter,
    "unbound parameter": _unbound_parameter,
    "unknown child": _unknown_child,
    "no children": _no_children,
    "cycle": _cycle,
    "unreachable": _unreachable,
    "never runs": _never_runs,
    "never starts": _never_starts,
    "never ends": _never_ends,
    "no goal": _no_goal,
    "stuck": _stuck,
    "ends short": _ends_short,
    "out of reach": _out_of_reach,
    "strays": _strays,
}


@settings(max_examples=60, deadline=None)
@given(runs())
def test_sound_graphs_pass_and_run(run: tuple[Grid, TaskGraph]) -> None:
    """A sound graph has no findings, grounds, and its root ends from every start, with and without C~."""
    grid, graph = run
    assert check(graph, grid.model) == ()
    grounded = ground(graph, grid.model)
    assert {node.task for node in grounded.nodes} == {*ACTIONS, *graph.tasks}
    starts = np.flatnonzero(grid.model.starts).tolist()
    for learner in (MaxQ(grounded, seed=(1,)), MaxQQ(grounded, seed=(1,))):
        steps = np.array([learner.train(grounded.root, [start], episodes=1)[0] for start in starts])
        assert ((steps == 0) == grounded.nodes[-1].terminal[starts]).all()


@pytest.mark.parametrize("kind", FAULTS)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_one_fault_is_found(kind: str, data: st.DataObject) -> None:
    """A sound graph with one fault put in has a finding of that kind, at that task and edge."""
    grid, graph = data.draw(runs())
    fault = data.draw(st.composite(FAULTS[kind])(graph, grid))
    findings = check(fault.graph, grid.model)
    places = [finding.where.partition(" -> ") for finding in findings if finding.kind == kind]
    assert any(at.startswith(fault.task) and child.startswith(fault.child) for at, _, child in places)


def _as_in_the_slow_search(grounded: GroundGraph, wanted: list[bool]) -> None:
    """Compare what each task may come to, and from where it may come to what is wanted, with the slow way."""
    states = range(grounded.model.index.size)
    origins = Origins(grounded)
    for place, node in enumerate(grounded.nodes):
        if not node.calls:
            continue
        slow = [ways_to_end(grounded, place, state) for state in states]
        for state in states:
            entry = np.zeros(len(states), dtype=np.bool_)
            entry[state] = node.live[state]
            then = course(grounded, place, entry)
            decided, ended = slow[state] if node.live[state] else (set(), set())
            assert set(np.flatnonzero(then.decides).tolist()) == decided
            assert set(np.flatnonzero(then.ends).tolist()) == ended
        ends = node.terminal & np.array(wanted)
        found = origins.of(place, ends)
        assert found.tolist() == [any(ends[list(ended)]) for _, ended in slow]


@settings(max_examples=60, deadline=None)
@given(ground_graphs(), st.data())
def test_ways_to_end_are_those_of_the_slow_search(grounded: GroundGraph, data: st.DataObject) -> None:
    """Forwards and backwards, by call and return, in worlds of chance in which some tasks never end."""
    size = grounded.model.index.size
    _as_in_the_slow_search(grounded, data.draw(st.lists(st.booleans(), min_size=size, max_size=size)))


@settings(max_examples=8, deadline=None)
@given(runs(), st.data())
def test_ways_to_end_in_working_spaces(run: tuple[Grid, TaskGraph], data: st.DataObject) -> None:
    """The same with working spaces, initiations, parameters and goals among the terminations."""
    grid, graph = run
    size = grid.model.index.size
    wanted = data.draw(st.lists(st.booleans(), min_size=size, max_size=size))
    _as_in_the_slow_search(ground(graph, grid.model), wanted)


def test_random_graphs_have_it_all() -> None:
    """What the generators promise is drawn: working spaces, goals, initiations, bound variables, chance."""
    seen: Counter[str] = Counter()

    @settings(max_examples=150, deadline=None, database=None, derandomize=True)
    @given(runs())
    def look(run: tuple[Grid, TaskGraph]) -> None:
        grid, graph = run
        tasks = graph.tasks.values()
        predicates = [p for t in tasks for p in (t.until, t.start, *(c.guard for c in t.do))]
        words = " ".join(map(str, predicates))
        bound = [to for task in tasks for call in task.do for _, to in call.binding]
        grounded = ground(graph, grid.model)
        seen["working space"] += any((~n.live & ~n.terminal).any() for n in grounded.nodes)
        seen["ends short"] += any((n.terminal & ~n.goal).any() for n in grounded.nodes)
        seen["initiation"] += any(task.start != ALWAYS for task in tasks if task.name != "Choosy")
        seen["variable"] += any(isinstance(to, Var) for to in bound)
        seen["parameter"] += any(isinstance(to, Param) for to in bound)
        seen["implication"] += "implies" in words
        seen["order"] += any(sign in words for sign in "<>")
        seen["chance"] += bool((grid.model.probabilities[..., 1] > 0).any())
        seen["inner wall"] += any(
            abs(a - c) + abs(b - d) == 1 and (c, d) not in grid.beside[a, b]
            for a, b in grid.cells
            for c, d in grid.cells
        )

    look()
    assert all(seen[what] >= 10 for what in seen), seen
