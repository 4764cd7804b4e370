"""What a learnt backend knows, on disk: its numbers as safetensors, and a card that says where they are from.

The card is in the header of the .safetensors file, so that the two are replaced together or not at all, and
beside it as JSON for people to read. Nothing in either file is ever executed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from safetensors import SafetensorError
from safetensors.numpy import load, save

from worlds import UserError

FORMAT: Final = 1
"""The version of the card's form that is written and read."""
MOST_BYTES: Final = 256 << 20
"""A weights file may be so large."""
_MOST_CARD: Final = 1 << 16  # bytes
_MOST_HEADER: Final = 1 << 20  # bytes; the card, and a line for each tensor
_KINDS: Final = "biuf"  # numpy's kinds of bool, integers and floats
_LENGTH: Final = 8  # bytes that give the length of the header

Tensors = dict[str, NDArray[Any]]
"""Arrays by name."""
Share = Annotated[float, Field(ge=0, le=1)]


@dataclass(frozen=True)
class Card:
    """Where a learnt backend comes from, and how good it was found to be.

    Parameters
    ----------
    backend
        The backend's name in the registry.
    data
        What it learnt from, in words: how many frames, of which seeds and variation.
    seed
        Of its training.
    accuracy
        Share of right labels on frames that it did not learn from, in [0, 1]; None if not measured.
    calibration_error
        Expected calibration error on frames that it did not learn from, in [0, 1]; None if not measured.
    temperature
        What its scores are divided by before the softmax.
    threshold
        The confidence below which it abstains; 0 if it never does.
    versions
        Versions of the packages that trained it.
    created_by
        The affordant that wrote it.
    format
        Version of the card's form.

    Examples
    --------
    >>> Card("cnn", data="5000 frames of seed 0", seed=0, accuracy=0.99).temperature
    1.0
    """

    __pydantic_config__ = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)

    backend: Annotated[str, Field(min_length=1, max_length=100)]
    data: Annotated[str, Field(max_length=10_000)]
    seed: int
    accuracy: Share | None = None
    calibration_error: Share | None = None
    temperature: Annotated[float, Field(gt=0)] = 1.0
    threshold: Share = 0.0
    versions: dict[str, str] = field(default_factory=dict)
    created_by: str = field(default_factory=lambda: f"affordant {version('affordant')}")
    format: int = FORMAT


_CARDS: Final = TypeAdapter(Card)


def save_model(path: Path | str, tensors: Mapping[str, NDArray[Any]], card: Card) -> None:
    """Write tensors and their card; what was there before stays until the new file is complete.

    Parameters
    ----------
    path
        Ends in ".safetensors"; the card's readable copy gets the ending ".json". The folder is made if
        it is missing.
    tensors
        Arrays of bool, integers or finite floats, by name.
    card
        Where they come from.

    Raises
    ------
    UserError
        If the path, a tensor or a field of the card will not do, or nothing can be written there.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     save_model(Path(folder, "m.safetensors"), {"w": np.eye(2)}, Card("mine", "two frames", 0))
    ...     tensors, card = load_model(Path(folder, "m.safetensors"))
    >>> tensors["w"].tolist(), card.backend
    ([[1.0, 0.0], [0.0, 1.0]], 'mine')
    """
    path = _named(path)
    arrays = {name: _native(path, name, np.asarray(tensor)) for name, tensor in tensors.items()}
    try:
        text = json.dumps(asdict(card), indent=2)
    except TypeError as error:
        raise UserError(
            f"{path}: the card cannot be written ({error}); use plain numbers and words"
        ) from error
    _read_card(text, path)
    content = save(arrays, metadata={"card": text})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _replace(path, content)
        _replace(path.with_suffix(".json"), f"{text}\n".encode())
    except OSError as error:
        raise UserError(f"{path}: it cannot be written ({error.strerror}); name another folder") from error


