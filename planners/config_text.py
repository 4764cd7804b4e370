"""Settings as a dataclass, and the same as text: a file of one's own, or single values by name.

A dataclass whose fields have the types below checks itself by `check_fields`, and is read by `load_settings`
and `parse_settings`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Final,
    Literal,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

from pydantic import Field, TypeAdapter, ValidationError

from hierarchy.text_files import file_text
from hierarchy.text_nodes import Document, FaultyTextError, TaskGraphTextError, read_yaml
from worlds import UserError, suggest

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    C = TypeVar("C", bound=DataclassInstance)
else:
    C = TypeVar("C")

Size = Annotated[int, Field(ge=1, le=100_000)]
Count = Annotated[int, Field(ge=1, le=10**12)]
Steps = Annotated[int, Field(ge=0, le=10**6)]
Share = Annotated[float, Field(ge=0, le=1)]
Part = Annotated[float, Field(gt=0, le=1)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Weight = Annotated[float, Field(ge=0, allow_inf_nan=False)]

Unread = Mapping[tuple[str, str], tuple[str, ...]]
"""Names of settings that are not read, by the setting and its value that keep them from being read."""

_MENDS: Final = {
    bool: "give true or false",
    str: "give words",
    Size: "give a whole number from 1 to 100000",
    Count: "give a whole number from 1 to 1000000000000",
    Steps: "give a whole number from 0 to 1000000",
    Share: "give a number from 0 to 1",
    Part: "give a number above 0, and at most 1",
    Positive: "give a number above 0",
    Weight: "give a number from 0 on",
}


class ConfigError(FaultyTextError):
    """A file of settings is wrong; see `parse_settings`."""


def check_fields(config: DataclassInstance) -> None:
    """Refuse settings of which a value is of the wrong kind or out of range; for their ``__post_init__``.

    Raises
    ------
    UserError
        If one is; the message names the setting, the value and the mend.
    """
    kind = type(config)
    for name, adapter in _adapters(kind).items():
        value = getattr(config, name)
        try:
            adapter.validate_python(value, strict=True)
        except ValidationError as error:
            raise UserError(f"{name}: {value!r} is not possible; {_mend(kind, name, value)}") from error


def read_settings(defaults: C, overrides: Mapping[str, str]) -> C:
    """Return settings with single values replaced, which are given as text.

    Raises
    ------
    UserError
        If a setting is unknown or out of range.

    Examples
    --------
    >>> from planners.tabular_config import TabularConfig
    >>> read_settings(TabularConfig(), {"gamma": "0.9"}).gamma
    0.9
    >>> read_settings(TabularConfig(), {"gama": "0.9"})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: gama=0.9: there is no such setting; did you mean 'gamma'?
    """
    return replace(defaults, **_values(type(defaults), overrides))


def load_settings(
    defaults: C, path: str | Path | None, overrides: Mapping[str, str], *, missing: str, unread: Unread
) -> C:
    """Return settings of which some stand in a YAML file, and single values count more than those.

    Parameters
    ----------
    defaults
        What is not given.
    path
        The file; None for none.
    overrides
        Values as text, by the names of settings.
    missing
        What to say if there is no such file: the problem and a mend.
    unread
        What is not read, and so must not be among `overrides` with another value than its default. In a file,
        which may list all settings, it is let be.

    Raises
    ------
    UserError
        If the file cannot be read or is no YAML, or a setting is unknown or out of range; the message tells
        the file, every line and every mend. If a single value would never be read.
    """
    values = _values(type(defaults), overrides)
    given = defaults
    if path is not None:
        given = parse_settings(defaults, file_text(Path(path), missing), str(path))
    config = replace(given, **values)
    for (choice, value), names in unread.items():
        for name in names:
            idle = getattr(config, choice) == value and name in overrides
            if idle and getattr(config, name) != getattr(defaults, name):
                raise UserError(
                    f"{name}: it is not read with {choice}={value}; leave it out, or give another {choice}"
                )
    return config


def parse_settings(defaults: C, text: str, source: str = "the settings") -> C:
    r"""Return settings of which some stand in YAML text: a mapping; no tags, anchors or aliases.

    Raises
    ------
    UserError
        If it is no such text, or a setting is unknown or out of range.

    Examples
    --------
    >>> from planners.tabular_config import TabularConfig
    >>> parse_settings(TabularConfig(), "gamma: 0.9\nrate: 2", "mine.yaml")
    Traceback (most recent call last):
        ...
    planners.config_text.ConfigError: mine.yaml, line 2, rate: 2 is not possible; give a number above 0, ...
    """
    lines = (line.partition("#")[0].strip() for line in text.splitlines())
    if not any(line and line != "---" for line in lines):
        return defaults  # all is left out
    try:
        document = read_yaml(text, source)
    except TaskGraphTextError as error:
        raise ConfigError(source, error.faults) from error
    if not isinstance(document.data, dict):
        fault = document.fault((), "these are no settings", "write NAME: VALUE in each line")
        raise ConfigError(source, [fault])
    return replace(defaults, **_documented(type(defaults), document, source))


@dataclass(frozen=True)
class _Right:
    value: Any


@dataclass(frozen=True)
class _Wrong:
    problem: str
    mend: str


def _values(kind: type[DataclassInstance], overrides: Mapping[str, str]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, text in overrides.items():
        found = _read(kind, name, text)
        if isinstance(found, _Wrong):
            raise UserError(f"{name}={text}: {found.problem}; {found.mend}")
        values[name] = found.value
    return values


def _documented(kind: type[DataclassInstance], document: Document, source: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    faults = []
    for name, text in document.data.items():
        found = _read(kind, name, text)
        if isinstance(found, _Wrong):
            faults.append(document.fault((name,), found.problem, found.mend))
        else:
            values[name] = found.value
    if faults:
        raise ConfigError(source, faults)
    return values


def _read(kind: type[DataclassInstance], name: str, text: Any) -> _Right | _Wrong:
    """Return the value that a setting's text stands for, or what is wrong with it."""
    adapters = _adapters(kind)
    if name not in adapters:
        return _Wrong("there is no such setting", suggest(name, adapters))
    if not isinstance(text, str):
        return _Wrong("this is no single value", _mend(kind, name, text))
    try:
        return _Right(adapters[name].validate_python(text))
    except ValidationError:
        return _Wrong(f"{text or 'nothing'} is not possible", _mend(kind, name, text))


@cache
def _types(kind: type[DataclassInstance]) -> dict[str, Any]:
    hints = get_type_hints(kind, include_extras=True)
    return {field.name: hints[field.name] for field in fields(kind)}


@cache
def _adapters(kind: type[DataclassInstance]) -> dict[str, TypeAdapter[Any]]:
    return {name: TypeAdapter[Any](hint) for name, hint in _types(kind).items()}


def _mend(kind: type[DataclassInstance], name: str, value: Any) -> str:
    hint = _types(kind)[name]
    if get_origin(hint) is Literal:
        words = get_args(hint)
        return suggest(value, words) if isinstance(value, str) else f"use one of {', '.join(words)}"
    return _MENDS[hint]
