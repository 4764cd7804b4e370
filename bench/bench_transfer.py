"""The published transfer test of four rooms: after 1000 episodes the goal leaves the east hallway.

Bacon, Harb and Precup, "The option-critic architecture" (AAAI 2017), section 5, on the dynamics of their code
(`worlds.four_rooms`, rules "bacon"), where the exact optimum is 8.39 steps. Run with
``python bench/bench_transfer.py FOLDER [SEEDS]``; the table is printed, and what was measured and the figure
are written into the folder. CPU time of one thread; it takes five to six minutes of it. What the folder holds
already is not measured again.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.sparse import csr_array
from side_by_side import machine
from transfer_pictures import table, transfer_figure

from comparisons.learn.greedy_tables import greedy_tables
from comparisons.style import picture
from hierarchy import ground
from hierarchy.four_rooms import four_rooms_graph
from planners import Exploration, HarmonicRate, Learner, Settings, flat_optimum
from planners.compiled import Compiled, CompiledFlatQ, CompiledMaxQQ
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.options import compile_options
from planners.option_critic.training import OptionCritic
from planners.option_critic.transfer import carry_over
from planners.option_critic_tabular import TabularOptionCritic
from worlds import Cell, StateIndex, Stream, TransitionModel, Variable
from worlds.four_rooms import CELLS, FIRST_GOAL, LATER_GOALS, four_rooms_model, starts_for

BEFORE: Final = 1000
"""Episodes with the first goal."""
AFTER: Final = 1500
"""Episodes with the other one."""
EVERY: Final = 50
"""Episodes between two evaluations."""
LIMIT: Final = 1000
"""Steps after which an episode is cut off, as published."""
CONFIG: Final = OptionCriticConfig(
    num_envs=8, horizon=32, epochs=4, minibatch=128, anneal=20_000, max_steps=LIMIT, total=10**9
)
"""Small batches: an update hears of some twenty episodes."""
SETTINGS: Final = Settings(rate=HarmonicRate(300), exploration=Exploration(300))

MODEL: Final = four_rooms_model()
GROUNDED: Final = ground(four_rooms_graph(), MODEL)
ROBOT, GOAL = MODEL.index.column("robot"), MODEL.index.column("goal")
TERMINAL: Final = GROUNDED.nodes[GROUNDED.root].terminal
BEST: Final = -flat_optimum(MODEL, TERMINAL).value
Ints = NDArray[np.int64]
Row = dict[str, float]


def best(goal: Cell) -> float:
    """Return the exact optimum's mean steps from the 103 cells to a goal."""
    return float(BEST[starts_for(MODEL.index, goal)].mean())


def places(goal: Cell) -> Ints:
    """Return the 104 states in which the goal is in a cell, in the order of `CELLS`."""
    return np.flatnonzero(CELLS.index(goal) == GOAL)


def expected_steps(goal: Cell, option: Ints, action: Ints) -> float:
    """Return the mean over starts of a policy's exact expected steps, episodes cut off after `LIMIT`.

    Parameters
    ----------
    goal
        Where the goal is.
    option
        What runs on in each cell by what ran up to there, the last column for none, shape
        (cells, options + 1).
    action
        What each option does in each cell, shape (cells, options).
    """
    columns = option.shape[1]
    joint = np.arange(option.size)
    cell, running = joint // columns, option.ravel()
    idle = running < 0  # nothing may be chosen: the robot waits for the episode to be cut off
    state, act = places(goal)[cell], action[cell, np.maximum(running, 0)]
    live = ~TERMINAL[state]
    chances = np.where((live & ~idle)[:, None], MODEL.probabilities[state, act], 0.0)
    to = ROBOT[MODEL.outcomes[state, act]] * columns + np.maximum(running, 0)[:, None]
    rows = np.repeat(joint, to.shape[1])
    kernel = csr_array((chances.ravel(), (rows, to.ravel())), shape=(joint.size, joint.size))
    kernel = kernel + csr_array(((live & idle).astype(float), (joint, joint)), shape=kernel.shape)
    steps = np.zeros(joint.size)
    for _ in range(LIMIT):
        steps = live + kernel @ steps
    return float(steps.reshape(option.shape)[~TERMINAL[places(goal)], -1].mean())


