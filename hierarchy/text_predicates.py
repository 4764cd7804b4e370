"""The language of predicates in a task graph's text: ``doors = open and robot in room A``.

::

    predicate  = choice ["implies" choice]
    choice     = chain {"or" chain}
    chain      = simple {"and" simple}
    simple     = "not" simple | "(" predicate ")" | "all" "(" predicate ")" | "any" "(" predicate ")"
               | "always" | "never" | side relation side | side ["not"] "in" set
    relation   = "=" | "!=" | "<" | "<=" | ">" | ">="
    set        = name | "{" [value {", " value}] "}"
    side       = name | value

Names and values (their labels) are words with single blanks between them; a comma at the end of a word ends
the value. Whatever would be read otherwise stands in quotes: ``"..."`` is a value, with JSON's escapes, and
`` `...` `` a name. Without quotes, a name comes before a value of the same spelling. `all` and `any` write
a connective with one part, which prints as that part alone elsewhere.
"""

from __future__ import annotations

import json
from collections.abc import Hashable
from typing import Any, Final, NoReturn, cast

from hierarchy.predicates import AllOf, AnyOf, Implies, Not, Predicate
from hierarchy.terms import Constant, Equal, Member, Ordered, Relation, Term
from hierarchy.text_words import KEYWORDS, PredicateError, Scope, Token, literal, misread, tokens
from worlds import Variable, suggest

_RELATIONS: Final = ("=", "!=", "<", "<=", ">", ">=")


def parse_predicate(text: str, scope: Scope) -> Predicate:
    """Read a predicate.

    Raises
    ------
    PredicateError
        If the text is wrong; the message gives the column and a mend.

    Examples
    --------
    >>> from hierarchy import Var
    >>> doors = Var(Variable("doors", ("closed", "open")))
    >>> scope = Scope({"doors": doors})
    >>> print(parse_predicate("doors != open", scope))
    not (doors = open)
    >>> parse_predicate("dors = open", scope)
    Traceback (most recent call last):
        ...
    hierarchy.text_words.PredicateError: column 1 of 'dors = open': unknown name 'dors'; did you mean 'doors'?
    """
    parser = _Parser(text, scope)
    try:
        predicate = parser.predicate()
    except RecursionError:
        raise PredicateError(text, 1, "it is nested too deeply", "write it flatter") from None
    if parser.token.kind != "end":
        mend = misread(parser.token.text) or "mend it there"
        parser.fail(f"'and', 'or' or the end is missing before {parser.token.text!r}", mend)
    return predicate


def parse_side(text: str, scope: Scope, domain: Variable) -> Term | Constant:
    """Read a name, or a value of `domain` by its label: what a parameter is bound to.

    Raises
    ------
    PredicateError
        If it is neither.
    """
    parser = _Parser(text, scope)
    side = parser.side()
    if parser.token.kind != "end":
        parser.fail(f"{parser.token.text!r} is one too many", "give one name or value")
    return parser.term(side) or parser.constant(side, domain)


