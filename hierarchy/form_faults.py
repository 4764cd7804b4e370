"""What pydantic finds wrong with a document's form, in our words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

from hierarchy.text_nodes import Document, Fault, Path
from worlds import suggest

_KEYS: Final = ("it is no mapping of keys to values", "write keys with values")
_WORDS: Final = {  # pydantic's kinds of error in ours: the problem, and a mend
    "list_type": ("it is no list", "write [first, second], or lines that begin with '- '"),
    "dict_type": _KEYS,
    "model_type": _KEYS,
    "string_type": ("it is no plain text", "write words, not a list or keys"),
    "float_parsing": ("it is no number", "write one, such as -10"),
    "float_type": ("it is no number", "write one, such as -10"),
    "finite_number": ("it is no finite number", "write one, such as -10"),
    "too_short": ("it is empty", "give at least one"),
    "string_too_short": ("it is empty", "write something there"),
}


def form_fault(
    document: Document, path: Path, error: dict[str, Any], known: Callable[[Path], Sequence[str]]
) -> Fault:
    r"""Return one of pydantic's errors as a fault of a document.

    Parameters
    ----------
    document
        What was read.
    path
        Where in it the error is.
    error
        As `pydantic.ValidationError.errors` gives it.
    known
        Returns the keys that may stand where an unknown one does.

    Examples
    --------
    >>> from hierarchy.text_nodes import read_yaml
    >>> document = read_yaml("graph: mine\ntaks: 1", "mine.yaml")
    >>> error = {"type": "extra_forbidden"}
    >>> str(form_fault(document, ("taks",), error, lambda _: ["graph", "tasks"]))
    "line 2, taks: unknown key 'taks'; did you mean 'tasks'?"
    """
    kind, last = error["type"], str(path[-1]) if path else ""
    if kind == "extra_forbidden":
        return document.fault(path, f"unknown key {last!r}", suggest(last, known(path), "keys:"))
    if kind == "missing":
        return document.fault(path[:-1], f"{last!r} is missing", f"add {last}: ...")
    if kind == "value_error":
        problem, _, mend = str(error["ctx"]["error"]).partition("; ")
    else:
        problem, mend = _WORDS.get(kind, (error["msg"], "mend it"))
    return document.fault(path, problem, mend)
