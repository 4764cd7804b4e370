"""What an option-critic carries over: the networks that do not see what has moved, and no others."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any

import collecting_runs
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy import GroundGraph, ground, two_rooms
from hierarchy.check import checked
from hierarchy.four_rooms import four_rooms_graph
from hierarchy.starts import beginning_where
from hierarchy.taxi import taxi_graph
from hierarchy.text import graph_text, load_graph
from planners.option_critic.checkpoint import Checkpoint, digest, save_checkpoint
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.training import OptionCritic
from planners.option_critic.transfer import carry_from, carry_over
from worlds import Cell, StateIndex, UserError, maze_model, parse_layout
from worlds.encoding import Encoding
from worlds.four_rooms import FIRST_GOAL, four_rooms_model, starts_for
from worlds.taxi import taxi_model

SMALL = OptionCriticConfig(num_envs=8, horizon=8, hidden=4, minibatch=64, max_steps=50, total=192)
LATER = Cell(10, 10)
LEAVES = ("NW(north)", "NW(west)", "NE(north)", "NE(east)", "SW(west)", "SW(south)", "SE(east)", "SE(south)")


@cache
def rooms() -> GroundGraph:
    """Return the four rooms."""
    return ground(four_rooms_graph(), four_rooms_model())


def learner(seed: int, goal: Cell = FIRST_GOAL, **words: Any) -> OptionCritic:
    """Return a learner of the four rooms while the goal is in one cell."""
    starts = starts_for(rooms().model.index, goal)
    return OptionCritic(rooms(), seed, replace(SMALL, **words), starts=starts)


def learnt(seed: int, **words: Any) -> OptionCritic:
    """Return one that has made an update."""
    found = learner(seed, **words)
    collecting_runs.learnt(found, 1)
    return found


def outputs(of: OptionCritic, states: np.ndarray) -> dict[str, torch.Tensor]:
    """Return what every network makes of some states, by the network's name."""
    seen = of.world.encoding(torch.as_tensor(states))
    nodes, options = of.grounded.nodes, of.options
    found = {}
    with torch.no_grad():
        actor = of.policy.actor.module.networks(seen)
        for i, place in enumerate(options.tasks):
            found[f"policy of {nodes[place].name}"] = actor[:, i]
        critic = of.policy.critic.module.networks(seen)
        for i, part in enumerate(options.parts):
            found[part.name] = critic[:, i]
        if of.policy.termination is not None:
            ends = of.policy.termination.module.networks(seen)
            names = sorted(
                {int(node) for node in options.nodes.flatten() if node >= len(of.grounded.model.actions)}
            )
            for i, place in enumerate(names):
                found[f"termination of {nodes[place].name}"] = ends[:, i]
    return found


def changed(before: dict[str, torch.Tensor], after: dict[str, torch.Tensor]) -> set[str]:
    """Return the names of the networks that make something else of the same states."""
    return {name for name in before if not torch.equal(before[name], after[name])}


@pytest.mark.parametrize("terminations", ["given", "prior"])
def test_what_does_not_see_the_goal_is_carried(terminations: str) -> None:
    """The ways to the hallways and what they are worth; what is told is what has changed, to the bit."""
    source, into = learnt(0, terminations=terminations), learner(1, LATER, terminations=terminations)
    states = np.random.default_rng(0).integers(rooms().model.index.size, size=50)
    fresh, old = outputs(into, states), outputs(source, states)
    carried = carry_over(source, into, ["goal"])
    expected = [f"policy of Leave{way}" for way in LEAVES] + [f"V Leave{way}" for way in LEAVES]
    if terminations == "prior":
        expected += [f"termination of Leave{way}" for way in LEAVES]
    assert list(carried) == expected
    new = outputs(into, states)
    assert changed(fresh, new) == set(carried)
    assert not changed({name: old[name] for name in carried}, new)


