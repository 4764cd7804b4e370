"""Walking shortest ways in PyTorch, for many starts at once."""

from __future__ import annotations

import torch
from torch import Tensor


class Ways:
    """Ways to marks, from tables of the next cell on them.

    A way of n steps is found in about log2(n) look-ups: the first half gives the second, through a table
    of where as many steps lead.

    Parameters
    ----------
    nexts
        Next cell on the way to each mark, shape (marks, cells); a mark leads to itself, and a
        cell without a way to -1.
    starts
        Cells that ways start from.

    Examples
    --------
    >>> ways = Ways(torch.tensor([[1, 2, 3, 3]]), torch.tensor([0, 1]))
    >>> ways.walk(torch.tensor([0, 0]), torch.tensor([0, 1]))[:, :4].tolist()
    [[0, 1, 2, 3], [1, 2, 3, 3]]
    """

    def __init__(self, nexts: Tensor, starts: Tensor) -> None:
        cells = torch.arange(nexts.shape[1], device=nexts.device)
        nexts = torch.where(nexts < 0, cells, nexts)  # where no way leads on, nobody goes
        self.tables = [nexts]
        while True:
            last = self.tables[-1]
            there = last[:, starts]
            if bool((there == nexts.gather(1, there)).all()):
                break
            self.tables.append(last.gather(1, last))

    def walk(self, mark: Tensor, start: Tensor) -> Tensor:
        """Return the cells of ways, shape (ways, any); the mark fills a way up."""
        way = start[:, None]
        for table in self.tables:
            way = torch.cat((way, table[mark[:, None], way]), 1)
        return way


def joined(first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
    """Return ways that go on where others end, and their lengths; the last cell fills a way up.

    Examples
    --------
    >>> way, length = joined(torch.tensor([[5, 6, 6], [6, 6, 6]]), torch.tensor([[6, 7], [6, 7]]))
    >>> way.tolist(), length.tolist()
    ([[5, 6, 7, 7, 7], [6, 7, 7, 7, 7]], [3, 2])
    """
    steps = (first != first[:, -1:]).sum(1)
    length = 1 + steps + (second != second[:, -1:]).sum(1)
    place = torch.arange(first.shape[1] + second.shape[1], device=first.device)
    ahead = (place - steps[:, None]).clamp(0, second.shape[1] - 1)
    there = first.gather(1, place.clamp(max=first.shape[1] - 1).expand(len(first), -1))
    return torch.where(place < steps[:, None], there, second.gather(1, ahead)), length
