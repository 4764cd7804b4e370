"""Frames spoilt at random while a network learns, so that it does not go by what a camera can lose.

Every batch draws from a generator of its own, made from seed and step: a run can be repeated step by step.
What is held out of training on purpose, to measure how far robustness carries: salt and pepper, defocus by a
disc, low contrast about the mean, grey, hue and JPEG.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

_WEIGHTS: Final = (0.299, 0.587, 0.114)  # of red, green and blue in brightness (ITU-R BT.601)
_KERNEL: Final = 11  # pixels; the longest blur
_SMALLEST: Final = 0.02  # of a frame's area: of patches the smallest
_SLIMMEST: Final = 2.5  # the height of a patch as a share of its width, or the other way round

Spoil = Callable[[Tensor, torch.Generator], Tensor]
"""Takes frames, shape (frames, 3, rows, columns), and a generator; gives spoilt ones."""


@dataclass(frozen=True)
class Augmentation:
    """How strongly frames are spoilt. Shares are of the frames of a batch; colours run from 0 to 1.

    Parameters
    ----------
    darkest, brightest
        Range of the factor on all colours, drawn on a log scale.
    tint
        Each channel is multiplied by 1 - tint to 1 + tint.
    saturation
        Colours are drawn towards grey, or away from it, by a factor of 1 - saturation to 1 + saturation.
    noisy, noise
        Share of frames with gaussian noise, and its largest standard deviation.
    blurred
        Share of frames smeared along a line of up to 11 pixels.
    coarse
        Share of frames whose resolution is divided by 2 or 4.
    hidden, patch
        Share of frames with a patch of one colour held before the lens, and the largest area of one, as a
        share of the frame's.
    """

    darkest: float = 0.2
    brightest: float = 1.3
    tint: float = 0.25
    saturation: float = 0.7
    noisy: float = 0.4
    noise: float = 0.18
    blurred: float = 0.3
    coarse: float = 0.1
    hidden: float = 0.75
    patch: float = 0.25


def augment(frames: Tensor, settings: Augmentation, draw: torch.Generator) -> Tensor:
    """Return a batch of frames, each spoilt in its own way.

    Parameters
    ----------
    frames
        Colours from 0 to 1, shape (frames, 3, rows, columns), on any device.
    settings
        How strongly.
    draw
        A generator on the CPU: every device then sees the same spoilt frames up to rounding.

    Returns
    -------
    Tensor
        Of the same shape, colours from 0 to 1.

    Examples
    --------
    >>> frames = torch.full((2, 3, 8, 8), 0.5)
    >>> augment(frames, Augmentation(), torch.Generator()).shape
    torch.Size([2, 3, 8, 8])
    """
    hide = partial(_hide, most=settings.patch)
    add_noise = partial(_add_noise, most=settings.noise)
    # What is before the lens is in the same light as the rest, so it comes first; the sensor's noise last.
    frames = _some(frames.clone(), ((0.5, _flip), (settings.hidden, hide)), draw)
    frames = _recolour(frames, settings, draw)
    spoils = ((settings.coarse, _coarsen), (settings.blurred, _smear), (settings.noisy, add_noise))
    return _some(frames, spoils, draw).clamp_(0.0, 1.0)


def _some(frames: Tensor, spoils: Sequence[tuple[float, Spoil]], draw: torch.Generator) -> Tensor:
    """Spoil a share of the frames in each way, in place."""
    for share, spoil in spoils:
        chosen = (torch.rand(len(frames), generator=draw) < share).nonzero().flatten()
        if len(chosen):  # only these: spoiling all and choosing afterwards takes three times as long
            chosen = chosen.to(frames.device)
            frames[chosen] = spoil(frames[chosen], draw)
    return frames


def _uniform(frames: Tensor, shape: tuple[int, ...], draw: torch.Generator) -> Tensor:
    """Return numbers from 0 to 1 for each frame, shape (frames, *shape)."""
    return torch.rand((len(frames), *shape), generator=draw).to(frames.device)


def _flip(frames: Tensor, _draw: torch.Generator) -> Tensor:
    return frames.flip(3)


def _recolour(frames: Tensor, settings: Augmentation, draw: torch.Generator) -> Tensor:
    grey = (frames * frames.new_tensor(_WEIGHTS).view(1, 3, 1, 1)).sum(1, keepdim=True)
    vivid = 1 + settings.saturation * (2 * _uniform(frames, (1, 1, 1), draw) - 1)
    tint = 1 + settings.tint * (2 * _uniform(frames, (3, 1, 1), draw) - 1)
    ratio = settings.brightest / settings.darkest
    light = settings.darkest * ratio ** _uniform(frames, (1, 1, 1), draw)
    return ((grey + vivid * (frames - grey)) * tint * light).clamp(0.0, 1.0)


def _add_noise(frames: Tensor, draw: torch.Generator, *, most: float) -> Tensor:
    strength = _uniform(frames, (1, 1, 1), draw) * most
    return frames + strength * torch.randn(frames.shape, generator=draw).to(frames.device)


def _hide(frames: Tensor, draw: torch.Generator, *, most: float) -> Tensor:
    """Hold a patch of one colour before each frame, anywhere, wholly in the picture."""
    area = _SMALLEST + (most - _SMALLEST) * _uniform(frames, (1, 1, 1), draw)
    aspect = _SLIMMEST ** (2 * _uniform(frames, (1, 1, 1), draw) - 1)
    inside = []
    for axis, side in ((2, (area * aspect).sqrt()), (3, (area / aspect).sqrt())):
        start = (1 - side) * _uniform(frames, (1, 1, 1), draw)
        count = frames.shape[axis]
        place = (torch.arange(count, device=frames.device) + 0.5) / count
        place = place.view([1, 1, 1, -1] if axis == 3 else [1, 1, -1, 1])
        inside.append((place >= start) & (place < start + side))
    return torch.where(inside[0] & inside[1], _uniform(frames, (3, 1, 1), draw), frames)


def _coarsen(frames: Tensor, draw: torch.Generator) -> Tensor:
    factor = 2 ** int(torch.randint(1, 3, (), generator=draw))
    small = functional.avg_pool2d(frames, factor)
    return functional.interpolate(small, size=frames.shape[2:], mode="bilinear")


def _smear(frames: Tensor, draw: torch.Generator) -> Tensor:
    """Smear each frame along a line of its own direction and length."""
    count, channels, *_ = frames.shape
    reach = (_KERNEL - 1) / 2
    place = torch.arange(_KERNEL, device=frames.device) - reach
    turn = _uniform(frames, (1, 1), draw) * torch.pi
    half = 0.5 + _uniform(frames, (1, 1), draw) * reach
    col, row = place.view(1, 1, -1), place.view(1, -1, 1)
    along, off = col * turn.cos() + row * turn.sin(), row * turn.cos() - col * turn.sin()
    kernel = (1 - off.abs()).clamp(min=0) * (half + 0.5 - along.abs()).clamp(0, 1)
    kernel = kernel / kernel.sum((1, 2), keepdim=True)
    padded = functional.pad(frames, (_KERNEL // 2,) * 4, mode="replicate")
    # A kernel for each frame: the frames become channels of one, convolved in groups.
    flat = padded.reshape(1, count * channels, *padded.shape[2:])
    weight = kernel.repeat_interleave(channels, 0).unsqueeze(1)
    smeared = functional.conv2d(flat, weight, groups=count * channels)
    return smeared.view_as(frames)
