from typing import Any

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from option_runs import allowed, choices, left_of, named
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule
from torchrl.envs import TransformedEnv
from torchrl.envs.utils import ExplorationType, set_exploration_type

from planners.option_critic.networks import Actor, Critic, columns_of
from planners.option_critic.options import NONE, compile_options
from planners.option_critic.policy import OptionPolicy
from planners.option_critic.transform import TaskStack
from worlds.model_env import ModelTorchEnv
from worlds.torch_stream import generator

OPTIONS, LEVELS, ACTIONS = 4, 2, 3
_SIZES = (OPTIONS, OPTIONS * ACTIONS, OPTIONS * LEVELS)


def _part(which: int, *shape: int) -> Any:
    """Return a network that reads its output off the observation, so that a test may say what it is."""
    return lambda seen: seen.split(_SIZES, -1)[which].unflatten(-1, shape)


def _policy(*, learnt: bool = False, seed: int = 0, **settings: Any) -> OptionPolicy:
    parts = [
        ("option_value", _part(0, OPTIONS)),
        ("option_logits", _part(1, OPTIONS, ACTIONS)),
        ("termination_logits", _part(2, OPTIONS, LEVELS)),
    ]
    critic, actor, ending = (TensorDictModule(part, ["observation"], [name]) for name, part in parts)
    return OptionPolicy(actor, critic, ending if learnt else None, draw=generator(seed), **settings)


def _found(rows: int, seed: int = 0, share: float = 0.5) -> TensorDictBase:
    """Return what an environment might say; something may be chosen at every level."""
    draw = generator(seed, 1)
    initiation = torch.rand(rows, LEVELS, OPTIONS, generator=draw) < share
    mask = torch.rand(rows, OPTIONS, ACTIONS, generator=draw) < share
    for one in (initiation, mask):
        some = torch.randint(one.shape[-1], one.shape[:-1], generator=draw)
        one.scatter_(-1, some[..., None], True)
    running = torch.randint(NONE, OPTIONS, (rows,), generator=draw)
    ended = (torch.rand(rows, LEVELS, generator=draw) < share) | (running == NONE)[:, None]
    return TensorDict(
        {
            "observation": 2 * torch.randn(rows, sum(_SIZES), generator=draw),
            "running": running,
            "initiation": initiation,
            "ended": ended,
            "option_action_mask": mask,
        },
        [rows],
    )


def _acts(policy: OptionPolicy, found: TensorDictBase, kind: ExplorationType) -> TensorDictBase:
    with set_exploration_type(kind), torch.no_grad():
        return policy(found.clone())


RANDOM, GREEDY = ExplorationType.RANDOM, ExplorationType.DETERMINISTIC


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 10**6),
    st.booleans(),
    st.sampled_from([0.0, 0.5, 1.0]),
    st.sampled_from([RANDOM, GREEDY, ExplorationType.MODE]),
)
def test_only_what_may_be_done_is_done(
    seed: int, learnt: bool, epsilon: float, kind: ExplorationType
) -> None:
    """What is chosen may be where control came back; what runs else goes on; actions may be taken."""
    found = _found(16, seed)
    for row in _acts(_policy(learnt=learnt, seed=seed, epsilon=epsilon), found, kind):
        option, running, ended = int(row["option"]), int(row["running"]), row["ended"].tolist()
        assert row["option_action_mask"][option, row["action"]]
        if not row["switch"]:
            assert option == running
        elif running == NONE or not learnt:
            assert row["initiation"][ended.index(True), option]
        else:
            assert row["initiation"][:, option].any()
        if not learnt or running == NONE:
            assert bool(row["switch"]) == any(ended)


def test_the_greedy_choice_is_the_best() -> None:
    """The best option that may be chosen and its likeliest permitted action, with its log-probability."""
    for row in _acts(_policy(epsilon=1.0), _found(40), GREEDY):
        values, logits, _ = row["observation"].split(_SIZES)
        if row["switch"]:
            may = row["initiation"][row["ended"].tolist().index(True)]
            assert row["option"] == values.where(may, torch.tensor(-99.0)).argmax()
        may = row["option_action_mask"][row["option"]]
        chances = logits.view(OPTIONS, ACTIONS)[row["option"]].exp() * may
        assert row["action"] == chances.argmax()
        assert row["action_log_prob"].exp().item() == pytest.approx(float(chances.max() / chances.sum()))


def test_learnt_terminations_end_what_is_likelier_than_not() -> None:
    """Greedily; at random each ends as often as it says; at the start of an episode all has ended."""
    found = _found(4000)
    found["running"].fill_(1)
    found["ended"].fill_(False)
    found["initiation"].fill_(True)
    row = torch.randn(sum(_SIZES), generator=generator(3))
    logits = row[-OPTIONS * LEVELS :].view(OPTIONS, LEVELS)
    for first, second in ((1.0, -3.0), (-1.0, -0.5), (-1.0, 2.0)):
        logits[1] = torch.tensor([first, second])
        found["observation"][:] = row
        assert _acts(_policy(learnt=True), found, GREEDY)["switch"].all() == (max(first, second) > 0)
        ends = _acts(_policy(learnt=True), found, RANDOM)["switch"].float().mean().item()
        stays = (1 - logits[1].sigmoid()).prod().item()
        assert ends == pytest.approx(1 - stays, abs=0.03)  # three deviations are 0.024
    found["running"].fill_(NONE)
    found["ended"].fill_(True)
    assert _acts(_policy(learnt=True), found, GREEDY)["switch"].all()


