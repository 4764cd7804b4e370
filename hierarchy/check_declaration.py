"""What is wrong with a task graph as it is declared, whatever world it runs in: names, types, structure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import networkx as nx

from hierarchy.check_comparisons import mistakes, words
from hierarchy.finding import Finding
from hierarchy.graph import Call, Task, TaskGraph
from hierarchy.predicates import Predicate
from hierarchy.terms import Constant, Param, Term
from worlds import suggest


def declaration_findings(graph: TaskGraph) -> Iterator[Finding]:
    """Yield every fault that shows without a world: of names and types, edges, and the graph as a whole.

    Examples
    --------
    >>> from worlds import Variable
    >>> graph = TaskGraph("corridor", [Variable("x", (0, 1))], ["left", "right"])
    >>> (x,) = graph.variables
    >>> _ = graph.task("Root", until=x.eq(1), uses=[], do="right")
    >>> for finding in declaration_findings(graph):
    ...     print(finding)
    Root: until (x = 1) reads 'x', which is not among the relevant variables; add 'x' to the uses of Root
    """
    for task in graph.tasks.values():
        for name in task.uses:
            if name not in graph.index.names:
                yield _unknown_variable(graph, task.name, f"it uses {name!r}", name)
        for key, predicate in (
            ("until", task.until),
            ("within", task.within),
            ("start", task.start),
            ("goal", task.goal),
        ):
            yield from _predicate(graph, task, task.name, key, predicate)
        if not task.do:
            yield Finding("no children", task.name, "it has nothing to do", "give it children with do=...")
        for call in task.do:
            yield from _edge(graph, task, call)
    for param in graph.root.params:
        yield Finding(
            "unbound parameter",
            graph.root.name,
            f"parameter {param.name!r} of the root is not bound, for nobody calls it",
            f"add a root without parameters that calls {graph.root.name}({param.name}=...)",
        )
    yield from _structure(graph)


def _structure(graph: TaskGraph) -> Iterator[Finding]:
    structure = nx.DiGraph(graph.networkx())
    for ring in _rings(structure):
        yield Finding(
            "cycle",
            ring[0],
            f"tasks call each other in a ring, {' -> '.join((*ring, ring[0]))}",
            "remove one of its edges",
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


def _rings(structure: nx.DiGraph[str]) -> Iterator[list[str]]:
    """Yield every task that calls itself, and one ring of each set of tasks that all lead to each other.

    One will do: to list all would take time exponential in the edges.
    """
    for tasks in nx.strongly_connected_components(structure):
        for name in tasks:
            if structure.has_edge(name, name):
                yield [name]
        if len(tasks) > 1:
            inner = structure.subgraph(tasks).copy()
            inner.remove_edges_from([(name, name) for name in tasks])
            yield [edge[0] for edge in nx.find_cycle(inner)]


def _predicate(graph: TaskGraph, task: Task, where: str, key: str, predicate: Predicate) -> Iterator[Finding]:
    reads = f"{key} ({predicate}) reads"
    for term in sorted(set(predicate.terms()), key=lambda term: term.name):
        yield from _term(graph, task, where, reads, term)
    for problem, mend in mistakes(predicate):
        yield Finding("mistyped comparison", where, f"{key}: {problem}", mend)


def _term(graph: TaskGraph, task: Task, where: str, reads: str, term: Term) -> Iterator[Finding]:
    """Check that a term is one of the task's parameters, or one of its relevant variables."""
    name = term.name
    if term.is_parameter:
        yield from _parameter(task, where, reads, term)
    elif name not in graph.index.names:
        yield _unknown_variable(graph, where, f"{reads} {name!r}", name)
    elif term.domain.values != (world := graph.index.variable(name)).values:
        yield Finding(
            "mistyped variable",
            where,
            f"{reads} a {name!r} of other values than the world's",
            f"use the graph's own {name!r}, with the values {words(world)}",
        )
    elif name not in task.uses:
        yield Finding(
            "hidden variable",
            where,
            f"{reads} {name!r}, which is not among the relevant variables",
            f"add {name!r} to the uses of {task.name}",
        )


def _parameter(task: Task, where: str, reads: str, term: Term) -> Iterator[Finding]:
    own = {param.name: param.domain for param in task.params}
    if term.name not in own:
        yield Finding(
            "unknown parameter",
            where,
            f"{reads} parameter {term.name!r}, which {task.name} does not have",
            _suggest(term.name, own, "parameters"),
        )
    elif set(term.domain.values) != set(own[term.name].values):
        yield Finding(
            "mistyped parameter",
            where,
            f"{reads} a parameter {term.name!r} of other values than that of {task.name}",
            f"use the task's own {term.name!r}, with the values {words(own[term.name])}",
        )


def _edge(graph: TaskGraph, task: Task, call: Call) -> Iterator[Finding]:
    where = f"{task.name} -> {call.child}"
    yield from _predicate(graph, task, where, "when", call.guard)
    for name in call.relevant or ():
        if name not in graph.index.names:
            yield _unknown_variable(graph, where, f"the edge uses {name!r}", name)
        elif name not in task.uses:
            yield Finding(
                "hidden variable",
                where,
                f"the edge uses {name!r}, which {task.name} does not",
                f"add {name!r} to the uses of {task.name}",
            )
    if call.child not in graph.tasks and call.child not in graph.actions:
        yield Finding(
            "unknown child",
            where,
            f"{call.child!r} is no task or action",
            _suggest(call.child, (*graph.tasks, *graph.actions), "children"),
        )
        return
    params = graph.tasks[call.child].params if call.child in graph.tasks else ()
    yield from _binding(graph, task, where, call, {param.name: param for param in params})


def _binding(
    graph: TaskGraph, task: Task, where: str, call: Call, params: dict[str, Param]
) -> Iterator[Finding]:
    """Check that a call binds all of the child's parameters and nothing else, to what they can be."""
    bound = dict(call.binding)
    for name in bound:
        if name not in params:
            yield Finding(
                "unknown parameter",
                where,
                f"it binds {name!r}, which is no parameter of {call.child}",
                _suggest(name, params, "parameters"),
            )
    for name, param in params.items():
        to = bound.get(name)
        if to is None:
            yield Finding(
                "unbound parameter",
                where,
                f"parameter {name!r} is not bound",
                f"write {call.child}({name}=...)",
            )
        elif isinstance(to, Constant):
            if to.value not in param.domain:
                yield Finding(
                    "mistyped parameter",
                    where,
                    f"{to} is not a value of {name!r}",
                    f"bind it to one of {words(param.domain)}",
                )
        elif unfit := list(_term(graph, task, where, f"{name!r} is bound to", to)):
            yield from unfit
        else:
            yield from _fit(where, param, to)


def _fit(where: str, param: Param, to: Term) -> Iterator[Finding]:
    """Check that a parameter can take the values of what it is bound to.

    Of a state variable some will do: the child is called where the variable has one of these.
    """
    needed, taken = set(to.domain.values), set(param.domain.values)
    if needed <= taken or (needed & taken and not to.is_parameter):
        return
    yield Finding(
        "mistyped parameter",
        where,
        f"{to.name!r} takes values that {param.name!r} does not",
        f"give {param.name!r} all of {words(to.domain)}",
    )


def _unknown_variable(graph: TaskGraph, where: str, reads: str, name: str) -> Finding:
    return Finding(
        "unknown variable",
        where,
        f"{reads}, which is no state variable of the world",
        _suggest(name, graph.index.names, "state variables"),
    )


def _suggest(name: str, known: Iterable[str], what: str) -> str:
    return suggest(name, sorted(known), f"known {what}:")