class Run(Protocol):
    """A learner in this test."""

    def train(self, goal: Cell, episodes: int) -> tuple[int, int]:
        """Learn from about so many more episodes; return how many they were, and their steps."""

    def greedy(self, goal: Cell) -> float:
        """Return the exact expected steps of its greedy policy."""


class Tables:
    """A compiled learner, whose tables are indexed by what tasks use: some by the goal, some not."""

    def __init__(self, kind: type[Compiled[Any]], seed: int) -> None:
        self.learner = kind(GROUNDED, [(seed,)], SETTINGS, threads=1)
        self.options = compile_options(self.learner.grounded)
        self.goal: Cell | None = None

    def train(self, goal: Cell, episodes: int) -> tuple[int, int]:
        """Rate and exploration of the root begin afresh when the goal has moved."""
        afresh, self.goal = goal != self.goal, goal
        starts = np.flatnonzero(starts_for(MODEL.index, goal)).tolist()
        steps = self.learner.train(self.learner.grounded.root, starts, episodes, afresh=afresh)
        return episodes, int(steps.sum())

    def greedy(self, goal: Cell) -> float:
        """Return the exact expected steps of its greedy policy."""
        found = greedy_tables(_Asked(self.learner.run(0), goal), self.options)  # type: ignore[arg-type]
        return expected_steps(goal, found.option[places(goal)], found.action[places(goal)])


class _Asked:
    """A tabular learner that is asked of one goal alone, which is a hundred times less to ask."""

    def __init__(self, learner: Learner, goal: Cell) -> None:
        self.learner, self.grounded, self.goal = learner, learner.grounded, CELLS.index(goal)

    def choices(self, place: int, state: int) -> Any:
        return self.learner.choices(place, state) if GOAL[state] == self.goal else ()

    def greedy(self, place: int, state: int) -> int:
        return self.learner.greedy(place, state)


class Published:
    """The tabular option-critic: four options learnt from nothing, and a reward of 1 at the goal.

    It sees the robot's cell alone, and goes on with all that it has learnt when the goal moves.
    """

    def __init__(self, seed: int) -> None:
        self.seed, self.learner, self.goal = seed, self._on(FIRST_GOAL, seed), FIRST_GOAL

    @staticmethod
    def _on(goal: Cell, seed: int) -> TabularOptionCritic:
        index = StateIndex((Variable("robot", CELLS, tuple(map(str, CELLS))),))
        outcomes = ROBOT[MODEL.outcomes[places(goal)]]
        end = np.arange(len(CELLS)) == CELLS.index(goal)
        chances = MODEL.probabilities[places(goal)]
        model = TransitionModel(
            index, MODEL.actions, outcomes, end[outcomes].astype(float), ~end, probabilities=chances
        )
        return TabularOptionCritic(model, end, (seed,))

    def train(self, goal: Cell, episodes: int) -> tuple[int, int]:
        """Learn on, wherever the goal is."""
        if goal != self.goal:
            new, old = self._on(goal, self.seed), self.learner
            new.q_u, new.preferences, new.endings = old.q_u, old.preferences, old.endings
            new.episodes = old.episodes
            self.learner, self.goal = new, goal
        return episodes, sum(self.learner.train(episodes))

    def greedy(self, goal: Cell) -> float:
        """Return the exact expected steps of its likeliest actions; options end where that is likelier."""
        learner, cells = self.learner, range(len(CELLS))
        first = np.array([int(learner.values(cell).argmax()) for cell in cells])
        count = learner.config.options
        ends = np.array([[learner.ending(k, cell) > 1 / 2 for k in range(count)] for cell in cells])
        option = np.where(ends, first[:, None], np.arange(count))
        action = learner.preferences.argmax(axis=2).T
        return expected_steps(goal, np.column_stack([option, first]), action)


