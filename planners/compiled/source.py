"""Numba source for the shapes of a ground graph: constants folded in, loops over actions unrolled.

Every function is inlined into the two entries, `learn` and `follow`, so that a kernel is one nest of loops
without calls.
"""

from __future__ import annotations

from planners.compiled.calling import calling_task
from planners.compiled.frame import ACTING, HEAD, LEARNING, follow_entry, learn_entry
from planners.compiled.kernel import Kernel
from planners.compiled.unrolled import unrolled_task
from planners.compiled.writing import block, lines


def kernel_source(kernel: Kernel) -> str:
    """Return the source of a module that holds the kernel's entries, `learn` and `follow`."""
    parts = [HEAD]
    for shape in kernel.shapes.shapes:
        parts += unrolled_task(kernel, shape) if shape.unrolled else calling_task(kernel, shape)
    parts += [learn_entry(_call(kernel, "run", LEARNING)), follow_entry(_call(kernel, "follow", ACTING))]
    return "\n\n".join(parts)


def _call(kernel: Kernel, what: str, given: str) -> str:
    """Write the call of the function that belongs to a task's shape."""
    found: list[str] = []
    for shape in kernel.shapes.shapes:
        told = ", ".join(f"me[{field + 1}]" for field in range(shape.told))
        call = f"t, c, left = {what}_{shape.number}({told}, s, c, left, {given})"
        found.append(block(f"{'elif' if found else 'if'} me[0] == {shape.number}:", call))
    return lines(*found)