class _Parser:
    """Reads one text by recursive descent; a method for each rule of the grammar."""

    def __init__(self, text: str, scope: Scope) -> None:
        self.text = text
        self.scope = scope
        self.tokens = tokens(text)
        self.at = 0

    @property
    def token(self) -> Token:
        return self.tokens[self.at]

    def fail(self, problem: str, mend: str, column: int | None = None) -> NoReturn:
        raise PredicateError(self.text, self.token.column if column is None else column, problem, mend)

    def take(self, *texts: str) -> str | None:
        """Take a sign or keyword, if it is next."""
        if self.token.kind in ("word", "sign") and self.token.text in texts:
            self.at += 1
            return self.tokens[self.at - 1].text
        return None

    def predicate(self) -> Predicate:
        premise = self.choice()
        if not self.take("implies"):
            return premise
        conclusion = self.choice()
        if self.token.text == "implies":
            self.fail("a second 'implies'", "put parentheses around one of the two")
        return Implies(premise, conclusion)

    def choice(self) -> Predicate:
        parts = [self.chain()]
        while self.take("or"):
            parts.append(self.chain())
        return AnyOf(tuple(parts)) if len(parts) > 1 else parts[0]

    def chain(self) -> Predicate:
        parts = [self.simple()]
        while self.take("and"):
            parts.append(self.simple())
        return AllOf(tuple(parts)) if len(parts) > 1 else parts[0]

    def simple(self) -> Predicate:
        if self.take("not"):
            return Not(self.simple())
        if self.take("always"):
            return AllOf(())
        if self.take("never"):
            return AnyOf(())
        if self.take("("):
            return self.bracketed()
        if self.token.text in ("all", "any") and self.tokens[self.at + 1].text == "(":
            kind = AllOf if self.take("all", "any") == "all" else AnyOf
            self.take("(")
            return kind((self.bracketed(),))
        return self.comparison()

    def bracketed(self) -> Predicate:
        inside = self.predicate()
        if not self.take(")"):
            self.fail("')' is missing", "close the parenthesis")
        return inside

    def comparison(self) -> Predicate:
        left = self.side()
        relation = self.take(*_RELATIONS)
        if relation in ("=", "!="):
            equal = self.equal(left, self.side())
            return equal if relation == "=" else Not(equal)
        if relation:
            return self.ordered(cast("Relation", relation), left, self.side())
        negated = self.take("not")
        if not self.take("in"):
            self.fail(f"{left.text!r} is compared with nothing", "go on with =, !=, <, <=, >, >= or in")
        member = self.member(self.known_term(left))
        return Not(member) if negated else member

    def equal(self, left: Token, right: Token) -> Predicate:
        term = self.known_term(left)
        return Equal(term, self.term(right) or self.constant(right, term.domain))

    def ordered(self, relation: Relation, left: Token, right: Token) -> Predicate:
        before, after = self.term(left), self.term(right)
        if not before and not after:
            self.known_term(left)
        first = before or self.constant(left, cast("Term", after).domain, free=True)
        second = after or self.constant(right, cast("Term", before).domain, free=True)
        try:
            _ = _example(first) < _example(second)  # asked only whether it can be
        except TypeError:
            problem = f"the values of {first} and {second} have no common order"
            self.fail(problem, "compare them with = or in", left.column)
        return Ordered(relation, first, second)

    def member(self, term: Term) -> Predicate:
        if not self.take("{"):
            column = self.token.column
            named = self.side()
            if named.text not in self.scope.sets:
                problem = f"unknown set of values {named.text!r}"
                known = named.text in term.domain.labels
                near = misread(named.text) or suggest(named.text, self.scope.sets, "sets:")
                mend = f"write {{{named.text}}}" if known else near
                self.fail(problem, mend, column)
            values = self.scope.sets[named.text]
            if foreign := [value for value in values.values if value not in term.domain]:
                problem = f"{named.text!r} holds {foreign[0]!r}, which is no value of {term}"
                self.fail(problem, "name a set of its values", column)
            return Member(term, values)
        chosen: list[Hashable] = []
        while not self.take("}"):
            if chosen and not self.take(","):
                self.fail("',' or '}' is missing", "separate values by a comma and a blank")
            chosen.append(self.constant(self.side(), term.domain).value)
        return term.isin(chosen)

    def side(self) -> Token:
        """Take a name or value: one in quotes, or words up to a sign or keyword."""
        first = self.token
        if first.kind == "value":
            self.at += 1
            try:
                return Token("value", str(json.loads(first.text, strict=False)), first.column)
            except ValueError:
                self.fail(f"{first.text} has a wrong escape", r"write \\ for a backslash", first.column)
        if first.kind == "name":
            self.at += 1
            return Token("name", first.text[1:-1].replace("``", "`"), first.column)
        words = []
        while self.token.kind == "word" and self.token.text not in KEYWORDS:
            words.append(self.token.text)
            self.at += 1
        if not words:
            doubled = first.text == self.tokens[self.at - 1].text == "="
            mend = "write '=' once" if doubled else "write one there"
            self.fail(f"a name or value is missing before {first.text!r}", mend)
        return Token("phrase", " ".join(words), first.column)

    def term(self, side: Token) -> Term | None:
        if side.kind == "name":
            return self.known_term(side)
        return self.scope.terms.get(side.text) if side.kind == "phrase" else None

    def known_term(self, side: Token) -> Term:
        if side.kind == "value" or side.text not in self.scope.terms:
            mend = misread(side.text) or suggest(side.text, self.scope.terms, "names:")
            self.fail(f"unknown name {side.text!r}", mend, side.column)
        return self.scope.terms[side.text]

    def constant(self, side: Token, domain: Variable, *, free: bool = False) -> Constant:
        """Return a value by its label; if `free`, else what the text says as a number or string."""
        if side.text in domain.labels:
            return Constant(domain.values[domain.labels.index(side.text)], side.text)
        if free and side.kind == "value":
            return Constant(side.text)
        if free and isinstance(value := literal(side.text), int | float):
            return Constant(value)
        parts = [part.strip() for part in side.text.split(",")]
        if len(parts) > 1 and set(parts) <= set(domain.labels):
            mend = f"separate values by a comma and a blank: {', '.join(parts)}"
        else:
            mend = misread(side.text) or suggest(side.text, (*domain.labels, *self.scope.terms), "there are:")
        self.fail(f"unknown value {side.text!r} of {domain.name}", mend, side.column)


def _example(side: Term | Constant) -> Any:
    return side.value if isinstance(side, Constant) else side.domain.values[0]
