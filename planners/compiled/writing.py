"""Pieces of Python source that generated kernels are put together from."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import indent

from planners.compiled.tables import CALLS


def lines(*parts: str) -> str:
    r"""Return pieces of source one below the other, empty ones left out.

    >>> lines("a = 1", "", "b = 2")
    'a = 1\nb = 2'
    """
    return "\n".join(part for part in parts if part)


def block(head: str, *body: str) -> str:
    """Return a head and, indented below it, its body.

    >>> print(block("while a < 3:", "a += 1"))
    while a < 3:
        a += 1
    """
    return lines(head, indent(lines(*body), "    "))


def function(head: str, *body: str) -> str:
    """Return a function that is inlined wherever it is called; its head is its name with its arguments."""
    return block(f"@kernel(cached=False, forceinline=True)\ndef {head}:", *body) + "\n"


def either(what: str, bodies: Mapping[int, str]) -> str:
    """Write what is done by a number that is one of some; the last of them is not asked for.

    >>> print(either("k", {0: "a()", 3: "b()"}))
    if k == 0:
        a()
    else:
        b()
    """
    *some, last = bodies
    asked = (
        block(f"{'elif' if place else 'if'} {what} == {number}:", bodies[number])
        for place, number in enumerate(some)
    )
    return lines(*asked, block("else:", bodies[last])) if some else bodies[last]


def pick(name: str, by_call: Mapping[int, object]) -> str:
    """Write `name` as a function of `k`; in one expression if it counts up with it.

    >>> print(pick("x", {0: "r0 + 4", 1: "r0 + 5"}))
    x = r0 + k + 4
    >>> print(pick("action", {0: 3, 1: 1}))
    if k == 0:
        action = 3
    else:
        action = 1
    """
    halves = [str(value).rpartition(" + ") for value in by_call.values()]
    heads, steps = {head for head, _, _ in halves}, [int(step) for _, _, step in halves]
    if len(heads) == 1 and steps == list(range(steps[0], steps[0] + len(steps))):
        terms = (term for term in (*heads, "k", str(steps[0])) if term not in {"", "0"})
        return f"{name} = {' + '.join(terms)}"
    return either("k", {k: f"{name} = {value}" for k, value in by_call.items()})


def first(count: int, name: str, value: str) -> str:
    """Write `name` as the value of the first of some actions that is worth `least`.

    >>> print(first(2, "outside", "o{}"))
    outside = o1
    outside = o0 if q0 >= least else outside
    """
    others = (f"{name} = {value.format(k)} if q{k} >= least else {name}" for k in reversed(range(count - 1)))
    return lines(f"{name} = {value.format(count - 1)}", *others)


def each(span: int, body: str) -> str:
    """Write a loop over the calls `k_` that are available in the words `here`, in order."""
    bits = f"k_ = {CALLS} * j + lowest(rest)", "rest = without_lowest(rest)"
    return block(
        f"for j in range({span}):", "rest = words[here + j]", block("while rest != NONE:", *bits, body)
    )
