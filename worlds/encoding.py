"""States as numbers for networks: a column for every value of a variable. Importing it loads PyTorch."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import embedding

from worlds.errors import UserError, suggest
from worlds.layout import Cell
from worlds.variables import StateIndex, Variable

_MOST: Final = 1 << 24  # numbers in a table of all states at once; above, each variable has its own


class Encoding:
    """What networks see of the states of a finite world.

    Of each variable there is a column for every value, 1 for the one it has; of variables whose values are
    cells, one for every row and every column of the grid besides, so that cells in line have something in
    common.

    Parameters
    ----------
    index
        Numbers the states.
    device
        Where the tensors live.

    Attributes
    ----------
    columns
        For each column the name of the variable that it tells of.

    Examples
    --------
    >>> from worlds import StateIndex, Variable
    >>> encoding = Encoding(StateIndex((Variable("x", (0, 1, 2)), Variable("door", ("shut", "open")))))
    >>> encoding(torch.tensor([0, 5])).tolist()
    [[1.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.0, 1.0]]
    >>> encoding.reading(["door"]).tolist()
    [False, False, False, True, True]
    """

    def __init__(self, index: StateIndex, device: torch.device | str | None = None) -> None:
        self.index = index
        tables = [_table(variable) for variable in index.variables]
        self.columns = tuple(
            variable.name
            for variable, table in zip(index.variables, tables, strict=True)
            for _ in range(table.shape[1])
        )
        self._tables = [torch.as_tensor(table, device=device) for table in tables]
        self._whole = index.size * len(self.columns) <= _MOST
        if self._whole:
            self._tables = [self._joined(torch.arange(index.size, device=device))]

    @classmethod
    def of_table(
        cls,
        index: StateIndex,
        seen: NDArray[np.float32],
        columns: Iterable[str],
        device: torch.device | str | None = None,
    ) -> Self:
        """Return an encoding of one's own, such as what a camera's frames are made into.

        Parameters
        ----------
        index
            Numbers the states.
        seen
            What is seen of every state, shape (states, columns).
        columns
            For each column the variable that it tells of.
        device
            Where the tensors live.

        Raises
        ------
        UserError
            If the shape does not fit, or a column tells of no variable.

        Examples
        --------
        >>> from worlds import StateIndex, Variable
        >>> index = StateIndex((Variable("x", (0, 1, 2)),))
        >>> Encoding.of_table(index, np.array([[0.0], [0.5], [1.0]], np.float32), ["x"])(torch.tensor([2]))
        tensor([[1.]])
        """
        named = tuple(columns)
        if seen.shape != (index.size, len(named)):
            wanted = (index.size, len(named))
            raise UserError(f"a table of shape {seen.shape} does not fit; give (states, columns) = {wanted}")
        found = cls(index, device)
        found.columns, found._whole = named, True
        found.reading(named)  # refuses names that are no variables
        found._tables = [torch.as_tensor(seen, dtype=torch.float32, device=device)]
        return found

    def __call__(self, state: Tensor) -> Tensor:
        """Return what states of some numbers look like, shape (*state.shape, columns), float32."""
        # An embedding's look-up is four times as quick as indexing.
        return embedding(state, self._tables[0]) if self._whole else self._joined(state)

    def reading(self, names: Iterable[str]) -> Tensor:
        """Return which columns tell of some variables, shape (columns,), bool.

        Raises
        ------
        UserError
            If there is no such variable.
        """
        wanted = set(names)
        for name in sorted(wanted - set(self.index.names)):
            raise UserError(f"there is no state variable {name!r}; {suggest(name, self.index.names)}")
        return torch.tensor([name in wanted for name in self.columns])

    def _joined(self, state: Tensor) -> Tensor:
        positions, rest = [], state
        for variable in reversed(self.index.variables):
            positions.append(rest % len(variable))
            rest = rest // len(variable)
        parts = zip(self._tables, reversed(positions), strict=True)
        return torch.cat([table[position] for table, position in parts], dim=-1)


def _table(variable: Variable) -> NDArray[np.float32]:
    """Return what each value of a variable looks like, shape (values, columns)."""
    found = [np.eye(len(variable), dtype=np.float32)]
    if all(isinstance(value, Cell) for value in variable.values):
        for places in np.array(variable.values).T:
            on = places[:, None] == np.unique(places)
            found.append(on.astype(np.float32))
    return np.concatenate(found, axis=1)
