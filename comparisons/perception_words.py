"""How the comparison of perception backends words its numbers: on one line, with their intervals."""

from __future__ import annotations


def words(condition: str) -> str:
    """Return a condition's name as text.

    >>> words("salt_and_pepper")
    'salt and pepper'
    """
    return condition.replace("_", " ")


def unbroken(text: str) -> str:
    """Return a text that is never broken into two lines.

    >>> unbroken("two cells").split()
    ['two', 'cells']
    """
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def between(low: str, high: str) -> str:
    """Return an interval's bounds in brackets.

    >>> between("1", "2") == "(1\N{EN DASH}\N{WORD JOINER}2)"
    True
    """
    return f"({low}\N{EN DASH}\N{WORD JOINER}{high})"


def interval(low: float, high: float) -> str:
    """Return an interval of shares in percent.

    >>> interval(0.93, 0.9945).split()
    ['93.0', 'to', '99.5', '%']
    """
    return unbroken(f"{100 * low:.1f} to {100 * high:.1f} %")


def with_interval(share: float, low: float, high: float) -> str:
    """Return a share and its interval, as numbers of percent.

    >>> with_interval(0.5, 0.25, 0.75).split()[0]
    '50.0'
    """
    return unbroken(f"{100 * share:.1f} {between(f'{100 * low:.1f}', f'{100 * high:.1f}')}")
