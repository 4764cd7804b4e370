"""Weights and cards on disk: what is written comes back, and what is broken or hostile is refused."""

import json
import os
import struct
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import save

from perception import models
from perception.models import Card, load_model, save_model
from worlds import UserError

CARD = Card("cnn", "3 frames of seed 0", seed=0, accuracy=0.5, versions={"numpy": "2"})
TENSORS = {"w": np.arange(6, dtype=np.float32).reshape(2, 3), "n": np.array([1, 2], dtype=np.int64)}


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    """Return weights that were saved."""
    path = tmp_path / "deep" / "cnn.safetensors"
    save_model(path, TENSORS, CARD)
    return path


def test_what_is_saved_comes_back(saved: Path) -> None:
    """Tensors with types and shapes, and the card, field by field; the JSON beside is the card."""
    tensors, card = load_model(str(saved), backend="cnn", shapes={"w": (2, 3), "n": (2,)})
    assert card == CARD
    assert {name: (t.dtype, t.tolist()) for name, t in tensors.items()} == {
        name: (t.dtype, t.tolist()) for name, t in TENSORS.items()
    }
    beside = json.loads(saved.with_suffix(".json").read_text())
    assert (beside["backend"], beside["accuracy"], beside["format"]) == ("cnn", 0.5, models.FORMAT)
    assert sorted(path.name for path in saved.parent.iterdir()) == ["cnn.json", "cnn.safetensors"]


def test_the_same_is_saved_as_the_same_bytes(saved: Path, tmp_path: Path) -> None:
    """Neither time nor the order of tensors is in the file."""
    other = tmp_path / "again.safetensors"
    save_model(other, dict(reversed(TENSORS.items())), CARD)
    assert other.read_bytes() == saved.read_bytes()


def test_arrays_of_any_layout_come_back(tmp_path: Path) -> None:
    """A transposed array and one of foreign byte order keep their values."""
    path = tmp_path / "m.safetensors"
    save_model(path, {"t": TENSORS["w"].T, "b": TENSORS["w"].astype(">f4")}, CARD)
    tensors, _ = load_model(path)
    assert tensors["t"].tolist() == TENSORS["w"].T.tolist()
    assert tensors["b"].tolist() == TENSORS["w"].tolist()


@pytest.mark.parametrize("stop", ["fsync", "replace"])
def test_a_save_that_fails_leaves_the_old_file(
    saved: Path, stop: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk, before or while the new file is put in place, loses nothing and leaves no litter."""

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(*((os, "fsync") if stop == "fsync" else (Path, "replace")), full)
    with pytest.raises(UserError, match="No space left on device"):
        save_model(saved, {"w": np.zeros(1)}, CARD)
    monkeypatch.undo()
    assert load_model(saved)[0]["n"].tolist() == [1, 2]
    assert len(list(saved.parent.iterdir())) == 2


def test_the_card_in_the_weights_counts(saved: Path) -> None:
    """Without the JSON the weights load; with another card beside them they do not."""
    beside = saved.with_suffix(".json")
    beside.write_text(beside.read_text().replace('"threshold": 0.0', '"threshold": 0.5'))
    with pytest.raises(UserError, match=r"not the card of cnn\.safetensors; delete it"):
        load_model(saved)
    beside.write_bytes(b"\xff\xfe")
    with pytest.raises(UserError, match="no UTF-8 text"):
        load_model(saved)
    beside.write_text("[" * 50_000)
    with pytest.raises(UserError, match="the card is wrong"):
        load_model(saved)
    beside.unlink()
    assert load_model(saved)[1] == CARD


def test_weights_for_something_else_are_refused(saved: Path) -> None:
    """Another backend, another shape, a tensor too many or too few are named."""
    with pytest.raises(UserError, match="for backend 'cnn', not 'hog'"):
        load_model(saved, backend="hog")
    with pytest.raises(UserError, match=r"'w' has shape \(2, 3\), not \(3, 2\)"):
        load_model(saved, shapes={"w": (3, 2), "n": (2,)})
    with pytest.raises(UserError, match=r"'n' has shape \(2,\), not none"):
        load_model(saved, shapes={"w": (2, 3)})
    with pytest.raises(UserError, match="'v' has shape none"):
        load_model(saved, shapes={"w": (2, 3), "n": (2,), "v": (1,)})


def header(length: int, text: bytes) -> bytes:
    """Return a safetensors file of a header alone."""
    return struct.pack("<Q", length) + text


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"PK\x03\x04 a zip, perhaps a pickle",
        b"\x80\x04\x95cos\nsystem\n(S'touch /tmp/owned'\ntR.",
        header(1 << 62, b"{}"),
        header(2, b"{}"),
        header(2, b"[]"),
        header(8, b"\xff" * 8),
        header(100_000, b"[" * 100_000),
        header(64, b'{"w":{"dtype":"F32","shape":[2,2],"data_offsets":[0,1000000000]}}'[:64]),
        save({"w": np.zeros(2)}),
        save({"w": np.zeros(2)}, metadata={"card": "{}"}),
        save({"w": np.zeros(2)}, metadata={"card": "x" * (1 << 17)}),
        save({"w": np.zeros(2)}, metadata={"card": "null"}),
    ],
)
def test_what_is_no_weights_file_is_refused(tmp_path: Path, content: bytes) -> None:
    """Nothing that is not a safetensors file with a card gets in, and the message names the file."""
    path = tmp_path / "bad.safetensors"
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"bad\.safetensors"):
        load_model(path)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_damaged_file_is_refused_or_sound(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Cut or changed anywhere, a file is a UserError or still a card with finite tensors: never a crash."""
    path = tmp_path_factory.mktemp("damaged") / "m.safetensors"
    save_model(path, TENSORS, CARD)
    path.with_suffix(".json").unlink()
    content = bytearray(path.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        content = content[:at]
    else:
        content[at] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    try:
        tensors, card = load_model(path)
    except UserError:
        return
    assert card.backend
    assert all(np.isfinite(tensor).all() for tensor in tensors.values())


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"accuracy": 1.5}, "accuracy"),
        ({"accuracy": float("nan")}, "accuracy"),
        ({"temperature": 0.0}, "temperature"),
        ({"seed": "zero"}, "seed"),
        ({"backend": ""}, "backend"),
        ({"versions": {"numpy": 2}}, "versions.numpy"),
        ({"format": 2}, "format 2"),
        ({"data": "x" * 10_001}, "data"),
    ],
)
def test_a_wrong_card_is_neither_written_nor_read(tmp_path: Path, change: dict[str, Any], where: str) -> None:
    """The field is named."""
    path = tmp_path / "m.safetensors"
    with pytest.raises(UserError, match=where):
        save_model(path, TENSORS, replace(CARD, **change))
    assert not path.exists()
    content = {**asdict(CARD), **change}
    path.write_bytes(save({"w": np.zeros(1)}, metadata={"card": json.dumps(content)}))
    with pytest.raises(UserError, match=where):
        load_model(path)


