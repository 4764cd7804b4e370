"""Task graphs as text: ``load_graph`` and ``parse_graph`` read it, ``graph_text`` writes it.

docs/task-graph-text.md describes the form. ``import hierarchy`` alone does not load this.
"""

from hierarchy.schema import json_schema
from hierarchy.text_nodes import Fault, TaskGraphTextError
from hierarchy.text_reading import LoadedGraph, graph_names, load_graph, parse_graph
from hierarchy.text_words import PredicateError
from hierarchy.text_worlds import TextWorld, load_world, maze_world, world_names
from hierarchy.text_writing import graph_text

__all__ = [
    "Fault",
    "LoadedGraph",
    "PredicateError",
    "TaskGraphTextError",
    "TextWorld",
    "graph_names",
    "graph_text",
    "json_schema",
    "load_graph",
    "load_world",
    "maze_world",
    "parse_graph",
    "world_names",
]
