"""Corruptions of frames, by name, at five severities, repeatable.

What happens to frame i of a batch is a function of seed, i, the corruption's name and the severity alone.
Lengths in pixels are for a frame 96 pixels wide and grow with the frame. The corruption that makes an
obstacle's colour like the floor's is one of the scene: `perception.variation.Variation.camouflage`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import cos, pi, sin
from types import MappingProxyType
from typing import Any, Final
from zlib import crc32

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from perception.protocol import Frame
from worlds import Stream, UserError, suggest

SEVERITIES: Final = (1, 2, 3, 4, 5)
_WIDTH: Final = 96
_ONE = 0x9E37_79B9  # keeps a corruption's streams apart from the scenes' of the same seed

Corruption = Callable[[Frame, int, Stream], Frame]
"""Takes a frame, shape (H, W, 3), a severity and random numbers; gives another frame of that shape."""


def corrupt(name: str, frames: NDArray[np.uint8], severity: int, seed: int) -> NDArray[np.uint8]:
    """Return frames as a worse camera, or a worse place, would show them.

    Parameters
    ----------
    name
        One of `CORRUPTIONS`.
    frames
        RGB, uint8, shape (n, H, W, 3); they are left as they are.
    severity
        1 (slight) to 5 (severe).
    seed
        Names the random numbers; frame i has its own.

    Returns
    -------
    NDArray[np.uint8]
        Shape (n, H, W, 3).

    Raises
    ------
    UserError
        If the name or the severity is unknown, or the frames are no RGB frames.

    Examples
    --------
    >>> grey = np.full((2, 96, 96, 3), 100, np.uint8)
    >>> [round(float(corrupt("dim_light", grey, severity, seed=0).mean())) for severity in (1, 3, 5)]
    [81, 47, 24]
    """
    if name not in CORRUPTIONS:
        raise UserError(f"unknown corruption {name!r}; {suggest(name, CORRUPTIONS)}")
    if severity not in SEVERITIES:
        raise UserError(f"severity {severity} of {name}; use 1 (slight) to {len(SEVERITIES)} (severe)")
    if frames.dtype != np.uint8 or frames.ndim != 4 or frames.shape[-1] != 3 or 0 in frames.shape[1:]:
        raise UserError(f"frames are uint8 of shape (n, height, width, 3), not {frames.dtype} {frames.shape}")
    out = np.empty_like(frames)
    for i, frame in enumerate(frames):
        stream = Stream(seed, _ONE, crc32(name.encode()), i)
        out[i] = CORRUPTIONS[name](np.ascontiguousarray(frame), severity, stream)
    return out


def _gaussian_noise(frame: Frame, severity: int, stream: Stream) -> Frame:
    """Add the sensor's noise, independent in every pixel and channel."""
    deviation = (8.0, 15.0, 24.0, 36.0, 50.0)[severity - 1]
    return _bytes(frame + deviation * _normals(stream, frame.shape))


