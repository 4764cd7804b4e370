"""The TorchRL environment keeps TorchRL's contract, and both its backends give the same episodes."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import torch
from batches import Arguments, kinds_of_maze
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tensordict import TensorDict, TensorDictBase
from torchrl.envs import ActionMask, TransformedEnv, check_env_specs

from worlds import Stream, UserError
from worlds.torch_env import BACKENDS, MazeTorchEnv
from worlds.torch_stream import below, bits, keys_of, sooner
from worlds.vector_env import MazeVectorEnv

EXAMPLE: Arguments = {"trigger": "T4", "goal": "G2", "start": (1, 0)}


@pytest.fixture(autouse=True)
def _same_draws() -> Iterator[None]:
    """Let random policies draw the same in each run of a test, and leave no trace of it."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        yield


def _env(number: int, backend: str = "numba", **arguments: Any) -> MazeTorchEnv:
    env = MazeTorchEnv(number, backend=backend, **arguments)
    env.set_seed(7)
    return env


def _act(env: MazeTorchEnv, data: TensorDictBase, actions: Any) -> tuple[TensorDictBase, TensorDictBase]:
    """Step by actions; return what happened, and where episodes that are over have begun anew."""
    data["action"] = torch.as_tensor(actions)
    happened, after = env.step_and_maybe_reset(data)
    return happened["next"].clone(), after


def _rows(data: TensorDictBase) -> dict[str, Any]:
    keys = ("observation", "action_mask", "reward", "terminated", "truncated", "done")
    return {key: data[key].tolist() for key in keys if key in data}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("obstacles", ["none", "layout", "random"])
@pytest.mark.parametrize("action_masks", [False, True])
def test_torchrl_s_checker_has_no_complaint(backend: str, obstacles: str, action_masks: bool) -> None:
    """check_env_specs passes, also where every second step ends an episode."""
    for max_steps in (2, 200):
        env = _env(5, backend, obstacles=obstacles, action_masks=action_masks, max_steps=max_steps)
        check_env_specs(env, break_when_any_done="both")


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(arguments=kinds_of_maze(4), seed=st.integers(0, 2**31))
def test_backends_and_the_vector_environment_agree(arguments: Arguments, seed: int) -> None:
    """In any maze, step for step: observations, masks, rewards, ends, and what follows them."""
    envs = [MazeTorchEnv(4, backend=backend, action_masks=True, **arguments) for backend in BACKENDS]
    vector = MazeVectorEnv(4, autoreset_mode="SameStep", action_masks=True, **arguments)
    for env in envs:
        env.set_seed(seed, static_seed=True)
    data = [env.reset() for env in envs]
    assert data[0]["observation"].tolist() == vector.reset(seed=seed)[0].tolist()
    for actions in np.random.default_rng(seed).integers(0, 4, (30, 4)):
        happened, data = zip(  # type: ignore[assignment]
            *(_act(env, before, actions) for env, before in zip(envs, data, strict=True)), strict=True
        )
        assert _rows(happened[0]) == _rows(happened[1])
        assert _rows(data[0]) == _rows(data[1])
        observations, _, terminated, truncated, info = vector.step(actions)
        assert data[0]["observation"].tolist() == observations.tolist()
        assert data[0]["action_mask"].tolist() == (info["action_mask"] == 1).tolist()
        assert happened[0]["terminated"][:, 0].tolist() == terminated.tolist()
        assert happened[0]["truncated"][:, 0].tolist() == truncated.tolist()
        for i in np.flatnonzero(terminated | truncated):
            assert happened[0]["observation"][i].tolist() == info["final_obs"][i].tolist()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_masked_reset_resets_those_alone(backend: str) -> None:
    """The others go on where they were, step counts and obstacles included."""
    env, free = (_env(6, backend, obstacles="random", max_steps=7) for _ in range(2))
    data, apart = env.reset(), free.reset()
    for _ in range(3):
        data, apart = (
            _act(some, before, torch.ones(6).long())[1] for some, before in ((env, data), (free, apart))
        )
    mask = torch.tensor([[True], [False], [False], [True], [False], [False]])
    before = data["observation"].clone()
    data = env.reset(TensorDict({"_reset": mask, **data.select("observation")}, batch_size=[6]))
    assert data["observation"][[1, 2, 4, 5]].tolist() == before[[1, 2, 4, 5]].tolist()
    assert data["observation"][[0, 3]].tolist() != before[[0, 3]].tolist()
    ends = []
    for _ in range(7):
        happened, data = _act(env, data, torch.zeros(6).long())
        other, apart = _act(free, apart, torch.zeros(6).long())
        ends.append(happened["done"][:, 0].tolist())
        if len(ends) <= 4:
            assert (
                happened["observation"][[1, 2, 4, 5]].tolist() == other["observation"][[1, 2, 4, 5]].tolist()
            )
    assert [row.index(True) if True in row else None for row in ends] == [None, None, None, 1, None, None, 0]


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_seed_names_the_episodes(backend: str) -> None:
    """The same seed gives the same rollout, another seed another; resetting goes on to new episodes."""
    env = _env(8, backend, obstacles="random", max_steps=10)
    runs = []
    for seed in (3, 3, 4):
        env.set_seed(seed)
        torch.manual_seed(1)
        runs.append(env.rollout(30, break_when_any_done=False)["next", "observation"].tolist())
    assert runs[0] == runs[1] != runs[2]
    env.set_seed(3)
    assert env.reset()["observation"].tolist() != env.reset()["observation"].tolist()


