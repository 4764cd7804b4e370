"""Comparisons in a predicate that say nothing: their sides can share no value, or have no common order."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import Any, Final

from hierarchy.predicates import AllOf, AnyOf, Implies, Not, Predicate
from hierarchy.terms import Constant, Equal, Member, Ordered, Term
from worlds import Variable

_LISTED: Final = 12  # a maze has many cells


def mistakes(predicate: Predicate) -> Iterator[tuple[str, str]]:
    """Yield the problem and the mend of every comparison that is wrong whatever the state.

    A value outside a term's domain is refused when a predicate is made of the term; one that is built by
    hand is found here.

    Examples
    --------
    >>> from hierarchy import Var
    >>> x, lamp = Var(Variable("x", (0, 1))), Var(Variable("lamp", ("off", "on")))
    >>> list(mistakes(x.eq(0) & ~x.eq(lamp)))
    [('x = lamp compares terms that share no value', "compare 'x' with one of 0, 1")]
    >>> for problem, mend in mistakes(x.lt("on")):
    ...     print(problem, "|", mend)
    x < on compares values that have no order | compare 'x' with its own sort of values, or use eq, ne or isin
    """
    for part in _comparisons(predicate):
        match part:
            case Equal(left, Constant() as right) if right.value not in left.domain:
                yield f"{part}, but {right} is not a value of {left.name!r}", _compare(left)
            case Equal(left, Term() as right) if not set(left.domain.values) & set(right.domain.values):
                yield f"{part} compares terms that share no value", _compare(left)
            case Member(left, right) if not right.values <= set(left.domain.values):
                yield f"{part}, but not all of these are values of {left.name!r}", _compare(left)
            case Ordered(_, left, right) if not _have_order(left, right):
                yield (
                    f"{part} compares values that have no order",
                    f"compare {str(left)!r} with its own sort of values, or use eq, ne or isin",
                )


def words(domain: Variable) -> str:
    """Return the labels of a domain's values, the first ones of many.

    Examples
    --------
    >>> words(Variable("lamp", ("off", "on")))
    'off, on'
    """
    more = ", ..." if len(domain) > _LISTED else ""
    return ", ".join(domain.labels[:_LISTED]) + more


def _comparisons(predicate: Predicate) -> Iterator[Equal | Ordered | Member]:
    """Yield the comparisons that a predicate is built of."""
    match predicate:
        case Equal() | Ordered() | Member():
            yield predicate
        case Not(inner):
            yield from _comparisons(inner)
        case Implies(premise, conclusion):
            yield from _comparisons(premise)
            yield from _comparisons(conclusion)
        case AllOf(parts) | AnyOf(parts):
            for part in parts:
                yield from _comparisons(part)


def _compare(term: Term) -> str:
    return f"compare {term.name!r} with one of {words(term.domain)}"


def _have_order(left: Term | Constant, right: Term | Constant) -> bool:
    try:
        for a in _values(left):
            for b in _values(right):
                _before(a, b)
    except TypeError:
        return False
    return True


def _before(left: Any, right: Any) -> bool:
    return bool(left < right)


def _values(side: Term | Constant) -> tuple[Hashable, ...]:
    return (side.value,) if isinstance(side, Constant) else side.domain.values
