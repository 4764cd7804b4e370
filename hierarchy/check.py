"""Static validation of a task graph: every finding names the task, the edge and the mend."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from hierarchy.graph import Call, Task, TaskGraph, TaskGraphError
from hierarchy.grounding import GroundCall, GroundGraph, GroundTask, ground
from hierarchy.predicates import Predicate
from hierarchy.terms import Param, Term, Var
from worlds import TransitionModel, suggest


@dataclass(frozen=True)
class Finding:
    """One fault of a task graph.

    `where` is a task, or an edge written ``parent -> child``.
    """

    kind: str
    where: str
    problem: str
    mend: str

    def __str__(self) -> str:
        return f"{self.where}: {self.problem}; {self.mend}"


def check(graph: TaskGraph, model: TransitionModel) -> tuple[Finding, ...]:
    """Return everything that is wrong with a task graph on a world; empty if it may run.

    The declaration is checked first; what needs the world's states (terminations that never hold,
    children that never run, states without a runnable child, goals out of reach) only once that is clean.

    Examples
    --------
    >>> from hierarchy import two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> check(two_rooms(maze), maze_model(maze))
    ()
    """
    return examine(graph, model)[0]


def examine(graph: TaskGraph, model: TransitionModel) -> tuple[tuple[Finding, ...], GroundGraph | None]:
    """Return what `check` finds, and the ground graph if the declaration allows grounding at all."""
    findings = tuple(_declaration(graph))
    if findings:
        return findings, None
    grounded = ground(graph, model)
    return tuple(_behaviour(grounded)), grounded


def checked(graph: TaskGraph, model: TransitionModel) -> GroundGraph:
    """Ground a task graph that passes `check`.

    Raises
    ------
    TaskGraphError
        If it does not; the message lists every finding.
    """
    findings, grounded = examine(graph, model)
    if findings or grounded is None:
        listed = "\n".join(f"  {finding}" for finding in findings)
        raise TaskGraphError(f"task graph {graph.name} cannot run:\n{listed}")
    return grounded


def _declaration(graph: TaskGraph) -> Iterator[Finding]:
    for task in graph.tasks.values():
        for name in task.uses:
            if name not in graph.index.names:
                yield Finding(
                    "unknown variable",
                    task.name,
                    f"it uses {name!r}, which is no state variable of the world",
                    _suggest(name, graph.index.names, "state variables"),
                )
        yield from _predicate(graph, task, task.name, "until", task.until)
        yield from _predicate(graph, task, task.name, "within", task.within)
        yield from _predicate(graph, task, task.name, "start", task.start)
        yield from _predicate(graph, task, task.name, "goal", task.goal)
        if not task.do:
            yield Finding("no children", task.name, "it has nothing to do", "give it children with do=...")
        for call in task.do:
            yield from _edge(graph, task, call)
    structure = graph.networkx()
    for cycle in nx.simple_cycles(nx.DiGraph(structure)):
        ring = " -> ".join((*cycle, cycle[0]))
        yield Finding(
            "cycle", cycle[0], f"tasks call each other in a ring, {ring}", "remove one of its edges"
        )
    used = {graph.root.name} | nx.descendants(structure, graph.root.name)
    for name in graph.tasks:
        if name not in used:
            yield Finding(
                "unreachable",
                name,
                f"no path leads to it from the root {graph.root.name}",
                "call it, or remove it (the root is the task that is added last)",
            )


def _predicate(graph: TaskGraph, task: Task, where: str, key: str, predicate: Predicate) -> Iterator[Finding]:
    params = {param.name for param in task.params}
    for name in sorted(predicate.parameters() - params):
        yield Finding(
            "unknown parameter",
            where,
            f"{key} ({predicate}) reads parameter {name!r}, which {task.name} does not have",
            _suggest(name, params, "parameters"),
        )
    for name in sorted(predicate.variables()):
        if name not in graph.index.names:
            yield Finding(
                "unknown variable",
                where,
                f"{key} ({predicate}) reads {name!r}, which is no state variable of the world",
                _suggest(name, graph.index.names, "state variables"),
            )
        elif name not in task.uses:
            yield Finding(
                "hidden variable",
                where,
                f"{key} ({predicate}) reads {name!r}, which is not among the relevant variables",
                f"add {name!r} to the uses of {task.name}",
            )


def _edge(graph: TaskGraph, task: Task, call: Call) -> Iterator[Finding]:
    where = f"{task.name} -> {call.child}"
    yield from _predicate(graph, task, where, "when", call.guard)
    for name in call.relevant or ():
        if name not in task.uses:
            yield Finding(
                "hidden variable",
                where,
                f"the edge uses {name!r}, which {task.name} does not",
                f"add {name!r} to the uses of {task.name}",
            )
    if call.child in graph.actions:
        return
    if call.child not in graph.tasks:
        known = (*graph.tasks, *graph.actions)
        yield Finding(
            "unknown child",
            where,
            f"{call.child!r} is no task or action",
            _suggest(call.child, known, "children"),
        )
        return
    bound = dict(call.binding)
    for param in graph.tasks[call.child].params:
        if param.name not in bound:
            yield Finding(
                "unbound parameter",
                where,
                f"parameter {param.name!r} is not bound",
                f"write {call.child}({param.name}=...)",
            )
        elif isinstance(term := bound[param.name], Term):
            yield from _bound_term(graph, task, where, param, term)


def _bound_term(graph: TaskGraph, task: Task, where: str, param: Param, term: Term) -> Iterator[Finding]:
    if isinstance(term, Var) and term.name not in graph.index.names:
        mend = _suggest(term.name, graph.index.names, "state variables")
        yield Finding("unknown variable", where, f"{term.name!r} is no state variable of the world", mend)
    elif isinstance(term, Param) and term not in task.params:
        mend = _suggest(term.name, [own.name for own in task.params], "parameters")
        yield Finding("unknown parameter", where, f"{term.name!r} is no parameter of {task.name}", mend)
    elif isinstance(term, Var) and set(term.domain.values) & set(param.domain.values):
        return  # the child is called where the variable has a value that the parameter can take
    elif not set(term.domain.values) <= set(param.domain.values):
        yield Finding(
            "mistyped parameter",
            where,
            f"{term.name!r} takes values that {param.name!r} does not",
            f"give {param.name!r} all of {', '.join(term.domain.labels)}",
        )


def _behaviour(grounded: GroundGraph) -> Iterator[Finding]:
    reachable = grounded.model.reachable()
    called = {grounded.root: grounded.model.starts}
    for place in range(grounded.root, len(grounded.model.actions) - 1, -1):
        task = grounded.nodes[place]
        for call in task.calls:
            called[call.child] = called.get(call.child, np.False_) | (call.available & reachable)
            if not (call.available & reachable).any():
                child = grounded.nodes[call.child].name
                yield Finding(
                    "never runs",
                    f"{task.name} -> {child}",
                    "the child can never run: guard, working space and termination leave no state",
                    "relax the guard (when), or remove the edge",
                )
            yield from _straying(grounded, task, call, call.available & reachable)
        yield from _ending(grounded, task, called[place] & task.live, reachable)


def _straying(
    grounded: GroundGraph, task: GroundTask, call: GroundCall, called: NDArray[np.bool_]
) -> Iterator[Finding]:
    """Check that a child task does not end where its caller neither runs nor ends."""
    child = grounded.nodes[call.child]
    if not child.calls:
        return
    strays = _passed(grounded, child, called) & child.terminal & ~task.live & ~task.terminal
    if strays.any():
        yield Finding(
            "strays",
            f"{task.name} -> {child.name}",
            f"the child can end outside its caller's working space, such as {_describe(grounded, strays)}",
            f"widen the working space (within) of {task.name}, or narrow that of {child.name}",
        )


def _ending(
    grounded: GroundGraph, task: GroundTask, called: NDArray[np.bool_], reachable: NDArray[np.bool_]
) -> Iterator[Finding]:
    """Check that a task ends, can end from wherever it is called, and always has something to do."""
    if not (task.terminal & reachable).any():
        problem = f"its termination ({grounded.graph.tasks[task.task].until}) never holds"
        yield Finding("never ends", task.name, problem, "mend its until")
        return
    short = task.terminal & ~task.goal & _passed(grounded, task, called)
    if short.any() and task.pseudo_reward is None:
        yield Finding(
            "ends short",
            task.name,
            f"it can end without reaching its goal, such as in {_describe(grounded, short)}",
            "give it a pseudo_reward below what finishing costs, or a learner will quit early",
        )
    if task.terminal[reachable].any() and not (task.goal & reachable).any():
        problem = f"its goal ({grounded.graph.tasks[task.task].goal}) holds at none of its terminations"
        yield Finding("no goal", task.name, problem, "mend its goal or its until")
    stuck = task.live & reachable & ~np.logical_or.reduce([call.available for call in task.calls])
    if stuck.any():
        yield Finding(
            "stuck",
            task.name,
            f"in {int(stuck.sum())} states it runs but no child can, such as {_describe(grounded, stuck)}",
            "widen a child's guard (when), or end the task there (until)",
        )
    lost = called & ~_can_end(grounded, task)
    if lost.any():
        yield Finding(
            "out of reach",
            task.name,
            f"called in {int(lost.sum())} states it cannot end from, such as {_describe(grounded, lost)}",
            "call it elsewhere (when), widen its working space (within), or mend its until",
        )


def _passed(grounded: GroundGraph, task: GroundTask, called: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the states that a task may pass through or end in when called in `called`."""
    passed = called.copy()
    moves = list(_moves(grounded, task))
    while True:
        more = passed.copy()
        for action, available in moves:
            more[grounded.model.following(passed & available & ~task.terminal, action)] = True
        if (more == passed).all():
            return passed
        passed = more


def _can_end(grounded: GroundGraph, task: GroundTask) -> NDArray[np.bool_]:
    """Return the states from which the actions below a task can end it, shape (states,)."""
    moves = list(_moves(grounded, task))
    ends = task.terminal.copy()
    while True:
        more = ends.copy()
        for action, available in moves:
            more |= available & grounded.model.may_reach(ends)[:, action]
        if (more == ends).all():
            return ends
        ends = more


def _moves(grounded: GroundGraph, task: GroundTask) -> Iterator[tuple[int, NDArray[np.bool_]]]:
    """Yield the primitive actions that a task may come to take, and where."""
    for call in task.calls:
        child = grounded.nodes[call.child]
        if child.calls:
            yield from _moves(grounded, child)
        else:
            yield call.child, call.available


def _describe(grounded: GroundGraph, mask: NDArray[np.bool_]) -> str:
    index = grounded.model.index
    state = index.state(int(np.flatnonzero(mask)[0]))
    words = (f"{v.name} = {v.label(value)}" for v, value in zip(index.variables, state, strict=True))
    return ", ".join(words)


def _suggest(name: str, known: Iterable[str], what: str) -> str:
    return suggest(name, sorted(known), f"known {what}:")
