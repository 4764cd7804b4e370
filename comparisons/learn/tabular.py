"""Compiled tabular learners as runs of `affordant learn`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from comparisons.learn.registry import Pieces, Request
from planners import EpisodeTooLongError, Exploration, HarmonicRate, Learner, LearningRate, Settings
from planners.compiled import Compiled, CompiledFlatQ, CompiledMaxQ
from planners.compiled.resuming import restore, state_of
from planners.option_critic.arrays import refuse_foreign
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.options import NONE, Options, compile_options
from worlds.errors import UserError

_TOTAL: Final = 1_000_000  # steps, unless said otherwise
_FIRST: Final = 100  # episodes of the first piece; each next one has a fifth of those before
_HALF: Final = 300  # episodes of a task after which every second choice is random
_SLOW: Final = 1000  # episodes after which the rate is a half, where there is chance

Row = NDArray[np.int64]


class TabularRun:
    """A run of a compiled learner on a whole graph, from every start of its world.

    The rate is 1 on a deterministic world, where nothing needs averaging, and falls harmonically elsewhere.
    """

    def __init__(self, kind: type[Compiled[Any]], request: Request) -> None:
        for given, what in ((request.config, "--config"), (request.settings, "--set and --terminations")):
            if given:
                raise UserError(
                    f"--learner {request.learner} has no settings to give by {what}; leave them out, "
                    "or use the option-critic"
                )
        self.grounded = request.grounded
        model = request.grounded.model
        rate = LearningRate(1.0, 1.0, 1) if model.is_deterministic else HarmonicRate(_SLOW)
        self.total = _TOTAL if request.steps is None else request.steps
        settings = Settings(rate=rate, exploration=Exploration(_HALF))
        self.learner = kind(request.grounded, [(request.seed,)], settings, threads=1)
        terminal = request.grounded.nodes[request.grounded.root].terminal
        self.starts = np.flatnonzero(model.starts & ~terminal).tolist()
        self.options = compile_options(self.learner.grounded)

    @property
    def settings(self) -> Mapping[str, bool | int | float | str]:
        """What it learns with: the rate's and the exploration's schedules, and the steps."""
        rate, exploration = self.learner.settings.rate, self.learner.settings.exploration
        return {"rate": str(rate), "exploration": str(exploration), "total": self.total}

    @property
    def episodes(self) -> int:
        """Episodes of the root so far."""
        return int(self.learner.episodes[0, self.learner.grounded.root])

    def learn(self) -> Pieces:
        """Learn, each piece a fifth longer than all before."""
        while self.learner.steps[0] < self.total:
            piece = max(_FIRST, self.episodes // 5)
            try:
                steps = self.learner.train(self.learner.grounded.root, self.starts, piece, afresh=False)
            except EpisodeTooLongError as error:
                raise UserError(f"{error}; give the learner a graph that ends, or another seed") from error
            yield int(self.learner.steps[0]), {"episode_length": float(steps.mean())}

    def due(self) -> bool:
        """Return True: pieces are as long as evaluations are far apart."""
        return True

    def greedy(self) -> GreedyPolicy:
        """Return the greedy policy."""
        return greedy_tables(self.learner.run(0), self.options)

    def state(self) -> Mapping[str, NDArray[np.generic]]:
        """Return tables, schedules' episodes and streams."""
        return state_of(self.learner)

    def restore(self, state: Mapping[str, NDArray[np.generic]], /) -> None:
        """Take up a state."""
        counted = range(1 << 62)
        bounds = dict.fromkeys(("episodes", "steps", "learning", "following"), counted)
        refuse_foreign(state, state_of(self.learner), bounds)
        restore(self.learner, state)


def maxq_0(request: Request) -> TabularRun:
    """Return a run of MAXQ-0."""
    return TabularRun(CompiledMaxQ, request)


def flat_q(request: Request) -> TabularRun:
    """Return a run of flat Q-learning."""
    return TabularRun(CompiledFlatQ, request)


def greedy_tables(learner: Learner, options: Options) -> GreedyPolicy:
    """Return what a tabular learner would do in every state, as tables over its graph's options.

    Control comes back as far as tasks on top of the stack have ended, and each caller then takes its best
    child, down to a primitive action.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from planners import MaxQ
    >>> from worlds import maze_model, parse_layout
    >>> rows = "grid", ". . : D1 G1", "T1 . | . .", "start 0,0", "trigger T1", "goal G1"
    >>> maze = parse_layout(chr(10).join(rows))
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> learner = MaxQ(grounded, seed=(0,))
    >>> start = grounded.model.index.number((maze.start, maze.triggers["T1"], maze.goals["G1"], "closed"))
    >>> _ = learner.train(grounded.root, [start], episodes=300)
    >>> greedy_tables(learner, compile_options(grounded)).returns(np.array([start]))
    array([-5.])
    """
    best = _best_children(learner)
    states, count = options.grounded.model.index.size, len(options)
    places = {tuple(edge.child for edge in stack): k for k, stack in enumerate(options.stacks)}
    anew: dict[tuple[int, ...], Row] = {(): _chosen((), options.grounded.root, best, places)}
    option = np.empty((states, count + 1), dtype=np.int64)
    for k, stack in enumerate(options.stacks):
        option[:, k] = k
        for level in reversed(range(len(stack))):  # what ends further down counts more
            below = tuple(edge.child for edge in stack[:level])
            if below not in anew:
                anew[below] = _chosen(below, stack[level].caller, best, places)
            back = options.ended[:, level : len(stack), k].all(axis=1) & (anew[below] != NONE)
            option[:, k] = np.where(back, anew[below], option[:, k])
    option[:, count] = np.maximum(anew[()], 0)  # nothing is chosen where the root has ended
    tops = [stack[-1].child for stack in options.stacks]
    action = np.stack([np.maximum(best.get(top, np.full(states, top)), 0) for top in tops], axis=1)
    return GreedyPolicy(options, option, action)


def _best_children(learner: Learner) -> dict[int, Row]:
    """Return the best child of every task in every state, by the task's place; `NONE` where it ended."""
    found = {}
    for place, node in enumerate(learner.grounded.nodes):
        if node.calls:
            best = np.full(node.terminal.size, NONE)
            for state in np.flatnonzero(~node.terminal).tolist():
                if learner.choices(place, state):
                    best[state] = node.calls[learner.greedy(place, state)].child
            found[place] = best
    return found


def _chosen(
    below: tuple[int, ...], caller: int, best: Mapping[int, Row], places: Mapping[tuple[int, ...], int]
) -> Row:
    """Return the option that begins in every state when a caller on top of `below` has control."""
    found = np.full(len(best[caller]), NONE)
    for child in np.unique(best[caller][best[caller] != NONE]).tolist():
        stack = (*below, child)
        option = places[stack] if stack in places else _chosen(stack, child, best, places)
        found = np.where(best[caller] == child, option, found)
    return found
