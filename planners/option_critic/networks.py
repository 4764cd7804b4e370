"""The networks of an option-critic: many small ones side by side, each seeing what its part goes by.

The critic keeps the value of a task stack as MAXQ does, as a sum: what the task on top is worth, and for each
call below it what is still to come once the call has ended (Dietterich, 2000, equation 9). Each summand sees
only the variables that it uses. So what was learnt of one goal holds for stacks that were never seen as a
whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Protocol, runtime_checkable

import torch
from torch import Generator, Tensor, nn

from planners.option_critic.options import NONE, Options
from worlds.encoding import Encoding

_SURE: Final = 30.0  # a logit whose probability is 1 but for rounding
_ROWS: Final = 256  # at a time: what is worked out between two layers then stays in the processor's cache


@runtime_checkable
class OneOption(Protocol):
    """A network that can give what it makes of one option a row at less cost than of all of them."""

    def one_option(self, observation: Tensor, option: Tensor) -> Tensor:
        """Return what it makes of the option of each row, shape (..., columns)."""


class SideBySide(nn.Module):
    """Networks of two hidden layers, computed together; each sees some of the columns.

    Parameters
    ----------
    sees
        Which network sees which column, shape (networks, columns), bool.
    outputs
        Numbers that each gives.
    hidden
        Width of each of its two hidden layers.
    draw
        Where the first weights come from.

    Examples
    --------
    >>> sees = torch.tensor([[True, False], [True, True]])
    >>> networks = SideBySide(sees, 3, 8, torch.Generator())
    >>> found = networks(torch.tensor([[0.5, 0.0], [0.5, 9.0]]))
    >>> found.shape, bool((found[0, 0] == found[1, 0]).all())
    (torch.Size([2, 2, 3]), True)
    """

    sees: Tensor

    def __init__(self, sees: Tensor, outputs: int, hidden: int, draw: Generator) -> None:
        super().__init__()
        self.register_buffer("sees", sees.float(), persistent=False)
        count, columns = sees.shape
        # One column in some ten is not 0: four times the usual variance makes up for part of that.
        sizes = ((columns, hidden, 8.0), (hidden, hidden, 2.0), (hidden, outputs, 1e-4))
        self.weights = nn.ParameterList(
            torch.randn(count, fan, out, generator=draw) * (gain / fan) ** 0.5 for fan, out, gain in sizes
        )
        self.biases = nn.ParameterList(torch.zeros(count, 1, out) for _, out, _ in sizes)

    def forward(self, seen: Tensor) -> Tensor:
        """Return what the networks make of rows, shape (..., columns): (..., networks, outputs)."""
        rows = seen.reshape(-1, seen.shape[-1])
        together = _ROWS if rows.is_cpu else max(1, len(rows))
        found = torch.cat([self._all(part) for part in torch.split(rows, together)])
        return found.view(*seen.shape[:-1], *found.shape[1:])

    def _all(self, rows: Tensor) -> Tensor:
        first, second, last = self.weights
        # The first layers are one matrix, since all see the same rows.
        wide = (first * self.sees[:, :, None]).transpose(0, 1).flatten(1)
        x = torch.relu(torch.addmm(self.biases[0].flatten(), rows, wide))
        x = x.view(len(rows), *self.biases[0].shape[::2]).transpose(0, 1)
        x = torch.relu(torch.baddbmm(self.biases[1], x, second))
        return torch.baddbmm(self.biases[2], x, last).transpose(0, 1)

    def one(self, rows: Tensor, which: Tensor) -> Tensor:
        """Return what one network a row makes of it, shape (rows, outputs).

        Parameters
        ----------
        rows
            Shape (rows, columns).
        which
            The network that each row is for, shape (rows,).
        """
        first, second, last = self.weights
        # Each network's rows stand together, with room for as many as the busiest has.
        order = which.argsort(stable=True)
        sizes = torch.bincount(which, minlength=len(self.sees))
        within = torch.arange(len(which), device=which.device) - (sizes.cumsum(0) - sizes)[which[order]]
        room = int(sizes.max()) if len(which) else 0
        at = torch.empty_like(order)
        at[order] = which[order] * room + within
        x = rows.new_zeros(len(self.sees) * room, rows.shape[-1]).index_copy(0, at, rows)
        x = x.view(len(self.sees), room, rows.shape[-1])
        x = torch.relu(torch.baddbmm(self.biases[0], x, first * self.sees[:, :, None]))
        x = torch.relu(torch.baddbmm(self.biases[1], x, second))
        return torch.baddbmm(self.biases[2], x, last).flatten(0, 1)[at]


class Actor(nn.Module):
    """The policies of the tasks that choose actions: logits by option and action.

    An option that is an action needs none; its logits are 0. Tasks that stand on top of several stacks have
    one policy.
    """

    place: Tensor

    def __init__(self, options: Options, sees: Tensor, hidden: int, draw: Generator) -> None:
        super().__init__()
        self.networks = SideBySide(sees, options.actions.shape[2], hidden, draw) if len(sees) else None
        self.count, self.actions = len(options), options.actions.shape[2]
        self.register_buffer("place", torch.as_tensor(options.task), persistent=False)

    def forward(self, observation: Tensor) -> Tensor:
        """Return logits, shape (..., options, actions)."""
        if self.networks is None:
            return observation.new_zeros(*observation.shape[:-1], self.count, self.actions)
        found = self.networks(observation)[..., self.place, :]
        return torch.where((self.place == NONE)[:, None], 0.0, found)

    def one_option(self, observation: Tensor, option: Tensor) -> Tensor:
        """Return the logits of one option a row, shape (..., actions)."""
        place = self.place[option.flatten()]
        rows = observation.reshape(-1, observation.shape[-1])
        found = rows.new_zeros(len(place), self.actions)
        if self.networks is not None:
            (chosen,) = torch.nonzero(place != NONE, as_tuple=True)
            found = found.index_copy(0, chosen, self.networks.one(rows[chosen], place[chosen]))
        return found.view(*option.shape, self.actions)


class Critic(nn.Module):
    """The value of each option: the sum of its parts.

    Parameters
    ----------
    options
        The options.
    sees
        Which part sees which column, shape (parts, columns), bool.
    hidden
        Width of the networks.
    scale
        What the networks' outputs are multiplied by: about what an episode is worth.
    draw
        Where the first weights come from.
    """

    made_of: Tensor

    def __init__(self, options: Options, sees: Tensor, hidden: int, scale: float, draw: Generator) -> None:
        super().__init__()
        self.networks = SideBySide(sees, 1, hidden, draw)
        self.scale = scale
        self.register_buffer("made_of", torch.as_tensor(options.made_of).float(), persistent=False)

    def forward(self, observation: Tensor) -> Tensor:
        """Return values, shape (..., options)."""
        return torch.matmul(self.networks(observation).squeeze(-1), self.made_of.T) * self.scale

    def one_option(self, observation: Tensor, option: Tensor) -> Tensor:
        """Return the value of one option a row, shape (..., 1)."""
        rows = observation.reshape(-1, observation.shape[-1])
        row, part = torch.nonzero(self.made_of[option.flatten()], as_tuple=True)
        parts = self.networks.one(rows[row], part)
        found = parts.new_zeros(len(rows), 1).index_add(0, row, parts) * self.scale
        return found.view(*option.shape, 1)


class Terminations(nn.Module):
    """The logit of each option's task at each level ending, where this is learnt.

    A primitive action has always ended after its step, and a level that an option lacks never does.
    """

    place: Tensor
    fixed: Tensor

    def __init__(self, options: Options, sees: Tensor, hidden: int, draw: Generator) -> None:
        super().__init__()
        self.networks = SideBySide(sees, 1, hidden, draw) if len(sees) else None
        called = torch.as_tensor(options.nodes)
        place = torch.full_like(called, NONE)
        for i, task in enumerate(called_tasks(options)):
            place[called == task] = i
        self.register_buffer("place", place, persistent=False)
        never = torch.where(called == NONE, -_SURE, _SURE)
        self.register_buffer("fixed", never, persistent=False)

    def forward(self, observation: Tensor) -> Tensor:
        """Return logits, shape (..., options, levels)."""
        if self.networks is None:
            return self.fixed.expand(*observation.shape[:-1], *self.fixed.shape)
        found = self.networks(observation).squeeze(-1)[..., self.place]
        return torch.where(self.place == NONE, self.fixed, found)

    def one_option(self, observation: Tensor, option: Tensor) -> Tensor:
        """Return the logits of one option a row, shape (..., levels)."""
        place, found = self.place[option.flatten()], self.fixed[option.flatten()]
        row, level = torch.nonzero(place != NONE, as_tuple=True)
        if self.networks is not None:
            rows = observation.reshape(-1, observation.shape[-1])
            logits = self.networks.one(rows[row], place[row, level]).squeeze(-1)
            found = found.index_put((row, level), logits)
        return found.view(*option.shape, found.shape[-1])


def called_tasks(options: Options) -> tuple[int, ...]:
    """Return the places of the tasks that options call at any level, in order."""
    primitives = len(options.grounded.model.actions)
    return tuple(sorted({int(node) for node in options.nodes.flatten() if node >= primitives}))


def columns_of(encoding: Encoding, uses: Sequence[Sequence[str]], *, abstracted: bool) -> Tensor:
    """Return which columns each of some parts sees, shape (parts, columns): what it uses, or everything."""
    found = [encoding.reading(names) for names in uses]
    seen = torch.stack(found) if found else torch.zeros(0, len(encoding.columns), dtype=torch.bool)
    return seen if abstracted else torch.ones_like(seen)
