"""Learning with an option-critic: a run is repeatable, goes on bit for bit, and tells what it measured."""

from dataclasses import replace
from math import log
from pathlib import Path

import numpy as np
import pytest
import torch
from collecting_runs import learnt, same
from numpy.typing import NDArray

from hierarchy import GroundGraph
from hierarchy.check import checked
from hierarchy.text import graph_text, load_graph, load_world
from planners.option_critic import training
from planners.option_critic.checkpoint import Checkpoint, digest, load_checkpoint, restore, save_checkpoint
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.loading import load_option_critic
from planners.option_critic.training import OptionCritic
from worlds import UserError

MAZE = "grid\n. . : D1 G1\nT1 . | . .\n. . : D2 .\nstart 0,0\ntrigger T1\ngoal G1\n"
SMALL = OptionCriticConfig(
    hidden=8, num_envs=16, horizon=16, epochs=2, minibatch=100, max_steps=20, anneal=4000, total=6 * 256
)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[GroundGraph, Path]:
    """Return the two-room graph on a maze of twelve cells, and the maze's file."""
    path = tmp_path_factory.mktemp("mazes") / "small.maze"
    path.write_text(MAZE)
    graph, world = load_graph("two_rooms", load_world(str(path)))
    return checked(graph, world.model()), path


@pytest.mark.parametrize("terminations", ["given", "prior"])
def test_a_run_that_was_broken_off_goes_on_bit_for_bit(
    small: tuple[GroundGraph, Path], tmp_path: Path, terminations: str
) -> None:
    """Through a file, after any update: the same measurements and the same networks as an unbroken run."""
    grounded, _ = small
    config = replace(SMALL, terminations=terminations)
    whole = OptionCritic(grounded, 5, config)
    unbroken = learnt(whole)
    assert [progress.steps for progress in unbroken] == [256 * k for k in range(1, 7)]
    for updates in (1, 4):
        broken = OptionCritic(grounded, 5, config)
        learnt(broken, updates)
        about = Checkpoint("option-critic", "", "w", 5, {}, digest(grounded), broken.steps)
        save_checkpoint(tmp_path / "c.safetensors", about, broken.state())
        new = OptionCritic(grounded, 5, config)
        restore(tmp_path / "c.safetensors", load_checkpoint(tmp_path / "c.safetensors"), new)
        assert new.steps == 256 * updates
        assert learnt(new) == unbroken[updates:]
        assert same(new.state(), whole.state())


def test_the_seed_names_the_run(small: tuple[GroundGraph, Path]) -> None:
    """The same one gives the same bits whatever torch's own generator does, another one others."""
    states = []
    for seed, other in ((0, 10), (0, 11), (1, 10)):
        torch.manual_seed(other)
        before = torch.get_rng_state()
        learner = OptionCritic(small[0], seed, SMALL)
        learnt(learner, 2)
        states.append(learner.state())
        assert torch.equal(torch.get_rng_state(), before)
    assert same(states[0], states[1])
    assert not same(states[0], states[2])


def test_what_is_measured(small: tuple[GroundGraph, Path]) -> None:
    """Losses, and how long options last and how varied they are, within what is possible."""
    learner = OptionCritic(small[0], 0, SMALL)
    for _, measures in learnt(learner):
        assert {"loss_objective", "loss_critic", "loss_entropy"} < measures.keys()
        assert 1 <= measures["option_duration"] <= 256
        assert 0 <= measures["usage_entropy"] <= log(len(learner.options))
    assert "loss_termination" not in measures


@pytest.mark.parametrize("terminations", ["given", "prior"])
def test_some_states_are_asked_as_all_are(small: tuple[GroundGraph, Path], terminations: str) -> None:
    """In any order and chunk by chunk, the rows are those of the policy; a mask is refused, none will do."""
    learner = OptionCritic(small[0], 0, replace(SMALL, terminations=terminations))
    learnt(learner, 2)
    policy, size = learner.greedy(), small[0].model.index.size
    for chunk in (5, 10**6):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(training, "_CHUNK", chunk)
            for states in (np.array([7, 3, 3, size - 1]), np.arange(size)[::-1], np.zeros(0, dtype=np.int64)):
                option, action = learner.greedy_in(states)
                np.testing.assert_array_equal(option, policy.option[states])
                np.testing.assert_array_equal(action, policy.action[states])
    with pytest.raises(UserError, match="of a mask, "):
        learner.greedy_in(small[0].model.starts)


def test_learnt_terminations_come_as_a_table(small: tuple[GroundGraph, Path]) -> None:
    """None where the graph gives them; else the running option goes on unless its task is likely to end."""
    grounded, _ = small
    assert OptionCritic(grounded, 0, SMALL).terminations() is None
    learner = OptionCritic(grounded, 0, replace(SMALL, terminations="learnt"))
    learnt(learner, 2)
    table, policy = learner.terminations(), learner.greedy()
    assert table is not None
    assert table.shape == learner.options.ended.transpose(0, 2, 1).shape
    choosable = learner.options.initiation[:, 0].any(axis=1)
    ends = table[:, :, 0] > 0.5
    chosen = np.broadcast_to(policy.option[:, -1:], ends.shape)
    goes_on = np.broadcast_to(np.arange(len(learner.options)), ends.shape)
    wanted = np.where(ends & choosable[:, None], chosen, goes_on)
    np.testing.assert_array_equal(policy.option[:, :-1], wanted)
    assert 0 < ends.mean() < 1


