"""YAML as plain data with the line of every key, and mistakes told by line and path."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import yaml

from hierarchy.graph import TaskGraphError
from hierarchy.text_words import shortened
from worlds import UserError

Path = tuple[str | int, ...]
"""Keys and places in lists that lead to a part of a document."""
LARGEST: Final = 1_000_000
"""Characters that a document may have."""
_DEEPEST: Final = 20  # the format itself needs 7
_TOLD: Final = 12  # mistakes that a message lists
_LONGEST: Final = 300  # characters of what a message quotes
_YAML_WORDS: Final = {  # a piece of the YAML reader's problem in our words: the problem, and a mend
    r"'\t'": ("a tab cannot indent", "indent with blanks"),
    "mapping values are not allowed": (
        "a ': ' cannot stand here",
        "put the value in quotes, or mend the indentation",
    ),
    "found another document": ("a second document begins here", "keep one"),
    "found '<block mapping start>'": (
        "it is indented otherwise than the lines before",
        "mend the indentation",
    ),
    "but found '?'": (
        "keys stand here beside the items of a list",
        "write keys alone, or a '- ' before each",
    ),
    "could not find expected ':'": ("a ':' is missing after a key", "write KEY: VALUE"),
    "unexpected end of stream": ("the text ends too early", "close its quotes and brackets"),
}


@dataclass(frozen=True, order=True)
class Fault:
    """One mistake in a text: its line, counted from 1, the path of its key, what is wrong, and a mend."""

    line: int
    path: str
    problem: str
    mend: str

    def __str__(self) -> str:
        at = f"line {self.line}, {self.path}" if self.path else f"line {self.line}"
        return f"{at}: {self.problem}; {self.mend}"


class FaultyTextError(UserError):
    """A text is wrong; `faults` tells where, in the order of their lines, the message the first of them."""

    def __init__(self, source: str, faults: Iterable[Fault]) -> None:
        self.source = source
        self.faults = tuple(sorted(faults))
        lines = [f"{source}, {fault}" for fault in self.faults[:_TOLD]]
        more = len(self.faults) - len(lines)
        super().__init__("\n".join([*lines, f"and {more} more in {source}"] if more else lines))


class TaskGraphTextError(FaultyTextError, TaskGraphError):
    """The text of a task graph is wrong.

    Examples
    --------
    >>> fault = Fault(3, "tasks.Root.untl", "unknown key 'untl'", "did you mean 'until'?")
    >>> str(TaskGraphTextError("mine.yaml", [fault]))
    "mine.yaml, line 3, tasks.Root.untl: unknown key 'untl'; did you mean 'until'?"
    """


@dataclass(frozen=True)
class Document:
    """A document's data, every scalar as it is written, and the line of each of its parts."""

    data: Any
    lines: Mapping[Path, int] = field(repr=False)

    def fault(self, path: Path, problem: str, mend: str) -> Fault:
        """Return a fault of the part at `path`, or of the nearest part above it that is there."""
        known = path
        while known not in self.lines:
            known = known[:-1]
        words = (path_text(path), problem, mend)
        return Fault(self.lines[known], *(shortened(each, _LONGEST) for each in words))


def path_text(path: Path) -> str:
    """Return a path as people write it.

    >>> path_text(("tasks", "Root", "do", 1, "when"))
    'tasks.Root.do[1].when'
    """
    words = [f"[{part}]" if isinstance(part, int) else f".{part}" for part in path]
    return "".join(words).removeprefix(".")


def read_yaml(text: str, source: str) -> Document:
    r"""Read one YAML document of mappings, lists and scalars; JSON will do, too.

    Scalars are taken as written, so that the labels ``no``, ``1e3`` and ``5:30`` mean themselves. Tags,
    anchors and aliases are refused: nothing here needs them, and they can make a small file huge.

    Raises
    ------
    TaskGraphTextError
        If it is no such document, holds a key twice, or is too large.

    Examples
    --------
    >>> document = read_yaml("graph: no\ntasks:\n  Root: {uses: [x]}\n", "mine.yaml")
    >>> document.data, document.lines["tasks", "Root"]
    ({'graph': 'no', 'tasks': {'Root': {'uses': ['x']}}}, 3)
    """
    try:
        if len(text) > LARGEST:
            problem = f"the text has {len(text)} characters, more than {LARGEST}"
            raise _refused(source, 1, problem, "split it")
        _refuse_specials(text, source)
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        raise _refused(source, *_told(error)) from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        problem = f"the character U+{error.character:04X} cannot stand in a text"
        raise _refused(source, line, problem, "remove it") from None
    if node is None or (isinstance(node, yaml.ScalarNode) and not node.value):
        raise _refused(source, 1, "the text is empty", "begin it with 'graph: NAME'")
    reader = _Reader(source)
    data = reader.read(node, ())
    if reader.faults:
        raise TaskGraphTextError(source, reader.faults)
    return Document(data, reader.lines)


def _refuse_specials(text: str, source: str) -> None:
    depth = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise _refused(source, line, "anchors (&) and aliases (*) are not read here", "write it out")
        if getattr(event, "tag", None):
            raise _refused(source, line, f"the tag {event.tag} is not read here", "remove it")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            raise _refused(source, line, f"it is nested more than {_DEEPEST} deep", "write it flatter")


def _told(error: yaml.MarkedYAMLError) -> tuple[int, str, str]:
    """Return the line, the problem and a mend of what is no YAML."""
    mark = error.problem_mark or error.context_mark
    problem, mend = next((words for piece, words in _YAML_WORDS.items() if piece in error.problem), ("", ""))
    problem = problem or shortened(error.problem, _LONGEST)
    began = error.context_mark.line + 1 if error.context_mark else mark.line + 1
    since = f", in what begins in line {began}" if began != mark.line + 1 else ""
    where = f"this is no YAML at column {mark.column + 1}{since}"
    return mark.line + 1, f"{where}: {problem}", mend or "mend it there"


def _refused(source: str, line: int, problem: str, mend: str) -> TaskGraphTextError:
    return TaskGraphTextError(source, [Fault(line, "", problem, mend)])


class _Reader:
    """Turns nodes into data, keeping lines."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.lines: dict[Path, int] = {}
        self.faults: list[Fault] = []

    def read(self, node: yaml.Node, path: Path) -> Any:
        self.lines.setdefault(path, node.start_mark.line + 1)
        if isinstance(node, yaml.ScalarNode):
            return self.scalar(node, path)
        if isinstance(node, yaml.SequenceNode):
            return [self.read(item, (*path, place)) for place, item in enumerate(node.value)]
        data: dict[str, Any] = {}
        for key, value in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                self.faults.append(Fault(line, path_text(path), "a key is no word", "write a plain key"))
                continue
            here = (*path, self.scalar(key, path))
            if key.value in data:
                first = self.lines[here]
                problem = f"the key {key.value!r} is given again; it stands in line {first} already"
                self.faults.append(Fault(line, path_text(here), problem, "remove one of the two"))
                continue
            self.lines[here] = line
            data[key.value] = self.read(value, here)
        return data

    def scalar(self, node: yaml.ScalarNode, path: Path) -> str:
        """Return a scalar as it is written; half of a pair of escapes is no character."""
        text = str(node.value)
        if any("\ud800" <= each <= "\udfff" for each in text):
            problem = "an escape stands for half a character"
            self.faults.append(
                Fault(node.start_mark.line + 1, path_text(path), problem, "write the character")
            )
            return text.encode(errors="replace").decode()
        return text
