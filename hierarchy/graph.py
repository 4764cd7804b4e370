"""Declaring a task graph: tasks, parameters, guarded calls, on networkx."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, replace

import networkx as nx

from hierarchy.predicates import ALWAYS, Predicate
from hierarchy.terms import Constant, Param, Term, Var
from worlds import StateIndex, UserError, Variable


class TaskGraphError(UserError):
    """A task graph is declared wrongly; the message names the task, the edge and the mend."""


@dataclass(frozen=True)
class Call:
    """An edge from a task to a child: a task with its parameters bound, or a primitive action.

    Parameters
    ----------
    child
        Name of the child task or primitive action.
    binding
        What each of the child's parameters is bound to: a value, a state variable, or one of the
        caller's own parameters.
    guard
        Where the child may be called, besides not being terminated there.
    relevant
        The state variables that the child's completion depends on; None means the caller's `uses`.
    """

    child: str
    binding: tuple[tuple[str, Term | Constant], ...] = ()
    guard: Predicate = ALWAYS
    relevant: tuple[str, ...] | None = None

    def when(self, guard: Predicate) -> Call:
        """Return the call with a guard (`when`), besides any that it has."""
        return replace(self, guard=guard if self.guard == ALWAYS else self.guard & guard)

    def using(self, *variables: Var) -> Call:
        """Return the call with its own relevant variables, fewer than the caller's (`uses` of an edge).

        Sound where the child's result does not depend on the rest (result-distribution irrelevance and
        termination: Dietterich 2000, sections 5.1.3 and 5.1.4).
        """
        return replace(self, relevant=tuple(variable.name for variable in variables))

    def __str__(self) -> str:
        bound = ", ".join(f"{name}={value}" for name, value in self.binding)
        return f"{self.child}({bound})" if bound else self.child


@dataclass(frozen=True)
class Task:
    """A task: when it ends, where it works, what matters to it, and what it may do.

    Calling a task with keywords binds its parameters and gives a `Call`.
    """

    name: str
    params: tuple[Param, ...]
    until: Predicate
    within: Predicate
    uses: tuple[str, ...]
    do: tuple[Call, ...]
    start: Predicate = ALWAYS
    goal: Predicate = ALWAYS
    pseudo_reward: float | None = None

    def __call__(self, **binding: Term | Hashable) -> Call:
        """Bind parameters for a call.

        Raises
        ------
        TaskGraphError
            If a parameter is unknown or a value is not in its domain.
        """
        by_name = {param.name: param for param in self.params}
        bound: list[tuple[str, Term | Constant]] = []
        for name, value in binding.items():
            if name not in by_name:
                known = ", ".join(by_name) or "none"
                raise TaskGraphError(f"task {self.name}: unknown parameter {name!r}; its parameters: {known}")
            if isinstance(value, Term):
                bound.append((name, value))
                continue
            try:
                bound.append((name, by_name[name].constant(value)))
            except ValueError as error:
                raise TaskGraphError(f"task {self.name}, parameter {name!r}: {error}") from None
        return Call(self.name, tuple(bound))


class TaskGraph:
    """A task graph under construction: tasks are added from the leaves up, the root last.

    Parameters
    ----------
    name
        The graph's name.
    variables
        The world's state variables.
    actions
        The world's primitive actions, in the order that breaks ties.

    Examples
    --------
    >>> x = Variable("x", (0, 1, 2))
    >>> graph = TaskGraph("corridor", [x], ["left", "right"])
    >>> (pos,) = graph.variables
    >>> to = Param.over("to", {"near": 0, "far": 2})
    >>> go = graph.task("Go", to, until=pos.eq(to), uses=[pos], do="left right")
    >>> root = graph.task("Root", until=pos.eq(2), uses=[pos], do=[go(to=2)])
    >>> print(root.do[0], "|", graph.tasks["Go"].until)
    Go(to=far) | x = to
    """

    def __init__(self, name: str, variables: Sequence[Variable], actions: Sequence[str]) -> None:
        self.name = name
        self.index = StateIndex(tuple(variables))
        self.variables = tuple(Var(variable) for variable in variables)
        self.actions = tuple(actions)
        self.tasks: dict[str, Task] = {}

    def task(
        self,
        name: str,
        *params: Param,
        until: Predicate,
        do: str | Iterable[Call | str],
        uses: Iterable[Var],
        within: Predicate = ALWAYS,
        start: Predicate = ALWAYS,
        goal: Predicate = ALWAYS,
        pseudo_reward: float | None = None,
    ) -> Task:
        """Add a task and return it.

        Parameters
        ----------
        name
            The task's name; the last task added is the root.
        *params
            Its parameters.
        until
            Its termination: it ends in every state in which this holds.
        do
            Its children: calls of other tasks and names of primitive actions (one string of names will do).
        uses
            The state variables that matter to it (max-node irrelevance); its parameters always do.
        within
            Its working space: it can be called only here, and a primitive action of its own that would
            leave this space without ending the task is not available to it (section 5.3.1 of the paper:
            "its working space is an eight-by-four room").
        start
            Its initiation: it can be called only where this holds, too.
        goal
            Which of its terminations are good ones. Defaults to all.
        pseudo_reward
            What a learner is taught to expect of the other terminations (MAXQ-Q; Dietterich 2000,
            sections 3.2 and 4.4): below what finishing costs, lest the task learns to quit early.

        Raises
        ------
        TaskGraphError
            If the name is taken.
        """
        if name in self.tasks or name in self.actions:
            raise TaskGraphError(f"task {name}: the name is taken by another task or action; choose another")
        words = do.split() if isinstance(do, str) else do
        calls = tuple(Call(child) if isinstance(child, str) else child for child in words)
        task = Task(
            name,
            params,
            until,
            within,
            tuple(variable.name for variable in uses),
            calls,
            start,
            goal,
            pseudo_reward,
        )
        self.tasks[name] = task
        return task

    @property
    def root(self) -> Task:
        """The last task added."""
        if not self.tasks:
            raise TaskGraphError(f"graph {self.name}: it has no tasks; add one with task(...)")
        return list(self.tasks.values())[-1]

    def networkx(self) -> nx.MultiDiGraph[str]:
        """Return tasks and actions as a multigraph; each edge holds its `call`, each node its `kind`."""
        graph: nx.MultiDiGraph[str] = nx.MultiDiGraph(name=self.name)
        for name in self.tasks:
            graph.add_node(name, kind="root" if name == self.root.name else "task")
        for name in self.actions:
            graph.add_node(name, kind="action")
        for task in self.tasks.values():
            for call in task.do:
                graph.add_edge(task.name, call.child, call=call)
        return graph
