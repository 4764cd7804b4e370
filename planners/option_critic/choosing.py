"""Which option runs next, and what that is worth: the rules that acting and learning share."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor

REFUSED: Final = -1e9
"""Added to what may not be chosen, in place of minus infinity, whose products are no numbers."""


def first_ended(ended: Tensor) -> tuple[Tensor, Tensor]:
    """Return whether anything of a stack has ended, and the first level that has, shapes (...,).

    Parameters
    ----------
    ended
        By level, shape (..., levels), bool.

    Examples
    --------
    >>> first_ended(torch.tensor([[False, True], [False, False]]))
    (tensor([ True, False]), tensor([1, 0]))
    """
    return ended.any(-1), ended.int().argmax(-1)


def greedy(values: Tensor, choosable: Tensor) -> Tensor:
    """Return the best option that may be chosen, the first among equals, shape (...,).

    Parameters
    ----------
    values, choosable
        Shape (..., options).

    Examples
    --------
    >>> greedy(torch.tensor([3.0, 1.0, 2.0]), torch.tensor([False, True, True]))
    tensor(2)
    """
    return values.masked_fill(~choosable, REFUSED).argmax(-1)


def any_of(choosable: Tensor, draw: Tensor) -> Tensor:
    """Return one of the options that may be chosen, each as likely, shape (...,).

    Parameters
    ----------
    choosable
        Shape (..., options), bool.
    draw
        Uniform numbers from 0 to 1, shape (...,).

    Examples
    --------
    >>> any_of(torch.tensor([[False, True, True]] * 2), torch.tensor([0.4, 0.6]))
    tensor([1, 2])
    """
    count = choosable.sum(-1)
    wanted = torch.minimum((draw * count).long(), count - 1)
    return (choosable.cumsum(-1) <= wanted[..., None]).sum(-1).clamp(max=choosable.shape[-1] - 1)


def permitted(logits: Tensor, mask: Tensor) -> Tensor:
    """Return log-probabilities of actions, of those that an option may take; of all where it may take none.

    An option that goes on where its task has ended, as learnt terminations may have it, may take none.

    Parameters
    ----------
    logits, mask
        Shape (..., actions).

    Examples
    --------
    >>> permitted(torch.zeros(2, 2), torch.tensor([[True, False], [False, False]])).exp().tolist()
    [[1.0, 0.0], [0.5, 0.5]]
    """
    allowed = mask | ~mask.any(-1, keepdim=True)
    return logits.masked_fill(~allowed, REFUSED).log_softmax(-1)


def of_option(found: Tensor, option: Tensor) -> Tensor:
    """Return the rows of some options.

    Parameters
    ----------
    found
        Shape (..., options, columns).
    option
        Shape (...,).

    Examples
    --------
    >>> of_option(torch.tensor([[[1, 2], [3, 4]]]), torch.tensor([1]))
    tensor([[3, 4]])
    """
    where = option[..., None, None].expand(*option.shape, 1, found.shape[-1])
    return found.gather(-2, where).squeeze(-2)


def upon_arrival(
    values: Tensor, option: Tensor, ending: Tensor, initiation: Tensor, cost: float
) -> tuple[Tensor, Tensor]:
    """Return what an option is worth where it arrives: U, which goes on or ends, and what going on is ahead.

    With probability `ending` of a level its task ends, unless one that called it already has; then the best
    option that may be chosen there follows, be it the same one, at a `cost`. Sutton, Precup and Singh (1999,
    section 3), Bacon, Harb and Precup (2017, equation 3), for stacks of tasks.

    Parameters
    ----------
    values
        Of the options in the state of arrival, shape (..., options).
    option
        The one that arrives, shape (...,).
    ending
        Probability that its task at each level ends, shape (..., levels).
    initiation
        What may be chosen if control comes back at a level, shape (..., levels, options).
    cost
        The deliberation cost of ending (Harb et al., 2018).

    Returns
    -------
    worth
        U, shape (...,).
    ahead
        By level, how much more going on is worth than ending there, shape (..., levels): minus the gradient
        of U by `ending`. A level matters as far as the tasks that called it go on, and going on there may
        still be ended by a level above it. With one level this is the advantage of theorem 2 (Bacon, Harb
        and Precup, 2017).

    Examples
    --------
    >>> worth, ahead = upon_arrival(
    ...     torch.tensor([1.0, 5.0]), torch.tensor(0), torch.tensor([0.5]), torch.ones(1, 2).bool(), 0.0
    ... )
    >>> worth, ahead
    (tensor(3.), tensor([-4.]))
    """
    going_on = values.gather(-1, option[..., None])
    best = values[..., None, :].masked_fill(~initiation, REFUSED).amax(-1)
    # Where nothing may be chosen an option has no way but to go on.
    ended = torch.where(initiation.any(-1), best - cost, going_on)
    worth, ahead = going_on[..., 0], []
    for level in reversed(range(ended.shape[-1])):
        ahead.append(worth - ended[..., level])
        worth = torch.lerp(worth, ended[..., level], ending[..., level])
    reached = torch.cat([torch.ones_like(going_on), (1 - ending[..., :-1]).cumprod(-1)], -1)
    return worth, reached * torch.stack(ahead[::-1], -1)


def summed_to_end(rewards: Tensor, over: Tensor, decay: float) -> Tensor:
    """Return what is still to come of some rewards before an option is over, discounted.

    Parameters
    ----------
    rewards
        Of each step of trajectories, time the last dimension but one, shape (..., time, 1).
    over
        Whether the option is over after the step, of the same shape.
    decay
        What one step later is worth.

    Examples
    --------
    >>> rewards = torch.tensor([[1.0], [2.0], [4.0]])
    >>> summed_to_end(rewards, torch.tensor([[False], [True], [False]]), 0.5).flatten().tolist()
    [2.0, 2.0, 4.0]
    """
    found, later = torch.empty_like(rewards), torch.zeros_like(rewards[..., 0, :])
    for step in reversed(range(rewards.shape[-2])):
        later = rewards[..., step, :] + decay * later * ~over[..., step, :]
        found[..., step, :] = later
    return found