def test_without_a_seed_torch_s_own_decides() -> None:
    """`torch.manual_seed` alone makes runs repeatable; otherwise they differ."""
    starts = []
    for seed in (1, 1, 2):
        torch.manual_seed(seed)
        starts.append(MazeTorchEnv(16).reset()["observation"].tolist())
    assert starts[0] == starts[1] != starts[2]


@pytest.mark.parametrize("backend", BACKENDS)
def test_those_that_are_not_to_step_stay(backend: str) -> None:
    """With `_step`, the others neither move nor count a step, and obstacles do not appear to them."""
    env, free = (_env(4, backend, obstacles="random", max_steps=9) for _ in range(2))
    data, apart = env.reset(), free.reset()
    moving = torch.tensor([True, False, True, False])
    for _ in range(4):
        data["action"] = apart["action"] = torch.tensor([1, 1, 3, 3])
        data["_step"] = moving.clone()
        data, apart = env.step(data)["next"].clone(), free.step(apart)["next"].clone()
        assert data["observation"][moving].tolist() == apart["observation"][moving].tolist()
        assert data["reward"][:, 0].tolist() == [-1, 0, -1, 0]
    free.set_seed(7)
    data["_step"], apart = ~moving, free.reset()
    for _ in range(9):
        data["action"] = apart["action"] = torch.tensor([1, 1, 3, 3])
        data, apart = env.step(data)["next"].clone(), free.step(apart)["next"].clone()
        data["_step"] = ~moving
        assert data["observation"][~moving].tolist() == apart["observation"][~moving].tolist()
    assert data["truncated"][~moving].all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_masks_go_into_torchrl_s_action_mask(backend: str) -> None:
    """Under its transform, a random policy moves at every step."""
    env = TransformedEnv(
        MazeTorchEnv(32, backend=backend, obstacles="random", action_masks=True, max_steps=20), ActionMask()
    )
    env.set_seed(0)
    rollout = env.rollout(40, break_when_any_done=False)
    moved = rollout["observation"][..., 0] != rollout["next", "observation"][..., 0]
    assert moved[rollout["action_mask"].any(-1)].all()
    assert moved.any(0).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_a_step_gives_is_not_written_again(backend: str) -> None:
    """Tensors of earlier steps stay as they were."""
    env = _env(5, backend, obstacles="random", max_steps=6)
    data, kept = env.reset(), []
    for _ in range(12):
        data["action"] = env.action_spec.rand()
        happened = env.step(data)["next"]
        kept.append((happened["observation"], happened["observation"].clone(), happened["done"].tolist()))
        data = env.reset(TensorDict({"_reset": happened["done"].clone(), **happened}, batch_size=[5]))
    assert all((now == then).all() for now, then, _ in kept)
    assert any(any(row[0] for row in done) for *_, done in kept)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "num_envs 0 is not possible; give an integer of 1 or more"),
        ({"backend": "numb"}, "backend 'numb' is not possible; did you mean 'numba'?"),
        (
            {"backend": "numba", "device": "meta"},
            "backend 'numba' is not possible on meta; use 'torch', or the device 'cpu'",
        ),
        ({"goal": "exit"}, "goal 'exit' is not possible; use one of G1, G2, G3, G4"),
    ],
)
def test_bad_arguments_are_refused(arguments: Arguments, message: str) -> None:
    """The error names the argument and the mend."""
    with pytest.raises(UserError) as caught:
        MazeTorchEnv(**arguments)
    assert str(caught.value) == message


def test_bad_seeds_and_actions_are_refused() -> None:
    """Nothing has moved then."""
    env = _env(2, **EXAMPLE)
    with pytest.raises(UserError, match="seed -3 is not possible; give an integer of 0 or more"):
        env.set_seed(-3)
    data = env.reset()
    data["action"] = torch.tensor([0, 5])
    with pytest.raises(UserError, match="action 5 of environment 1 is not possible; give 0 to 3"):
        env.step(data)
    assert env.batch.state[:, 4].tolist() == [0, 0]  # type: ignore[union-attr]


@given(st.lists(st.integers(0, 2**64 - 1), min_size=1, max_size=3), st.integers(1, 2**29))
def test_pytorch_draws_what_a_stream_draws(name: list[int], n: int) -> None:
    """Bits, integers below a bound, comparisons with a probability, and keys."""
    stream = Stream(*name)
    key = torch.tensor([stream.key - (stream.key >> 63 << 64)])
    assert [int(bits(key, k + 1)[0]) % 2**64 for k in range(4)] == [stream.bits() for _ in range(4)]
    assert [int(below(key, k + 5, n)[0]) for k in range(4)] == [stream.below(n) for _ in range(4)]
    assert [bool(sooner(key, k + 9, 0.75)[0]) for k in range(4)] == [
        stream.uniform() < 0.75 for _ in range(4)
    ]
    keys = keys_of(stream.key, 3, torch.device("cpu"))
    assert [int(k) % 2**64 for k in keys] == [Stream(*name, i).key for i in range(3)]


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_a_gpu_gives_the_same_episodes() -> None:
    """PyTorch alone on a GPU and the kernel on the CPU agree over 200 steps of random obstacles."""
    cpu = _env(64, obstacles="random", max_steps=40, action_masks=True)
    gpu = _env(64, "torch", obstacles="random", max_steps=40, action_masks=True, device="cuda")
    data = [cpu.reset(), gpu.reset()]
    for _ in range(200):
        actions = cpu.action_spec.rand()
        found = [_act(cpu, data[0], actions), _act(gpu, data[1], actions.to("cuda"))]
        data = [after for _, after in found]
        assert _rows(found[0][0]) == _rows(found[1][0])
        assert _rows(data[0]) == _rows(data[1])
