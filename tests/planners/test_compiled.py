"""Compiled learners are the reference learners, bit for bit."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import interpreted
import numpy as np
import pytest
from graphs import graphs, grids
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hierarchy import GroundGraph, Param, TaskGraph, checked, ground, two_rooms
from hierarchy.hdg import hdg_graph
from hierarchy.taxi import taxi_graph
from planners import Boltzmann, Exploration, HarmonicRate, LearningRate, Settings
from planners.compiled import Compiled, CompiledFlatQ, CompiledMaxQ, CompiledMaxQQ, runs
from planners.compiled.build import FOLDER, build
from planners.learner import EpisodeTooLongError
from planners.maxq import MaxQ
from worlds import (
    StateIndex,
    Stream,
    TransitionModel,
    UserError,
    Variable,
    jit,
    load_layout,
    maze_model,
    parse_layout,
)
from worlds.hdg import LandmarkMaze, landmark_model
from worlds.taxi import taxi_model

KINDS = [CompiledMaxQ, CompiledMaxQQ, CompiledFlatQ]


def maze_graph() -> GroundGraph:
    """Return the paper's graph on the paper's maze."""
    maze = load_layout("two_rooms")
    return ground(two_rooms(maze), maze_model(maze))


def rainy_taxi() -> GroundGraph:
    """Return the graph of Taxi in the rain."""
    model = taxi_model(rain=0.2)
    return ground(taxi_graph(model), model)


def slippery_landmarks() -> GroundGraph:
    """Return the graph of a small landmark maze in which moves slip, with pseudo-rewards."""
    maze = LandmarkMaze(side=4)
    return ground(hdg_graph(maze, may_leave=True), landmark_model(maze, slip=0.2))


def wide(count: int = 70) -> GroundGraph:
    """Return a corridor of `count` cells in which the root goes to the goal by a task for each cell."""
    cells = tuple(range(count))
    index = StateIndex((Variable("x", cells), Variable("goal", cells)))
    ways = [[(max(x - 1, 0), goal), (min(x + 1, count - 1), goal)] for x in cells for goal in cells]
    after = np.array([[index.number(way) for way in pair] for pair in ways])
    starts = index.column("x") != index.column("goal")
    model = TransitionModel(index, ("left", "right"), after, np.full(after.shape, -1.0), starts)
    graph = TaskGraph("wide", index.variables, model.actions)
    x, goal = graph.variables
    to = Param(Variable("to", cells))
    goto = graph.task("Goto", to, until=x.eq(to), uses=[x], do="left right")
    graph.task("Root", until=x.eq(goal), uses=[x, goal], do=[goto(to=goal), "right"])
    return checked(graph, model)


def everything(learner: Any) -> dict[str, Any]:
    """Return all that a reference learner holds that learning changes."""
    names = ("completion", "reward", "inner_completion", "table", "episodes", "steps")
    found = {name: getattr(learner, name) for name in names if hasattr(learner, name)}
    return {**found, "random": learner.random.drawn, "chance": learner.chance.drawn}


def lessons(grounded: GroundGraph) -> list[tuple[int, list[int]]]:
    """Return a first task and the root, with states that they can start from."""
    starts = np.flatnonzero(grounded.model.starts).tolist()
    tasks = {len(grounded.model.actions), grounded.root}
    begins = {task: [start for start in starts if grounded.nodes[task].live[start]] for task in sorted(tasks)}
    return [(task, begin) for task, begin in begins.items() if begin]


def agree(kind: type[Compiled[Any]], grounded: GroundGraph, given: Settings, episodes: int = 60) -> None:
    """Hold two compiled runs to the reference: steps, tables, counts, streams and greedy ways."""
    compiled = kind(grounded, [(3,), (5, 1)], given)
    references = [kind.reference(grounded, seed, given) for seed in compiled.seeds]
    for task, begin in lessons(compiled.grounded):
        steps = compiled.train(task, begin, episodes)
        ways = compiled.greedy_steps(task, begin[:5], limit=60)
        for number, reference in enumerate(references):
            assert steps[number].tolist() == reference.train(task, begin, episodes)
            found = [reference.greedy_steps(task, start, limit=60) for start in begin[:5]]
            assert [None if way < 0 else way for way in ways[number].tolist()] == found
            assert everything(compiled.run(number)) == everything(reference)


@pytest.mark.parametrize(
    ("kind", "world", "gamma"),
    [
        (CompiledMaxQ, maze_graph, 1.0),
        (CompiledMaxQ, rainy_taxi, 0.9),
        (CompiledMaxQ, slippery_landmarks, 1.0),
        (CompiledMaxQ, wide, 1.0),
        (CompiledMaxQQ, maze_graph, 1.0),
        (CompiledMaxQQ, slippery_landmarks, 0.9),
        (CompiledFlatQ, maze_graph, 1.0),
        (CompiledFlatQ, slippery_landmarks, 0.9),
    ],
)
def test_compiled_runs_are_the_reference_s(
    kind: type[Compiled[Any]], world: Callable[[], GroundGraph], gamma: float
) -> None:
    """Steps, tables, counts, streams and greedy ways agree to the last bit, sure moves or not."""
    agree(kind, world(), Settings(gamma=gamma), episodes=40)


def test_schedules_of_single_tasks_are_heeded() -> None:
    """A task's own rate and exploration are those of the reference."""
    given = Settings(
        rates={"GotoDoor": HarmonicRate(30)},
        explorations={"Root": Exploration(10)},
        rate=LearningRate(0.5),
    )
    agree(CompiledMaxQ, maze_graph(), given)


