"""Tabular learners as runs: all states at once as one by one, settings, and going on after a break."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comparisons.learn.greedy_tables import best_children, one_by_one
from comparisons.learn.registry import Request, StuckError, new_run
from comparisons.learn.tabular import CompiledRun, ReadableRun, TabularRun
from hierarchy import GroundGraph
from hierarchy.check import checked
from hierarchy.text import load_graph, load_world, parse_graph
from planners import HSMQ, FlatQ, Learner, MaxQ, MaxQQ
from worlds import UserError

STUDIES = Path(__file__).parents[2] / "examples/studies"
MAZE = "name small\n\ngrid\n. . : D1 G1\nT1 . | . .\n. . : D2 .\n\nstart 0,0\ntrigger T1\ngoal G1\n"
KINDS = (MaxQ, MaxQQ, HSMQ, FlatQ)


@cache
def grounded_on(name: str, world: str | None = None) -> GroundGraph:
    """Return a ground graph by its name or file."""
    graph, world_read = load_graph(name, None if world is None else load_world(world))
    return checked(graph, world_read.model())


@pytest.fixture(scope="module")
def early(tmp_path_factory: pytest.TempPathFactory) -> GroundGraph:
    """Return a small graph whose tasks have pseudo-rewards."""
    path = tmp_path_factory.mktemp("mazes") / "small.maze"
    path.write_text(MAZE)
    text = (STUDIES / "early_doors.yaml").read_text()
    graph, world = parse_graph(text, world=load_world(str(path)))
    return checked(graph, world.model())


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=10)
@given(episodes=st.integers(0, 60), seed=st.integers(0, 5))
def test_all_states_at_once_are_as_one_by_one(
    early: GroundGraph, kind: type[Learner], episodes: int, seed: int
) -> None:
    """Half-learnt, with ties and pseudo-rewards: the very same children."""
    learner = kind(early, (seed,))
    starts = np.flatnonzero(early.model.starts & ~early.nodes[early.root].terminal).tolist()
    learner.train(learner.grounded.root, starts, episodes)
    quick, slow = best_children(learner), one_by_one(learner)
    assert quick.keys() == slow.keys()
    for place, best in slow.items():
        np.testing.assert_array_equal(quick[place], best)


def test_a_learner_of_ones_own_is_asked_one_by_one() -> None:
    """Anything that has choices and a greedy child will do."""

    class First(MaxQ):
        def greedy(self, task: int, state: int) -> int:
            return self._available[task][state][0]

    grounded = grounded_on("taxi")
    children = one_by_one(First(grounded, (0,)))
    root = children[grounded.root]
    runs = ~grounded.nodes[grounded.root].terminal
    calls = grounded.nodes[grounded.root].calls
    first = np.select([call.available for call in calls], [call.child for call in calls], -1)
    np.testing.assert_array_equal(root[runs], first[runs])


@pytest.mark.parametrize(("learner", "own"), [("hsmq", {}), ("maxq-0", {"all_states": "true"})])
def test_a_readable_run_goes_on_after_a_break(early: GroundGraph, learner: str, own: dict[str, str]) -> None:
    """Its state is all that it hangs on: the same tables and streams, bit for bit."""
    asked = Request(learner, early, seed=2, settings={"evaluate": "7", **own}, steps=1500)
    whole, broken, new = new_run(asked), new_run(asked), new_run(asked)
    assert isinstance(whole, ReadableRun)
    points = list(whole.learn())
    for _ in zip(range(3), broken.learn(), strict=False):
        pass
    new.restore(broken.state())
    assert list(new.learn()) == points[3:]
    for name, array in whole.state().items():
        np.testing.assert_array_equal(new.state()[name], array)
    short = {name: array[:-1] for name, array in whole.state().items()}
    with pytest.raises(UserError, match="is of another graph, world or config"):
        new.restore(short)


@pytest.mark.parametrize(("learner", "kind"), [("maxq-0", MaxQ), ("maxq-q", MaxQQ), ("flat-q", FlatQ)])
@pytest.mark.slow
def test_a_compiled_run_is_the_readable_one(early: GroundGraph, learner: str, kind: type[Learner]) -> None:
    """With settings of its own: the same policy after the same steps."""
    own = {"gamma": "0.9", "rate_falls": "harmonic", "rate_half": "20", "evaluate": "50"}
    compiled = new_run(Request(learner, early, seed=1, settings=own, steps=3000))
    assert isinstance(compiled, CompiledRun)
    readable = ReadableRun(kind, Request(learner, early, seed=1, settings=own, steps=3000))
    assert list(compiled.learn()) == list(readable.learn())
    one, other = compiled.greedy(), readable.greedy()
    np.testing.assert_array_equal(one.option, other.option)
    np.testing.assert_array_equal(one.action, other.action)


def test_learning_at_all_states_takes_another_way(early: GroundGraph) -> None:
    """It is a setting that matters, and is not compiled."""
    kinds, values = [], []
    for value in ("false", "true"):
        asked = Request("maxq-0", early, settings={"all_states": value}, steps=500)
        kinds.append(type(new_run(asked)))
        readable = ReadableRun(MaxQ, asked)
        list(readable.learn())
        values.append(readable.state()["values"])
    assert kinds == [CompiledRun, ReadableRun]
    assert (values[0] != values[1]).any()


def test_schedules_of_single_tasks_must_be_of_tasks(early: GroundGraph) -> None:
    """The learner names the one that is none."""
    own = {"explores": "boltzmann", "cooling_of": "GotoDor 0.5"}
    with pytest.raises(UserError, match="settings name 'GotoDor', which is no task"):
        new_run(Request("maxq-0", early, settings=own))


def test_an_episode_that_does_not_end_is_told(early: GroundGraph) -> None:
    """As what it is, so that a study can keep it as a result."""
    run = new_run(Request("hsmq", early, settings={"max_steps": "3"}))
    assert isinstance(run, TabularRun)
    with pytest.raises(
        StuckError, match="no end after 3 primitive steps; give the learner a graph that ends"
    ):
        list(run.learn())
