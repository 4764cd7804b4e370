"""The task-graph DSL: predicates as data, tasks, validation, grounding, value counts, drawing."""

from hierarchy.check import Finding, check, checked
from hierarchy.counts import ValueCounts, value_counts
from hierarchy.drawing import mermaid, task_graph_picture
from hierarchy.graph import Call, Task, TaskGraph, TaskGraphError
from hierarchy.grounding import GroundCall, GroundGraph, GroundTask, Leaf, ground
from hierarchy.predicates import ALWAYS, Constant, Param, Predicate, Term, ValueSet, Var
from hierarchy.two_rooms import two_rooms

__all__ = [
    "ALWAYS",
    "Call",
    "Constant",
    "Finding",
    "GroundCall",
    "GroundGraph",
    "GroundTask",
    "Leaf",
    "Param",
    "Predicate",
    "Task",
    "TaskGraph",
    "TaskGraphError",
    "Term",
    "ValueCounts",
    "ValueSet",
    "Var",
    "check",
    "checked",
    "ground",
    "mermaid",
    "task_graph_picture",
    "two_rooms",
    "value_counts",
]
