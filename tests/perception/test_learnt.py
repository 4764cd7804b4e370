"""What all backends that learn have in common: calibration, effort, weights on disk, repeatable bits."""

import hashlib
import json
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import save

from perception.calibration import fit_temperature, softmax
from perception.cnn import Cnn
from perception.ensemble import Ensemble
from perception.hog import Hog
from perception.labelled import Rows
from perception.learnt import Learnt
from perception.models import Card
from perception.training import Training
from worlds import UserError

BACKENDS = (Cnn, Hog, Ensemble)
CARD = Card("shade", "nothing", 0)


class Shade(Learnt):
    """Goes by the first pixel's colours: their values are the scores of labels, times what it learnt."""

    name, shapes, packages = "shade", {"factor": (1,)}, ("numpy",)

    def scores(self, frames: np.ndarray) -> np.ndarray:
        """Return the colours as scores of labels; the second distance wins where green is above 100."""
        colours = frames[:, 0, 0].astype(np.float64) * self.tensors["factor"]
        far = frames[:, 0, 0, 1:2] > 100
        return np.concatenate([colours, ~far, far], axis=1)

    def fit(self, data: Any, seed: int, *, tuning: Any = None, about: Any = None, **_: Any) -> "Shade":
        """Learn how many frames it was given."""
        return self._fitted(data, seed, tuning, about, lambda rows: {"factor": np.array([len(rows.frames)])})


def coloured(count: int = 40, seed: int = 0) -> Rows:
    """Return frames of faint colours, with labels that hardly go by them."""
    random = np.random.default_rng(seed)
    frames = np.repeat(random.integers(0, 3, (count, 1, 1, 3), np.uint8), 8, axis=1).repeat(8, axis=2)
    labels = np.where(
        random.random(count) < 0.6, frames[:, 0, 0].argmax(axis=1), random.integers(0, 3, count)
    )
    return Rows(frames, labels, np.ones(count, np.int64))


def test_scores_become_percepts() -> None:
    """Probabilities are the softmax of tempered scores, distances the best score's, and doubt abstains."""
    card = Card("shade", "nothing", 0, temperature=4.0, threshold=0.9)
    shade = Shade(model=({"factor": np.array([2.0])}, card))
    frames = np.zeros((2, 8, 8, 3), np.uint8)
    frames[0, 0, 0], frames[1, 0, 0] = (0, 1, 2), (0, 120, 0)
    found = shade.perceive(frames)
    assert np.allclose(found.probabilities[0], softmax(np.array([[0.0, 0.5, 1.0]])))
    assert found.labels.tolist() == [2, 1]
    assert found.distances.tolist() == [1, 2]
    assert found.abstains.tolist() == [True, False]


def test_fitting_calibrates_on_frames_that_were_not_learnt() -> None:
    """Of 40 frames 36 are learnt and 4 set the temperature; tuning frames, where given, do it instead."""
    data, tuning = coloured(), coloured(30, seed=1)
    shade = Shade(model=({"factor": np.ones(1)}, CARD)).fit(data, 7, about="shades")
    kept = Rows.of(data, np.arange(9, 40, 10))
    assert shade.tensors["factor"].tolist() == [36]
    assert shade.card.temperature == fit_temperature(shade.scores(kept.frames)[:, :3], kept.labels)
    assert (shade.card.backend, shade.card.data, shade.card.seed) == ("shade", "shades", 7)
    shade.fit(data, 7, tuning=tuning)
    assert shade.tensors["factor"].tolist() == [40]
    assert shade.card.temperature == fit_temperature(shade.scores(tuning.frames)[:, :3], tuning.labels)
    assert shade.card.data == "40 frames"


def test_a_backend_of_ones_own_is_saved_and_loaded(tmp_path: Path) -> None:
    """The base class does both, and refuses a file for another backend."""
    shade = Shade(model=({"factor": np.array([3.0])}, CARD))
    shade.save(tmp_path / "s.safetensors")
    loaded = Shade.load(tmp_path / "s.safetensors")
    assert loaded.tensors["factor"].tolist() == [3.0]
    assert loaded.card == CARD
    with pytest.raises(UserError, match="'shade', not 'cnn'"):
        Cnn.load(tmp_path / "s.safetensors")


