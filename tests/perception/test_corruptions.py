"""Corruptions repeat, leave their input alone, and grow worse with severity."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from perception.corruptions import CORRUPTIONS, HELD_OUT, SEVERITIES, corrupt
from perception.pushed import pushed_frames
from perception.variation import Variation
from worlds import UserError


@pytest.fixture(scope="module")
def frames() -> NDArray[np.uint8]:
    """Return a few frames of the twin."""
    return pushed_frames(range(6), 290, Variation()).frames


@pytest.mark.parametrize("name", CORRUPTIONS)
def test_severity_makes_it_worse(name: str, frames: NDArray[np.uint8]) -> None:
    """The mean change of a pixel grows from each severity to the next, and the first changes something."""
    change = [np.abs(corrupt(name, frames, s, 0).astype(int) - frames).mean() for s in SEVERITIES]
    if name == "hue_shift":  # farthest is half a turn; which channel it changes most goes by the colour
        assert 0 < change[0] < change[2]
    else:
        assert change == sorted(change)
        assert change[0] > 0.2
        assert change[4] > 1.4 * change[0]


@pytest.mark.parametrize("name", CORRUPTIONS)
def test_a_frame_goes_by_its_number_and_the_seed(name: str, frames: NDArray[np.uint8]) -> None:
    """The same frame at the same place comes out the same in any batch; the input is untouched."""
    before = frames.copy()
    whole = corrupt(name, frames, 3, 7)
    assert np.array_equal(corrupt(name, frames[:2], 3, 7), whole[:2])
    assert np.array_equal(frames, before)
    assert whole.dtype == np.uint8
    assert whole.shape == frames.shape


@pytest.mark.parametrize("name", sorted(CORRUPTIONS.keys() - {"low_resolution", "jpeg", "defocus", "grey"}))
def test_chance_differs_between_frames_and_seeds(name: str, frames: NDArray[np.uint8]) -> None:
    """Where chance plays a part, no two of many equal frames or seeds come out alike all the time."""
    same = np.repeat(frames[:1], 12, axis=0)
    out = corrupt(name, same, 3, 0)
    assert any(not np.array_equal(out[0], other) for other in out[1:])
    assert not np.array_equal(out, corrupt(name, same, 3, 1))


def test_noise_has_the_deviation_it_says() -> None:
    """Severity 3 adds noise of deviation 24 about the frame, cut off by nothing at medium grey."""
    noisy = corrupt("gaussian_noise", np.full((1, 96, 96, 3), 128, np.uint8), 3, 0)
    assert noisy.mean() == pytest.approx(128, abs=1)
    assert noisy.std() == pytest.approx(24, abs=1)


@pytest.mark.parametrize("name", ["motion_blur", "defocus"])
@given(severity=st.sampled_from(SEVERITIES), seed=st.integers(0, 2**30))
@settings(max_examples=25, deadline=None)
def test_blur_spreads_a_point_and_keeps_its_light(name: str, severity: int, seed: int) -> None:
    """A white point stays where it is, symmetric about itself, and its light sums to what it was."""
    point = np.zeros((1, 65, 65, 3), np.uint8)
    point[0, 32, 32] = 255
    spread = corrupt(name, point, severity, seed)[0, ..., 0].astype(float)
    assert spread.sum() == pytest.approx(255, rel=0.2)  # rounding, over as many pixels as it has
    rows, cols = np.nonzero(spread)
    assert (rows.mean(), cols.mean()) == pytest.approx((32, 32), abs=0.5)


def test_grey_at_its_worst_has_no_colour(frames: NDArray[np.uint8]) -> None:
    """At severity 5 red, green and blue are one."""
    grey = corrupt("grey", frames, 5, 0)
    assert (grey.max(axis=-1) == grey.min(axis=-1)).all()


def test_hue_shift_keeps_value_and_greys(frames: NDArray[np.uint8]) -> None:
    """A turned hue has the same brightest channel; grey has no hue to turn."""
    turned = corrupt("hue_shift", frames, 4, 0)
    assert np.abs(turned.max(axis=-1).astype(int) - frames.max(axis=-1)).max() <= 1
    grey = corrupt("grey", frames, 5, 0)
    assert np.array_equal(corrupt("hue_shift", grey, 4, 0), grey)


@given(
    name=st.sampled_from(sorted(CORRUPTIONS)),
    severity=st.sampled_from(SEVERITIES),
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
)
@settings(max_examples=60, deadline=None)
def test_any_size_of_frame(name: str, severity: int, size: tuple[int, int]) -> None:
    """Frames of any height and width keep them."""
    frames = np.full((2, *size, 3), 90, np.uint8)
    assert corrupt(name, frames, severity, 0).shape == frames.shape


def test_occlusion_covers_the_share_it_says() -> None:
    """At severity 5 about 22 % of a frame is one other colour."""
    black = np.zeros((40, 96, 96, 3), np.uint8)
    covered = corrupt("occlusion", black, 5, 0).any(axis=-1).mean()
    assert covered == pytest.approx(0.22, abs=0.02)


def test_held_out_corruptions_are_known() -> None:
    """The held-out ones are some of all, and not all of them."""
    assert set(HELD_OUT) < set(CORRUPTIONS)


def test_no_frames_give_no_frames() -> None:
    """A batch of no frames is left as it is."""
    assert corrupt("grey", np.zeros((0, 8, 8, 3), np.uint8), 1, 0).shape == (0, 8, 8, 3)


@pytest.mark.parametrize(
    ("name", "shape", "dtype", "severity", "message"),
    [
        ("motionblur", (1, 8, 8, 3), np.uint8, 1, "did you mean 'motion_blur'"),
        ("grey", (1, 8, 8, 3), np.uint8, 0, "severity 0 of grey"),
        ("grey", (8, 8, 3), np.uint8, 1, r"not uint8 \(8, 8, 3\)"),
        ("grey", (1, 8, 8, 4), np.uint8, 1, "frames are uint8"),
        ("grey", (1, 8, 8, 3), np.float64, 1, "not float64"),
    ],
)
def test_wrong_input_is_refused(
    name: str, shape: tuple[int, ...], dtype: type, severity: int, message: str
) -> None:
    """Unknown names and severities, and what is no batch of frames, are refused in words."""
    with pytest.raises(UserError, match=message):
        corrupt(name, np.zeros(shape, dtype), severity, 0)
