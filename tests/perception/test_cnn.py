"""The CNN backend: its network, how it learns, and the weights that come with the package."""

from pathlib import Path

import numpy as np
import pytest
import torch

import perception
from perception.augmentation import Augmentation
from perception.cnn import Cnn
from perception.labelled import PIXELS, Rows, held_out, resized
from perception.models import Card, save_model
from perception.network import SHAPES, Network, scores
from perception.pushed import PushedFrames, pushed_frames
from perception.training import Training, train
from perception.variation import CLEAN
from worlds import UserError
from worlds.torch_stream import generator

QUICK = Training(updates=12, batch=16)


def blobs(count: int = 60, seed: int = 0) -> Rows:
    """Return frames that a glance tells apart: empty, a bright square, a dark one; near ones are larger."""
    random = np.random.default_rng(seed)
    labels, distances = np.arange(count) % 3, 1 + np.arange(count) // 3 % 2
    frames = random.integers(100, 130, (count, 64, 64, 3), np.uint8)
    for frame, label, distance in zip(frames, labels, distances, strict=True):
        half = 16 // distance
        if label:
            frame[40 - half : 40 + half, 32 - half : 32 + half] = 255 if label == 1 else 0
    return Rows(frames, labels, distances)


@pytest.fixture(scope="module")
def pushed() -> PushedFrames:
    """Return clean frames of a test seed."""
    return pushed_frames(range(60), 299, CLEAN)


def test_network_is_small() -> None:
    """The network has fewer than 100,000 parameters, and its weights come in less than 1 MB."""
    assert sum(parameter.numel() for parameter in Network().parameters()) < 100_000
    weights = Path(perception.__file__).parent / "weights" / "cnn.safetensors"
    assert weights.stat().st_size < 1_000_000


def test_folding_changes_nothing() -> None:
    """The folded network gives the scores of the one that learnt, whatever its running figures are."""
    network = Network()
    network.draw(generator(3))
    network.train()
    network(torch.rand(32, 3, PIXELS, PIXELS, generator=generator(4)) ** 2)  # moves the running figures
    network.eval()
    frames = torch.rand(4, 3, PIXELS, PIXELS, generator=generator(5))
    folded = {name: torch.from_numpy(array) for name, array in network.folded().items()}
    assert {name: tensor.shape for name, tensor in folded.items()} == dict(SHAPES)
    assert torch.allclose(scores(folded, frames), network(frames), atol=1e-4)


def test_brightness_and_contrast_do_not_count() -> None:
    """A frame at a third of its contrast has the same scores."""
    folded = {name: torch.from_numpy(array) for name, array in Network().eval().folded().items()}
    frames = torch.rand(2, 3, PIXELS, PIXELS, generator=generator(6))
    assert torch.allclose(scores(folded, frames), scores(folded, frames / 3 + 0.2), atol=1e-3)


def test_same_seed_same_bits() -> None:
    """The same data and seed give the same weights bit for bit, and another seed gives others."""
    data = blobs()
    one, again, other = (train(data, seed, QUICK) for seed in (1, 1, 2))
    assert all(np.array_equal(one[name], again[name]) for name in SHAPES)
    assert not np.array_equal(one["heads.weight"], other["heads.weight"])


def test_training_leaves_torch_as_it_was() -> None:
    """Neither the number of threads nor torch's random numbers are changed by a training."""
    threads = torch.get_num_threads()
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    train(blobs(), 0, Training(updates=10, batch=8))
    assert torch.get_num_threads() == threads
    assert torch.equal(torch.rand(3), expected)


def test_it_learns_labels_and_distances() -> None:
    """After a short training it tells squares that it has not seen, and how far they are."""
    plain = Augmentation(darkest=0.9, noisy=0, blurred=0, coarse=0, hidden=0)
    shares: list[float] = []
    cnn = Cnn().fit(blobs(), 0, settings=Training(updates=60, augmentation=plain), progress=shares.append)
    fresh = blobs(30, seed=9)
    found = cnn.perceive(fresh.frames)
    assert (found.labels == fresh.labels).mean() > 0.9
    assert (found.distances == fresh.distances)[fresh.labels > 0].mean() > 0.9
    assert shares[-1] == 1.0
    assert len(shares) == 60


