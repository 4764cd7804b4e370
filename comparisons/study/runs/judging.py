"""Affordances of a strategy held to the oracle: which are optimal, and what those cost that are not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from comparisons.dynamic import choice_of
from comparisons.robot import Encounter
from hierarchy import GroundGraph
from planners import Plan, Proof, Replanner, Strategy, prove
from worlds import ACTIONS, Layout, MazeState
from worlds.layout_writing import layout_text


class Once(Replanner):
    """The oracle, asked once for each situation: the same plans, which it keeps until it is to forget them.

    Many obstacles with no way between them would take the exact search very long. So it is asked only where
    there is a way past the cubes alone: every way is one of these.
    """

    def __init__(self, layout: Layout, grounded: GroundGraph) -> None:
        super().__init__(layout, grounded)
        self._plans: dict[tuple[int, MazeState], Plan | None] = {}

    def plan(self, task: int, belief: MazeState) -> Plan | None:
        """Return a shortest plan of primitive actions that ends `task`, or None if there is no way."""
        key = task, belief
        if key not in self._plans:
            plain = replace(belief, spheres=frozenset())
            hopeless = bool(belief.spheres) and self.plan(task, plain) is None
            self._plans[key] = None if hopeless else super().plan(task, belief)
        return self._plans[key]

    def forget(self) -> None:
        """Forget all plans."""
        self._plans.clear()


@dataclass(frozen=True)
class Judged:
    """One affordance of a strategy, held to the oracle under what the robot knew.

    Parameters
    ----------
    encounter
        The obstacle, the subtask and the belief.
    best
        A shortest plan of the subtask from there.
    proof
        About the strategy's action; None where it has none at all, though there is a way.
    """

    encounter: Encounter
    best: Plan
    proof: Proof | None

    @property
    def optimal(self) -> bool:
        """Whether the strategy's action is proved an optimal first action."""
        return self.proof is not None and self.proof.optimal

    @property
    def fatal(self) -> bool:
        """Whether the subtask cannot be ended any more after the strategy's action."""
        return self.proof is not None and self.proof.after is None

    @property
    def cost(self) -> int:
        """Steps lost beyond the fewest; 0 where there is no action, or no way is left after it."""
        return 0 if self.proof is None or self.proof.loss is None else self.proof.loss


def judged(
    oracle: Replanner, strategy: Strategy, encounter: Encounter, *, followed: bool = False
) -> Judged | None:
    """Hold a strategy's affordance to the oracle; None where the subtask has no way left.

    Parameters
    ----------
    oracle
        The exact search.
    strategy
        What is judged.
    encounter
        The situation.
    followed
        Whether the encounter's affordance is this strategy's own. If not, it is asked in the same situation
        (`comparisons.dynamic.choice_of`).

    Raises
    ------
    RuntimeError
        If a certificate of the oracle does not hold.
    """
    task, belief = encounter.task, encounter.belief
    best = oracle.plan(task, belief)
    if best is None:
        return None
    choice = encounter.affordance.action if followed else choice_of(strategy, encounter)
    proof = None if choice is None else prove(oracle, task, belief, choice)
    if proof is not None and proof.faults:
        raise RuntimeError(f"a certificate of the oracle does not hold: {'; '.join(proof.faults)}")
    return Judged(encounter, best, proof)


Group = tuple[str, str, int, int]
"""Subtask (such as GotoDoor), shape, number of known obstacles, distance of the obstacle in cells."""


@dataclass
class Count:
    """How a group of affordances fared.

    Parameters
    ----------
    asked, optimal
        Affordances where there is a way, and those proved optimal.
    fatal, silent
        Those after which no way is left, and those without any action.
    cost
        Steps that the others lose, in all.
    """

    asked: int = 0
    optimal: int = 0
    fatal: int = 0
    silent: int = 0
    cost: int = 0

    def add(self, one: Judged) -> None:
        """Count one affordance."""
        self.asked += 1
        self.optimal += one.optimal
        self.fatal += one.fatal
        self.silent += one.proof is None
        self.cost += one.cost

    def __add__(self, other: Count) -> Count:
        mine, theirs = vars(self), vars(other)
        return Count(**{name: mine[name] + theirs[name] for name in mine})