@pytest.mark.parametrize(
    ("name", "array", "problem"),
    [
        ("updates", None, "there is none"),
        ("updates", np.array(0), "0 is none of 1 to"),
        ("updates", np.array(1.0), "float64, not"),
        ("more", np.zeros(1), "there should be none"),
        ("env.state", np.zeros(3, np.int64), r"shape \(3,\) and type int64, not \(16,\)"),
        ("env.state", np.full(16, 10**6), "1000000 is none of 0 to"),
        ("env.running", np.full(16, 4), "4 is none of -1 to 3"),
        ("env.steps", np.full(16, 20), "20 is none of 0 to 19"),
        ("adam.0.step", None, "there is none"),
        ("adam.999.step", np.zeros((), np.float32), "there should be none"),
        ("adam.x.step", np.zeros((), np.float32), "there should be none"),
    ],
)
def test_foreign_arrays_are_refused(
    small: tuple[GroundGraph, Path], name: str, array: NDArray[np.generic] | None, problem: str
) -> None:
    """Missing, too many, of another shape or type, or places that there are not."""
    learner = OptionCritic(small[0], 0, SMALL)
    learnt(learner, 1)
    state = {**learner.state(), name: array}
    with pytest.raises(UserError, match=f"array '{name}': .*{problem}"):
        learner.restore({key: value for key, value in state.items() if value is not None})


def test_a_learner_is_loaded_with_its_graph_and_world(
    small: tuple[GroundGraph, Path], tmp_path: Path
) -> None:
    """The checkpoint alone gives back a learner that does the same; a changed maze is noticed."""
    _, maze = small
    graph, world = load_graph("two_rooms", load_world(str(maze)))
    grounded = checked(graph, world.model())
    learner = OptionCritic(grounded, 0, SMALL)
    learnt(learner)
    path = tmp_path / "c.safetensors"
    config = {name: getattr(SMALL, name) for name in SMALL.__dataclass_fields__}
    about = Checkpoint(
        "option-critic", graph_text(graph, world), world.name, 0, config, digest(grounded), learner.steps
    )
    save_checkpoint(path, about, learner.state())
    loaded = load_option_critic(path)
    assert same(loaded.state(), learner.state())
    for table in ("option", "action"):
        np.testing.assert_array_equal(getattr(loaded.greedy(), table), getattr(learner.greedy(), table))
    for wrong, problem in (
        (replace(about, learner="maxq-0"), "of the learner 'maxq-0'"),
        (replace(about, config={**config, "gamma": 7.0}), "its config is wrong .gamma: 7.0"),
        (replace(about, config={**config, "mood": 1}), "its config is wrong"),
        (replace(about, config={**config, "hidden": 9}), "array 'adam.0.exp_avg': it has shape"),
        (replace(about, world="two_rooms"), "no longer what was learnt on"),
        (replace(about, world="nowhere"), "no world 'nowhere'"),
        (replace(about, graph="graph: x"), "c.safetensors: its task graph, line 1"),
    ):
        save_checkpoint(path, wrong, learner.state())
        with pytest.raises(UserError, match=problem):
            load_option_critic(path)


def test_a_start_with_nothing_to_call_is_refused(small: tuple[GroundGraph, Path]) -> None:
    """On the trigger with doors closed the paper's root has no child: the message names such a state."""
    grounded, _ = small
    idle = np.ones(grounded.model.index.size, dtype=np.bool_)
    idle &= ~np.any([call.available for call in grounded.nodes[grounded.root].calls], axis=0)
    idle &= ~grounded.nodes[grounded.root].terminal
    starts = grounded.model.starts.copy()
    starts[np.flatnonzero(idle)[0]] = True
    with pytest.raises(UserError, match=r"1 of \d+ starts leave the root nothing to call.*robot = "):
        OptionCritic(grounded, 0, SMALL, starts=starts)


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
@pytest.mark.parametrize("terminations", ["given", "prior"])
def test_a_gpu_learns_and_goes_on(small: tuple[GroundGraph, Path], terminations: str) -> None:
    """Networks, tables and steps live there; a run that was broken off goes on there from its arrays."""
    grounded, _ = small
    config = replace(SMALL, terminations=terminations)
    whole, broken = (OptionCritic(grounded, 4, config, device="cuda") for _ in range(2))
    assert {part.device.type for part in (*whole.loss.parameters(), *whole.stack.tables.buffers())} == {
        "cuda"
    }
    learnt(whole)
    learnt(broken, updates=2)
    again = OptionCritic(grounded, 4, config, device="cuda")
    again.restore(broken.state())
    learnt(again)
    assert again.steps == whole.steps
    assert again.greedy().option.shape == whole.greedy().option.shape
    assert all(np.isfinite(array).all() for array in again.state().values())