def test_batches_and_singles_agree_to_the_bit(pushed: PushedFrames) -> None:
    """A frame's probabilities do not depend on the batch that it comes in."""
    cnn = Cnn()
    whole = cnn.perceive(pushed.frames[:6]).probabilities
    singles = [cnn.perceive(frame[None]).probabilities[0] for frame in pushed.frames[:6]]
    assert np.array_equal(whole, np.array(singles))


def test_ready_made_weights_are_good(pushed: PushedFrames) -> None:
    """On clean frames of a seed never learnt from, the ready-made weights err at most once in 60."""
    found = Cnn().perceive(pushed.frames)
    assert (found.labels == pushed.truth).sum() >= 59
    assert (found.distances == pushed.true_distances)[pushed.truth > 0].mean() > 0.95


def test_saved_and_loaded_is_the_same(tmp_path: Path, pushed: PushedFrames) -> None:
    """What is loaded sees what was saved, with the same card."""
    cnn = Cnn().fit(blobs(), 3, settings=QUICK, about="squares")
    cnn.save(tmp_path / "mine.safetensors")
    loaded = Cnn.load(tmp_path / "mine.safetensors")
    assert loaded.card == cnn.card
    assert (loaded.card.data, loaded.card.seed) == ("squares", 3)
    assert np.array_equal(loaded.scores(pushed.frames[:4]), cnn.scores(pushed.frames[:4]))


def test_weights_of_another_network_are_refused(tmp_path: Path) -> None:
    """A file with other tensors, or for another backend, is refused by name."""
    save_model(tmp_path / "w.safetensors", {"conv0.weight": np.zeros((2, 2))}, Card("cnn", "", 0))
    with pytest.raises(UserError, match=r"conv0\.bias|another network"):
        Cnn.load(tmp_path / "w.safetensors")
    save_model(tmp_path / "h.safetensors", {"factors": np.zeros(2)}, Card("hog", "", 0))
    with pytest.raises(UserError, match="'hog', not 'cnn'"):
        Cnn.load(tmp_path / "h.safetensors")


def test_temperature_goes_into_the_last_layer(pushed: PushedFrames) -> None:
    """Tempered tensors at temperature 1 give the probabilities of the backend."""
    cnn = Cnn()
    same = Cnn(model=cnn.tempered())
    frames = pushed.frames[:5]
    assert same.card.temperature == 1.0
    assert np.allclose(same.perceive(frames).probabilities, cnn.perceive(frames).probabilities, atol=1e-5)


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((0, 64, 64, 3), np.uint8),
        np.zeros((64, 64, 3), np.uint8),
        np.zeros((1, 64, 64, 3), np.float32),
        np.zeros((1, 64, 64, 4), np.uint8),
    ],
)
def test_wrong_frames_are_refused(wrong: np.ndarray) -> None:
    """An empty batch, one frame, floats and four channels are refused."""
    with pytest.raises(UserError, match="frames need uint8"):
        Cnn().perceive(wrong)


def test_wrong_data_are_refused() -> None:
    """Labels that are too few, out of range or without a distance are refused before anything is learnt."""
    data = blobs(30)
    with pytest.raises(UserError, match="as many labels"):
        train(Rows(data.frames, data.labels[:5], data.distances), 0, QUICK)
    with pytest.raises(UserError, match="labels are 0 to 2"):
        train(Rows(data.frames, data.labels + 1, data.distances), 0, QUICK)
    with pytest.raises(UserError, match="distances of obstacles"):
        train(Rows(data.frames, data.labels, data.distances + 1), 0, QUICK)


def test_too_short_a_training_is_refused() -> None:
    """Fewer than ten updates, or batches of one frame, are refused."""
    for wrong in ({"updates": 9}, {"batch": 1}):
        with pytest.raises(UserError, match="at least 10 updates of at least 2 frames"):
            Training(**wrong)


def test_frames_of_any_size_are_resized() -> None:
    """Larger and smaller frames become 64 x 64; a flat colour stays what it is."""
    for side in (8, 64, 96, 200):
        small = resized(np.full((2, side, side, 3), 77, np.uint8))
        assert small.shape == (2, PIXELS, PIXELS, 3)
        assert (small == 77).all()


def test_tuning_frames_are_kept_apart() -> None:
    """Every tenth frame is held out and no frame is in both parts."""
    data = Rows(blobs(40).frames, np.zeros(40, np.int64), np.arange(40))
    learnt, kept = held_out(data)
    assert kept.distances.tolist() == [9, 19, 29, 39]
    assert not set(learnt.distances.tolist()) & set(kept.distances.tolist())
