"""Checkpoints on disk: what is written comes back, and what is broken, hostile or foreign is refused."""

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
from safetensors.numpy import load, save

from hierarchy import ground, two_rooms
from perception.models import Card, save_model
from planners.option_critic.checkpoint import Checkpoint, digest, load_checkpoint, save_checkpoint
from worlds import TransitionModel, UserError, maze_model, parse_layout

ABOUT = Checkpoint(
    "option-critic",
    "graph: g\n",
    "two_rooms",
    3,
    {"rate": 0.1, "abstracted": True},
    "d",
    7,
    ("steps", "loss"),
)
STATE = {"w": np.arange(6, dtype=np.float32).reshape(2, 3), "updates": np.array(7)}
CURVE = np.array([[1.0, np.nan], [2.0, -0.5]])


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    """Return a checkpoint that was saved."""
    path = tmp_path / "run" / "c.safetensors"
    save_checkpoint(path, ABOUT, STATE, CURVE)
    return path


def test_what_is_saved_comes_back(saved: Path) -> None:
    """Arrays with types and shapes, the curve with its gaps, and the card; the JSON beside is the card."""
    stored = load_checkpoint(str(saved))
    assert replace(stored.about, sha256="") == ABOUT
    assert {name: (a.dtype, a.shape, a.tolist()) for name, a in stored.state.items()} == {
        name: (a.dtype, a.shape, a.tolist()) for name, a in STATE.items()
    }
    np.testing.assert_array_equal(stored.curve, CURVE)
    beside = json.loads(saved.with_suffix(".json").read_text())
    assert (beside["learner"], beside["steps"], beside["columns"]) == ("option-critic", 7, ["steps", "loss"])
    assert {"torch", "torchrl", "tensordict", "numpy"} == beside["versions"].keys()
    assert sorted(path.name for path in saved.parent.iterdir()) == ["c.json", "c.safetensors"]


def test_the_same_is_saved_as_the_same_bytes(saved: Path, tmp_path: Path) -> None:
    """Neither time nor the order of arrays is in the file."""
    other = tmp_path / "again.safetensors"
    save_checkpoint(other, ABOUT, dict(reversed(STATE.items())), CURVE)
    assert other.read_bytes() == saved.read_bytes()


@pytest.mark.parametrize("stop", ["fsync", "replace"])
def test_a_save_that_fails_leaves_the_old_one(
    saved: Path, stop: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk, before or while the new file is put in place, loses nothing and leaves no litter."""

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(*((os, "fsync") if stop == "fsync" else (Path, "replace")), full)
    with pytest.raises(UserError, match="No space left on device"):
        save_checkpoint(saved, replace(ABOUT, steps=8), STATE, CURVE)
    monkeypatch.undo()
    assert load_checkpoint(saved).about.steps == 7
    assert len(list(saved.parent.iterdir())) == 2


def test_numbers_that_are_not_finite_are_not_saved(tmp_path: Path) -> None:
    """A run that went astray does not replace a good checkpoint."""
    with pytest.raises(UserError, match=r"tensor 'state\.w' holds numbers that are not finite"):
        save_checkpoint(tmp_path / "c.safetensors", ABOUT, {"w": np.array([np.inf])})
    assert list(tmp_path.iterdir()) == []


def test_an_array_that_was_changed_is_noticed(saved: Path) -> None:
    """One bit of one number is enough."""
    content = bytearray(saved.read_bytes())
    content[-1] ^= 1
    saved.write_bytes(content)
    with pytest.raises(UserError, match="not those that were written"):
        load_checkpoint(saved)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_damaged_file_is_refused_or_sound(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Cut or changed anywhere, a file is a UserError, or its arrays are those that were written."""
    path = tmp_path_factory.mktemp("damaged") / "c.safetensors"
    save_checkpoint(path, ABOUT, STATE, CURVE)
    content = bytearray(path.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        content = content[:at]
    else:
        content[at] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    try:
        stored = load_checkpoint(path)
    except UserError:
        return
    assert {name: array.tolist() for name, array in stored.state.items()} == {
        name: array.tolist() for name, array in STATE.items()
    }


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
        header(2, b"[]"),
        header(100_000, b"[" * 100_000),
        save({"w": np.zeros(2)}),
        save({"w": np.zeros(2)}, metadata={"card": "{}"}),
        save({"w": np.zeros(2)}, metadata={"card": "x" * (1 << 19) + "x"}),
        save({"w": np.zeros(2)}, metadata={"card": "null"}),
    ],
)
def test_what_is_no_checkpoint_is_refused(tmp_path: Path, content: bytes) -> None:
    """Nothing that is not a safetensors file with a card gets in, and the message names the file."""
    path = tmp_path / "bad.safetensors"
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"bad\.safetensors"):
        load_checkpoint(path)


