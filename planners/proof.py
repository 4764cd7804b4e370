"""Proving that an action is an optimal first action of a task, or refuting it by a counter-example."""

from __future__ import annotations

from dataclasses import dataclass

from planners.search import Plan, Replanner, verify
from worlds import MazeState, step


@dataclass(frozen=True, eq=False)
class Proof:
    """Whether an action is an optimal first action, with the evidence.

    Parameters
    ----------
    action
        The action that was asked about.
    best
        A shortest plan from the belief: no plan is shorter, by its certificate.
    after
        A shortest plan from where the action leads; None if the task cannot be ended from there.
    faults
        What the certificates of `best` and `after` fail in, in words; empty unless the oracle is wrong.
    """

    action: int
    best: Plan
    after: Plan | None
    faults: tuple[str, ...]

    @property
    def loss(self) -> int | None:
        """Steps that the action costs beyond the fewest; None if the task cannot be ended after it."""
        return None if self.after is None else 1 + len(self.after.actions) - len(self.best.actions)

    @property
    def optimal(self) -> bool:
        """Whether the action begins a shortest plan. If not, `best` is the counter-example."""
        return self.loss == 0 and not self.faults


def prove(oracle: Replanner, task: int, belief: MazeState, action: int) -> Proof | None:
    """Decide whether `action` is an optimal first action of `task` under what the robot knows.

    Returns None where the task has no way left at all, so that no action is optimal.

    Examples
    --------
    South of 4,0 stands a cube; the way to T4 leads around it by the East, and West is a wall.

    >>> from hierarchy import ground, two_rooms
    >>> from worlds import ACTIONS, load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> oracle = Replanner(maze, ground(two_rooms(maze), maze_model(maze)))
    >>> belief = MazeState(robot=32, trigger=49, goal=31, cubes=frozenset({40}))
    >>> task = oracle.grounded.place("GotoTrigger(T4)")
    >>> prove(oracle, task, belief, ACTIONS.index("East")).optimal
    True
    >>> refuted = prove(oracle, task, belief, ACTIONS.index("North"))
    >>> refuted.optimal, refuted.loss, len(refuted.best.actions)
    (False, 2, 3)
    """
    best = oracle.plan(task, belief)
    if best is None:
        return None
    area = oracle.area(task, belief)
    later, _ = step(oracle.layout, belief, action)
    after = oracle.plan(task, later)
    faults = verify(oracle.layout, area, belief, best)
    if after is not None:
        faults += verify(oracle.layout, area, later, after)
    return Proof(action, best, after, faults)
