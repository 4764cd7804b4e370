"""The task-graph DSL: predicates as data, tasks, validation, grounding, value counts, drawing."""

from hierarchy.abstraction import prove_abstraction
from hierarchy.abstraction_counts import TableSize, TableSizes, table_sizes
from hierarchy.abstraction_funnel import discounted_funnels
from hierarchy.abstraction_report import AbstractionReport, EdgeReport
from hierarchy.abstraction_sets import DerivedEdge, DerivedUses, derive_uses
from hierarchy.abstraction_verdict import Judgement, Verdict, Witness
from hierarchy.check import Finding, check, checked
from hierarchy.counts import ValueCounts, value_counts
from hierarchy.drawing import dot, mermaid, task_graph_picture
from hierarchy.exits import Exits, evaluate, primitive_exits, task_exits
from hierarchy.graph import Call, Task, TaskGraph, TaskGraphError
from hierarchy.grounding import GroundCall, GroundGraph, GroundTask, Leaf, ground
from hierarchy.predicates import ALWAYS, Constant, Param, Predicate, Term, ValueSet, Var
from hierarchy.two_rooms import two_rooms

__all__ = [
    "ALWAYS",
    "AbstractionReport",
    "Call",
    "Constant",
    "DerivedEdge",
    "DerivedUses",
    "EdgeReport",
    "Exits",
    "Finding",
    "GroundCall",
    "GroundGraph",
    "GroundTask",
    "Judgement",
    "Leaf",
    "Param",
    "Predicate",
    "TableSize",
    "TableSizes",
    "Task",
    "TaskGraph",
    "TaskGraphError",
    "Term",
    "ValueCounts",
    "ValueSet",
    "Var",
    "Verdict",
    "Witness",
    "check",
    "checked",
    "derive_uses",
    "discounted_funnels",
    "dot",
    "evaluate",
    "ground",
    "mermaid",
    "primitive_exits",
    "prove_abstraction",
    "table_sizes",
    "task_exits",
    "task_graph_picture",
    "two_rooms",
    "value_counts",
]
