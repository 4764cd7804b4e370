"""Tabular learners compiled for one ground graph, bit-identical to the readable ones; loads numba."""

from planners.compiled.learners import CompiledFlatQ, CompiledMaxQ, CompiledMaxQQ
from planners.compiled.runs import Compiled

__all__ = ["Compiled", "CompiledFlatQ", "CompiledMaxQ", "CompiledMaxQQ"]
