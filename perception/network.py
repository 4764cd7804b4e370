"""The network of the CNN backend: four convolutions, and two heads for label and distance.

It learns with batch normalisation; what is kept, and what runs, is the folded network: each normalisation is
a factor and a constant by then, and goes into the convolution before it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from perception.labelled import PIXELS
from perception.learnt import SCORES

CONVOLUTIONS: Final = ((3, 16, 2), (16, 32, 2), (32, 64, 2), (64, 64, 1))
"""Channels in, channels out and stride of each; all are 3 x 3."""
_HIDDEN: Final = 32
_FAINT: Final = 1e-4  # of the range of colours: less than this is no picture
_PLACES: Final = (PIXELS // 16) ** 2  # of the map that the heads see

FEATURES: Final = CONVOLUTIONS[-1][1] * _PLACES
"""Numbers of the last map of a frame."""

SHAPES: Final[Mapping[str, tuple[int, ...]]] = {
    **{f"conv{i}.weight": (out, into, 3, 3) for i, (into, out, _) in enumerate(CONVOLUTIONS)},
    **{f"conv{i}.bias": (out,) for i, (_, out, _) in enumerate(CONVOLUTIONS)},
    "hidden.weight": (_HIDDEN, FEATURES),
    "hidden.bias": (_HIDDEN,),
    "heads.weight": (SCORES, _HIDDEN),
    "heads.bias": (SCORES,),
}
"""The folded network's tensors."""


class Network(nn.Module):
    """The network as it learns.

    Parameters
    ----------
    dropout
        Share of the last map that is left out at random while it learns.

    Examples
    --------
    >>> Network()(torch.zeros(2, 3, 64, 64)).shape  # 3 labels, 2 distances
    torch.Size([2, 5])
    >>> sum(parameter.numel() for parameter in Network().parameters()) < 100_000
    True
    """

    def __init__(self, dropout: float = 0.05) -> None:
        super().__init__()
        self.convs = nn.ModuleList(
            nn.Conv2d(into, out, 3, stride, 1, bias=False) for into, out, stride in CONVOLUTIONS
        )
        self.norms = nn.ModuleList(nn.BatchNorm2d(out) for _, out, _ in CONVOLUTIONS)
        self.dropout = nn.Dropout(dropout)
        self.hidden = nn.Linear(CONVOLUTIONS[-1][1] * _PLACES, _HIDDEN)
        self.heads = nn.Linear(_HIDDEN, SCORES)

    def forward(self, frames: Tensor) -> Tensor:
        """Return scores, shape (frames, 5), of frames with colours from 0 to 1, shape (frames, 3, 64, 64)."""
        x = standardised(frames)
        for conv, norm in zip(self.convs, self.norms, strict=True):
            x = functional.relu(norm(conv(x)))
        x = functional.max_pool2d(x, 2).flatten(1)
        scores: Tensor = self.heads(functional.relu(self.hidden(self.dropout(x))))
        return scores

    def draw(self, random: torch.Generator) -> None:
        """Draw the weights anew (He and others, "Delving deep into rectifiers", ICCV 2015)."""
        for module in (*self.convs, self.hidden, self.heads):
            assert isinstance(module, nn.Conv2d | nn.Linear), "only these two have weights to draw"
            nn.init.kaiming_normal_(module.weight, nonlinearity="relu", generator=random)
            if module.bias is not None:
                nn.init.zeros_(module.bias)

    def folded(self) -> dict[str, NDArray[Any]]:
        """Return the tensors of the network that `scores` runs, as `SHAPES` names them, float32."""
        found: dict[str, Tensor] = {}
        for i, (conv, norm) in enumerate(zip(self.convs, self.norms, strict=True)):
            assert isinstance(norm, nn.BatchNorm2d), "each convolution has its normalisation"
            assert norm.running_mean is not None, "normalisations keep running figures"
            assert norm.running_var is not None, "normalisations keep running figures"
            assert isinstance(conv, nn.Conv2d), "it normalises a convolution"
            factor = norm.weight / torch.sqrt(norm.running_var + norm.eps)
            found[f"conv{i}.weight"] = conv.weight * factor.view(-1, 1, 1, 1)
            found[f"conv{i}.bias"] = norm.bias - norm.running_mean * factor
        for name, layer in (("hidden", self.hidden), ("heads", self.heads)):
            found[f"{name}.weight"], found[f"{name}.bias"] = layer.weight, layer.bias
        return {
            name: np.ascontiguousarray(tensor.detach().cpu().numpy(), dtype=np.float32)
            for name, tensor in found.items()
        }


def standardised(frames: Tensor) -> Tensor:
    """Return frames each with mean 0 and standard deviation 1: dim and pale frames look like others then.

    Examples
    --------
    >>> frames = torch.rand(1, 3, 64, 64)
    >>> torch.allclose(standardised(frames), standardised(0.5 * frames + 0.1), atol=1e-3)
    True
    """
    deviation, mean = torch.std_mean(frames, (1, 2, 3), keepdim=True, correction=0)
    return (frames - mean) / (deviation + _FAINT)


def scores(tensors: Mapping[str, Tensor], frames: Tensor) -> Tensor:
    """Return what the folded network makes of frames.

    Parameters
    ----------
    tensors
        As `SHAPES` names them.
    frames
        Colours from 0 to 1, shape (frames, 3, 64, 64).

    Returns
    -------
    Tensor
        Scores of labels and distances, shape (frames, 5).

    Examples
    --------
    >>> network = Network().eval()
    >>> tensors = {name: torch.from_numpy(array) for name, array in network.folded().items()}
    >>> frames = torch.rand(1, 3, 64, 64)
    >>> torch.allclose(scores(tensors, frames), network(frames), atol=1e-5)
    True
    """
    x = last_map(tensors, frames)
    x = functional.linear(x, tensors["hidden.weight"], tensors["hidden.bias"]).relu_()
    return functional.linear(x, tensors["heads.weight"], tensors["heads.bias"])


def last_map(tensors: Mapping[str, Tensor], frames: Tensor) -> Tensor:
    """Return the last map of the folded network, which its heads see, shape (frames, `FEATURES`).

    Parameters
    ----------
    tensors, frames
        As `scores` takes them.
    """
    x = standardised(frames)
    for i, (_, _, stride) in enumerate(CONVOLUTIONS):
        weight, bias = tensors[f"conv{i}.weight"], tensors[f"conv{i}.bias"]
        x = functional.conv2d(x, weight, bias, stride, 1).relu_()
    return functional.max_pool2d(x, 2).flatten(1)
