"""Arrays on disk as safetensors, with words in the header: read with care.

Such a file holds numbers and text, nothing that is ever executed. A card among the words tells what it is of:
`perception.models` and `planners.option_critic.checkpoint` say what stands on theirs.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from safetensors import SafetensorError
from safetensors.numpy import load, save

from worlds.errors import UserError
from worlds.files import read_bytes

MOST_BYTES: Final = 256 << 20
"""A file may be so large."""
_MOST_HEADER: Final = 1 << 20  # bytes; the words, and a line for each array
_KINDS: Final = "biuf"  # numpy's kinds of bool, integers and floats
_LENGTH: Final = 8  # bytes that give the length of the header

Tensors = dict[str, NDArray[Any]]
"""Arrays by name."""


class TensorFile(NamedTuple):
    """What such a file holds: arrays by name, and words by key."""

    tensors: Tensors
    words: dict[str, str]


class Formatted(Protocol):
    """A card: it tells the version of its form."""

    @property
    def format(self) -> int:
        """Version of the form."""


C = TypeVar("C", bound=Formatted)


@dataclass(frozen=True)
class Cards(Generic[C]):
    """Reads the cards of one kind of file.

    Parameters
    ----------
    adapter
        Of the card's class.
    format
        The version of the form that is read.
    most
        Characters that a card may have.
    missing
        What a file without a card is, and what to do about it.
    mend
        What to do about a card that is wrong.

    Examples
    --------
    >>> @dataclass(frozen=True)
    ... class Card:
    ...     format: int
    >>> cards = Cards(TypeAdapter(Card), 1, 100, "there is no card; write one", "write it anew")
    >>> cards.read('{"format": 1}', "m.safetensors")
    Card(format=1)
    >>> cards.read('{}', "m.safetensors")
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: m.safetensors: the card is wrong at format: Field required; write it anew
    """

    adapter: TypeAdapter[C]
    format: int
    most: int
    missing: str
    mend: str

    def read(self, text: str | None, source: Path | str) -> C:
        """Return a card from its JSON.

        Parameters
        ----------
        text
            The JSON; None if there is none.
        source
            Where it is from, for messages.

        Raises
        ------
        UserError
            If there is no card, it is too long, a field of it is wrong, or it is of another format.
        """
        if text is None:
            raise UserError(f"{source}: {self.missing}")
        if len(text) > self.most:
            raise UserError(f"{source}: the card has more than {self.most} characters; {self.mend}")
        try:
            card = self.adapter.validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"]) or "the whole"
            raise UserError(f"{source}: the card is wrong at {where}: {first['msg']}; {self.mend}") from error
        if card.format != self.format:
            other = f"the card is of format {card.format}"
            raise UserError(f"{source}: {other}; this affordant reads {self.format}: update it")
        return card


def tensor_bytes(path: Path, tensors: Mapping[str, NDArray[Any]], words: Mapping[str, str]) -> bytes:
    """Return a file's content, the same for the same arrays and words in any order.

    Parameters
    ----------
    path
        Where it is to go, for messages.
    tensors
        Arrays of bool, integers or finite floats, by name.
    words
        Text by key.

    Raises
    ------
    UserError
        If the path has another ending than ".safetensors", or an array will not do.

    Examples
    --------
    >>> content = tensor_bytes(Path("m.safetensors"), {"w": np.eye(2)}, {"card": "mine"})
    >>> content[8:46]
    b'{"__metadata__":{"card":"mine"},"w":{"'
    """
    named(path)
    arrays = {name: native(path, name, np.asarray(tensor)) for name, tensor in tensors.items()}
    content = save(arrays, dict(words))
    _words(path, content)  # what could not be read again is not written
    return content


def read_tensors(path: Path, missing: str, most: int = MOST_BYTES) -> TensorFile:
    """Read a file that `tensor_bytes` gave.

    Parameters
    ----------
    path
        The file.
    missing
        What to say where there is none: the problem and a mend.
    most
        Bytes that it may have.

    Raises
    ------
    UserError
        If there is no such file, it is too large or broken, or an array holds what is no finite number.
    """
    named(path)
    content = read_bytes(path, most, missing)
    try:
        tensors: Tensors = load(content)
    # KeyError: a type that numpy does not have; the others: a header that contradicts what follows it.
    except (SafetensorError, KeyError, ValueError, TypeError) as error:
        raise UserError(
            f"{path}: this is no safetensors file, or a broken one ({error}); copy it anew"
        ) from error
    words = _words(path, content)
    for name, tensor in tensors.items():
        native(path, name, tensor)
    return TensorFile(tensors, words)


def named(path: Path | str) -> Path:
    """Return a path that ends in ".safetensors", or raise a `UserError`."""
    path = Path(path)
    if path.suffix != ".safetensors":
        raise UserError(f"{path}: weights are kept in files that end in .safetensors; name it so")
    return path


def native(path: Path, name: str, tensor: NDArray[Any]) -> NDArray[Any]:
    """Return an array in the machine's byte order and C order, if it holds numbers and all are finite."""
    if tensor.dtype.kind not in _KINDS:
        raise UserError(f"{path}: tensor {name!r} is of type {tensor.dtype}; use bool, integers or floats")
    if tensor.dtype.kind == "f" and not np.isfinite(tensor).all():
        raise UserError(f"{path}: tensor {name!r} holds numbers that are not finite; train it anew")
    return np.asarray(tensor, dtype=tensor.dtype.newbyteorder("="), order="C")


def _words(path: Path, content: bytes) -> dict[str, str]:
    """Return the header's own words; `content` has been read as safetensors before."""
    length = int.from_bytes(content[:_LENGTH], "little")
    if length > _MOST_HEADER:
        raise UserError(f"{path}: the header has {length} bytes, more than {_MOST_HEADER}; save it anew")
    header: dict[str, dict[str, str]] = json.loads(content[_LENGTH : _LENGTH + length])
    return header.get("__metadata__") or {}