def test_boltzmann_runs_agree() -> None:
    """Boltzmann exploration makes the same choices; values differ by no more than the last bits."""
    grounded = maze_graph()
    cooling = Boltzmann(start=20.0, factor=0.9, least=0.05)
    given = Settings(exploration=cooling, explorations={"GotoDoor": Exploration(50)})
    starts = np.flatnonzero(grounded.model.starts).tolist()
    compiled = CompiledMaxQ(grounded, [(1,), (2,)], given)
    steps = compiled.train(grounded.root, starts, 150)
    reference = MaxQ(grounded, (2,), given)
    assert steps[1].tolist() == reference.train(grounded.root, starts, 150)
    for ours, theirs in zip(compiled.run(1).completion, reference.completion, strict=True):
        for row, expected in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(row, expected, rtol=0, atol=1e-9)


def test_a_run_goes_on_as_the_reference() -> None:
    """A run taken out as a reference learner learns on as the compiled run does."""
    grounded = maze_graph()
    starts = np.flatnonzero(grounded.model.starts).tolist()
    compiled = CompiledMaxQ(grounded, [(4,)])
    compiled.train(grounded.root, starts, 30)
    taken = compiled.run(0)
    assert taken.train(grounded.root, starts, 30) == compiled.train(grounded.root, starts, 30)[0].tolist()
    assert everything(taken) == everything(compiled.run(0))


def test_runs_do_not_hang_on_each_other() -> None:
    """A run is the same alone, among others, and on any number of threads."""
    grounded = maze_graph()
    starts = np.flatnonzero(grounded.model.starts).tolist()
    seeds = [(seed,) for seed in range(40)]
    many, one, alone = (
        CompiledMaxQ(grounded, seeds, threads=4),
        CompiledMaxQ(grounded, seeds, threads=1),
        CompiledMaxQ(grounded, seeds[17:18]),
    )
    steps = [learner.train(grounded.root, starts, 50) for learner in (many, one, alone)]
    assert (steps[0] == steps[1]).all()
    assert (many.values == one.values).all()
    assert (steps[0][17] == steps[2][0]).all()
    assert (many.values[17] == alone.values[0]).all()


def test_a_measurement_after_each_episode_changes_nothing() -> None:
    """Training with a call after each episode is the training without, and the call sees each state."""
    grounded = maze_graph()
    starts = np.flatnonzero(grounded.model.starts).tolist()
    plain, watched = (CompiledMaxQ(grounded, [(1,), (2,)]) for _ in range(2))
    seen: list[float] = []
    steps = watched.train(grounded.root, starts, 25, lambda: seen.append(float(watched.values.sum())))
    assert (steps == plain.train(grounded.root, starts, 25)).all()
    assert (watched.values == plain.values).all()
    assert len(set(seen)) == 25


