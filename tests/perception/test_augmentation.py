"""Frames spoilt at random for training: what stays, what goes, and what a patch before the lens is."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.augmentation import Augmentation, augment
from worlds.torch_stream import generator

PATCH_ONLY = Augmentation(
    darkest=1.0, brightest=1.0, tint=0.0, saturation=0.0, noisy=0.0, blurred=0.0, coarse=0.0, hidden=1.0
)


def patched(seed: int, how: Augmentation, count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Return grey frames with patches, and where these are."""
    frames = torch.full((count, 3, 64, 64), 0.5)
    found = augment(frames, how, generator(seed)).numpy()
    return found, (np.abs(found - 0.5) > 1e-4).any(axis=1)


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


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 1000))
def test_a_patch_is_a_rectangle_of_one_colour(seed: int) -> None:
    """It lies wholly in the picture, and its area and proportions are within their limits."""
    found, where = patched(seed, PATCH_ONLY)
    for frame, place in zip(found, where, strict=True):
        rows, cols = np.flatnonzero(place.any(axis=1)), np.flatnonzero(place.any(axis=0))
        height, width = rows[-1] - rows[0] + 1, cols[-1] - cols[0] + 1
        assert place.sum() == height * width
        assert np.ptp(frame[:, place], axis=1).max() < 1e-6
        assert (height - 1) * (width - 1) < PATCH_ONLY.patch * 64 * 64
        assert (height + 1) * (width + 1) > 0.02 * 64 * 64
        assert (height + 1) / (width - 1) > 1 / 2.5
        assert (height - 1) / (width + 1) < 2.5


def test_patches_come_in_all_sizes_and_places() -> None:
    """Over many frames the largest are near the limit, and every row and column is hidden at times."""
    _, where = patched(3, PATCH_ONLY, 400)
    areas = where.mean(axis=(1, 2))
    assert areas.min() < 0.04
    assert 0.9 * PATCH_ONLY.patch < areas.max() < 1.1 * PATCH_ONLY.patch
    assert areas.mean() == pytest.approx((0.02 + PATCH_ONLY.patch) / 2, abs=0.02)
    assert where.any(axis=(0, 1)).all()
    assert where.any(axis=(0, 2)).all()


def test_the_share_of_patched_frames_is_the_one_asked_for() -> None:
    """Of 400 frames about a quarter are patched where a quarter is wanted."""
    _, where = patched(4, Augmentation(**{**vars(PATCH_ONLY), "hidden": 0.25}), 400)
    assert where.any(axis=(1, 2)).mean() == pytest.approx(0.25, abs=0.07)


def test_a_patch_is_in_the_light_of_the_rest() -> None:
    """In a third of the light a patch's colours go from 0 to a third."""
    dim = Augmentation(**{**vars(PATCH_ONLY), "darkest": 1 / 3, "brightest": 1 / 3})
    found = augment(torch.full((200, 3, 16, 16), 0.5), dim, generator(5)).numpy()
    assert found.max() < 1 / 3 + 1e-4
    assert found.max() > 0.3
