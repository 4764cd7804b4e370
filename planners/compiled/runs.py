"""Compiled learners: many runs of a tabular learner at once, each the reference's run to the last bit."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final, Generic, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundGraph
from planners.compiled.build import build
from planners.compiled.frame import NO_SCHEDULE, STUCK
from planners.compiled.kernel import Kernel, Kind
from planners.compiled.schedules import tabulate
from planners.compiled.shapes import find_shapes
from planners.compiled.sharing import End, Work, shared
from planners.compiled.source import kernel_source
from planners.compiled.tables import lay_out
from planners.exploration import Boltzmann, Exploration, Explorer
from planners.learner import EpisodeTooLongError, Learner, Settings, streams_of
from planners.schedules import by_task
from planners.states import starting_states
from worlds import Stream, UserError

SCHEDULED: Final = 4096
"""Episodes that the schedules' tables hold at first."""

L = TypeVar("L", bound=Learner)
Steps = NDArray[np.int32]


class Compiled(ABC, Generic[L]):
    """Runs of one learner, one for each seed, by a kernel that is generated for the ground graph.

    A run is the reference learner's run with the same seed, to the last bit: alone or among others, on any
    number of threads. Only Boltzmann exploration takes exponentials, which may differ in the last bit
    between numba and Python; its values agree within 1e-9 for as long as no choice falls the other way.

    Parameters
    ----------
    grounded
        The ground graph, with its world's model.
    seeds
        The seed of each run, which names its random stream as it does for the reference.
    settings
        Schedules, discount and tie break. Exploration is `Exploration` or `Boltzmann`; all-states updating
        is for the reference alone.
    threads
        How many threads share the runs; left out, as many as the process may use at once.

    Attributes
    ----------
    grounded
        What is learnt on: the ground graph, or for flat Q-learning its flattened one.
    values
        All that has been learnt, shape (runs, values), laid out as `tables` says.
    episodes
        Episodes of each node since its schedules began, shape (runs, nodes).
    steps
        Primitive steps of learning so far, shape (runs,).

    Raises
    ------
    UserError
        If there is no seed, or the settings ask for what is not compiled.
    """

    reference: ClassVar[type[Learner]]
    kind: ClassVar[Kind]

    def __init__(
        self,
        grounded: GroundGraph,
        seeds: Sequence[Sequence[int]],
        settings: Settings | None = None,
        *,
        threads: int | None = None,
    ) -> None:
        if not seeds:
            raise UserError("a compiled learner needs a seed for each run, such as seeds=[(0,), (1,)]")
        self.settings = settings or Settings()
        self.seeds = [tuple(seed) for seed in seeds]
        self.threads = threads or len(os.sched_getaffinity(0))
        self._given = grounded
        self.grounded = self._ground(grounded)
        nodes = self.grounded.nodes
        explorers = by_task(self.grounded, self.settings.exploration, self.settings.explorations)
        rates = by_task(self.grounded, self.settings.rate, self.settings.rates)
        _refuse(self.settings, explorers)
        self._schedules = list(zip(rates, explorers, strict=True))
        self._scheduled = SCHEDULED
        self.tables = lay_out(self.grounded, flat=self.kind == "flat-q")
        boltzmann = [isinstance(explorer, Boltzmann) for explorer in explorers]
        shapes = find_shapes(self.grounded, self.tables, boltzmann, pseudo_rewards=self.kind != "maxq-0")
        kernel = Kernel(
            self.kind,
            float(self.settings.gamma),
            float(self.settings.tie),
            len(grounded.model.actions),
            self.tables,
            shapes,
        )
        self._kernel = build(kernel_source(kernel))
        self._told = shapes.told
        outcomes = self.tables.outcomes
        self._world = (
            *(self.tables.words, self.tables.rows, shapes.links),
            *(outcomes.first, outcomes.after, outcomes.reward, outcomes.up_to),
        )
        self._room = max(len(node.calls) for node in nodes)
        runs = len(self.seeds)
        self.values = np.zeros((runs, self.tables.size * (2 if self.kind == "maxq-q" else 1)))
        self.episodes = np.zeros((runs, len(nodes)), dtype=np.int64)
        self.steps = np.zeros(runs, dtype=np.int64)
        streams = [streams_of(seed) for seed in self.seeds]
        self._learning = _Streams.of([random for random, _ in streams])
        self._following = _Streams.of([chance for _, chance in streams])

    @staticmethod
    def _ground(grounded: GroundGraph) -> GroundGraph:
        """Return what the reference learns on."""
        return grounded

    @abstractmethod
    def _fill(self, learner: L, values: NDArray[np.float64]) -> None:
        """Put one run's values into a reference learner."""

    def train(
        self,
        task: int,
        starts: Sequence[int],
        episodes: int,
        after_each: Callable[[], None] | None = None,
        *,
        afresh: bool = True,
    ) -> Steps:
        """Run episodes of a task in every run, each from a random one of `starts`.

        The task's rate and exploration start afresh; what it and its children have learnt stays. On an
        error nothing has been learnt, or with `after_each` nothing in that episode.

        Parameters
        ----------
        task
            The task's place in the ground graph.
        starts
            States to start from.
        episodes
            Episodes of each run.
        after_each
            Called after every episode of all runs, to take a measurement.
        afresh
            Whether the task's rate and exploration start afresh; if not, they go on falling.

        Returns
        -------
        ndarray
            Primitive steps of each episode, shape (runs, episodes).

        Raises
        ------
        EpisodeTooLongError
            If an episode passes the settings' `max_steps`.
        UserError
            If the task comes to a state in which it has no child to call, or there is nothing to start from.
        """
        begin = self._checked(task, starts)
        if afresh:
            self.episodes[:, task] = 0
        steps = np.zeros((len(self.seeds), episodes), dtype=np.int32)
        if after_each is None:
            self._learn(task, begin, steps)
            return steps
        for episode in range(episodes):
            one = np.zeros((len(self.seeds), 1), dtype=np.int32)
            self._learn(task, begin, one)
            steps[:, episode] = one[:, 0]
            after_each()
        return steps

    def greedy_steps(self, task: int, states: Sequence[int], limit: int = 1000) -> NDArray[np.int64]:
        """Return the primitive steps of the greedy policies.

        Parameters
        ----------
        task
            The task's place in the ground graph.
        states
            States to start from.
        limit
            Steps after which a policy is given up.

        Returns
        -------
        ndarray
            Steps from each state, shape (runs, states); -1 past `limit`.
        """
        begin = self._checked(task, states)
        steps = np.zeros((len(self.seeds), begin.size), dtype=np.int64)
        told = np.array(self._told[task], dtype=np.int64)

        def follow(low: int, high: int, trouble: NDArray[np.int64], scratch: NDArray[np.float64]) -> int:
            status: int = self._kernel.follow(
                told, low, high, *self._following.arrays, self.values, begin, limit, steps,
                *self._world, trouble, scratch,
            )  # fmt: skip
            return status

        self._heed(self._shared(follow, steps.size))
        return steps

    def run(self, number: int, into: L | None = None) -> L:
        """Return a reference learner that has learnt what a run has, and would go on as it does.

        It is the one that is given, which this has returned before for the same run, or a new one.
        """
        learner = self._reference(number) if into is None else into
        self._fill(learner, self.values[number])
        learner.episodes = self.episodes[number].tolist()
        learner.steps = int(self.steps[number])
        learner.random.drawn = int(self._learning.drawn[number])
        learner.chance.drawn = int(self._following.drawn[number])
        return learner

    def _reference(self, number: int) -> L:
        learner = self.reference(self._given, self.seeds[number], self.settings)
        return cast(L, learner)

    def _checked(self, task: int, states: Sequence[int]) -> NDArray[np.int64]:
        """Return states as an array. A kernel does not look where it reads: it must be given good ones."""
        if task not in self._told:
            places = f"{len(self.grounded.model.actions)} to {len(self.grounded.nodes) - 1}"
            raise UserError(f"{task} is not the place of a task; tasks have the places {places}")
        return starting_states(self.grounded, task, states)

    def _learn(self, task: int, starts: NDArray[np.int64], steps: Steps) -> None:
        """Run the episodes that `steps` has room for; on an error leave everything as it was."""
        told = np.array(self._told[task], dtype=np.int64)
        before = self.values.copy(), self.episodes.copy(), self._learning.drawn.copy()
        while True:
            at, schedule = tabulate(self._schedules, self._scheduled)

            def learn(low: int, high: int, trouble: NDArray[np.int64], scratch: NDArray[np.float64]) -> int:
                status: int = self._kernel.learn(
                    told, low, high, *self._learning.arrays, self.values, self.episodes,
                    at, schedule, self._scheduled, starts, steps.shape[1], self.settings.max_steps, steps,  # noqa: B023
                    *self._world, trouble, scratch,
                )  # fmt: skip
                return status

            ends = self._shared(learn, steps.size)
            if all(end.status == 0 for end in ends):
                self.steps += steps.sum(axis=1)
                return
            self.values[:], self.episodes[:], self._learning.drawn[:] = before
            if not any(end.status == NO_SCHEDULE for end in ends):
                self._heed(ends)
            self._scheduled *= 2

    def _shared(self, work: Work, episodes: int) -> list[End]:
        """Do the work of all runs, `threads` at a time."""
        runs = len(self.seeds)
        return shared(work, runs, threads=self.threads, episodes=episodes, room=self._room)

    def _heed(self, ends: Sequence[End]) -> None:
        """Raise what the first failure says."""
        for end in ends:
            if end.status == STUCK:
                self._reference(end.run).greedy(end.task, end.state)  # raises
            if end.status < 0:
                where = f"run {end.run}, episode {end.episode}"
                raise EpisodeTooLongError(
                    f"no end after {self.settings.max_steps} primitive steps in {where}"
                )


@dataclass(frozen=True, eq=False)
class _Streams:
    """One random stream a run, as arrays of shape (runs,)."""

    keys: NDArray[np.uint64]
    drawn: NDArray[np.int64]

    @classmethod
    def of(cls, streams: Sequence[Stream]) -> _Streams:
        keys = np.array([stream.key for stream in streams], dtype=np.uint64)
        return cls(keys, np.zeros(len(streams), dtype=np.int64))

    @property
    def arrays(self) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
        return self.keys, self.drawn


def _refuse(settings: Settings, explorers: Sequence[Explorer]) -> None:
    """Refuse settings that no kernel knows."""
    if settings.all_states:
        raise UserError("all-states updating is not compiled; use the reference learner, such as MaxQ")
    for explorer in explorers:
        if type(explorer) not in {Exploration, Boltzmann}:
            raise UserError(
                f"exploration by {type(explorer).__name__} is not compiled; give Exploration or Boltzmann, "
                "or use the reference learner, such as MaxQ"
            )