def test_with_nothing_moved_everything_is_carried() -> None:
    """Then the two policies are one; names in any order, and twice, are as good."""
    source, into = learnt(0), learner(1, LATER)
    assert len(carry_over(source, into, ())) == 9 + 18
    one, other = source.greedy(), into.greedy()
    np.testing.assert_array_equal(one.option, other.option)
    np.testing.assert_array_equal(one.action, other.action)
    again = learner(1, LATER)
    assert carry_over(source, again, iter(["goal", "goal"])) == carry_over(source, learner(1, LATER), "goal")


def test_what_is_carried_is_what_learns() -> None:
    """The loss and the optimiser hold the very weights; the source is left as it was."""
    source, into = learnt(0), learner(1, LATER)
    before = source.state()
    carried = carry_over(source, into, ["goal"])
    states = np.arange(40)
    begun = outputs(into, states)
    next(into.learn())
    assert set(carried) & changed(begun, outputs(into, states))
    assert collecting_runs.same(before, source.state())


def test_a_run_that_began_so_resumes_bit_for_bit() -> None:
    """From its own state alone: the learner that goes on never hears of the source."""
    source = learnt(0)
    whole, broken, new = (learner(1, LATER) for _ in range(3))
    for one in (whole, broken):
        carry_over(source, one, ["goal"])
    unbroken = collecting_runs.learnt(whole)
    collecting_runs.learnt(broken, 1)
    new.restore(broken.state())
    assert collecting_runs.learnt(new) == unbroken[1:]
    assert collecting_runs.same(whole.state(), new.state())


@settings(max_examples=15, deadline=None)
@given(st.sets(st.sampled_from(["taxi", "passenger", "destination"])))
def test_nothing_that_sees_a_moved_variable_is_carried(moved: set[str]) -> None:
    """Of Taxi, depth three, whatever has moved: the parts that are carried use none of it, the others do."""
    grounded = taxi()
    source, into = OptionCritic(grounded, 0, SMALL), OptionCritic(grounded, 1, SMALL)
    uses = {part.name: set(part.uses) for part in source.options.parts}
    places = zip(source.options.tasks, source.options.task_uses, strict=True)
    uses |= {f"policy of {grounded.nodes[place].name}": set(names) for place, names in places}
    expected = {name for name, used in uses.items() if not used & moved}
    if expected:
        assert set(carry_over(source, into, moved)) == expected
    else:
        with pytest.raises(UserError, match="nothing can be carried over"):
            carry_over(source, into, moved)


@cache
def taxi() -> GroundGraph:
    """Return Taxi."""
    model = taxi_model()
    return ground(taxi_graph(model), model)


@pytest.mark.parametrize(
    ("words", "moved", "problem"),
    [
        ({}, ["gaol"], "there is no state variable 'gaol'; did you mean 'goal'"),
        ({"abstracted": False}, ["goal"], "every network sees goal: .* abstracted: true"),
        ({}, ["robot"], "every network sees robot: nothing can be carried over; learn anew"),
    ],
)
def test_what_cannot_be_is_told(words: dict[str, Any], moved: list[str], problem: str) -> None:
    """A variable that there is not, or one that everything sees."""
    with pytest.raises(UserError, match=problem):
        carry_over(learner(0, **words), learner(1, **words), moved)


@pytest.mark.parametrize(
    ("name", "value"), [("hidden", 8), ("terminations", "prior"), ("abstracted", False), ("gamma", 0.9)]
)
def test_other_networks_are_refused(name: str, value: object) -> None:
    """Of another width, kind or discount: the message says which setting."""
    was = getattr(SMALL, name)
    with pytest.raises(UserError, match=f"setting {name} was {was} and is {value} now; give {name}: {was}"):
        carry_over(learner(0), learner(1, **dict[str, Any]({name: value})), ["goal"])


def test_other_settings_may_differ() -> None:
    """How fast and how long is learnt is nothing to what was learnt."""
    assert carry_over(learner(0), learner(1, num_envs=4, rate=1e-4, total=10**6), ["goal"])


