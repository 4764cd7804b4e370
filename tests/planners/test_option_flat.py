"""Learning without tasks: an option-critic whose options are actions; flat PPO and DQN, broken off."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from collecting_runs import State, learnt, same
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hierarchy import GroundGraph, TaskGraph, checked, ground, two_rooms
from hierarchy.text import load_graph
from planners import flat_optimum
from planners.option_critic import flat_baselines
from planners.option_critic.checkpoint import Checkpoint, digest, load_checkpoint, restore, save_checkpoint
from planners.option_critic.config import Ends, OptionCriticConfig
from planners.option_critic.flat_baselines import Flat, FlatDQN, FlatPPO
from planners.option_critic.memory import Memory
from planners.option_critic.training import OptionCritic
from worlds import StateIndex, TransitionModel, UserError, Variable, maze_model, parse_layout
from worlds.model_env import ModelTorchEnv

SMALL = OptionCriticConfig(
    hidden=8, num_envs=8, horizon=16, epochs=2, minibatch=50, max_steps=20, anneal=2000, total=8 * 128
)
OTHERS: dict[str, Any] = {
    "terminations": "prior",
    "abstracted": False,
    "hidden": 9,
    "num_envs": 4,
    "horizon": 8,
    "epochs": 1,
    "minibatch": 49,
    "rate": 1e-3,
    "last_rate": 1e-3,
    "entropy": 0.3,
    "epsilon": 0.9,
    "anneal": 400,
    "gamma": 0.5,
    "lmbda": 0.5,
    "clip": 1e-4,
    "critic": 0.1,
    "most_gradient": 1e-4,
    "termination": 0.9,
    "prior": 9.0,
    "deliberation": 9.0,
    "max_steps": 5,
}
KINDS = pytest.mark.parametrize("kind", [FlatPPO, FlatDQN])


@cache
def world(name: str) -> GroundGraph:
    """Return a graph on a small maze, or on four rooms, where chance has a say."""
    if name == "four_rooms":
        graph, found = load_graph("four_rooms")
        return checked(graph, found.model())
    rows = "grid", ". . : D1 G1", "T1 . | . .", "start 0,0", "trigger T1", "goal G1"
    maze = parse_layout("\n".join(rows))
    return ground(two_rooms(maze), maze_model(maze))


@pytest.mark.parametrize("terminations", ["given", "prior", "learnt"])
def test_options_that_are_actions_learn(terminations: Ends) -> None:
    """A graph without subtasks is learnt by the critic alone, whatever ends a task; all starts optimal."""
    index = StateIndex((Variable("x", tuple(range(8))),))
    after = np.array([[max(x - 1, 0), min(x + 1, 7)] for x in range(8)])
    model = TransitionModel(index, ("left", "right"), after, np.full(after.shape, -1.0), np.arange(8) < 7)
    graph = TaskGraph("corridor", index.variables, model.actions)
    (x,) = graph.variables
    graph.task("Root", until=x.eq(7), uses=[x], do="left right")
    grounded = checked(graph, model)
    config = OptionCriticConfig(
        terminations=terminations,
        num_envs=16,
        horizon=16,
        minibatch=64,
        hidden=8,
        anneal=10_000,
        total=10_000,
    )
    learner, starts = OptionCritic(grounded, 0, config), np.arange(7)
    best = flat_optimum(model, grounded.nodes[grounded.root].terminal).value[:7]
    assert any(np.allclose(learner.greedy().returns(starts), best) for _ in learner.learn())


@pytest.mark.parametrize(
    ("kind", "name", "memory"),
    [
        (FlatPPO, "maze", 0),
        (FlatPPO, "four_rooms", 0),
        (FlatDQN, "maze", 100_000),
        (FlatDQN, "four_rooms", 100_000),
        (FlatDQN, "maze", 300),  # what is kept is overwritten, from the middle on
        (FlatDQN, "maze", 128),  # by each update, from the beginning on
        (FlatDQN, "maze", 1),  # more is collected at a time
    ],
)
def test_a_flat_run_that_was_broken_off_goes_on_bit_for_bit(
    kind: type[Flat], name: str, memory: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through a file, after any update: the same measurements, arrays and tables as an unbroken run."""
    monkeypatch.setattr(flat_baselines, "MEMORY", memory)
    grounded, path = world(name), tmp_path / "c.safetensors"
    whole = kind(grounded, 5, SMALL)
    unbroken = learnt(whole)
    assert [progress.steps for progress in unbroken] == [128 * k for k in range(1, 9)]
    for updates in (1, 3, 7):
        broken = kind(grounded, 5, SMALL)
        learnt(broken, updates)
        about = Checkpoint("flat", "", "w", 5, {}, digest(grounded), broken.steps)
        save_checkpoint(path, about, broken.state())
        new = kind(grounded, 5, SMALL)
        restore(path, load_checkpoint(path), new)
        assert new.steps == 128 * updates
        assert same(new.state(), broken.state())
        assert learnt(new) == unbroken[updates:]
        assert same(new.state(), whole.state())
        np.testing.assert_array_equal(new.greedy().option, whole.greedy().option)