def load_model(
    path: Path | str, backend: str | None = None, shapes: Mapping[str, tuple[int, ...]] | None = None
) -> tuple[Tensors, Card]:
    """Read what `save_model` wrote.

    Parameters
    ----------
    path
        The .safetensors file.
    backend
        The backend that it must be for. Defaults to any.
    shapes
        The tensors that it must hold, no more and no fewer, with their shapes. Defaults to any.

    Raises
    ------
    UserError
        If there is no such file, it is too large, broken, not of this kind, for another backend, or its
        card differs from the JSON beside it; the message says which.
    """
    path = _named(path)
    content = _read(path, MOST_BYTES)
    try:
        tensors: Tensors = load(content)
    # KeyError: a type that numpy does not have; the others: a header that contradicts what follows it.
    except (SafetensorError, KeyError, ValueError, TypeError) as error:
        raise UserError(
            f"{path}: this is no safetensors file, or a broken one ({error}); copy it anew"
        ) from error
    card = _read_card(_header(path, content).get("card"), path)
    _agrees(path, card)
    if backend is not None and card.backend != backend:
        raise UserError(f"{path}: the weights are for backend {card.backend!r}, not {backend!r}; name others")
    for name, tensor in tensors.items():
        _native(path, name, tensor)
    if shapes is not None:
        came = {name: tensor.shape for name, tensor in tensors.items()}
        for name in sorted(came.keys() | shapes.keys()):
            if came.get(name) != shapes.get(name):
                raise UserError(
                    f"{path}: tensor {name!r} has shape {came.get(name, 'none')}, "
                    f"not {shapes.get(name, 'none')}; the weights are for another network"
                )
    return tensors, card


def installed(*packages: str) -> dict[str, str]:
    """Return the versions of installed packages, for a card.

    >>> sorted(installed("numpy", "safetensors"))
    ['numpy', 'safetensors']
    """
    return {package: version(package) for package in packages}


def _named(path: Path | str) -> Path:
    path = Path(path)
    if path.suffix != ".safetensors":
        raise UserError(f"{path}: weights are kept in files that end in .safetensors; name it so")
    return path


def _native(path: Path, name: str, tensor: NDArray[Any]) -> NDArray[Any]:
    """Return a tensor in the machine's byte order and C order, if it holds numbers and all are finite."""
    if tensor.dtype.kind not in _KINDS:
        raise UserError(f"{path}: tensor {name!r} is of type {tensor.dtype}; use bool, integers or floats")
    if tensor.dtype.kind == "f" and not np.isfinite(tensor).all():
        raise UserError(f"{path}: tensor {name!r} holds numbers that are not finite; train it anew")
    return np.ascontiguousarray(tensor, dtype=tensor.dtype.newbyteorder("="))


def _header(path: Path, content: bytes) -> dict[str, str]:
    """Return the header's own words; `content` has been read as safetensors before."""
    length = int.from_bytes(content[:_LENGTH], "little")
    if length > _MOST_HEADER:
        raise UserError(
            f"{path}: the header has {length} bytes, more than {_MOST_HEADER}; save it by save_model"
        )
    header: dict[str, dict[str, str]] = json.loads(content[_LENGTH : _LENGTH + length])
    return header.get("__metadata__") or {}


def _read_card(text: str | None, source: Path | str) -> Card:
    if text is None:
        raise UserError(f"{source}: the weights have no card; save them by perception.models.save_model")
    if len(text) > _MOST_CARD:
        raise UserError(f"{source}: the card has more than {_MOST_CARD} characters; shorten it")
    try:
        card = _CARDS.validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole"
        raise UserError(f"{source}: the card is wrong at {where}: {first['msg']}; save it anew") from error
    if card.format != FORMAT:
        raise UserError(
            f"{source}: the card is of format {card.format}; this affordant reads {FORMAT}: update it"
        )
    return card


def _agrees(path: Path, card: Card) -> None:
    """Refuse a readable card that says something else than the one that counts."""
    beside = path.with_suffix(".json")
    if not beside.exists():
        return
    try:
        copy = _read_card(_read(beside, _MOST_CARD).decode(), beside)
    except UnicodeDecodeError as error:
        raise UserError(f"{beside}: this is no UTF-8 text; delete it, the weights hold their card") from error
    if copy != card:
        raise UserError(
            f"{beside}: this is not the card of {path.name}; delete it, the weights hold their own"
        )


def _read(path: Path, most: int) -> bytes:
    try:
        if not path.exists():
            raise UserError(f"{path}: there is no such file; check the path, or train the backend first")
        if not path.is_file():
            raise UserError(f"{path}: this is no ordinary file; name one")
        with path.open("rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise UserError(
            f"{path}: it cannot be read ({error.strerror}); check the path and its rights"
        ) from error
    if len(content) > most:
        raise UserError(
            f"{path}: the file is larger than {most} bytes; it holds something else than is looked for"
        )
    return content


def _replace(path: Path, content: bytes) -> None:
    """Write a file beside and move it into place, so that no reader ever sees half of it."""
    new = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        with new.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    finally:
        with suppress(FileNotFoundError):
            new.unlink()
