"""Flat PPO and flat DQN: tables, targets and seeds."""

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from hierarchy import GroundGraph, ground, two_rooms
from planners import flat_optimum
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.flat_baselines import Flat, FlatDQN, FlatPPO
from worlds import maze_model, parse_layout

SMALL = OptionCriticConfig(num_envs=8, horizon=16, minibatch=64, total=512, anneal=512)
KINDS = pytest.mark.parametrize("kind", [FlatPPO, FlatDQN])


@pytest.fixture(scope="module")
def grounded() -> GroundGraph:
    """Return the paper's graph on a maze of eight cells."""
    rows = "grid", ". . : D1 G1", "T1 . | . .", "start 0,0", "trigger T1", "goal G1"
    maze = parse_layout("\n".join(rows))
    return ground(two_rooms(maze), maze_model(maze))


def parameters(learner: Flat) -> list[torch.Tensor]:
    """Return what has been learnt."""
    return [value.detach().clone() for value in learner.loss.state_dict().values()]


@KINDS
def test_seeds_name_runs(kind: type[Flat], grounded: GroundGraph) -> None:
    """The same seed gives the same bits whatever torch's own generator does; another seed gives others."""
    found = []
    for seed, other in ((1, 10), (1, 11), (2, 10)):
        torch.manual_seed(other)
        learner = kind(grounded, seed, SMALL)
        assert [progress.steps for progress in learner.learn()] == [128, 256, 384, 512]
        found.append(parameters(learner))
    assert all(map(torch.equal, found[0], found[1]))
    assert not all(map(torch.equal, found[0], found[2]))


@KINDS
def test_torchs_own_generator_is_left_alone(kind: type[Flat], grounded: GroundGraph) -> None:
    """Learning draws nothing from it that the caller could miss."""
    before = torch.get_rng_state()
    for _ in kind(grounded, 1, SMALL).learn():
        assert torch.equal(torch.get_rng_state(), before)


@KINDS
def test_tables_hold_the_best_action(kind: type[Flat], grounded: GroundGraph) -> None:
    """With East preferred by bias alone every state's option is East, which moves east."""
    learner = kind(grounded, 1, SMALL)
    network = learner.actor if isinstance(learner, FlatPPO) else learner.values  # type: ignore[attr-defined]
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
        network.networks.biases[2][0, 0, grounded.model.actions.index("East")] = 1.0
    policy = learner.greedy()
    assert {policy.options.names[option] for option in np.unique(policy.option)} == {"East"}
    state = int(np.flatnonzero(grounded.model.starts)[0])
    assert not np.isfinite(policy.returns(np.array([state]))).any()  # the trigger lies south
    assert policy.action[state, policy.option[state, -1]] == grounded.model.actions.index("East")


def test_the_target_of_dqn_ends_with_the_episode(grounded: GroundGraph) -> None:
    """With Q = -10 everywhere the error is |-1 - 9.8 + 10| = 0.8 on the way, and |-1 + 10| = 9 at the end."""
    learner = FlatDQN(grounded, 1, SMALL)
    with torch.no_grad():
        for parameter in learner.values.parameters():
            parameter.zero_()
        learner.values.networks.biases[2].fill_(-10 / learner.values.scale)
    for value in learner.loss.target_value_network_params.flatten_keys().values():
        value.zero_()
    learner.loss.target_value_network_params["module", "0", "module", "networks", "biases", "2"].fill_(
        -10 / learner.values.scale
    )
    seen = learner.world.encoding(torch.tensor([0]))
    for over, error in ((False, 0.5 * 0.8**2), (True, 9 - 0.5)):
        flag = torch.tensor([[over]])
        after = {"observation": seen, "reward": torch.tensor([[-1.0]]), "done": flag, "terminated": flag}
        row = TensorDict({"observation": seen, "action": torch.tensor([2]), "next": after}, [1])
        assert float(learner.loss(row)["loss"].detach()) == pytest.approx(error, rel=1e-4)


def test_entropy_and_exploration_fall(grounded: GroundGraph) -> None:
    """PPO's entropy weight falls to 0 over the annealing, DQN's epsilon from 1 to 0.05."""
    ppo, dqn = FlatPPO(grounded, 1, SMALL), FlatDQN(grounded, 1, SMALL)
    weights = [float(ppo.loss.entropy_coeff) for _ in ppo.learn()]
    np.testing.assert_allclose(weights, [0.1, 0.075, 0.05, 0.025], rtol=1e-5)
    shares = [float(dqn.explorer.eps) for _ in dqn.learn()]
    np.testing.assert_allclose(shares, [1.0, 0.75, 0.5, 0.25])
    dqn._anneal(0.0)
    assert float(dqn.explorer.eps) == pytest.approx(0.05)


def test_episodes_begin_where_they_are_told_to(grounded: GroundGraph) -> None:
    """With one start given, every episode begins there."""
    starts = np.zeros(grounded.model.index.size, dtype=np.bool_)
    starts[np.flatnonzero(grounded.model.starts)[1]] = True
    learner = FlatPPO(grounded, 1, SMALL, starts=starts)
    assert set(learner.world.reset()["state"].tolist()) == set(np.flatnonzero(starts).tolist())


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "total"), [(FlatPPO, 40_000), (FlatDQN, 40_000)])
def test_a_small_maze_is_learnt_to_the_optimum(kind: type[Flat], total: int, grounded: GroundGraph) -> None:
    """From every start the greedy return is the best."""
    config = OptionCriticConfig(num_envs=32, horizon=32, total=total, anneal=total)
    learner = kind(grounded, 1, config)
    for _ in learner.learn():
        pass
    starts = np.flatnonzero(grounded.model.starts)
    best = flat_optimum(grounded.model, grounded.nodes[grounded.root].terminal).value
    np.testing.assert_allclose(learner.greedy().returns(starts), best[starts])