def test_wrong_data_are_refused_whether_learnt_or_tuned_on() -> None:
    """Labels out of range are a UserError in either part, and what was known stays."""
    data = coloured()
    wrong = Rows(data.frames, data.labels + 1, data.distances)
    for learnt, tuning in ((wrong, None), (wrong, data), (data, wrong)):
        hog = Hog()
        with pytest.raises(UserError, match="labels are 0 to 2"):
            hog.fit(learnt, 0, tuning=tuning)
        assert hog.card == Hog().card


def test_hog_needs_no_torch() -> None:
    """Importing and running the HOG backend leaves torch out."""
    code = (
        "import sys, numpy as np; from perception.hog import Hog; "
        "Hog().perceive(np.zeros((1, 64, 64, 3), np.uint8)); sys.exit('torch' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], check=False)  # noqa: S603 (our own words)
    assert run.returncode == 0


@pytest.mark.parametrize("effort", [0.0, -1.0, 10.5, float("nan"), float("inf")])
def test_effort_out_of_range_is_refused(effort: float) -> None:
    """All three backends say what effort may be, and know afterwards what they knew."""
    for backend in (kind() for kind in BACKENDS):
        before = backend.card
        with pytest.raises(UserError, match="above 0 and at most 10"):
            backend.fit(coloured(), 0, effort=effort)
        assert backend.card == before


def test_effort_is_a_share_of_the_updates() -> None:
    """Half the effort takes half the updates, but never fewer than ten."""
    usual = Training(updates=24, batch=8)
    for effort, updates in ((0.5, 12), (0.01, 10), (1.25, 30)):
        shares: list[float] = []
        Cnn().fit(coloured(), 0, settings=usual, effort=effort, progress=shares.append)
        assert len(shares) == updates
        assert usual.scaled(effort) == Training(updates=updates, batch=8)


def test_effort_changes_nothing_in_hog() -> None:
    """The best linear classifier is the same whatever the effort."""
    one, other = (Hog().fit(coloured(), 0, effort=effort) for effort in (1.0, 0.1))
    assert np.array_equal(one.tensors["factors"], other.tensors["factors"])


@pytest.mark.parametrize("kind", BACKENDS)
def test_hostile_weights_are_refused(kind: type[Learnt], tmp_path: Path) -> None:
    """A pickle in disguise runs nothing; cut, infinite or extra tensors are refused as well."""
    tensors, card = kind.ready_made()
    path, mark = tmp_path / "w.safetensors", tmp_path / "mark"

    class Hostile:
        def __reduce__(self) -> tuple[Any, ...]:
            return Path.touch, (mark,)

    kind(model=(tensors, card)).save(path)
    whole = path.read_bytes()
    path.with_suffix(".json").unlink()
    first = next(iter(tensors))
    words = {"card": header_card(whole)}
    infinite = {**tensors, first: np.full_like(tensors[first], np.inf)}
    for content in (
        pickle.dumps(Hostile()),
        whole[:-1],
        whole[: len(whole) // 2],
        whole[1:],
        save(infinite, metadata=words),
        save({**tensors, "extra": np.zeros(1, np.float32)}, metadata=words),
        save({name: tensor for name, tensor in tensors.items() if name != first}, metadata=words),
        save(tensors),
    ):
        path.write_bytes(content)
        with pytest.raises(UserError, match=r"w\.safetensors"):
            kind.load(path)
    assert not mark.exists()
    path.write_bytes(whole)
    assert kind.load(path).card == card


def header_card(content: bytes) -> str:
    """Return the card in a weights file's header, as it stands there."""
    length = int.from_bytes(content[:8], "little")
    card: str = json.loads(content[8 : 8 + length])["__metadata__"]["card"]
    return card


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["cnn", "hog"])
def test_processes_learn_the_same_bits(kind: str, tmp_path: Path) -> None:
    """Two processes, one of them with two threads, write the same file from the same data and seed."""
    code = (
        "import sys; from perception.pushed import pushed_frames; "
        "from perception.registry import load_backend; "
        "from perception.variation import Variation; "
        "data = pushed_frames(range(300), 3, Variation()); "
        "load_backend(sys.argv[1]).fit(data, 5, effort=0.01).save(sys.argv[2])"
    )
    found = set()
    for threads in ("1", "2"):
        path = tmp_path / f"{threads}.safetensors"
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        command = [sys.executable, "-c", code, kind, str(path)]
        subprocess.run(command, check=True, env=environment)  # noqa: S603 (our own words)
        found.add(hashlib.sha256(path.read_bytes()).hexdigest())
    assert len(found) == 1