def test_the_weights_of_a_backend_are_no_checkpoint(tmp_path: Path) -> None:
    """They have a card, too, of another kind."""
    save_model(tmp_path / "cnn.safetensors", {"w": np.zeros(2)}, Card("cnn", "no frames", 0))
    with pytest.raises(UserError, match="the card is wrong at learner: Field required"):
        load_checkpoint(tmp_path / "cnn.safetensors")


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"seed": -1}, "seed"),
        ({"seed": "zero"}, "seed"),
        ({"steps": 1.5}, "steps"),
        ({"learner": ""}, "learner"),
        ({"config": {"rate": [1]}}, "config.rate"),
        ({"columns": ["steps"]}, "learning curve is broken"),
        ({"format": 2}, "format 2"),
        ({"mood": "good"}, "mood"),
        ({"sha256": "0"}, "not those that were written"),
    ],
)
def test_a_wrong_card_is_refused(saved: Path, change: dict[str, Any], where: str) -> None:
    """The field is named."""
    content = {**asdict(load_checkpoint(saved).about), **change}
    saved.write_bytes(save(load(saved.read_bytes()), metadata={"card": json.dumps(content)}))
    with pytest.raises(UserError, match=where):
        load_checkpoint(saved)


def test_paths_that_lead_to_no_file_are_refused(tmp_path: Path) -> None:
    """Missing, a folder, a pipe, another ending."""
    os.mkfifo(tmp_path / "pipe.safetensors")
    (tmp_path / "folder.safetensors").mkdir()
    for name, problem in {
        "missing.safetensors": "no such file; check the path, or learn first",
        "folder.safetensors": "this is a folder",
        "pipe.safetensors": "no ordinary file",
        "weights.pt": r"end in \.safetensors",
    }.items():
        with pytest.raises(UserError, match=problem):
            load_checkpoint(tmp_path / name)
    with pytest.raises(UserError, match="cannot be written"):
        save_checkpoint(tmp_path / "pipe.safetensors" / "c.safetensors", ABOUT, STATE)


def test_the_digest_tells_worlds_apart() -> None:
    """The same graph on the same maze has one digest; a start less, or a dearer step, has another."""
    maze = parse_layout("grid\n. . : D1 G1\nT1 . | . .\nstart 0,0\ntrigger T1\ngoal G1")
    model, graph = maze_model(maze), two_rooms(maze)
    first, again = digest(ground(graph, model)), digest(ground(graph, maze_model(maze)))
    assert first == again
    fewer, dearer = model.starts.copy(), model.outcome_rewards.copy()
    fewer[np.flatnonzero(fewer)[0]] = False
    dearer[0, 0] -= 1
    given_ = (model.index, model.actions, model.outcomes)
    for other in (
        TransitionModel(*given_, model.outcome_rewards, fewer, probabilities=model.probabilities),
        TransitionModel(*given_, dearer, model.starts, probabilities=model.probabilities),
    ):
        assert digest(ground(graph, other)) != first
