"""Single values of a study file: what their text means."""

from __future__ import annotations

import re
from typing import Any, Final, NamedTuple
from unicodedata import category

from comparisons.study.spec import Value

LAST_SEED: Final = 2**63 - 1
"""The largest seed, and how far from 0 a whole number may be."""
_WHOLE: Final = re.compile(r"[-+]?[0-9]+(_[0-9]+)*")
_NUMBER: Final = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_TRUTH: Final = {"true": True, "false": False}
_NOTHING: Final = ("", "~", "null")  # in whatever case
_LONGEST: Final = 40  # digits, leading zeros among them; far more than any number needs


class Written(NamedTuple):
    """A value as it is written, which labels it, and what that means."""

    text: str
    value: Value


def is_nothing(given: Any) -> bool:
    """Return whether that is how YAML writes that there is nothing.

    >>> is_nothing(""), is_nothing("Null"), is_nothing("none"), is_nothing([])
    (True, True, False, False)
    """
    return isinstance(given, str) and given.lower() in _NOTHING


def has_controls(text: str) -> bool:
    r"""Return whether a text has control characters, which a table or a terminal would take for its own.

    >>> has_controls("λ, 0.9"), has_controls("two\nlines")
    (False, True)
    """
    return any(category(letter) == "Cc" for letter in text)


def value_of(text: str) -> Value:
    """Return what the text of a setting means: a truth value, a number, or itself.

    Only ``true`` and ``false`` are truth values: ``no`` and ``off`` may well be words of a learner's. A
    whole number may have single underscores between its digits.

    Raises
    ------
    ValueError
        If it is empty, or too large for a number.

    Examples
    --------
    >>> [value_of(text) for text in ("true", "20", "1_000", "1e3", ".5", "no", "1.2.3", "maxq-0")]
    [True, 20, 1000, 1000.0, 0.5, 'no', '1.2.3', 'maxq-0']
    """
    if is_nothing(text):
        raise ValueError("it is empty; give a value, or leave it out")
    if text.lower() in _TRUTH:
        return _TRUTH[text.lower()]
    if _WHOLE.fullmatch(text):
        whole = _whole(text)
        if whole is None:
            raise ValueError(f"{text} is too large; give a number within {LAST_SEED} of 0")
        return whole
    if _NUMBER.fullmatch(text):
        number = float(text)
        if not abs(number) < float("inf"):
            raise ValueError(f"{text} is too large; give a finite number")
        return number
    return text


def written(given: Any) -> Written:
    """Return a value with its text; lists and mappings are refused."""
    if isinstance(given, str):
        return Written(given, value_of(given))
    raise ValueError("this is no single value; write a number or a word")


def label(given: Any) -> str:
    """Return a level's label; lists and mappings are refused."""
    if is_nothing(given):
        raise ValueError("it is empty; write a name as it stands under vary")
    if isinstance(given, str):
        return given
    raise ValueError("this is no single label; write one as it stands under vary")


def seed(given: Any) -> int:
    """Return a seed."""
    return _at_least(given, 0, "seed")


def count(given: Any) -> int:
    """Return how many seeds there are, at least one."""
    return _at_least(given, 1, "number of seeds", ", a list, or {first: 100, count: 20}")


def _at_least(given: Any, least: int, what: str, other: str = "") -> int:
    number = _whole(given) if isinstance(given, str) and _WHOLE.fullmatch(given) else None
    if number is None or number < least:
        shown = given if isinstance(given, str) and given else "this"
        raise ValueError(f"{shown} is no {what}; give a whole number from {least} to {LAST_SEED}{other}")
    return number


def _whole(text: str) -> int | None:
    """Return a whole number of 64 bits, or None for a larger one."""
    number = int(text) if len(text) <= _LONGEST else LAST_SEED + 1
    return number if abs(number) <= LAST_SEED else None
