"""Static validation of a task graph: every finding names the task, the edge and the mend."""

from __future__ import annotations

from hierarchy.check_behaviour import behaviour_findings
from hierarchy.check_declaration import declaration_findings
from hierarchy.finding import Finding
from hierarchy.graph import TaskGraph, TaskGraphError
from hierarchy.grounding import GroundGraph, ground
from worlds import TransitionModel

__all__ = ["Finding", "check", "checked", "examine"]


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
    """Return what `check` finds, and the ground graph if the declaration allows grounding at all.

    Examples
    --------
    >>> from hierarchy import two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> findings, grounded = examine(two_rooms(maze), maze_model(maze))
    >>> findings, len(grounded.nodes)
    ((), 15)
    """
    findings = tuple(declaration_findings(graph))
    if findings:
        return findings, None
    grounded = ground(graph, model)
    return tuple(behaviour_findings(grounded)), grounded


def checked(graph: TaskGraph, model: TransitionModel) -> GroundGraph:
    """Ground a task graph that passes `check`.

    Raises
    ------
    TaskGraphError
        If it does not; the message lists every finding.

    Examples
    --------
    >>> from worlds import StateIndex, Variable
    >>> import numpy as np
    >>> x, right = StateIndex((Variable("x", (0, 1, 2)),)), np.array([[1], [2], [2]])
    >>> model = TransitionModel(x, ("right",), right, np.full((3, 1), -1.0), np.ones(3, bool))
    >>> graph = TaskGraph("corridor", x.variables, model.actions)
    >>> (at,) = graph.variables
    >>> _ = graph.task("Root", until=at.eq(2), uses=[at], do="rihgt")
    >>> checked(graph, model)
    Traceback (most recent call last):
        ...
    hierarchy.graph.TaskGraphError: task graph corridor cannot run:
      Root -> rihgt: 'rihgt' is no task or action; did you mean 'right'?
    """
    findings, grounded = examine(graph, model)
    if findings or grounded is None:
        listed = "\n".join(f"  {finding}" for finding in findings)
        raise TaskGraphError(f"task graph {graph.name} cannot run:\n{listed}")
    return grounded
