"""Writing predicates as their text, such that reading it gives the same predicate."""

from __future__ import annotations

import json
from typing import cast

from hierarchy.graph import TaskGraphError
from hierarchy.predicates import AllOf, AnyOf, Implies, Not, Predicate
from hierarchy.terms import Constant, Equal, Member, Ordered, Term, ValueSet
from hierarchy.text_words import Scope, bare_or, name_in_quotes, value_in_quotes
from worlds import Variable


def predicate_text(predicate: Predicate, scope: Scope) -> str:
    """Return a predicate as `parse_predicate` reads it: what it prints, with quotes where words need them.

    Examples
    --------
    >>> from hierarchy import Var
    >>> hand = Var(Variable("hand", ("empty", "cup and lid")))
    >>> predicate_text(~hand.eq("cup and lid"), Scope({"hand": hand}))
    'not (hand = "cup and lid")'
    """
    match predicate:
        case AllOf():
            return _joined(predicate.parts, ("always", "all", "and"), scope)
        case AnyOf():
            return _joined(predicate.parts, ("never", "any", "or"), scope)
        case Implies():
            premise, conclusion = (
                predicate_text(p, scope) for p in (predicate.premise, predicate.conclusion)
            )
            return f"({premise}) implies ({conclusion})"
        case Not():
            return f"not ({predicate_text(predicate.inner, scope)})"
        case _:
            return _comparison(predicate, scope)


def _joined(parts: tuple[Predicate, ...], words: tuple[str, str, str], scope: Scope) -> str:
    none, single, between = words
    if not parts:
        return none
    if len(parts) == 1:
        return f"{single} ({predicate_text(parts[0], scope)})"
    return f" {between} ".join(_part(part, scope) for part in parts)


def _part(part: Predicate, scope: Scope) -> str:
    text = predicate_text(part, scope)
    several = isinstance(part, AllOf | AnyOf) and len(part.parts) > 1
    return f"({text})" if several or isinstance(part, Implies) else text


def _comparison(predicate: Predicate, scope: Scope) -> str:
    match predicate:
        case Member(left=left, right=right):
            return f"{_name(left.name)} in {_set(left, right)}"
        case Equal(left=left, right=right):
            return f"{_name(left.name)} = {side_text(right, left.domain, scope)}"
        case Ordered(relation=relation, left=Term() as left, right=right):
            return f"{_name(left.name)} {relation} {side_text(right, left.domain, scope)}"
        case Ordered(relation=relation, left=Constant() as value, right=Term() as right):
            return f"{side_text(value, right.domain, scope)} {relation} {_name(right.name)}"
    raise TaskGraphError(f"the predicate {predicate} has no text; compare a variable or a parameter")


def side_text(side: Term | Constant, domain: Variable, scope: Scope) -> str:
    """Return a name, or a value of `domain` by its label, as `parse_side` reads it.

    A value outside the domain, which only an order can have to do with, is written as a literal.
    """
    if isinstance(side, Term):
        return _name(side.name)
    if side.value in domain:
        label = domain.label(side.value)
        return value_in_quotes(label) if label in scope.terms else bare_or(label, value_in_quotes)
    return json.dumps(side.value) if isinstance(side.value, str) else repr(side.value)


def is_listed(term: Term, values: ValueSet) -> bool:
    """Return whether a set has no name of its own, so that it is written value by value.

    >>> from hierarchy import Var
    >>> x = Var(Variable("x", (0, 1)))
    >>> is_listed(x, x.isin([1]).right), is_listed(x, ValueSet("end", frozenset({1})))
    (True, False)
    """
    foreign = any(value not in term.domain for value in values.values)
    return not foreign and cast("Member", term.isin(values.values)).right == values


def _set(term: Term, values: ValueSet) -> str:
    if not is_listed(term, values):
        return _name(values.name)
    chosen = (term.domain.label(value) for value in term.domain.values if value in values.values)
    return "{" + ", ".join(bare_or(label, value_in_quotes) for label in chosen) + "}"


def _name(name: str) -> str:
    return bare_or(name, name_in_quotes)
