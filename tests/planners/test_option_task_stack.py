import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from option_runs import NAMES, allowed, choices, left_of, named, sound_graphs
from tensordict import TensorDict, TensorDictBase
from torchrl.envs import TransformedEnv
from torchrl.envs.utils import check_env_specs

from hierarchy import GroundGraph
from planners.option_critic.choosing import any_of, first_ended, of_option
from planners.option_critic.options import NONE, Options, compile_options
from planners.option_critic.transform import TaskStack
from worlds.model_env import ModelTorchEnv
from worlds.torch_stream import generator


def _env(options: Options, number: int, seed: int, max_steps: int = 12) -> TransformedEnv:
    grounded = options.grounded
    starts = grounded.model.starts & ~grounded.nodes[grounded.root].terminal
    over = grounded.nodes[grounded.root].terminal
    world = ModelTorchEnv(grounded.model, over, number, starts=starts, max_steps=max_steps)
    env = TransformedEnv(world, TaskStack(options))
    env.set_seed(seed)
    return env


class _Wanders:
    """Ends what has ended, and chooses any option and any action that it may."""

    def __init__(self, seed: int) -> None:
        self.draw = generator(seed)

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        running = tensordict["running"]
        switch, level = first_ended(tensordict["ended"])
        chosen = any_of(of_option(tensordict["initiation"], level), self._uniform(running))
        option = torch.where(switch, chosen, running)
        action = any_of(of_option(tensordict["option_action_mask"], option), self._uniform(running))
        return tensordict.update({"option": option, "action": action})

    def _uniform(self, like: torch.Tensor) -> torch.Tensor:
        return torch.rand(like.shape, generator=self.draw)


def _as_in_the_slow_run(options: Options, steps: TensorDictBase) -> None:
    """Go along one environment's steps with a stack of calls that is kept one state at a time."""
    grounded, model = options.grounded, options.grounded.model
    paths = [tuple(edge.child for edge in stack) for stack in options.stacks]
    fresh, running = True, NONE
    for step in steps:
        state, option, action = (int(step[key]) for key in ("state", "option", "action"))
        if fresh:
            assert model.starts[state]
            running = NONE
        assert int(step["running"]) == running
        left = () if fresh else left_of(grounded, paths[running], state)
        caller = (grounded.root, *left)[-1]
        if fresh or left != paths[running]:
            ways = {(*left, *way) for way in choices(grounded, caller, state)}
            mask = step["initiation"][len(left)].tolist()
            assert {path for path, may in zip(paths, mask, strict=True) if may} == ways
            assert paths[option] in ways
        else:
            assert option == running
            assert not step["ended"].any()
        may = allowed(grounded, paths[option], state)
        assert set(np.flatnonzero(step["option_action_mask"][option].numpy()).tolist()) == may
        after = int(step["next", "state"])
        assert (model.outcomes[state, action] == after).any()
        assert int(step["next", "running"]) == option
        ended = step["next", "ended"].tolist()
        kept = len(left_of(grounded, paths[option], after))
        assert (ended.index(True) if any(ended) else len(paths[option])) == kept
        if options.pseudo_reward.any():
            top = grounded.nodes[paths[option][-1]]
            short = top.terminal[after] and not top.goal[after]
            assert float(step["next", "pseudo_reward"]) == (top.pseudo_reward if short else 0)
        fresh, running = bool(step["next", "done"]), option
    assert len(steps) > 0


@pytest.mark.parametrize("name", NAMES)
def test_task_stacks_are_those_of_call_and_return(name: str) -> None:
    """Five environments that end and begin anew, on the graphs that come with the project."""
    options = compile_options(named(name))
    steps = _env(options, 5, 3).rollout(60, _Wanders(4), break_when_any_done=False)
    assert steps["next", "done"].sum() >= 5
    for one in steps:
        _as_in_the_slow_run(options, one)


@settings(max_examples=10, deadline=None)
@given(sound_graphs(), st.integers(0, 99))
def test_task_stacks_of_random_graphs(grounded: GroundGraph, seed: int) -> None:
    """The same on random graphs of up to five levels, where callers may end before what they called."""
    options = compile_options(grounded)
    for one in _env(options, 3, seed).rollout(30, _Wanders(seed), break_when_any_done=False):
        _as_in_the_slow_run(options, one)


