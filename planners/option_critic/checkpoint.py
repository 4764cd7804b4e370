"""A learner on disk: all that learning hangs on, so that it goes on bit for bit, and what it is a learner of.

A checkpoint is one safetensors file. Its header carries a card (which graph, world, seed and config, how far)
and beside it lies the same card as JSON, for people to read. Both are written whole or not at all; nothing in
them is ever executed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, TypeAdapter

from hierarchy import GroundGraph
from worlds import UserError
from worlds.files import replace_files
from worlds.tensor_file import Cards, Tensors, read_tensors, tensor_bytes

FORMAT: Final = 1
"""The version of the card's form that is written and read."""
_CURVE: Final = "curve"
_MOST_CARD: Final = 1 << 19  # characters
_PACKAGES: Final = ("numpy", "torch", "torchrl", "tensordict")

Arrays = Mapping[str, NDArray[np.generic]]
Text = Annotated[str, Field(min_length=1, max_length=200)]


@dataclass(frozen=True)
class Checkpoint:
    """What a checkpoint is of, and how far learning was.

    Parameters
    ----------
    learner
        The learner's name, such as "option-critic".
    graph
        The task graph's text.
    world
        The world's name.
    starts
        Predicate of the starts that episodes begin in; empty for all.
    carried
        Which checkpoint's networks it began with, and without which variables; empty for none.
    seed
        Of learning.
    config
        What it learns with, by name.
    digest
        Of the ground graph (`digest`).
    steps
        Environment steps so far.
    columns
        What the rows of the learning curve hold.
    sha256
        Of the arrays; filled in when they are written.
    versions
        Versions of the packages that it was learnt with.
    created_by
        The affordant that wrote it.
    format
        Version of the card's form.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)

    learner: Text
    graph: Annotated[str, Field(max_length=200_000)]
    world: Annotated[str, Field(min_length=1, max_length=4096)]
    seed: Annotated[int, Field(ge=0, lt=1 << 64)]
    config: dict[Text, bool | int | float | str]
    digest: Text
    steps: Annotated[int, Field(ge=0)]
    columns: Annotated[tuple[Text, ...], Field(max_length=100)] = ()
    starts: Annotated[str, Field(max_length=4096)] = ""
    carried: Annotated[str, Field(max_length=4096)] = ""
    sha256: str = ""
    versions: dict[str, str] = field(default_factory=lambda: {name: version(name) for name in _PACKAGES})
    created_by: str = field(default_factory=lambda: f"affordant {version('affordant')}")
    format: int = FORMAT


@dataclass(frozen=True, eq=False)
class Stored:
    """What was read of a checkpoint.

    Parameters
    ----------
    about
        What it is of.
    state
        The learner's arrays.
    curve
        The learning curve so far, shape (rows, columns); nan where there was nothing to measure.
    """

    about: Checkpoint
    state: Tensors
    curve: NDArray[np.float64]


class Restorable(Protocol):
    """A learner that can go on from arrays."""

    @property
    def grounded(self) -> GroundGraph:
        """The ground graph that was given."""

    def restore(self, state: Mapping[str, NDArray[np.generic]], /) -> None:
        """Take up a state, or raise a `UserError`."""


_CARDS: Final = Cards(
    TypeAdapter(Checkpoint),
    FORMAT,
    _MOST_CARD,
    missing="this is no checkpoint of a learner; name one that affordant learn wrote",
    mend="learn anew",
)


def save_checkpoint(
    path: Path | str, about: Checkpoint, state: Arrays, curve: NDArray[np.float64] | None = None
) -> None:
    """Write a checkpoint; what was there before stays until the new one is complete.

    Parameters
    ----------
    path
        Ends in ".safetensors"; the card's readable copy gets the ending ".json".
    about
        What it is of.
    state
        The learner's arrays, as ``OptionCritic.state()`` gives them.
    curve
        The learning curve so far, shape (rows, columns). Defaults to none.

    Raises
    ------
    UserError
        If an array holds what is no finite number, or nothing can be written there.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> about = Checkpoint("mine", "graph: g", "two_rooms", 0, {"rate": 0.1}, "d", steps=7)
    >>> with TemporaryDirectory() as folder:
    ...     save_checkpoint(Path(folder, "c.safetensors"), about, {"w": np.arange(3)})
    ...     stored = load_checkpoint(Path(folder, "c.safetensors"))
    >>> stored.about.steps, stored.state["w"].tolist(), stored.curve.shape
    (7, [0, 1, 2], (0, 0))
    """
    path = Path(path)
    rows = np.zeros((0, len(about.columns))) if curve is None else curve
    arrays: dict[str, NDArray[Any]] = {f"state.{name}": np.asarray(array) for name, array in state.items()}
    known = ~np.isnan(rows)
    arrays |= {_CURVE: np.where(known, rows, 0.0), f"{_CURVE}.known": known}
    text = json.dumps({**asdict(about), "sha256": _hash(arrays)}, indent=2, ensure_ascii=False)
    _CARDS.read(text, path)
    content = tensor_bytes(path, arrays, {"card": text})
    replace_files({path: content, path.with_suffix(".json"): f"{text}\n".encode()})


def load_checkpoint(path: Path | str) -> Stored:
    """Read what `save_checkpoint` wrote; the JSON beside it is for people alone.

    Raises
    ------
    UserError
        If there is no such file, it is too large, broken or of another kind; the message says which.
    """
    path = Path(path)
    tensors, words = read_tensors(path, "there is no such file; check the path, or learn first")
    about = _CARDS.read(words.get("card"), path)
    if _hash(tensors) != about.sha256:
        raise UserError(f"{path}: the arrays are not those that were written; copy the checkpoint anew")
    rows, known = tensors.pop(_CURVE, None), tensors.pop(f"{_CURVE}.known", None)
    shape = (-1 if rows is None else len(rows), len(about.columns))
    if rows is None or known is None or not rows.shape == known.shape == shape or known.dtype != np.bool_:
        raise UserError(f"{path}: the learning curve is broken; learn anew, or copy the checkpoint anew")
    state = {name.removeprefix("state."): array for name, array in tensors.items()}
    return Stored(about, state, np.where(known, rows.astype(np.float64), np.nan))


def digest(grounded: GroundGraph) -> str:
    """Return a digest of a ground graph: its world's model, its tasks' masks and its calls'.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> model = maze_model(maze)
    >>> one, other = ground(two_rooms(maze), model), ground(two_rooms(maze, one_door_task=True), model)
    >>> digest(one) == digest(other), len(digest(one))
    (False, 64)
    """
    model = grounded.model
    found = hashlib.sha256(repr((model.index.names, model.index.shape, model.actions)).encode())
    for array in (model.outcomes, model.outcome_rewards, model.probabilities, model.starts):
        found.update(np.ascontiguousarray(array).data)
    for node in grounded.nodes:
        found.update(node.name.encode())
        for mask in (node.terminal, node.live, node.initiation, node.goal):
            found.update(np.packbits(mask).data)
        for call in node.calls:
            found.update(repr((call.child, call.relevant)).encode())
            found.update(np.packbits(call.available).data)
    return found.hexdigest()


def restore(path: Path | str, stored: Stored, learner: Restorable) -> None:
    """Let a learner take up a checkpoint's state.

    Parameters
    ----------
    path
        The checkpoint, for messages.
    stored
        What was read of it.
    learner
        Such as an `OptionCritic`.

    Raises
    ------
    UserError
        If the ground graph is another than the checkpoint's, or an array will not do.
    """
    if digest(learner.grounded) != stored.about.digest:
        raise UserError(
            f"{path}: the task graph on world {stored.about.world} is no longer what was learnt on; "
            "give back the graph and the world's file as they were, or learn anew"
        )
    try:
        learner.restore(stored.state)
    except UserError as error:
        raise UserError(f"{path}: {error}") from error


def _hash(arrays: Arrays) -> str:
    found = hashlib.sha256()
    for name in sorted(arrays):
        array = np.asarray(arrays[name], order="C")
        array = array.astype(array.dtype.newbyteorder("<"), copy=False)
        found.update(repr((name, array.dtype.str, array.shape)).encode())
        found.update(array.tobytes())
    return found.hexdigest()