def _motion_blur(frame: Frame, severity: int, stream: Stream) -> Frame:
    """Move the camera along a line of any direction while the shutter is open."""
    length = _scaled((3.0, 5.0, 7.0, 10.0, 14.0)[severity - 1], frame)
    angle = stream.between(0.0, pi)
    half = (length - 1) / 2
    size = 2 * int(np.ceil(half)) + 1
    steps = np.linspace(-half, half, 8 * size)
    kernel = np.zeros((size, size), np.float32)
    rows = np.rint(size // 2 + steps * sin(angle)).astype(np.int64)
    cols = np.rint(size // 2 + steps * cos(angle)).astype(np.int64)
    np.add.at(kernel, (rows, cols), np.float32(1 / len(steps)))
    return _frame(cv2.filter2D(frame, -1, kernel, borderType=cv2.BORDER_REPLICATE))


def _dim_light(frame: Frame, severity: int, stream: Stream) -> Frame:
    """Take light away, and add the sensor's noise that comes with it."""
    share = (0.75, 0.58, 0.44, 0.32, 0.22)[severity - 1] * stream.between(0.9, 1.1)
    return _bytes(share * frame + (0.5 + 0.3 * severity) * _normals(stream, frame.shape))


def _occlusion(frame: Frame, severity: int, stream: Stream) -> Frame:
    """Hold a patch of one colour somewhere in front of the lens."""
    height, width = frame.shape[:2]
    area = (0.03, 0.06, 0.10, 0.15, 0.22)[severity - 1]
    aspect = stream.between(0.5, 2.0)
    rows = min(max(round(height * (area * aspect) ** 0.5), 1), height)
    cols = min(max(round(width * (area / aspect) ** 0.5), 1), width)
    top, left = stream.below(height - rows + 1), stream.below(width - cols + 1)
    out = frame.copy()
    out[top : top + rows, left : left + cols] = [stream.below(256) for _ in range(3)]
    return out


def _low_resolution(frame: Frame, severity: int, stream: Stream) -> Frame:  # noqa: ARG001 (nothing is drawn)
    """Give the sensor fewer pixels, and enlarge them again."""
    height, width = frame.shape[:2]
    share = (0.6, 0.45, 0.34, 0.25, 0.18)[severity - 1]
    small = max(round(width * share), 1), max(round(height * share), 1)
    coarse = cv2.resize(frame, small, interpolation=cv2.INTER_AREA)
    return _frame(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR))


def _jpeg(frame: Frame, severity: int, stream: Stream) -> Frame:  # noqa: ARG001 (nothing is drawn)
    """Compress the frame as JPEG."""
    quality = (50, 30, 18, 11, 6)[severity - 1]
    # The format keeps brightness better than colour, so which channel is red matters.
    bgr = cv2.cvtColor(frame, cv2.COLOR_RGB2BGR)
    _, packed = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return _frame(cv2.imdecode(packed, cv2.IMREAD_COLOR_RGB))


def _salt_and_pepper(frame: Frame, severity: int, stream: Stream) -> Frame:
    """Make some pixels dead, black or white."""
    share = (0.01, 0.02, 0.04, 0.07, 0.11)[severity - 1]
    draw = stream.uniforms(frame.shape[0] * frame.shape[1]).reshape(frame.shape[:2])
    out = frame.copy()
    out[draw < share / 2] = 0
    out[draw >= 1 - share / 2] = 255
    return out


def _defocus(frame: Frame, severity: int, stream: Stream) -> Frame:  # noqa: ARG001 (nothing is drawn)
    """Put the lens out of focus: every point becomes a disc."""
    radius = _scaled((1.2, 1.8, 2.5, 3.4, 4.5)[severity - 1], frame)
    size = int(np.ceil(radius))
    fine = (np.arange(8 * (2 * size + 1)) + 0.5) / 8 - size - 0.5
    inside = (np.hypot(fine[:, None], fine[None, :]) <= radius).astype(np.float32)
    kernel = cv2.resize(inside, (2 * size + 1, 2 * size + 1), interpolation=cv2.INTER_AREA)
    return _frame(cv2.filter2D(frame, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE))


def _low_contrast(frame: Frame, severity: int, stream: Stream) -> Frame:
    """Let mist rise: all colours are drawn towards one grey."""
    share = (0.7, 0.55, 0.4, 0.3, 0.2)[severity - 1]
    return _bytes(share * frame + (1 - share) * stream.between(90.0, 166.0))


def _grey(frame: Frame, severity: int, stream: Stream) -> Frame:  # noqa: ARG001 (nothing is drawn)
    """Take colour away, at severity 5 all of it."""
    share = severity / len(SEVERITIES)
    grey = cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)[..., None]
    return _bytes((1 - share) * frame + share * grey)


def _hue_shift(frame: Frame, severity: int, stream: Stream) -> Frame:
    """Turn every hue by the same angle, either way round."""
    degrees = (15, 35, 60, 100, 180)[severity - 1] * (1 if stream.below(2) else -1)
    turned = cv2.cvtColor(frame, cv2.COLOR_RGB2HSV)
    turned[..., 0] = (turned[..., 0].astype(np.int64) + degrees // 2) % 180  # opencv counts in steps of 2
    return _frame(cv2.cvtColor(turned, cv2.COLOR_HSV2RGB))


CORRUPTIONS: Final[Mapping[str, Corruption]] = MappingProxyType(
    {
        "gaussian_noise": _gaussian_noise,
        "motion_blur": _motion_blur,
        "dim_light": _dim_light,
        "occlusion": _occlusion,
        "low_resolution": _low_resolution,
        "jpeg": _jpeg,
        "salt_and_pepper": _salt_and_pepper,
        "defocus": _defocus,
        "low_contrast": _low_contrast,
        "grey": _grey,
        "hue_shift": _hue_shift,
    }
)
"""Every corruption of a frame, by name."""
HELD_OUT: Final = ("salt_and_pepper", "defocus", "jpeg", "low_contrast", "grey", "hue_shift")
"""Those that no backend may be trained or tuned on: they measure what it makes of the unforeseen."""


def _normals(stream: Stream, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return standard normal numbers of a shape."""
    uniforms = stream.uniforms(int(np.prod(shape))).reshape(shape)
    numbers: NDArray[np.float64] = ndtri(uniforms + 2.0**-54)  # never 0, whose quantile is infinite
    return numbers


def _scaled(length: float, frame: Frame) -> float:
    width: int = frame.shape[1]
    return max(length * width / _WIDTH, 1.0)


def _bytes(values: NDArray[np.floating[Any]]) -> Frame:
    frame: Frame = np.rint(values).clip(0, 255).astype(np.uint8)
    return frame


def _frame(image: Any) -> Frame:
    """Say of what opencv gave that it is a frame."""
    return np.asarray(image, dtype=np.uint8)