@dataclass
class Ledger:
    """Counts of affordances, exactly as they can be added up over runs.

    Parameters
    ----------
    groups
        By group.
    losses
        Mistakes that leave a way, by the steps that they cost.
    boxed_in
        Obstacles that leave the subtask no way, so that there is nothing to judge.
    wrong
        The actions that are not optimal, by the obstacle's shape: of each the one with the fewest known
        obstacles, then the shortest way.
    """

    groups: dict[Group, Count] = field(default_factory=dict)
    losses: Counter[int] = field(default_factory=Counter)
    boxed_in: int = 0
    wrong: dict[str, Judged] = field(default_factory=dict)

    def add(self, one: Judged | None, grounded: GroundGraph) -> None:
        """Count one affordance; None where nothing could be judged."""
        if one is None:
            self.boxed_in += 1
            return
        met = one.encounter
        group = grounded.nodes[met.task].task, met.affordance.shape, met.known, met.distance
        self.groups.setdefault(group, Count()).add(one)
        if one.cost:
            self.losses[one.cost] += 1
        before = self.wrong.get(met.affordance.shape)
        refutes = one.proof is not None and not one.optimal
        if refutes and (before is None or _size(one) < _size(before)):
            self.wrong[met.affordance.shape] = one

    def refuted(self) -> dict[str, Judged]:
        """Return the smallest counter-example with each shape that there is one with, in order."""
        return dict(sorted(self.wrong.items()))

    def total(self, **only: str | int) -> Count:
        """Return the counts of all groups, or of those with the given ``subtask``, ``shape`` or ``known``."""
        names = ("subtask", "shape", "known", "distance")
        chosen = (
            count
            for group, count in self.groups.items()
            if all(group[names.index(name)] == value for name, value in only.items())
        )
        return sum(chosen, Count())

    def as_data(self) -> list[dict[str, Any]]:
        """Return the counts of each group as plain data, in order."""
        names = ("subtask", "shape", "known", "distance")
        return [
            {**dict(zip(names, group, strict=True)), **vars(count)}
            for group, count in sorted(self.groups.items())
        ]


def _size(one: Judged) -> tuple[int, int]:
    return one.encounter.known, len(one.best.actions)


def counterexample_data(layout: Layout, grounded: GroundGraph, one: Judged) -> dict[str, Any]:
    """Return an affordance that is not optimal as plain data, all that is needed to draw it.

    Cells are written as ``[row, column]``, actions by their names.
    """
    assert one.proof is not None, "a refuted action is an action"
    belief, node = one.encounter.belief, grounded.nodes[one.encounter.task]
    ((_, target),) = node.binding
    after = one.proof.after

    def cells(numbers: Iterable[int]) -> list[list[int]]:
        return [list(layout.cells[number]) for number in sorted(numbers)]

    return {
        "layout": layout_text(layout),
        "robot": list(layout.cells[belief.robot]),
        "trigger": list(layout.cells[belief.trigger]),
        "goal": list(layout.cells[belief.goal]),
        "doors_open": belief.doors_open,
        "cubes": cells(belief.cubes),
        "spheres": cells(belief.spheres),
        "obstacle": list(layout.cells[one.encounter.cell]),
        "task": node.name,
        "target": list(layout.marks[str(target)]),
        "known": one.encounter.known,
        "action": ACTIONS[one.proof.action],
        "optimal": [ACTIONS[action] for action in sorted(one.best.first_actions)],
        "cost": one.proof.loss,
        "way": [ACTIONS[a] for a in (one.proof.action, *(() if after is None else after.actions))],
        "best": [ACTIONS[a] for a in one.best.actions],
    }


def smallest(found: Iterable[Mapping[str, Any] | None]) -> Mapping[str, Any] | None:
    """Return the smallest of counter-examples of several runs: fewest known obstacles, then shortest way.

    Examples
    --------
    >>> one, other = ({"known": 2, "best": ["East"]}, {"known": 1, "best": ["East", "South"]})
    >>> smallest([one, None, other]) is other
    True
    """
    there = [one for one in found if one is not None]
    return min(there, key=lambda one: (one["known"], len(one["best"])), default=None)
