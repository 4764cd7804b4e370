"""The words of predicates in a task graph's text: tokens, quotes, literals, and what is said of mistakes."""

from __future__ import annotations

import json
import re
from ast import literal_eval
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from typing import Final, cast

from hierarchy.graph import TaskGraphError
from hierarchy.terms import Term, ValueSet

_TOKEN: Final = re.compile(
    r"""(?P<value>"(?:[^"\\]|\\.)*")|(?P<name>`(?:[^`]|``)*`)|(?P<sign><=|>=|!=|[=<>(){}])"""
    r"""|(?P<word>[^\s(){}"`=<>!]+)|(?P<wrong>\S)""",
    re.DOTALL,
)
_QUOTED: Final = 90  # characters of a predicate that a message quotes
KEYWORDS: Final = frozenset({"and", "or", "not", "in", "implies", "always", "never"})
_FOREIGN: Final = {"&&": "and", "&": "and", "||": "or", "|": "or", "->": "implies", "=>": "implies"}


class PredicateError(TaskGraphError):
    """A predicate's text is wrong; `column` counts from 1 in `text`."""

    def __init__(self, text: str, column: int, problem: str, mend: str) -> None:
        self.problem = f"column {column} of {_around(text, column)!r}: {problem}"
        self.mend = mend
        self.column = column
        super().__init__(f"{self.problem}; {mend}")


def _around(text: str, column: int) -> str:
    """Return a text, or what stands around a column of a long one."""
    if len(text) > _QUOTED:
        first = min(max(0, column - 1 - _QUOTED // 2), len(text) - _QUOTED)
        last = first + _QUOTED
        text = ("..." if first else "") + text[first:last] + ("..." if last < len(text) else "")
    return " ".join(text.split())


def shortened(text: str, most: int) -> str:
    """Return a text, its middle left out where it is longer than `most` characters.

    >>> shortened("abcdefghijklmnop", 9), shortened("abc", 9)
    ('abc...nop', 'abc')
    """
    half = (most - 3) // 2
    return text if len(text) <= most else f"{text[:half]}...{text[-half:]}"


@dataclass(frozen=True)
class Scope:
    """What the words of a predicate may mean: terms and sets of values, by name."""

    terms: Mapping[str, Term]
    sets: Mapping[str, ValueSet] = field(default_factory=dict)


@dataclass(frozen=True)
class Token:
    """A piece of a text, and the column that it begins at, counted from 1.

    Kinds: value, name, sign, word and end; a parser adds phrase, several words.
    """

    kind: str
    text: str
    column: int


def tokens(text: str) -> list[Token]:
    """Split a text; a comma at a word's end becomes a sign."""
    tokens = []
    for match in _TOKEN.finditer(text):
        kind, word, column = str(match.lastgroup), match[0], match.start() + 1
        if kind == "wrong":
            mend = "close the quotes" if word in '"`' else "write 'not' or '!='"
            raise PredicateError(text, column, f"{word!r} stands alone", mend)
        if kind == "word" and word.endswith(","):
            bare = word.rstrip(",")
            tokens += [Token("word", bare, column)] if bare else []
            tokens += [Token("sign", ",", column + len(bare) + i) for i in range(len(word) - len(bare))]
        else:
            tokens.append(Token(kind, word, column))
    return [*tokens, Token("end", "the end", len(text) + 1)]


def literal(text: str) -> Hashable:
    """Return the Python number, truth value, tuple or quoted string that a text writes; else the text.

    >>> literal("3"), literal("(1, 2)"), literal("near"), literal("'3'")
    (3, (1, 2), 'near', '3')
    """
    try:
        value = literal_eval(text.strip())
        hash(value)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        return text
    return cast("Hashable", value)


def misread(words: str) -> str:
    """Return a mend for words that hold a connective of other languages, or one in capitals.

    >>> misread("open && robot"), misread("open AND robot"), misread("room A")
    ("write 'and' for '&&'", "write 'and' for 'AND'", '')
    """
    for word in words.split(" "):
        meant = _FOREIGN.get(word, word.lower())
        if meant in KEYWORDS and word != meant:
            return f"write {meant!r} for {word!r}"
    return ""


def bare_or(text: str, quoted: Callable[[str], str]) -> str:
    """Return a text as it is if it is read as itself, in quotes otherwise.

    >>> bare_or("room A", name_in_quotes), bare_or("not here", name_in_quotes), bare_or("a,", value_in_quotes)
    ('room A', '`not here`', '"a,"')
    """
    words = text.split(" ")
    matches = [_TOKEN.fullmatch(word) for word in words]
    plain = all(match and match.lastgroup == "word" and not match[0].endswith(",") for match in matches)
    return text if plain and not KEYWORDS & set(words) else quoted(text)


def name_in_quotes(name: str) -> str:
    """Return a name in back quotes.

    >>> name_in_quotes("on(a,b)")
    '`on(a,b)`'
    """
    return "`" + name.replace("`", "``") + "`"


def value_in_quotes(label: str) -> str:
    r"""Return a value in quotes, with JSON's escapes.

    >>> print(value_in_quotes('6" nail'))
    "6\" nail"
    """
    return json.dumps(label, ensure_ascii=False)
