"""Tabular learners compiled for one ground graph, bit-identical to the readable ones; loads numba."""

from planners.compiled.learners import Compiled, CompiledFlatQ, CompiledMaxQ, CompiledMaxQQ

__all__ = ["Compiled", "CompiledFlatQ", "CompiledMaxQ", "CompiledMaxQQ"]
