"""The task-graph DSL: predicates as data, tasks, validation, grounding, value counts, drawing, proofs.

What needs scipy (exits, and the proof of safe state abstraction) is loaded when it is first named.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from hierarchy.check import Finding, check, checked
from hierarchy.counts import ValueCounts, value_counts
from hierarchy.drawing import dot, mermaid, task_graph_picture
from hierarchy.graph import Call, Task, TaskGraph, TaskGraphError
from hierarchy.grounding import GroundCall, GroundGraph, GroundTask, Leaf, ground
from hierarchy.predicates import ALWAYS, Predicate
from hierarchy.terms import Constant, Param, Term, ValueSet, Var
from hierarchy.two_rooms import two_rooms

if TYPE_CHECKING:
    from hierarchy.abstraction import prove_abstraction
    from hierarchy.abstraction_counts import TableSize, TableSizes, table_sizes
    from hierarchy.abstraction_funnel import discounted_funnels
    from hierarchy.abstraction_report import AbstractionReport, EdgeReport
    from hierarchy.abstraction_sets import DerivedEdge, DerivedUses, derive_uses
    from hierarchy.abstraction_verdict import Judgement, Verdict, Witness
    from hierarchy.exits import Exits, evaluate, primitive_exits, task_exits

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

_ON_DEMAND = {
    "prove_abstraction": "hierarchy.abstraction",
    "TableSize": "hierarchy.abstraction_counts",
    "TableSizes": "hierarchy.abstraction_counts",
    "table_sizes": "hierarchy.abstraction_counts",
    "discounted_funnels": "hierarchy.abstraction_funnel",
    "AbstractionReport": "hierarchy.abstraction_report",
    "EdgeReport": "hierarchy.abstraction_report",
    "DerivedEdge": "hierarchy.abstraction_sets",
    "DerivedUses": "hierarchy.abstraction_sets",
    "derive_uses": "hierarchy.abstraction_sets",
    "Judgement": "hierarchy.abstraction_verdict",
    "Verdict": "hierarchy.abstraction_verdict",
    "Witness": "hierarchy.abstraction_verdict",
    "Exits": "hierarchy.exits",
    "evaluate": "hierarchy.exits",
    "primitive_exits": "hierarchy.exits",
    "task_exits": "hierarchy.exits",
}


def __getattr__(name: str) -> Any:
    if name not in _ON_DEMAND:
        raise AttributeError(f"module 'hierarchy' has no attribute {name!r}")
    return getattr(import_module(_ON_DEMAND[name]), name)
