"""The CNN backend: its network, how it learns, and the weights that come with the package."""

from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from perception import LABELS
from perception.audit import accuracies, audit, groups, held_out_audit, hues
from perception.augmentation import Augmentation, augment, generator
from perception.cnn import READY_MADE, Cnn
from perception.models import Card, save_model
from perception.network import PIXELS, SHAPES, Network, scores
from perception.pushed import PushedFrames, pushed_frames
from perception.training import Rows, Training, held_out, resized, train
from perception.variation import CLEAN
from worlds import UserError

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
    assert Path(*Path(__import__("perception").__file__).parts[:-1], READY_MADE).stat().st_size < 1_000_000


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


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), count=st.integers(1, 5))
def test_augmented_frames_are_frames(seed: int, count: int) -> None:
    """Spoilt frames keep their shape and range, repeat with their seed, and leave the originals alone."""
    frames = torch.rand(count, 3, 32, 32, generator=generator(seed))
    before = frames.clone()
    one, again = (augment(frames, Augmentation(), generator(seed, 1)) for _ in range(2))
    assert one.shape == frames.shape
    assert 0 <= float(one.min()) <= float(one.max()) <= 1
    assert torch.equal(one, again)
    assert torch.equal(frames, before)


def test_tuning_frames_are_kept_apart() -> None:
    """Every tenth frame is held out and no frame is in both parts."""
    data = Rows(blobs(40).frames, np.zeros(40, np.int64), np.arange(40))
    learnt, kept = held_out(data)
    assert kept.distances.tolist() == [9, 19, 29, 39]
    assert not set(learnt.distances.tolist()) & set(kept.distances.tolist())


def test_audit_counts_every_frame_by_its_group(pushed: PushedFrames) -> None:
    """Groups of colour, of size and of distance each hold every obstacle once."""
    found = groups(pushed)
    for kind in ("colour", "size", "distance"):
        total = sum(rows.astype(int) for name, rows in found.items() if name.startswith(kind))
        assert np.array_equal(total, (pushed.labels > 0).astype(int))
    counted = audit(Cnn().perceive, pushed)
    assert sum(of for _, of in counted.values()) == (pushed.labels == 0).sum() + 3 * (pushed.labels > 0).sum()
    assert all(0 <= right <= of for right, of in counted.values())


def test_audit_finds_a_shortcut(pushed: PushedFrames) -> None:
    """A backend that learnt nothing of a distance fails on it, and the audit says so."""
    learnt = {}

    def fit(data: Rows) -> object:
        learnt["distances"] = set(data.distances[data.labels > 0].tolist())

        class Near:
            labels = np.zeros(int(((pushed.labels > 0) & (pushed.distances == 2)).sum()), np.int64)

        return lambda _frames: Near

    found = held_out_audit(fit, pushed, pushed, ("distance 2",))  # type: ignore[arg-type]
    assert learnt["distances"] == {1}
    assert found["distance 2"][0] == 0
    assert found["distance 2"][1] > 10
    with pytest.raises(ValueError, match="no group"):
        held_out_audit(fit, pushed, pushed, ("colour of the wind",))  # type: ignore[arg-type]


def test_primary_colours_have_their_names() -> None:
    """Each hue's own colour and its darker shade bear its name, and accuracies leave empty groups out."""
    pure = np.array(
        [[255, 0, 0], [255, 255, 0], [0, 255, 0], [0, 255, 255], [0, 0, 255], [255, 0, 255]], np.uint8
    )
    assert hues(pure).tolist() == hues(pure // 3).tolist()
    assert hues(pure).tolist() == ["red", "yellow", "green", "cyan", "blue", "magenta"]
    assert accuracies(np.zeros(1), np.zeros(1), {"none": np.array([False])}) == {}
    assert len(LABELS) == 3