def test_another_graph_or_world_is_refused() -> None:
    """Other rules of the same rooms, another graph of the same world, another world; other starts are not."""
    other = ground(four_rooms_graph(), four_rooms_model(rules="sutton"))
    for grounded, name in ((other, "four_rooms"), (taxi(), "taxi")):
        moved = grounded.model.index.names[0]
        with pytest.raises(UserError, match=rf"another task graph or world .four_rooms.*.{name}."):
            carry_over(learner(0), OptionCritic(grounded, 1, SMALL), [moved])
    maze = parse_layout("grid\n. . : D1 G1\nT1 . | . .\n. . : D2 .\nstart 0,0\ntrigger T1\ngoal G1\n")
    one, two = (ground(two_rooms(maze, one_door_task=one), maze_model(maze)) for one in (False, True))
    with pytest.raises(UserError, match="another task graph or world"):
        carry_over(OptionCritic(one, 0, SMALL), OptionCritic(two, 1, SMALL), ["goal"])
    part = beginning_where(rooms(), "goal = 7,9")
    assert carry_over(OptionCritic(part, 0, SMALL), OptionCritic(rooms(), 1, SMALL), ["goal"])


def test_one_that_has_learnt_is_not_written_over() -> None:
    """Only a new one is begun with what was carried."""
    with pytest.raises(UserError, match="has learnt for 64 steps already"):
        carry_over(learner(0), learnt(1), ["goal"])


def test_those_that_see_states_differently_are_refused() -> None:
    """Another encoding's columns mean something else, be they as many."""
    index: StateIndex = rooms().model.index
    table = Encoding(index)(torch.arange(index.size)).numpy()
    columns = Encoding(index).columns
    encodings = [Encoding.of_table(index, seen, columns) for seen in (table, table[:, ::-1].copy(), table)]
    same, other, alike = (OptionCritic(rooms(), 0, SMALL, encoding=encoding) for encoding in encodings)
    assert carry_over(same, alike, ["goal"]) == carry_over(learner(0), learner(1), ["goal"])
    with pytest.raises(UserError, match="other encodings"):
        carry_over(same, other, ["goal"])


def test_a_checkpoint_is_carried_from(tmp_path: Path) -> None:
    """Also one whose episodes began in part of the starts; what is refused names the file."""
    graph, world = load_graph("four_rooms")
    grounded = beginning_where(checked(graph, world.model()), "goal = 7,9")
    source = OptionCritic(grounded, 0, SMALL)
    next(source.learn())
    about = Checkpoint(
        "option-critic",
        graph_text(graph, world),
        world.name,
        0,
        asdict(SMALL),
        digest(grounded),
        steps=source.steps,
        starts="goal = 7,9",
    )
    path = tmp_path / "c.safetensors"
    save_checkpoint(path, about, source.state())
    one, other = learner(1, LATER), learner(1, LATER)
    assert carry_from(path, one, ["goal"]) == carry_over(source, other, ["goal"])
    states = np.arange(60)
    assert not changed(outputs(one, states), outputs(other, states))
    with pytest.raises(UserError, match=r"c\.safetensors: there is no state variable 'gaol'"):
        carry_from(path, learner(1), ["gaol"])
    with pytest.raises(UserError, match=r"no\.safetensors.*check the path"):
        carry_from(tmp_path / "no.safetensors", learner(1), ["goal"])


@pytest.mark.slow
def test_what_was_learnt_is_of_use() -> None:
    """After as many steps with the goal moved, the carried learner's ways are shorter, by the median of 3."""
    config = OptionCriticConfig(
        num_envs=32, horizon=16, minibatch=256, anneal=40_000, total=30_720, max_steps=100
    )
    index = rooms().model.index
    gained = []
    for seed in range(3):
        source = OptionCritic(rooms(), seed, config, starts=starts_for(index, FIRST_GOAL))
        list(source.learn())
        lost = []
        for carried in (True, False):
            new = OptionCritic(
                rooms(), 10 + seed, replace(config, total=5_120), starts=starts_for(index, LATER)
            )
            if carried:
                carry_over(source, new, ["goal"])
            length = [progress.steps / max(1, int(new.world.episodes.sum()) - 32) for progress in new.learn()]
            lost.append(length[-1])
        gained.append(lost[1] / lost[0])
    assert np.median(gained) > 1.3