class Neural:
    """The option-critic that the graph is compiled to."""

    def __init__(self, seed: int, goal: Cell, source: OptionCritic | None = None, *, moved: str = "") -> None:
        self.learner = OptionCritic(GROUNDED, seed, CONFIG, starts=starts_for(MODEL.index, goal))
        if source is not None:
            carry_over(source, self.learner, moved.split())
        self.pieces = self.learner.learn()

    @property
    def done(self) -> int:
        """Episodes that have ended."""
        return max(0, int(self.learner.world.episodes.sum()) - self.learner.world.number)

    def train(self, goal: Cell, episodes: int) -> tuple[int, int]:  # noqa: ARG002 - it is where episodes begin
        """Learn on, update by update."""
        before, steps = self.done, self.learner.steps
        while self.done < before + episodes:
            next(self.pieces)
        return self.done - before, self.learner.steps - steps

    def greedy(self, goal: Cell) -> float:
        """Return the exact expected steps of its greedy policy."""
        return expected_steps(goal, *self.learner.greedy_in(places(goal)))


def measure(run: Run, goal: Cell, episodes: int) -> list[Row]:
    """Let a learner learn; return a row an evaluation, the first before learning."""
    rows, done, steps = [{"episodes": 0.0, "steps": 0.0, "greedy": run.greedy(goal), "cpu": 0.0}], 0, 0
    cpu = 0.0
    while done < episodes:
        since = time.process_time()
        more, took = run.train(goal, min(EVERY, episodes - done))
        cpu += time.process_time() - since
        done, steps = done + more, steps + took
        row = {"episodes": float(done), "steps": float(steps), "as_run": took / more, "cpu": cpu}
        rows.append({**row, "greedy": run.greedy(goal)})
    return rows


def moved_to(seed: int) -> Cell:
    """Return where a seed's goal is after 1000 episodes."""
    return LATER_GOALS[Stream(seed).below(len(LATER_GOALS))]


def seed_of(seed: int) -> dict[str, dict[str, Any]]:
    """Run every learner with a seed: rows before and after the goal has moved."""
    goal, found = moved_to(seed), dict[str, dict[str, Any]]()

    def note(name: str, before: list[Row], after: list[Row]) -> None:
        optima = {"optimum_before": best(FIRST_GOAL), "optimum_after": best(goal)}
        found[name] = {"seed": seed, "goal": str(goal), **optima, "before": before, "after": after}

    for name, make in TABULAR.items():
        run = make(seed)
        note(name, measure(run, FIRST_GOAL, BEFORE), measure(run, goal, AFTER))
    first = Neural(seed, FIRST_GOAL)
    before = measure(first, FIRST_GOAL, BEFORE)
    for name, moved in NEURAL.items():
        source = None if moved is None else first.learner
        later = Neural(1000 + seed, goal, source, moved=moved or "")
        note(name, before, measure(later, goal, AFTER))
    return found


TABULAR: Final[dict[str, Callable[[int], Run]]] = {
    "tabular option-critic, as published": Published,
    "flat Q": partial(Tables, CompiledFlatQ),
    "MAXQ-Q": partial(Tables, CompiledMaxQQ),
}
NEURAL: Final[dict[str, str | None]] = {
    "option-critic, carried": "goal",
    "option-critic, all carried": "",
    "option-critic, fresh": None,
}
"""What has moved, as is said; None for networks freshly drawn."""
NAMES: Final = (*TABULAR, *NEURAL)


def main() -> None:
    """Measure, print and draw."""
    torch.set_num_threads(1)
    folder = Path(sys.argv[1])
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 8
    folder.mkdir(parents=True, exist_ok=True)
    kept = folder / "transfer.json"
    if not kept.exists():
        kept.write_text(json.dumps(measured(seeds)) + "\n", encoding="utf-8")
    told = json.loads(kept.read_text(encoding="utf-8"))
    found = told["learners"]
    (folder / "four_rooms_transfer.png").write_bytes(picture(transfer_figure(found)).png)
    print(f"{told['machine']}; {told['seeds']} seeds, {told['cpu']:.0f} s of CPU time")
    print(table(found))


def measured(seeds: int) -> dict[str, Any]:
    """Run every learner with every seed."""
    since = time.process_time()
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in NAMES}
    for seed in range(seeds):
        for name, rows in seed_of(seed).items():
            found[name].append(rows)
    cpu = time.process_time() - since
    return {"machine": machine(), "config": asdict(CONFIG), "seeds": seeds, "cpu": cpu, "learners": found}


if __name__ == "__main__":
    main()