@pytest.mark.parametrize("name", ["taxi", "slippery hdg"])
def test_specs_hold(name: str) -> None:
    """TorchRL's own check of an environment passes with the transform on it; its actions have no option."""
    env = _env(compile_options(named(name)), 3, 0)
    check_env_specs(env)
    assert (env.rollout(3)["next", "running"] == NONE).all()


def test_a_run_that_is_taken_up_goes_on() -> None:
    """Options that are to be found running are, at the first reset only."""
    env = _env(compile_options(named("taxi")), 2, 0)
    env.transform.resume(torch.tensor([3, NONE]))
    assert env.reset()["running"].tolist() == [3, NONE]
    assert env.reset()["running"].tolist() == [NONE, NONE]


def test_only_what_is_reset_begins_anew() -> None:
    """The others keep the option that runs."""
    env = _env(compile_options(named("taxi")), 3, 0)
    last = env.rollout(2, _Wanders(1))[:, -1]["next"]
    before = last["running"].tolist()
    found = env.reset(last.clone().set("_reset", torch.tensor([[False], [True], [False]])))
    assert min(before) >= 0
    assert found["running"].tolist() == [before[0], NONE, before[2]]
    assert torch.equal(env.transform.running, found["running"])
    assert found["ended"][1].all()
    assert torch.equal(found["initiation"][0], last["initiation"][0])


class _Each:
    """Ends what has ended, and chooses by an environment's number and step alone."""

    def __init__(self, number: int) -> None:
        self.taken = torch.zeros(number, dtype=torch.int64)

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        running = tensordict["running"]
        draw = (self.taken * 0.37 + torch.arange(len(running)) * 0.21) % 1
        switch, level = first_ended(tensordict["ended"])
        chosen = any_of(of_option(tensordict["initiation"], level), draw)
        option = torch.where(switch, chosen, running)
        action = any_of(of_option(tensordict["option_action_mask"], option), draw)
        return tensordict.update({"option": option, "action": action})


@pytest.mark.parametrize("column", [False, True])
def test_those_that_do_not_step_keep_their_option_and_tables(column: bool) -> None:
    """With `_step`, each environment goes the way that it goes when all step, only later."""
    number, steps = 4, 40
    keys = ("state", "running", "initiation", "ended", "option_action_mask")
    ways = []
    for draw in (None, generator(5)):
        env, policy = _env(compile_options(named("taxi")), number, 2, max_steps=1000), _Each(number)
        data, seen = env.reset(), [[] for _ in range(number)]
        while min(policy.taken.tolist()) < steps:
            moving = torch.ones(number, dtype=torch.bool)
            if draw is not None:
                moving = torch.rand(number, generator=draw) < torch.tensor([0.1, 0.5, 0.9, 1.0])
            before = data.select(*keys).clone()
            data = policy(data)
            for i in moving.nonzero()[:, 0].tolist():
                seen[i].append((*before[i]["state"].view(1).tolist(), int(data["option"][i])))
            if draw is not None:
                data["_step"] = moving[:, None] if column else moving
            data = env.step(data)["next"].exclude("reward").clone()
            policy.taken += moving
            for key in keys:
                assert torch.equal(data[key][~moving], before[key][~moving])
            assert torch.equal(env.transform.running, data["running"])
        ways.append([way[:steps] for way in seen])
    assert ways[0] == ways[1]
    assert len({option for way in ways[0] for _, option in way}) >= 4


def test_a_rollout_until_all_are_done_leaves_those_that_are_as_they_ended() -> None:
    """TorchRL's own use of `_step`: the last of each environment's steps stays, running option and all."""
    env = _env(compile_options(named("two_rooms")), 6, 1, max_steps=150)
    steps = env.rollout(150, _Wanders(2), break_when_any_done=False, break_when_all_done=True)
    lengths = (~steps["next", "done"][..., 0]).sum(1).tolist()
    assert len(set(lengths)) > 1
    assert isinstance(steps, TensorDict)
    for one, length in zip(steps, lengths, strict=True):
        _as_in_the_slow_run(env.transform.options, one[: length + 1])
        last = one["next", "running"][length]
        assert (one["next", "running"][length:] == last).all()
        assert int(last) == int(one["option"][length])
    assert torch.equal(env.transform.running, steps["next", "running"][:, -1])