def test_a_card_takes_plain_numbers(tmp_path: Path) -> None:
    """What JSON does not know is refused before anything is written."""
    with pytest.raises(UserError, match="use plain numbers"):
        save_model(tmp_path / "m.safetensors", TENSORS, replace(CARD, accuracy=np.float32(0.5)))
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_field_of_the_card_is_refused(tmp_path: Path) -> None:
    """A field of a later version is not dropped in silence."""
    path = tmp_path / "m.safetensors"
    content = {**asdict(CARD), "mood": "good"}
    path.write_bytes(save({"w": np.zeros(1)}, metadata={"card": json.dumps(content)}))
    with pytest.raises(UserError, match="mood"):
        load_model(path)


@pytest.mark.parametrize(
    "tensor", [np.array([np.nan]), np.array(["x"]), np.array([object()]), np.array([1j])]
)
def test_tensors_that_are_no_finite_numbers_are_refused(tmp_path: Path, tensor: Any) -> None:
    """Before anything is written, and on reading as well."""
    path = tmp_path / "m.safetensors"
    with pytest.raises(UserError, match="tensor 'w'"):
        save_model(path, {"w": tensor}, CARD)
    assert not path.exists()
    if tensor.dtype.kind == "f":
        path.write_bytes(save({"w": tensor}, metadata={"card": json.dumps(asdict(CARD))}))
        with pytest.raises(UserError, match="not finite"):
            load_model(path)


def test_paths_that_lead_to_no_file_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Missing, a folder, a pipe, a device, another ending, too large: told at once, and not waited for."""
    os.mkfifo(tmp_path / "pipe.safetensors")
    (tmp_path / "folder.safetensors").mkdir()
    (tmp_path / "zero.safetensors").symlink_to("/dev/zero")
    (tmp_path / "large.safetensors").write_bytes(bytes(101))
    monkeypatch.setattr(models, "MOST_BYTES", 100)
    for name, problem in {
        "missing.safetensors": "no such file",
        "folder.safetensors": "this is a folder",
        "pipe.safetensors": "no ordinary file",
        "zero.safetensors": "no ordinary file",
        "large.safetensors": "larger than 100 bytes",
        "weights.pt": r"end in \.safetensors",
    }.items():
        with pytest.raises(UserError, match=problem):
            load_model(tmp_path / name)
    with pytest.raises(UserError, match=r"end in \.safetensors"):
        save_model(tmp_path / "weights.pt", TENSORS, CARD)
    with pytest.raises(UserError, match="cannot be written"):
        save_model(tmp_path / "large.safetensors" / "m.safetensors", TENSORS, CARD)
