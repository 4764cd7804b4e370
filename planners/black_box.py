"""MAXQ-0 in a world without a model: a task graph is grounded on trust, and learnt by living episodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np

from hierarchy import ALWAYS, GroundGraph, Leaf, TaskGraph, TaskGraphError
from hierarchy.check import examine
from planners.learner import Settings, Trace
from planners.maxq import MaxQ
from worlds import Stream, UserError
from worlds.black_box import BlackBox, Move, UnknownModel

_LEARNING = 0x4C65_6172_6E  # names the stream of the resets of learning
_GREEDY = 0x4772_6565_6479  # names that of greedy episodes

_POSSIBLE: Final = frozenset({"ends short", "stuck", "strays"})
"""Findings about states that may never occur together, or never follow: without a model, no faults yet."""


class _CutOffError(Exception):
    """The environment has truncated the episode."""


def ground_black_box(graph: TaskGraph, box: BlackBox) -> GroundGraph:
    """Ground a task graph on an environment of which no model is known.

    Checked is what can be: the declaration, and that no termination and no child is ruled out in every joint
    state. Not known, and so neither checked nor proved: which states occur, whether a task can end from
    where it is called, whether it can end short of its goal, whether a live task always has a child to call,
    and whether the declared relevant variables are a safe abstraction.

    Each primitive action has one value a joint state: which states share an expected reward is not known.

    Raises
    ------
    TaskGraphError
        If a task has a working space (`within`): which actions leave it is not known. Also if the check
        finds a fault that no model could mend, or the graph's variables or actions are not the environment's.
    """
    if graph.index != box.index or graph.actions != box.actions:
        raise TaskGraphError(
            f"task graph {graph.name} is not of this world; build it with TaskGraph(name, "
            "box.index.variables, box.actions)"
        )
    for task in graph.tasks.values():
        if task.within != ALWAYS:
            raise TaskGraphError(
                f"task {task.name}: its working space (within) needs a model, to tell what leaves it; "
                "use guards (when) and an initiation (start) instead"
            )
    model = UnknownModel(box.index, box.actions)
    found, grounded = examine(graph, model)
    findings = [finding for finding in found if finding.kind not in _POSSIBLE]
    if findings or grounded is None:
        listed = "\n".join(f"  {finding}" for finding in findings)
        raise TaskGraphError(f"task graph {graph.name} cannot run:\n{listed}")
    leaf = Leaf(np.arange(box.index.size, dtype=np.int64), box.index.size)
    nodes = tuple(node if node.calls else replace(node, leaf=leaf) for node in grounded.nodes)
    return GroundGraph(graph, model, nodes)


class BlackBoxMaxQ(MaxQ):
    """A MAXQ-0 learner that steps the environment itself, and resets it for each episode of the root.

    Its values are what its episodes taught it. That they are near the optimum cannot be proved: there is no
    model to solve, and states that no episode came to keep the value 0.

    Where the environment terminates an episode, every task that may be running must end, too (`until`); one
    that would go on is refused with the state. An episode that the environment truncates is given up: what
    was learnt on the way stays, and the tasks that were running learn nothing from the cut, but count it as
    an episode, lest their exploration never falls.

    Parameters
    ----------
    graph
        The task graph, of the environment's variables and actions.
    box
        The environment.
    seed
        Names the random streams, those that seed the resets, too; every integer part counts.
    settings
        Schedules, discount and tie break.

    Examples
    --------
    >>> import gymnasium
    >>> from worlds import Variable
    >>> lake = gymnasium.make("FrozenLake-v1", is_slippery=False)
    >>> cells = Variable("cell", tuple(range(16)))
    >>> box = BlackBox(lake, [cells], lambda n: (n,), "Left Down Right Up".split())
    >>> graph = TaskGraph("lake", box.index.variables, box.actions)
    >>> (cell,) = graph.variables
    >>> holes = [5, 7, 11, 12]
    >>> root = graph.task("Root", until=cell.isin([*holes, 15]), uses=[cell], do=box.actions)
    >>> learner = BlackBoxMaxQ(graph, box, seed=(1,), settings=Settings(gamma=0.9, tie=0.001))
    >>> steps = learner.learn(episodes=400)
    >>> len(learner.greedy_episode())
    6
    """

    def __init__(
        self, graph: TaskGraph, box: BlackBox, seed: Sequence[int], settings: Settings | None = None
    ) -> None:
        super().__init__(ground_black_box(graph, box), seed, settings)
        self._box = box
        self._resets = {name: Stream(*seed, name) for name in (_LEARNING, _GREEDY)}
        self._last: Move | None = None

    def learn(self, episodes: int, after_each: Callable[[], None] | None = None) -> list[int]:
        """Run episodes of the root, each from where the environment begins; return their primitive steps.

        As in `train`, the root's rate and exploration start afresh, and `after_each` is called after every
        episode. A greedy episode in between changes nothing of what is learnt after it, if the environment
        draws its chances from the seed of its reset.

        Raises
        ------
        EpisodeTooLongError
            If an episode passes the settings' `max_steps`.
        UserError
            If a task goes on where the environment has terminated the episode, or has no child to call.
        """
        root = self.grounded.root
        self.episodes[root] = 0
        counts = []
        for _ in range(episodes):
            before = self.steps
            self._limit = before + self.settings.max_steps
            with suppress(_CutOffError):
                self._run(root, self._reset(_LEARNING))
            counts.append(self.steps - before)
            if after_each is not None:
                after_each()
        return counts

    def train(
        self,
        task: int,  # noqa: ARG002
        starts: Sequence[int],  # noqa: ARG002
        episodes: int,  # noqa: ARG002
        after_each: Callable[[], None] | None = None,  # noqa: ARG002
        *,
        afresh: bool = True,  # noqa: ARG002
    ) -> list[int]:
        """Refuse: a black box begins its episodes where it will, so call `learn`."""
        raise UserError("a black box cannot be put into a state to train from; call learn(episodes)")

    def greedy_episode(self, limit: int = 1000) -> list[tuple[int, int]] | None:
        """Return the (state, primitive action) pairs of a greedy episode of the root, learning nothing.

        None if it passes `limit` steps, or the environment truncates it.
        """
        start = self._reset(_GREEDY)
        try:
            return self.greedy_route(self.grounded.root, start, limit)
        except _CutOffError:
            return None

    def _run(self, task: int, state: int, caller_rate: float = 1.0) -> tuple[Trace, int]:
        """Carry out a task once, learning, as every learner does; a cut counts as an episode, too."""
        try:
            return super()._run(task, state, caller_rate)
        except _CutOffError:
            if task >= self._primitives:
                self.episodes[task] += 1
            raise

    def _reset(self, name: int) -> int:
        """Begin an episode, its seed drawn from the named stream; return its first state."""
        state = self._box.reset(seed=self._resets[name].below(2**31))
        self._last = Move(state, 0.0, terminated=False, truncated=False)
        return state

    def _act(self, action: int, state: int, chance: Stream) -> tuple[int, float]:  # noqa: ARG002
        """Step the environment, which has its own chance, from the state that it is in."""
        if self._last is None or state != self._last.state:
            raise UserError("a black box can act only in the state it is in; call learn or greedy_episode")
        if self._last.terminated:
            where = self._box.index.words(state)
            raise UserError(
                f"the environment ended the episode in {where}, where a task still runs; "
                "let the until of every task that may be running hold there"
            )
        if self._last.truncated:
            raise _CutOffError
        self._last = self._box.step(action)
        return self._last.state, self._last.reward
