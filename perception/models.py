"""What a learnt backend knows, on disk: its numbers as safetensors, and a card that says where they are from.

The card is in the header of the .safetensors file, so that the two are replaced together or not at all, and
beside it as JSON for people to read. Nothing in either file is ever executed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Final

from numpy.typing import NDArray
from pydantic import ConfigDict, Field, TypeAdapter

from worlds import UserError
from worlds.files import read_bytes, replace_files
from worlds.tensor_file import MOST_BYTES, Cards, Tensors, named, read_tensors, tensor_bytes

__all__ = ["FORMAT", "MOST_BYTES", "Card", "Share", "Tensors", "installed", "load_model", "save_model"]

FORMAT: Final = 1
"""The version of the card's form that is written and read."""
_MOST_CARD: Final = 1 << 16  # characters, or bytes of the copy
_MISSING: Final = "there is no such file; check the path, or train the backend first"
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


_CARDS: Final = Cards(
    TypeAdapter(Card),
    FORMAT,
    _MOST_CARD,
    missing="the weights have no card; save them by perception.models.save_model",
    mend="save it anew",
)


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
    >>> import numpy as np
    >>> with TemporaryDirectory() as folder:
    ...     save_model(Path(folder, "m.safetensors"), {"w": np.eye(2)}, Card("mine", "two frames", 0))
    ...     tensors, card = load_model(Path(folder, "m.safetensors"))
    >>> tensors["w"].tolist(), card.backend
    ([[1.0, 0.0], [0.0, 1.0]], 'mine')
    """
    path = named(path)
    try:
        text = json.dumps(asdict(card), indent=2)
    except TypeError as error:
        raise UserError(
            f"{path}: the card cannot be written ({error}); use plain numbers and words"
        ) from error
    _CARDS.read(text, path)
    content = tensor_bytes(path, tensors, {"card": text})
    replace_files({path: content, path.with_suffix(".json"): f"{text}\n".encode()})


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
    path = named(path)
    tensors, words = read_tensors(path, _MISSING, MOST_BYTES)
    card = _CARDS.read(words.get("card"), path)
    _agrees(path, card)
    if backend is not None and card.backend != backend:
        raise UserError(f"{path}: the weights are for backend {card.backend!r}, not {backend!r}; name others")
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


def _agrees(path: Path, card: Card) -> None:
    """Refuse a readable card that says something else than the one that counts."""
    beside = path.with_suffix(".json")
    if not beside.exists():
        return
    try:
        copy = _CARDS.read(read_bytes(beside, _MOST_CARD, _MISSING).decode(), beside)
    except UnicodeDecodeError as error:
        raise UserError(f"{beside}: this is no UTF-8 text; delete it, the weights hold their card") from error
    if copy != card:
        raise UserError(
            f"{beside}: this is not the card of {path.name}; delete it, the weights hold their own"
        )