def test_schedules_grow_with_the_episodes() -> None:
    """More episodes than the schedules' first tables hold give the reference's run."""
    grounded = wide(4)
    starts = np.flatnonzero(grounded.model.starts).tolist()
    compiled = CompiledMaxQ(grounded, [(1,)])
    episodes = runs.SCHEDULED + 50
    steps = compiled.train(grounded.root, starts, episodes)
    assert steps[0].tolist() == MaxQ(grounded, (1,)).train(grounded.root, starts, episodes)


def test_an_endless_episode_is_given_up_and_nothing_is_learnt() -> None:
    """Past `max_steps` the reference's error is raised, and the learner is as it was before."""
    grounded = maze_graph()
    starts = np.flatnonzero(grounded.model.starts).tolist()
    compiled = CompiledMaxQ(grounded, [(1,), (2,)], Settings(max_steps=40))
    before = everything(compiled.run(1))
    with pytest.raises(EpisodeTooLongError, match="no end after 40 primitive steps in run 0, episode 0"):
        compiled.train(grounded.root, starts, 20)
    assert everything(compiled.run(1)) == before


def test_a_task_with_nothing_to_call_is_named() -> None:
    """Where a task has no child to call the error is the reference's."""
    grounded = maze_graph()
    task = grounded.place("GotoDoor(D1)")
    elsewhere = int(np.flatnonzero(~grounded.nodes[task].live & ~grounded.nodes[task].terminal)[0])
    compiled = CompiledMaxQ(grounded, [(1,)])
    for call in (
        lambda: compiled.train(task, [elsewhere], 1),
        lambda: compiled.greedy_steps(task, [elsewhere]),
    ):
        with pytest.raises(UserError, match=r"task GotoDoor\(D1\) has no child to call in state"):
            call()


class _Odd:
    """An explorer of a user's own."""

    def __call__(self, episode: int) -> float:
        return 1.0 / (1 + episode)

    def choose(self, level: float, choices: Any, values: Any, tie: float, random: Stream) -> int:
        del level, values, tie
        return int(random.choose(choices))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (Settings(all_states=True), "all-states updating is not compiled"),
        (Settings(exploration=_Odd()), "exploration by _Odd is not compiled; give Exploration or Boltzmann"),
    ],
)
def test_what_is_not_compiled_is_refused(given: Settings, message: str) -> None:
    """Settings that no kernel knows are refused, with what to use instead."""
    with pytest.raises(UserError, match=message):
        CompiledMaxQ(maze_graph(), [(1,)], given)


def test_no_seeds_and_no_starts_are_refused() -> None:
    """Nothing to run, nothing to start from, and what is no task or state are errors of the user."""
    with pytest.raises(UserError, match="needs a seed for each run"):
        CompiledMaxQ(maze_graph(), [])
    grounded = maze_graph()
    learner = CompiledMaxQ(grounded, [(1,)])
    for call in (lambda task, states: learner.train(task, states, 5), learner.greedy_steps):
        with pytest.raises(UserError, match="task Root has no states to start from"):
            call(grounded.root, [])
        with pytest.raises(UserError, match="states are numbers from 0 to 2047, and 2048 is none of them"):
            call(grounded.root, [5, 2048])
        with pytest.raises(UserError, match="by their numbers; of a mask"):
            call(grounded.root, grounded.model.starts)
        with pytest.raises(UserError, match="2 is not the place of a task; tasks have the places 4 to 14"):
            call(2, [5])


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.data(), st.sampled_from(KINDS), st.sampled_from([1.0, 0.9]))
def test_generated_source_is_the_reference_on_random_graphs(
    data: st.DataObject, kind: type[Compiled[Any]], gamma: float
) -> None:
    """The source that is generated for any sound graph, left to Python, is the reference learner."""
    grid = data.draw(grids())
    grounded = ground(data.draw(graphs(grid)), grid.model)
    explorer = data.draw(st.sampled_from([Exploration(5), Boltzmann(5.0, 0.9, 0.5)]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs, "build", interpreted.interpret)
        agree(kind, grounded, Settings(gamma=gamma, exploration=explorer), episodes=8)


@pytest.mark.slow
@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.data(), st.sampled_from(KINDS))
def test_compiled_runs_are_the_reference_s_on_random_graphs(
    data: st.DataObject, kind: type[Compiled[Any]]
) -> None:
    """Kernels of random sound graphs are the reference learner, compiled as users run them."""
    grid = data.draw(grids())
    grounded = ground(data.draw(graphs(grid)), grid.model)
    agree(kind, grounded, Settings(exploration=Exploration(5)), episodes=20)


