"""Errors that a user can mend, told apart from our own bugs."""

from __future__ import annotations


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
