"""Settings of a kind of run, completed and checked: a default, a range or a choice for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from comparisons.study.spec import Value
from worlds import UserError, suggest

NO_CORRUPTION: Final = "none"
"""The corruption that leaves frames as they are."""


@dataclass(frozen=True)
class Setting:
    """What one setting of a kind may be; its type is the default's.

    Parameters
    ----------
    default
        What it is if it is not given.
    least, most
        Bounds of a number, both possible; None for none.
    choices
        Returns the words that a text may be; None for any.
    """

    default: Value
    least: float | None = None
    most: float | None = None
    choices: Callable[[], Sequence[str]] | None = None


def completed(settings: Mapping[str, Setting], given: Mapping[str, Value]) -> dict[str, Value]:
    """Return all settings: those given, checked, and for the others the defaults.

    A whole number will do where a share is asked for; it becomes one, so that 1 and 1.0 are the same run.

    Raises
    ------
    UserError
        If a setting is not known, of the wrong type, or out of range; the message begins with its name.

    Examples
    --------
    >>> known = {"episodes": Setting(50, least=1), "share": Setting(0.5, 0, 1)}
    >>> completed(known, {"share": 1})
    {'episodes': 50, 'share': 1.0}
    >>> completed(known, {"episode": 3})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: episode: there is no such setting; did you mean 'episodes'?
    """
    for name in given:
        if name not in settings:
            raise UserError(f"{name}: there is no such setting; {suggest(name, settings)}")
    return {name: _checked(name, of, given.get(name, of.default)) for name, of in settings.items()}


def check_corruption(settings: Mapping[str, Value]) -> None:
    """Refuse a corruption without a severity, which spoils nothing, and a severity without a corruption.

    Raises
    ------
    UserError
        If there is but one of the two.

    Examples
    --------
    >>> check_corruption({"corruption": "jpeg", "severity": 3})
    >>> check_corruption({"corruption": "none", "severity": 3})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: severity: 3 of no corruption; name a corruption, or give 0
    """
    corruption, severity = settings["corruption"], settings["severity"]
    if severity and corruption == NO_CORRUPTION:
        raise UserError(f"severity: {severity} of no corruption; name a corruption, or give 0")
    if corruption != NO_CORRUPTION and not severity:
        raise UserError(
            f"severity: 0 of {corruption} leaves frames as they are; "
            f"give 1 or more, or corruption {NO_CORRUPTION}"
        )


def _checked(name: str, of: Setting, value: Value) -> Value:
    wanted = type(of.default)
    if wanted is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not wanted:
        raise UserError(f"{name}: {value!r} is not possible; give {_form(of)}")
    if isinstance(value, str) and of.choices is not None and value not in of.choices():
        raise UserError(f"{name}: {value!r} is not possible; {suggest(value, of.choices())}")
    if not isinstance(value, str | bool):
        low = of.least is None or value >= of.least
        if not (low and (of.most is None or value <= of.most)):
            raise UserError(f"{name}: {value!r} is not possible; give {_form(of)}")
    return value


def _form(of: Setting) -> str:
    """Return in words what a setting may be."""
    if isinstance(of.default, str):
        return "a word" if of.choices is None else f"one of {', '.join(of.choices())}"
    if isinstance(of.default, bool):
        return "true or false"
    form = "a whole number" if isinstance(of.default, int) else "a number"
    if of.least is not None and of.most is not None:
        return f"{form} from {of.least:g} to {of.most:g}"
    return form if of.least is None else f"{form}, {of.least:g} or more"
