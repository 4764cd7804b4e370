"""The line that learning is to reach: the oracle's best return from every start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundGraph
from planners import flat_optimum
from planners.option_critic.greedy import GreedyPolicy
from worlds.errors import UserError

_SAME: Final = 1e-6  # returns that differ by no more than this are equal


@dataclass(frozen=True, eq=False)
class Line:
    """What there is to reach: the best return from every start that the root's end can be reached from.

    Parameters
    ----------
    starts
        Numbers of states, shape (starts,).
    best
        The flat optimum's exact values, shape (starts,).
    """

    starts: NDArray[np.int64]
    best: NDArray[np.float64]

    @classmethod
    def of(cls, grounded: GroundGraph) -> Line:
        """Ask the oracle.

        Raises
        ------
        UserError
            If no start leads to the root's end.
        """
        terminal = grounded.nodes[grounded.root].terminal
        best = flat_optimum(grounded.model, terminal).value
        starts = np.flatnonzero(grounded.model.starts & ~terminal & np.isfinite(best))
        if not starts.size:
            name = grounded.graph.name
            raise UserError(f"task graph {name}: no start leads to its end; see affordant check {name}")
        return cls(starts, best[starts])

    def measure(self, policy: GreedyPolicy) -> Measured:
        """Return how near a policy comes."""
        returns = policy.returns(self.starts)
        ending = np.isfinite(returns)
        lost = (self.best - returns)[ending]
        nothing = not ending.any()
        return Measured(
            float((self.best - returns <= _SAME).mean()),
            float(ending.mean()),
            float("nan") if nothing else float(returns[ending].mean()),
            float("nan") if nothing else float(lost.mean()),
        )


class Measured(NamedTuple):
    """How near a policy comes to the best.

    Attributes
    ----------
    share_optimal
        Share of the starts from which its return is the best possible, within 1e-6.
    share_ending
        Share of the starts from which it surely ends.
    mean_return, mean_loss
        Of those from which it ends, and by how much it falls short of the best; nan if there are none.
    """

    share_optimal: float
    share_ending: float
    mean_return: float
    mean_loss: float

    def enough(self, tolerance: float) -> bool:
        """Return whether learning may stop: all optimal, or all ending and the mean near enough."""
        near = self.share_ending == 1 and self.mean_loss <= tolerance and tolerance > 0
        return self.share_optimal == 1 or near