def test_what_ends_above_decides() -> None:
    """With both levels ended by what is learnt, the outer one's options may be chosen."""
    found = _found(1)
    found["running"].fill_(1)
    found["observation"].fill_(5.0)
    found["initiation"][0] = torch.tensor([[False, False, True, False], [True, True, False, False]])
    assert _acts(_policy(learnt=True), found, GREEDY)["option"].tolist() == [2]


def test_with_nothing_to_choose_what_runs_goes_on() -> None:
    """Though it has ended; and it takes any action, where it may take none."""
    found = _found(50)
    found["running"].fill_(2)
    found["ended"].fill_(True)
    found["initiation"].fill_(False)
    found["option_action_mask"].fill_(False)
    for kind in (RANDOM, GREEDY):
        done = _acts(_policy(epsilon=1.0), found, kind)
        assert (done["option"] == 2).all()
        assert not done["switch"].any()
    assert set(_acts(_policy(), found, RANDOM)["action"].tolist()) == set(range(ACTIONS))


@pytest.mark.parametrize("epsilon", [0.0, 0.4, 1.0])
def test_epsilon_is_the_share_of_random_options(epsilon: float) -> None:
    """Each of those that may be chosen as often, the best one besides; only when drawn."""
    found = _found(6000)
    found["ended"].fill_(True)
    found["initiation"][:] = torch.tensor([True, True, False, True])
    found["observation"][:, :OPTIONS] = torch.tensor([1.0, 2.0, 9.0, 0.0])
    counts = torch.bincount(_acts(_policy(epsilon=epsilon), found, RANDOM)["option"], minlength=4) / 6000
    wanted = [epsilon / 3, 1 - epsilon + epsilon / 3, 0.0, epsilon / 3]
    assert counts.tolist() == pytest.approx(wanted, abs=0.02)  # three deviations
    assert (_acts(_policy(epsilon=epsilon), found, GREEDY)["option"] == 1).all()


def test_actions_are_drawn_as_often_as_they_are_likely() -> None:
    """From the softmax of the running option's logits, over what it may do."""
    found = _found(6000)
    found["running"].fill_(3)
    found["ended"].fill_(False)
    found["option_action_mask"][:, 3] = torch.tensor([True, True, False])
    found["observation"][:] = 0.0
    found["observation"][:, OPTIONS + 3 * ACTIONS] = 1.0
    done = _acts(_policy(), found, RANDOM)
    counts = torch.bincount(done["action"], minlength=3) / 6000
    odds = torch.tensor([torch.e, 1.0, 0.0])
    assert counts.tolist() == pytest.approx((odds / odds.sum()).tolist(), abs=0.02)  # three deviations
    wanted = (odds / odds.sum()).log()[done["action"]]
    assert torch.allclose(done["action_log_prob"], wanted, atol=1e-5)


@pytest.mark.parametrize("learnt", [False, True])
def test_chance_comes_from_its_generator_alone(learnt: bool) -> None:
    """The same generator gives the same draws, another gives others, and torch's own is left alone."""
    found, before = _found(64), torch.get_rng_state()
    one, again, other = (
        _acts(_policy(learnt=learnt, seed=seed, epsilon=0.5), found, RANDOM) for seed in (1, 1, 2)
    )
    assert (one == again).all()
    assert not torch.equal(one["action"], other["action"])
    assert torch.equal(torch.get_rng_state(), before)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_greedy_choices_are_the_same_in_any_batch(seed: int, learnt: bool) -> None:
    """Row by row, in one batch, and in a batch of two dimensions."""
    found, policy = _found(6, seed), _policy(learnt=learnt)
    whole = _acts(policy, found, GREEDY)
    square = _acts(policy, found.view(2, 3), GREEDY)
    for key in policy.out_keys:
        alone = torch.cat([_acts(policy, found[i : i + 1], GREEDY)[key] for i in range(6)])
        assert torch.equal(alone, whole[key])
        assert torch.equal(square[key].flatten(), whole[key])


@pytest.mark.parametrize("name", ["two_rooms", "taxi", "slippery hdg"])
def test_in_a_world_it_keeps_to_the_graph(name: str) -> None:
    """Runs with networks that know nothing go by call and return, as a scalar run of the stack has it."""
    options = compile_options(named(name))
    grounded = options.grounded
    over = grounded.nodes[grounded.root].terminal
    world = ModelTorchEnv(grounded.model, over, 4, starts=grounded.model.starts & ~over, max_steps=30)
    env = TransformedEnv(world, TaskStack(options))
    env.set_seed(0)
    draw = generator(0)
    sees = columns_of(world.encoding, options.task_uses, abstracted=True)
    actor = TensorDictModule(Actor(options, sees, 4, draw), ["observation"], ["option_logits"])
    sees = columns_of(world.encoding, [part.uses for part in options.parts], abstracted=True)
    critic = TensorDictModule(Critic(options, sees, 4, 1.0, draw), ["observation"], ["option_value"])
    policy = OptionPolicy(actor, critic, epsilon=0.5, draw=draw)
    with set_exploration_type(RANDOM), torch.no_grad():
        steps = env.rollout(80, policy, break_when_any_done=False)
    paths = [tuple(edge.child for edge in stack) for stack in options.stacks]
    switches = 0
    for step in steps.flatten():
        state, running, option = (int(step[key]) for key in ("state", "running", "option"))
        left = () if running == NONE else left_of(grounded, paths[running], state)
        if running == NONE or left != paths[running]:
            caller = (grounded.root, *left)[-1]
            assert paths[option] in {(*left, *way) for way in choices(grounded, caller, state)}
            switches += 1
        else:
            assert option == running
        assert int(step["action"]) in allowed(grounded, paths[option], state)
    assert 0 < switches < steps.numel()
