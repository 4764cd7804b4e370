"""Finite worlds as TorchRL environments: the contract, and every episode beside a readable reference."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor
from torchrl.envs import check_env_specs

from worlds import (
    StateIndex,
    Stream,
    TransitionModel,
    UserError,
    Variable,
    load_layout,
    maze_model,
    model_env,
)
from worlds.four_rooms import FIRST_GOAL, four_rooms_model, starts_for
from worlds.model_env import ModelTorchEnv
from worlds.taxi import taxi_model
from worlds.torch_stream import fractions, generator

_SURE = maze_model(load_layout("two_rooms"))
_CHANCY = taxi_model(rain=0.2, fickle=0.3)


@pytest.fixture(autouse=True)
def _same_draws() -> Iterator[None]:
    """Let random policies draw the same in each run of a test, and leave no trace of it."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        yield


def _in_turn(state: Tensor) -> Tensor:
    """Return an action for every environment, another in another state."""
    return (state * 7 + torch.arange(len(state))) % len(_CHANCY.actions)


def _delivered(model: TransitionModel) -> NDArray[np.bool_]:
    there: NDArray[np.bool_] = model.index.column("passenger") == 5
    return there


def _never(model: TransitionModel) -> NDArray[np.bool_]:
    return np.zeros(model.index.size, dtype=np.bool_)


@dataclass
class _One:
    """One environment as its documentation tells it: slow, and for reading."""

    model: TransitionModel
    terminal: NDArray[np.bool_]
    seed: int
    number: int
    max_steps: int
    episode: int = -1
    state: int = 0
    steps: int = 0
    draws: Stream = field(default_factory=Stream)

    def reset(self) -> int:
        """Begin the next episode: draw 1 of its stream is the start."""
        self.episode += 1
        self.draws = Stream(self.seed, self.number, self.episode)
        self.state = self.draws.choose(np.flatnonzero(self.model.starts).tolist())
        self.steps = 0
        return self.state

    def step(self, action: int) -> tuple[int, float, bool, bool]:
        """Return next state, reward, and whether the episode is over or cut off: draw 1 + t is step t's."""
        chances = self.model.probabilities[self.state, action]
        drawn, below = self.draws.uniform(), 0.0
        for which in np.flatnonzero(chances > 0):
            below += chances[which]
            if drawn < below:
                break
        reward = self.model.outcome_rewards[self.state, action, which]
        self.state = int(self.model.outcomes[self.state, action, which])
        self.steps += 1
        over = bool(self.terminal[self.state])
        return self.state, float(reward), over, self.steps >= self.max_steps and not over


