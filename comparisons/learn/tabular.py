"""Tabular learners as runs of `affordant learn`: compiled where they can be, readable otherwise."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from comparisons.learn.greedy_tables import greedy_tables
from comparisons.learn.registry import Pieces, Request, StuckError
from planners import HSMQ, EpisodeTooLongError, FlatQ, Learner, MaxQ, MaxQQ
from planners.compiled import Compiled, CompiledFlatQ, CompiledMaxQ, CompiledMaxQQ
from planners.compiled.resuming import restore, state_of
from planners.option_critic.arrays import refuse_foreign
from planners.option_critic.greedy import GreedyPolicy
from planners.option_critic.options import compile_options
from planners.tabular_config import load_tabular_config

_COMPILED: Final[Mapping[type[Learner], type[Compiled[Any]]]] = {
    MaxQ: CompiledMaxQ,
    MaxQQ: CompiledMaxQQ,
    FlatQ: CompiledFlatQ,
}
_COUNTED: Final = range(1 << 62)


class TabularRun(ABC):
    """A run of a tabular learner on a whole graph, from every start of its world."""

    def __init__(self, request: Request) -> None:
        config = load_tabular_config(request.config, request.settings)
        self.config = config if request.steps is None else replace(config, total=request.steps)
        self.grounded = request.grounded
        model = request.grounded.model
        self._settings = self.config.settings(deterministic=model.is_deterministic)
        terminal = request.grounded.nodes[request.grounded.root].terminal
        self.starts = np.flatnonzero(model.starts & ~terminal).tolist()

    @property
    def settings(self) -> Mapping[str, bool | int | float | str]:
        """The config, by name."""
        return asdict(self.config)

    @property
    @abstractmethod
    def steps(self) -> int:
        """Steps so far."""

    @property
    @abstractmethod
    def episodes(self) -> int:
        """Episodes of the root so far."""

    @abstractmethod
    def _train(self, episodes: int) -> float:
        """Go on for so many episodes; return their mean length."""

    @abstractmethod
    def greedy(self) -> GreedyPolicy:
        """Return the greedy policy."""

    @abstractmethod
    def state(self) -> Mapping[str, NDArray[np.generic]]:
        """Return tables, schedules' episodes and streams."""

    @abstractmethod
    def restore(self, state: Mapping[str, NDArray[np.generic]], /) -> None:
        """Take up a state."""

    def learn(self) -> Pieces:
        """Learn, each piece as long as the config wants evaluations to be apart."""
        while self.steps < self.config.total:
            try:
                length = self._train(self.config.piece(self.episodes))
            except EpisodeTooLongError as error:
                raise StuckError(f"{error}; give the learner a graph that ends, or another seed") from error
            yield self.steps, {"episode_length": length}

    def due(self) -> bool:
        """Return True: pieces are as long as evaluations are far apart."""
        return True


class CompiledRun(TabularRun):
    """A run of a compiled learner."""

    def __init__(self, kind: type[Compiled[Any]], request: Request) -> None:
        super().__init__(request)
        self.learner = kind(request.grounded, [(request.seed,)], self._settings, threads=1)
        self.options = compile_options(self.learner.grounded)
        self._asked = self.learner.run(0)  # it takes a while to make

    @property
    def steps(self) -> int:
        """Steps so far."""
        return int(self.learner.steps[0])

    @property
    def episodes(self) -> int:
        """Episodes of the root so far."""
        return int(self.learner.episodes[0, self.learner.grounded.root])

    def _train(self, episodes: int) -> float:
        steps = self.learner.train(self.learner.grounded.root, self.starts, episodes, afresh=False)
        return float(steps.mean())

    def greedy(self) -> GreedyPolicy:
        """Return the greedy policy."""
        return greedy_tables(self.learner.run(0, self._asked), self.options)

    def state(self) -> Mapping[str, NDArray[np.generic]]:
        """Return tables, schedules' episodes and streams."""
        return state_of(self.learner)

    def restore(self, state: Mapping[str, NDArray[np.generic]], /) -> None:
        """Take up a state."""
        bounds = dict.fromkeys(("episodes", "steps", "learning", "following"), _COUNTED)
        refuse_foreign(state, state_of(self.learner), bounds)
        restore(self.learner, state)


class ReadableRun(TabularRun):
    """A run of a readable learner: of HSMQ, which is not compiled, and of any that learns at all states."""

    def __init__(self, kind: type[Learner], request: Request) -> None:
        super().__init__(request)
        self.learner = kind(request.grounded, (request.seed,), self._settings)
        self.options = compile_options(self.learner.grounded)

    @property
    def steps(self) -> int:
        """Steps so far."""
        return self.learner.steps

    @property
    def episodes(self) -> int:
        """Episodes of the root so far."""
        return self.learner.episodes[self.learner.grounded.root]

    def _train(self, episodes: int) -> float:
        steps = self.learner.train(self.learner.grounded.root, self.starts, episodes, afresh=False)
        return float(np.mean(steps))

    def greedy(self) -> GreedyPolicy:
        """Return the greedy policy."""
        return greedy_tables(self.learner, self.options)

    def state(self) -> Mapping[str, NDArray[np.generic]]:
        """Return tables, schedules' episodes and streams."""
        learner = self.learner
        counts = {
            "episodes": np.array(learner.episodes, dtype=np.int64),
            "steps": np.array([learner.steps], dtype=np.int64),
            "learning": np.array([learner.random.drawn], dtype=np.int64),
            "following": np.array([learner.chance.drawn], dtype=np.int64),
        }
        return {"values": np.concatenate([np.array(row) for row in _rows(learner)]), **counts}

    def restore(self, state: Mapping[str, NDArray[np.generic]], /) -> None:
        """Take up a state."""
        bounds = dict.fromkeys(("episodes", "steps", "learning", "following"), _COUNTED)
        refuse_foreign(state, self.state(), bounds)
        learner, values, at = self.learner, state["values"].tolist(), 0
        for row in _rows(learner):
            row[:] = values[at : at + len(row)]
            at += len(row)
        learner.episodes[:] = state["episodes"].tolist()
        learner.steps = int(state["steps"][0])
        learner.random.drawn = int(state["learning"][0])
        learner.chance.drawn = int(state["following"][0])


def maxq_0(request: Request) -> TabularRun:
    """Return a run of MAXQ-0."""
    return _run(MaxQ, request)


def maxq_q(request: Request) -> TabularRun:
    """Return a run of MAXQ-Q."""
    return _run(MaxQQ, request)


def hsmq(request: Request) -> TabularRun:
    """Return a run of HSMQ."""
    return _run(HSMQ, request)


def flat_q(request: Request) -> TabularRun:
    """Return a run of flat Q-learning."""
    return _run(FlatQ, request)


def _run(kind: type[Learner], request: Request) -> TabularRun:
    """Return a run, compiled if the learner is and if it does not learn at all states."""
    all_states = load_tabular_config(request.config, request.settings).all_states
    if kind in _COMPILED and not all_states:
        return CompiledRun(_COMPILED[kind], request)
    return ReadableRun(kind, request)


def _rows(learner: Learner) -> list[list[float]]:
    """Return all that a learner has learnt: the very lists, in one order."""
    if isinstance(learner, HSMQ):
        return [row for tables in learner.table for row in tables]
    assert isinstance(learner, MaxQ), "these are the two families of tables"
    completions = [row for tables in learner.completion for row in tables]
    inner = learner.inner_completion if isinstance(learner, MaxQQ) else []
    return [*completions, *learner.reward, *(row for tables in inner for row in tables)]
