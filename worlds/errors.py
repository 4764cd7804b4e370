"""Errors that a user can mend, told apart from our own bugs."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Final

_LISTED: Final = 12  # a maze has many cells


class UserError(ValueError):
    """Something the user gave is wrong; the message names what, where and how to mend it.

    The command line prints these without a traceback and exits with status 2. Every other
    exception is a bug of ours and keeps its traceback.
    """


class LayoutError(UserError):
    """A layout's text is wrong.

    Parameters
    ----------
    source
        The file (or a name for the text) that was read.
    line
        Number of the offending line, counted from 1; None where the whole file is at fault.
    problem
        What is wrong.
    mend
        What to change.

    Examples
    --------
    >>> str(LayoutError("a.maze", 3, "the row has 7 cells", "give it 8"))
    'a.maze, line 3: the row has 7 cells; give it 8'
    """

    def __init__(self, source: str, line: int | None, problem: str, mend: str) -> None:
        where = source if line is None else f"{source}, line {line}"
        super().__init__(f"{where}: {problem}; {mend}")
        self.source = source
        self.line = line
        self.problem = problem
        self.mend = mend


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that an unknown one is probably a slip of, or None.

    Examples
    --------
    >>> nearest("spere", ["cube", "sphere"]), nearest("pyramid", ["cube", "sphere"])
    ('sphere', None)
    """
    return next(iter(get_close_matches(word, list(known), n=1)), None)


def suggest(word: str, known: Iterable[str], otherwise: str = "use one of") -> str:
    """Return a mend for an unknown word: the nearest known one, or `otherwise` and what is known.

    Examples
    --------
    >>> suggest("spere", ["cube", "sphere"]), suggest("pyramid", ["cube", "sphere"])
    ("did you mean 'sphere'?", 'use one of cube, sphere')
    """
    names = list(dict.fromkeys(known))
    near = nearest(word, names)
    if near is not None:
        return f"did you mean {near!r}?"
    more = ", ..." if len(names) > _LISTED else ""
    return f"{otherwise} {', '.join(names[:_LISTED]) or 'none'}{more}"