@given(st.integers(-(2**63), 2**64), st.integers(0, 10_000), st.integers(1, 2**31))
def test_kernels_draw_what_streams_draw(seed: int, drawn: int, n: int) -> None:
    """Draw by draw, the kernels' random numbers are the stream's."""
    stream = Stream(seed, 7)
    key = np.uint64(stream.key)
    stream.drawn = drawn
    assert int(jit.bits(key, drawn + 1)) == stream.bits()
    assert jit.uniform(key, drawn + 2) == stream.uniform()
    assert jit.below(key, drawn + 3, n) == stream.below(n)


@given(st.integers(1, 2**64 - 1))
def test_words_of_bits(word: int) -> None:
    """Bits are counted, found and taken away."""
    x = np.uint64(word)
    assert jit.ones(x) == word.bit_count()
    assert jit.lowest(x) == (word & -word).bit_length() - 1
    assert int(jit.without_lowest(x)) == word & (word - 1)


TRY = """
import numpy as np
from pathlib import Path
from planners import MaxQ
from planners.compiled import CompiledMaxQ
from hierarchy import ground, two_rooms
from worlds import load_layout, maze_model
maze = load_layout("two_rooms")
grounded = ground(two_rooms(maze), maze_model(maze))
starts = np.flatnonzero(grounded.model.starts).tolist()
steps = CompiledMaxQ(grounded, [(1,)]).train(grounded.root, starts, 20)
assert steps[0].tolist() == MaxQ(grounded, (1,)).train(grounded.root, starts, 20)
"""


def _try(folder: Path) -> None:
    """Learn in a process of its own, with its kernels in a folder; it must do so without a word."""
    env = {**os.environ, FOLDER: str(folder)}
    done = subprocess.run(  # noqa: S603 - our own
        [sys.executable, "-c", TRY], env=env, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_the_cache_is_used_and_survives_damage(tmp_path: Path) -> None:
    """Machine code is kept; cut, changed or emptied files, and changed source, are replaced."""
    _try(tmp_path)
    code = sorted(tmp_path.rglob("*.nbc"))
    assert code
    written = {path: path.stat().st_mtime_ns for path in code}
    _try(tmp_path)
    assert {path: path.stat().st_mtime_ns for path in code} == written
    for path in sorted(tmp_path.rglob("*.nb?")):
        whole = path.read_bytes()
        for damaged in (whole[: len(whole) // 2], whole[:-9] + bytes(9), b""):
            path.write_bytes(damaged)
            _try(tmp_path)
    (source,) = tmp_path.glob("*.py")
    text = source.read_text()
    source.write_text("raise SystemExit(3)\n")
    _try(tmp_path)
    assert source.read_text() == text


@pytest.mark.slow
def test_without_a_place_for_the_cache_all_is_well(tmp_path: Path) -> None:
    """Where no folder can be made nothing is kept and nothing is said."""
    taken = tmp_path / "file"
    taken.write_text("no folder")
    _try(taken / "below")
    assert list(tmp_path.iterdir()) == [taken]


def test_graphs_of_one_form_share_a_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """A maze of another size takes the kernel of the paper's, and learns right with it."""
    sources = []

    def watched(source: str) -> Any:
        sources.append(source)
        return build(source)

    monkeypatch.setattr(runs, "build", watched)
    rows = "grid", ". . T1 | . G1", ". T2 . : D1 .", "T3 . . : D2 G2", "T4 . . | G3 G4", "start 0,0"
    maze = parse_layout("\n".join((*rows, "trigger T1", "goal G1")))
    small = ground(two_rooms(maze), maze_model(maze))
    CompiledMaxQ(maze_graph(), [(1,)])
    agree(CompiledMaxQ, small, Settings(), episodes=30)
    assert sources[0] == sources[1]


def test_a_module_is_built_once() -> None:
    """The same source gives the same module."""
    source = "ANSWER = 42\n"
    assert build(source) is build(source)
    assert build(source).ANSWER == 42