@KINDS
def test_a_flat_run_that_pauses_goes_on_in_place(kind: type[Flat]) -> None:
    """Going on with the same learner after a pause is no different, either."""
    whole, parts = (kind(world("maze"), 5, SMALL) for _ in range(2))
    assert learnt(whole) == learnt(parts, 3) + learnt(parts)
    assert same(whole.state(), parts.state())


def test_the_checkpoint_of_dqn_holds_its_steps_and_no_more() -> None:
    """Every step collected is there once, is one that the world allows, and follows from the one before."""
    grounded = world("maze")
    learner = FlatDQN(grounded, 1, SMALL)
    learnt(learner, 3)
    state = learner.state()
    kept = {name.removeprefix("memory."): state[name] for name in state if name.startswith("memory.")}
    assert {array.shape for array in kept.values()} == {(3 * 128,)}
    assert sum(array.itemsize for array in kept.values()) == 9  # fewer than 256 states
    model, terminal = grounded.model, grounded.nodes[grounded.root].terminal
    before, action, after = (kept[name].astype(np.int64) for name in ("state", "action", "next_state"))
    np.testing.assert_array_equal(after, model.successors[before, action])
    np.testing.assert_array_equal(kept["reward"], model.rewards[before, action])
    np.testing.assert_array_equal(kept["terminated"], terminal[after])
    assert kept["terminated"].sum() < kept["done"].sum()  # some episodes were cut off
    grid = (3, SMALL.num_envs, SMALL.horizon)
    follows = before.reshape(grid)[:, :, 1:] == after.reshape(grid)[:, :, :-1]
    assert (follows | kept["done"].reshape(grid)[:, :, :-1]).all()
    np.testing.assert_array_equal(before.reshape(grid)[0, :, 0], first_states(learner))


def first_states(learner: Flat) -> NDArray[np.int64]:
    """Return where the environments of a learner begin."""
    new = type(learner)(learner.grounded, learner.seed, learner.config)
    found: NDArray[np.int64] = new.world.reset()["state"].numpy()
    return found


@settings(max_examples=30, deadline=None)
@given(
    most=st.integers(1, 40),
    sizes=st.lists(st.integers(1, 25), min_size=1, max_size=5),
    more=st.integers(1, 25),
)
def test_a_memory_that_is_restored_is_the_same_memory(most: int, sizes: list[int], more: int) -> None:
    """It keeps the last steps, and the same are drawn from it and replaced, however often it went round."""
    model = world("maze").model
    env = ModelTorchEnv(model, np.zeros(model.index.size, bool), 2)
    env.set_seed(0)
    memories = Memory(env, most, 30), Memory(env, most, 30)
    batches = [env.rollout(size) for size in sizes]
    for batch in batches:
        memories[0].keep(batch)
    made = 2 * sum(sizes)
    last = torch.cat([batch["state"].flatten() for batch in batches])[-most:]
    kept = memories[0].state()["memory.state"]
    turned = made % most if made > most else 0
    assert np.roll(kept, -turned).tolist() == last.tolist()
    memories[1].keep(batches[0])
    memories[1].restore(memories[0].state(), made)
    new = env.rollout(more)
    drawn = []
    for memory in memories:
        assert memory.state().keys() == memory.wanted(made).keys()
        memory.keep(new)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(0)
            drawn.append(memory.draw())
    assert (drawn[0] == drawn[1]).all()
    assert torch.equal(drawn[0]["observation"], env.encoding(drawn[0]["state"]))
    assert torch.equal(drawn[0]["next", "observation"], env.encoding(drawn[0]["next", "state"]))
    assert same(memories[0].state(), memories[1].state())


