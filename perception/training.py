"""How the CNN learns: AdamW under one cycle of the learning rate, on frames spoilt at random.

The same data, seed and settings give the same bits on one machine: weights, order and augmentation are drawn
from streams of the seed, and one thread does the sums.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Final, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from perception.augmentation import Augmentation, augment
from perception.labelled import Labelled, checked_data, resized
from perception.learnt import checked_effort
from perception.network import Network
from perception.protocol import LABELS, REACH
from worlds import UserError
from worlds.torch_stream import generator

_LEAST_UPDATES: Final = 10
_INIT, _ORDER, _SPOIL, _DROP = range(4)  # what a stream of the seed is for


@dataclass(frozen=True)
class Training:
    """How long and how fast the network learns.

    Parameters
    ----------
    updates
        Steps of the optimiser, however many frames there are; at least 10, for the rate to rise and fall.
    batch
        Frames a step.
    rate
        The learning rate's top.
    decay
        Weight decay.
    distance
        Weight of the distance's loss beside the label's.
    augmentation
        How the frames are spoilt.

    Raises
    ------
    UserError
        If there are too few updates, or no frames in a batch.
    """

    updates: int = 6800
    batch: int = 32
    rate: float = 3e-3
    decay: float = 0.02
    distance: float = 0.2
    augmentation: Augmentation = field(default_factory=Augmentation)

    def __post_init__(self) -> None:
        if self.updates < _LEAST_UPDATES or self.batch < 2:
            raise UserError(
                f"training takes at least {_LEAST_UPDATES} updates of at least 2 frames, "
                f"not {self.updates} of {self.batch}"
            )

    def scaled(self, effort: float) -> Self:
        """Return the same with `effort` times as many updates, at least 10.

        Raises
        ------
        UserError
            If the effort is not above 0 and at most 10.

        Examples
        --------
        >>> [Training(updates=400).scaled(effort).updates for effort in (0.5, 0.001, 2)]
        [200, 10, 800]
        """
        updates = max(round(checked_effort(effort) * self.updates), _LEAST_UPDATES)
        return replace(self, updates=updates)


def train(
    data: Labelled,
    seed: int,
    settings: Training | None = None,
    *,
    device: str = "cpu",
    progress: Callable[[float], None] | None = None,
) -> dict[str, NDArray[Any]]:
    """Train a network and return its folded tensors.

    Parameters
    ----------
    data
        What it learns from.
    seed
        Names the run.
    settings
        Defaults to ``Training()``.
    device
        Where torch computes.
    progress
        Called with the share of the steps that is done.

    Raises
    ------
    UserError
        If the data are no batch of frames with labels and distances.
    """
    settings = Training() if settings is None else settings
    frames, labels, distances = (tensor.to(device) for tensor in _prepared(data))
    # Torch's own generator, which initialises layers and drops parts of them, is left as it was.
    with one_thread(), torch.random.fork_rng(devices=[]):
        network = Network().to("cpu")
        network.draw(generator(seed, _INIT))
        network.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        optimiser = torch.optim.AdamW(network.parameters(), lr=settings.rate, weight_decay=settings.decay)
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser, settings.rate, total_steps=settings.updates, pct_start=0.2
        )
        network.train()
        torch.manual_seed(generator(seed, _DROP).initial_seed())
        for step, chosen in enumerate(_batches(len(frames), seed, settings)):
            here = chosen.to(device)
            seen = augment(frames[here].float() / 255, settings.augmentation, generator(seed, _SPOIL, step))
            found = network(seen.contiguous(memory_format=torch.channels_last))
            loss = _loss(found, labels[here], distances[here], settings)
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            schedule.step()
            if progress is not None:
                progress((step + 1) / settings.updates)
        network.eval()
        return network.folded()


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch use one thread meanwhile: the order of sums, and so their last bits, then stay the same."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _prepared(data: Labelled) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    checked_data(data)
    frames = torch.from_numpy(resized(data.frames)).permute(0, 3, 1, 2).contiguous()
    # Distances count from 0 here, as scores do; those of frames with nothing ahead are not read.
    labels, distances = (
        torch.tensor(np.array(values, dtype=np.int64)) for values in (data.labels, data.distances)
    )
    return frames, labels, (distances - 1).clamp(0, REACH - 1)


def _batches(count: int, seed: int, settings: Training) -> Iterator[torch.Tensor]:
    """Yield the frames of each step: every frame once, in a random order, then again in another."""
    left, epoch = torch.empty(0, dtype=torch.int64), 0
    for _ in range(settings.updates):
        while len(left) < settings.batch:
            left = torch.cat([left, torch.randperm(count, generator=generator(seed, _ORDER, epoch))])
            epoch += 1
        yield left[: settings.batch]
        left = left[settings.batch :]


def _loss(
    found: torch.Tensor, labels: torch.Tensor, distances: torch.Tensor, settings: Training
) -> torch.Tensor:
    kinds, cells = found[:, : len(LABELS)], found[:, len(LABELS) :]
    loss = functional.cross_entropy(kinds, labels)
    there = (labels > 0).to(found.dtype)
    far = functional.cross_entropy(cells, distances, reduction="none")
    return loss + settings.distance * (far * there).sum() / there.sum().clamp(min=1)
