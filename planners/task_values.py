"""What the children of tasks are worth in a state, and the greedy way of going by that.

Whatever knows these values, a table or a network, acts in the same way: each task takes its best child, the
first in order among equals, until it ends.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property, lru_cache
from itertools import accumulate

from hierarchy import GroundGraph
from planners.exploration import first_best
from worlds import Stream, TransitionModel, UserError


class TaskValues(ABC):
    """Values of the children of every task of a ground graph.

    Parameters
    ----------
    grounded
        The ground graph, with its world's model.
    tie
        Children whose values differ by no more than this count as equal.
    chance
        Where a stochastic world's outcomes come from on greedy ways.
    """

    def __init__(self, grounded: GroundGraph, tie: float, chance: Stream) -> None:
        self.grounded, self.tie, self.chance = grounded, tie, chance
        nodes = grounded.nodes
        self._primitives = len(grounded.model.actions)
        self._terminal: list[list[bool]] = [node.terminal.tolist() for node in nodes]
        self._children = [[call.child for call in node.calls] for node in nodes]
        self._available = [_choices(grounded, place) for place in range(len(nodes))]

    @abstractmethod
    def q(self, task: int, state: int, k: int) -> float:
        """Return Q(task, state, k-th child): the child first, then the task to its end."""

    def _preference(self, task: int, state: int, k: int) -> float:
        """Return what the task's own policy compares its children by."""
        return self.q(task, state, k)

    def choices(self, task: int, state: int) -> tuple[int, ...]:
        """Return the places of the children that a task may call in a state."""
        return self._available[task][state]

    def greedy(self, task: int, state: int) -> int:
        """Return the place of the best child, the first in order among equals."""
        return first_best(self._runnable(task, state), self._preferences(task, state), self.tie)

    def _preferences(self, task: int, state: int) -> list[float]:
        return [self._preference(task, state, k) for k in self._available[task][state]]

    def _runnable(self, task: int, state: int) -> tuple[int, ...]:
        """Return what a task may call in a state, at least one child."""
        choices = self._available[task][state]
        if not choices:
            name, where = self.grounded.nodes[task].name, self.grounded.model.index.words(state)
            raise UserError(
                f"task {name} has no child to call in state {state} ({where}); start it where it runs, "
                "and see what hierarchy.check says of the graph"
            )
        return choices

    @cached_property
    def _outcomes(self) -> list[list[list[tuple[int, float, float]]]]:
        """What may follow, by state and action; read when needed, for a black box has nothing to read."""
        return _outcomes(self.grounded.model)

    def _act(self, action: int, state: int, chance: Stream) -> tuple[int, float]:
        """Return the next state and the reward of a primitive action; chance decides if it must."""
        outcomes = self._outcomes[state][action]
        if len(outcomes) == 1:
            return outcomes[0][:2]
        draw = chance.uniform()
        for after, reward, up_to in outcomes:
            if draw < up_to:
                return after, reward
        return outcomes[-1][:2]

    def follow(self, action: int, state: int) -> int:
        """Return the state that a primitive action leads to, learning nothing.

        Chance has a stream of its own here, so that a measurement never changes what is learnt after it.
        """
        return self._act(action, state, self.chance)[0]

    def greedy_route(self, task: int, state: int, limit: int = 1000) -> list[tuple[int, int]] | None:
        """Return the (state, primitive action) pairs of the greedy policy, or None past `limit` steps."""
        route: list[tuple[int, int]] = []
        return route if self._follow(task, state, route, limit) is not None else None

    def _follow(self, task: int, state: int, route: list[tuple[int, int]], limit: int) -> int | None:
        if task < self._primitives:
            route.append((state, task))
            return self.follow(task, state) if len(route) <= limit else None
        while not self._terminal[task][state]:
            child = self._children[task][self.greedy(task, state)]
            after = self._follow(child, state, route, limit)
            if after is None:
                return None
            state = after
        return state

    def greedy_steps(self, task: int, state: int, limit: int = 1000) -> int | None:
        """Return the primitive steps of the greedy policy from a state, or None past `limit`."""
        route = self.greedy_route(task, state, limit)
        return None if route is None else len(route)


def _choices(grounded: GroundGraph, place: int) -> list[tuple[int, ...]]:
    """Return the places of the available calls of a node, for every state."""
    calls = grounded.nodes[place].calls
    columns = [call.available.tolist() for call in calls]
    return [tuple(k for k, on in enumerate(row) if on) for row in zip(*columns, strict=True)]


@lru_cache(maxsize=2)  # learners of one world share it
def _outcomes(model: TransitionModel) -> list[list[list[tuple[int, float, float]]]]:
    """Return, by state and action, the outcomes that occur: next state, reward, cumulated probability."""
    table = []
    for after, rewards, chances in zip(
        model.outcomes.tolist(), model.outcome_rewards.tolist(), model.probabilities.tolist(), strict=True
    ):
        row = []
        for outcomes in zip(after, rewards, chances, strict=True):
            occurring = [outcome for outcome in zip(*outcomes, strict=True) if outcome[2] > 0]
            cumulated = accumulate(chance for _, _, chance in occurring)
            row.append([(s, r, up_to) for (s, r, _), up_to in zip(occurring, cumulated, strict=True)])
        table.append(row)
    return table