@st.composite
def _worlds(draw: st.DrawFn) -> tuple[TransitionModel, NDArray[np.bool_]]:
    """Draw a world with one to four outcomes, some of which never occur, and where episodes end."""
    sizes = draw(st.lists(st.integers(1, 3), min_size=1, max_size=2))
    index = StateIndex(tuple(Variable(f"v{i}", tuple(range(size))) for i, size in enumerate(sizes)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = (index.size, draw(st.integers(1, 3)), draw(st.integers(1, 4)))
    weights = rng.integers(0, 4, shape).astype(float)
    weights[..., 0] += weights.sum(axis=2) == 0
    terminal = rng.random(index.size) < 0.3
    terminal[rng.integers(index.size)] = False
    starts = ~terminal & (rng.random(index.size) < 0.6)
    starts |= ~terminal & ~starts.any()
    model = TransitionModel(
        index,
        tuple(f"a{i}" for i in range(shape[1])),
        rng.integers(0, index.size, shape),
        rng.integers(-5, 5, shape) / 2,  # such numbers are the same in 32 bits
        starts,
        probabilities=weights / weights.sum(axis=2, keepdims=True),
    )
    return model, terminal


def _act(env: ModelTorchEnv, data: TensorDictBase, actions: Any) -> tuple[TensorDictBase, TensorDictBase]:
    """Step by actions; return what happened, and where episodes that are over have begun anew."""
    data["action"] = torch.as_tensor(actions)
    happened, after = env.step_and_maybe_reset(data)
    return happened["next"].clone(), after


def _rows(happened: TensorDictBase) -> list[tuple[Any, ...]]:
    keys = ("reward", "terminated", "truncated")
    columns = [happened["state"].tolist(), *(happened[key][:, 0].tolist() for key in keys)]
    return list(zip(*columns, strict=True))


@pytest.mark.parametrize("number", [1, 3, 64])
@pytest.mark.parametrize("max_steps", [2, 200])
def test_torchrl_s_checker_has_no_complaint(number: int, max_steps: int) -> None:
    """check_env_specs passes on worlds with chance and without, also where every second step ends."""
    for model, terminal in ((_SURE, _never(_SURE)), (_CHANCY, _delivered(_CHANCY))):
        env = ModelTorchEnv(model, terminal, number, max_steps=max_steps)
        env.set_seed(3)
        check_env_specs(env, break_when_any_done="both")


@settings(max_examples=40, deadline=None)
@given(
    world=_worlds(), seed=st.integers(0, 2**63), number=st.sampled_from([1, 3, 64]), most=st.integers(1, 9)
)
def test_every_episode_is_the_reference_s(
    world: tuple[TransitionModel, NDArray[np.bool_]], seed: int, number: int, most: int
) -> None:
    """In any world: starts, next states, rewards, ends, and the episodes that follow, number by number."""
    model, terminal = world
    env = ModelTorchEnv(model, terminal, number, max_steps=most)
    env.set_seed(seed)
    ones = [_One(model, terminal, seed, i, most) for i in range(number)]
    data = env.reset()
    assert data["state"].tolist() == [one.reset() for one in ones]
    for actions in np.random.default_rng(0).integers(0, len(model.actions), (20, number)):
        happened, data = _act(env, data, actions)
        expected = [one.step(int(action)) for one, action in zip(ones, actions, strict=True)]
        assert _rows(happened) == expected
        now = [
            one.reset() if over or cut else state
            for one, (state, _, over, cut) in zip(ones, expected, strict=True)
        ]
        assert data["state"].tolist() == now
        assert data["observation"].equal(env.encoding(torch.tensor(now)))


@pytest.mark.parametrize("number", [1, 3, 64])
def test_a_rollout_is_what_its_smaller_batches_give(number: int) -> None:
    """TorchRL's rollout of `number` environments holds those of fewer, whatever the batch size."""
    runs = []
    for count in (number, 80):
        env = ModelTorchEnv(_CHANCY, _delivered(_CHANCY), count, max_steps=9)
        env.set_seed(5)
        policy = TensorDictModule(_in_turn, ["state"], ["action"])
        runs.append(env.rollout(40, policy, break_when_any_done=False))
    assert runs[0].batch_size == (number, 40)
    for key in ("state", "observation", ("next", "state"), ("next", "reward"), ("next", "done")):
        assert runs[0][key].equal(runs[1][key][:number])
    assert runs[0]["next", "truncated"][:, 8::9].any()


def test_starts_that_are_given_come_in_place_of_the_model_s() -> None:
    """Episodes begin there alone, each place as often."""
    model = four_rooms_model()
    starts = starts_for(model.index, FIRST_GOAL)
    env = ModelTorchEnv(model, _never(model), 4000, starts=starts)
    env.set_seed(0)
    counts = np.bincount(env.reset()["state"].numpy(), minlength=model.index.size)
    assert (counts[~starts] == 0).all()
    assert abs(counts[starts] - 4000 / 103).max() < 5 * (4000 / 103) ** 0.5


def test_outcomes_come_as_often_as_they_should() -> None:
    """Of 20,000 draws of one action each outcome takes its share, give or take five deviations."""
    index, shares = StateIndex((Variable("x", (0, 1, 2, 3)),)), np.array([0.1, 0.0, 0.6, 0.3])
    model = TransitionModel(
        index,
        ("go",),
        np.broadcast_to(np.arange(4), (4, 1, 4)),
        np.zeros((4, 1, 4)),
        np.ones(4, dtype=np.bool_),
        probabilities=np.broadcast_to(shares, (4, 1, 4)),
    )
    env = ModelTorchEnv(model, _never(model), 20_000)
    env.set_seed(11)
    data = env.reset()
    for _ in range(3):
        happened, data = _act(env, data, torch.zeros(20_000, dtype=torch.int64))
        found = np.bincount(happened["state"].numpy(), minlength=4)
        assert (abs(found - 20_000 * shares) <= 5 * np.sqrt(20_000 * shares * (1 - shares))).all()


@pytest.mark.parametrize(
    ("drawn", "expected"),
    [(0, 1), (int(0.1 * 2**53), 1), (int(0.1 * 2**53) + 1, 2), ((1 << 53) - 1, 10)],
)
def test_rounding_leads_to_no_outcome_that_never_occurs(
    monkeypatch: pytest.MonkeyPatch, drawn: int, expected: int
) -> None:
    """Ten tenths sum to less than 1: the highest draw is the last outcome that occurs, not one after it.

    And 0.1 * 2**53 is no whole number: the draw just below it is still the first outcome.
    """
    chances = np.array([0.0, *[0.1] * 10, 0.0])
    assert np.cumsum(chances)[-1] < 1
    index, shape = StateIndex((Variable("x", tuple(range(12))),)), (12, 1, 12)
    model = TransitionModel(
        index,
        ("go",),
        np.broadcast_to(np.arange(12), shape),
        np.zeros(shape),
        np.ones(12, dtype=np.bool_),
        probabilities=np.broadcast_to(chances, shape),
    )
    monkeypatch.setattr(model_env, "fractions", lambda key, _: torch.full_like(key, drawn))
    env = ModelTorchEnv(model, _never(model), 2)
    happened, _ = _act(env, env.reset(), [0, 0])
    assert happened["state"].tolist() == [expected] * 2


def test_a_masked_reset_resets_those_alone() -> None:
    """The others go on as if nothing had been: place, step count and draws."""
    env, free = (ModelTorchEnv(_CHANCY, _delivered(_CHANCY), 6, max_steps=7) for _ in range(2))
    for some in (env, free):
        some.set_seed(7)
    data, apart = env.reset(), free.reset()
    for _ in range(3):
        data, apart = (_act(some, now, torch.ones(6).long())[1] for some, now in ((env, data), (free, apart)))
    mask = torch.tensor([[True], [False], [False], [True], [False], [False]])
    data = env.reset(TensorDict({"_reset": mask, **data.select("state", "observation")}, batch_size=[6]))
    fresh = [Stream(7, i, 1).choose(np.flatnonzero(_CHANCY.starts).tolist()) for i in (0, 3)]
    assert data["state"][[0, 3]].tolist() == fresh
    ends = []
    for step in range(7):
        happened, data = _act(env, data, torch.zeros(6).long())
        other, apart = _act(free, apart, torch.zeros(6).long())
        ends.append(happened["truncated"][:, 0].tolist())
        if step < 4:
            rest = [1, 2, 4, 5]
            assert happened["state"][rest].tolist() == other["state"][rest].tolist()
    assert [[row[i] for row in ends].index(True) for i in range(6)] == [6, 3, 3, 6, 3, 3]


def test_those_that_are_not_to_step_stay() -> None:
    """With `_step`, the others neither move nor count a step; later they draw what they would have drawn."""
    env, free = (ModelTorchEnv(_CHANCY, _delivered(_CHANCY), 4, max_steps=9) for _ in range(2))
    for some in (env, free):
        some.set_seed(7)
    data, apart, begun = env.reset(), free.reset(), None
    moving, actions = torch.tensor([True, False, True, False]), torch.tensor([1, 1, 3, 3])
    begun = data["state"].clone()
    for _ in range(4):
        data["action"] = apart["action"] = actions
        data["_step"] = moving.clone()
        data, apart = env.step(data)["next"].clone(), free.step(apart)["next"].clone()
        assert data["state"][moving].tolist() == apart["state"][moving].tolist()
        assert data["state"][~moving].tolist() == begun[~moving].tolist()
        assert data["observation"].equal(env.encoding(data["state"]))
        assert (data["reward"][:, 0] != 0).tolist() == moving.tolist()
    free.set_seed(7)
    apart = free.reset()
    for step in range(9):
        data["action"] = apart["action"] = actions
        data["_step"] = ~moving
        data, apart = env.step(data)["next"].clone(), free.step(apart)["next"].clone()
        assert data["state"][~moving].tolist() == apart["state"][~moving].tolist()
        assert data["truncated"][:, 0].tolist() == [False, step == 8, False, step == 8]


def test_a_snapshot_is_taken_up_by_another_environment() -> None:
    """Its next reset leads to where the snapshot was taken; all goes on from there as it would have."""
    env, other = (ModelTorchEnv(_CHANCY, _delivered(_CHANCY), 5, max_steps=6) for _ in range(2))
    env.set_seed(2)
    data = env.reset()
    for _ in range(8):
        data = _act(env, data, torch.tensor([0, 1, 2, 3, 4]))[1]
    kept = env.snapshot()
    other.set_seed(9)
    other.resume(kept)
    again = other.reset()
    assert again["state"].tolist() == data["state"].tolist()
    assert again["observation"].equal(data["observation"])
    for _ in range(14):
        happened, data = _act(env, data, torch.tensor([3, 2, 1, 0, 0]))
        repeated, again = _act(other, again, torch.tensor([3, 2, 1, 0, 0]))
        assert _rows(repeated) == _rows(happened)
        assert again["state"].tolist() == data["state"].tolist()
    assert other.reset()["state"].tolist() == env.reset()["state"].tolist()
    env.resume(kept)
    assert env.snapshot().keys() == kept.keys()
    assert all(value.equal(kept[name]) for name, value in env.snapshot().items())


def test_a_snapshot_of_other_environments_is_refused() -> None:
    """Nothing has changed then."""
    env = ModelTorchEnv(_SURE, _never(_SURE), 3)
    env.set_seed(1)
    env.reset()
    kept = env.snapshot()
    with pytest.raises(UserError, match="take one of an environment with num_envs=3"):
        env.resume(ModelTorchEnv(_SURE, _never(_SURE), 4).snapshot())
    with pytest.raises(UserError, match="the snapshot holds"):
        env.resume({**kept, "state_": kept["state"]})
    assert all(value.equal(kept[name]) for name, value in env.snapshot().items())


def test_a_seed_names_the_episodes() -> None:
    """The same seed gives the same starts, another seed others; resetting goes on to new episodes."""
    env = ModelTorchEnv(_SURE, _never(_SURE), 16)
    starts = []
    for seed in (3, 3, 4):
        env.set_seed(seed)
        starts.append(env.reset()["state"].tolist())
    assert starts[0] == starts[1] != starts[2]
    assert env.reset()["state"].tolist() != starts[2]


def test_without_a_seed_torch_s_own_decides() -> None:
    """`torch.manual_seed` alone makes runs repeatable; otherwise they differ."""
    starts = []
    for seed in (1, 1, 2):
        torch.manual_seed(seed)
        starts.append(ModelTorchEnv(_SURE, _never(_SURE), 16).reset()["state"].tolist())
    assert starts[0] == starts[1] != starts[2]


def test_what_a_step_gives_is_not_written_again() -> None:
    """Tensors of earlier steps stay as they were, also where episodes end."""
    env = ModelTorchEnv(_CHANCY, _delivered(_CHANCY), 5, max_steps=4)
    env.set_seed(1)
    data, kept = env.reset(), []
    for _ in range(10):
        happened, data = _act(env, data, torch.tensor([0, 1, 2, 3, 3]))
        kept += [(tensor, tensor.clone()) for tensor in (happened["state"], data["state"], env.state)]
    assert all(now.equal(then) for now, then in kept)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "num_envs 0 is not possible; give an integer of 1 or more"),
        ({"max_steps": 0}, "max_steps 0 is not possible; give 1 or more"),
        ({"starts": np.zeros(2048, np.bool_)}, "an episode needs a state to begin in that is not terminal"),
        ({"terminal": np.ones(2048, np.bool_)}, "an episode needs a state to begin in that is not terminal"),
        ({"terminal": np.zeros(3, np.bool_)}, r"terminal has shape \(3,\); give one flag for each of 2048"),
        ({"starts": np.ones((2048, 1), np.bool_)}, r"starts has shape \(2048, 1\); give one flag for each"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    """The error names the argument and the mend."""
    with pytest.raises(UserError, match=message):
        ModelTorchEnv(**{"model": _SURE, "terminal": _never(_SURE), **arguments})


@pytest.mark.parametrize("wrong", [-1, 4])
def test_bad_seeds_and_actions_are_refused(wrong: int) -> None:
    """Nothing has moved then."""
    env = ModelTorchEnv(_SURE, _never(_SURE), 2)
    with pytest.raises(UserError, match="seed -3 is not possible; give an integer of 0 or more"):
        env.set_seed(-3)
    data = env.reset()
    begun = env.snapshot()
    data["action"] = torch.tensor([0, wrong])
    with pytest.raises(UserError, match=f"action {wrong} of environment 1 is not possible; give 0 to 3"):
        env.step(data)
    assert all(value.equal(begun[name]) for name, value in env.snapshot().items())


@given(st.lists(st.integers(0, 2**64 - 1), max_size=3), st.lists(st.integers(1, 2**20), min_size=1))
def test_fractions_are_a_stream_s_uniform_numbers(name: list[int], counters: list[int]) -> None:
    """Each of many streams at a draw of its own, as whole numbers over 2**53."""
    streams = [Stream(*name, i) for i in range(len(counters))]
    keys = torch.tensor([stream.key - (stream.key >> 63 << 64) for stream in streams])
    for stream, counter in zip(streams, counters, strict=True):
        stream.drawn = counter - 1
    found = [drawn / 2**53 for drawn in fractions(keys, torch.tensor(counters)).tolist()]
    assert found == [stream.uniform() for stream in streams]


def test_a_generator_has_a_stream_s_name() -> None:
    """The same integers give the same numbers, whatever torch has drawn; others, or another order, do not."""
    drawn = []
    for name in ((1, 2), (2, 1), (1,), (1, 2, 0), (1, 2)):
        torch.rand(3)
        drawn.append(torch.rand(4, generator=generator(*name)).tolist())
    assert drawn[0] == drawn[4]
    assert len({tuple(numbers) for numbers in drawn}) == 4


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_a_gpu_gives_the_same_episodes() -> None:
    """All tensors live there, and 60 steps with chance and resets agree with the CPU's."""
    envs = [
        ModelTorchEnv(_CHANCY, _delivered(_CHANCY), 64, max_steps=9, device=device)
        for device in ("cpu", "cuda")
    ]
    for env in envs:
        env.set_seed(4)
    data = [env.reset() for env in envs]
    for actions in np.random.default_rng(0).integers(0, len(_CHANCY.actions), (60, 64)):
        found = [
            _act(env, before, torch.as_tensor(actions, device=env.device))
            for env, before in zip(envs, data, strict=True)
        ]
        data = [after for _, after in found]
        assert data[1]["observation"].device.type == "cuda"
        assert _rows(found[0][0]) == _rows(found[1][0])
        assert data[0]["observation"].equal(data[1]["observation"].cpu())