@pytest.mark.parametrize(
    ("kind", "name", "array", "problem"),
    [
        (FlatPPO, "updates", None, "there is none"),
        (FlatPPO, "updates", np.array(0), "0 is none of 1 to"),
        (FlatPPO, "updates", np.zeros(2, np.int64), r"shape \(2,\) and type int64, not \(\)"),
        (FlatPPO, "env.running", np.zeros(8, np.int64), "there should be none"),
        (FlatPPO, "env.state", np.full(8, 10**6), "1000000 is none of 0 to"),
        (FlatPPO, "memory.action", np.zeros(128, np.uint8), "there should be none"),
        (FlatPPO, "adam.0.exp_avg", np.zeros(3, np.float32), r"shape \(3,\)"),
        (FlatDQN, "updates", None, "there is none"),
        (FlatDQN, "updates", np.array(1.0), "float64, not"),
        (FlatDQN, "memory.reward", None, "there is none"),
        (FlatDQN, "memory.state", np.zeros(127, np.uint8), r"shape \(127,\) and type uint8, not \(128,\)"),
        (FlatDQN, "memory.action", np.full(128, 4, np.uint8), "4 is none of 0 to 3"),
        (FlatDQN, "memory.next_state", np.full(128, 255, np.uint8), "255 is none of 0 to 15"),
        (FlatDQN, "memory.terminated", np.zeros(128, np.uint8), "uint8, not .* bool"),
    ],
)
def test_foreign_arrays_are_refused_by_flat_learners(
    kind: type[Flat], name: str, array: NDArray[np.generic] | None, problem: str
) -> None:
    """By name, as missing, too many or wrong, before any is taken up."""
    learner = kind(world("maze"), 0, SMALL)
    learnt(learner, 1)
    state = {**learner.state(), name: array}
    other = kind(world("maze"), 1, SMALL)
    before = {name: value.clone() for name, value in other.loss.state_dict().items()}
    with pytest.raises(UserError, match=f"array '{name}': .*{problem}"):
        other.restore({key: value for key, value in state.items() if value is not None})
    assert other.steps == 0
    assert all(torch.equal(value, before[name]) for name, value in other.loss.state_dict().items())


def test_steps_and_updates_that_do_not_fit_are_refused() -> None:
    """With two updates told, 256 steps are asked for."""
    learner = FlatDQN(world("maze"), 0, SMALL)
    learnt(learner, 1)
    with pytest.raises(UserError, match=r"'memory.action': it has shape \(128,\) .*, not \(256,\)"):
        learner.restore({**learner.state(), "updates": np.array(2)})


@KINDS
def test_the_settings_that_are_read_are_those_that_matter(kind: type[Flat]) -> None:
    """Every setting but when to look and to end either changes what is learnt, or is among those unread."""
    assert OTHERS.keys() | {"total", "evaluate"} == SMALL.__dataclass_fields__.keys()

    def after(config: OptionCriticConfig) -> State:
        learner = kind(world("maze"), 0, config)
        learnt(learner, 3)
        return learner.state()

    usual = after(SMALL)
    unread = {name for name, value in OTHERS.items() if same(after(replace(SMALL, **{name: value})), usual)}
    assert unread == kind.unread


@KINDS
def test_a_flat_network_is_wide_unless_said_otherwise(kind: type[Flat]) -> None:
    """128, as they were compared."""
    assert kind(world("maze"), 0).config == OptionCriticConfig(hidden=128)
