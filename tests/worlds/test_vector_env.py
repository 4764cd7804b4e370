"""The vector environment is Gymnasium's SyncVectorEnv of readable environments, much faster."""

import copy
import pickle
from typing import Any

import gymnasium
import numpy as np
import pytest
from batches import Arguments, kinds_of_maze, one_of, random_actions
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from worlds import UserError
from worlds.registration import ENVIRONMENTS
from worlds.vector_env import MazeVectorEnv

MODES = list(AutoresetMode)
EXAMPLE: Arguments = {"trigger": "T4", "goal": "G2", "start": (1, 0)}


class _Shared(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment of a batch, to which SyncVectorEnv's `seed + i` is the batch's seed."""

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        number = self.unwrapped.number  # type: ignore[attr-defined]
        return super().reset(seed=None if seed is None else seed - number, options=options)


def _sync(arguments: Arguments, number: int, mode: AutoresetMode) -> SyncVectorEnv:
    def maker(i: int) -> Any:
        return lambda: _Shared(one_of(arguments, i))

    return SyncVectorEnv([maker(i) for i in range(number)], autoreset_mode=mode)


def _as_ours(values: Any) -> Any:
    """Return what SyncVectorEnv gives, in our integers: it takes those of MazeEnv and of Python."""
    if isinstance(values, dict):
        return {key: _as_ours(value) for key, value in values.items()}
    if isinstance(values, tuple | list):
        return [_as_ours(value) for value in values]
    if isinstance(values, np.ndarray) and values.dtype == object:
        return [None if value is None else str(_as_ours(value)) for value in values]
    if isinstance(values, np.ndarray) and values.dtype == np.int64:
        return values.astype(np.int32)
    return values


def _agree(arguments: Arguments, mode: AutoresetMode, number: int, seed: int, steps: int) -> None:
    ours = MazeVectorEnv(number, autoreset_mode=mode, action_masks=True, **arguments)
    theirs = _sync(arguments, number, mode)
    assert _same(ours.reset(seed=seed), theirs.reset(seed=seed))
    for actions in random_actions(seed % 1000, steps, number):
        found, expected = ours.step(actions), theirs.step(actions)
        assert _same(found, expected)
        over = found[2] | found[3]
        if mode is AutoresetMode.DISABLED and over.any():
            answers = [envs.reset(options={"reset_mask": over.copy()}) for envs in (ours, theirs)]
            assert _same(*answers)


def _same(found: Any, expected: Any) -> bool:
    return data_equivalence(_as_ours(found), _as_ours(expected), exact=True)


@pytest.mark.parametrize("mode", MODES)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(arguments=kinds_of_maze(4), seed=st.integers(0, 2**40))
def test_any_maze_goes_as_in_gymnasium_s_own(mode: AutoresetMode, arguments: Arguments, seed: int) -> None:
    """Observations, rewards, ends and all infos are those of SyncVectorEnv, in each autoreset mode."""
    _agree(arguments, mode, number=3, seed=seed, steps=40)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("obstacles", ["none", "layout", "random"])
def test_a_long_run_goes_as_in_gymnasium_s_own(mode: AutoresetMode, obstacles: str) -> None:
    """So do five mazes of the paper over 1500 steps."""
    _agree({"obstacles": obstacles, "max_steps": 70}, mode, number=5, seed=3, steps=1500)


def test_the_comparison_would_see_a_difference() -> None:
    """Another seed, or a mask that differs, is not the same."""
    ours, theirs = MazeVectorEnv(3, action_masks=True), _sync({}, 3, AutoresetMode.NEXT_STEP)
    assert not _same(ours.reset(seed=1), theirs.reset(seed=2))
    observations, info = ours.reset(seed=2)
    info["action_mask"][0, 0] ^= 1
    assert not _same((observations, info), theirs.reset(seed=2))


@pytest.mark.parametrize("name", ENVIRONMENTS)
@pytest.mark.parametrize("mode", [None, "vector_entry_point"])
def test_make_vec_makes_it(name: str, mode: str | None) -> None:
    """Gymnasium finds it by the id of the single environment, and it keeps to what it declares."""
    envs = gymnasium.make_vec(name, num_envs=5, vectorization_mode=mode, max_steps=9)
    assert isinstance(envs.unwrapped, MazeVectorEnv)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    observations, _ = envs.reset(seed=0)
    envs.action_space.seed(0)
    for _ in range(30):
        assert envs.observation_space.contains(observations)
        assert envs.single_observation_space.contains(observations[0])
        observations, rewards, terminated, truncated, _ = envs.step(envs.action_space.sample())
        assert rewards.dtype == np.float64
        assert {rewards.shape, terminated.shape, truncated.shape} == {(5,)}
    assert envs.spec is not None
    again = gymnasium.make_vec(envs.spec)
    assert data_equivalence(again.reset(seed=4), envs.reset(seed=4), exact=True)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_the_single_environment_s_space_is_the_same(name: str) -> None:
    """The observations of one are those of the other, in smaller integers."""
    single = gymnasium.make(name)
    envs = gymnasium.make_vec(name, num_envs=2)
    assert (single.observation_space.nvec == envs.single_observation_space.nvec).all()  # type: ignore[attr-defined]
    assert single.action_space == envs.single_action_space


@pytest.mark.parametrize(
    "clone",
    [copy.deepcopy, lambda envs: pickle.loads(pickle.dumps(envs))],  # noqa: S301
    ids=["deepcopy", "pickle"],
)
def test_a_copy_goes_on_as_the_original_would(clone: Any) -> None:
    """In the middle of episodes, a copy has the same state and goes its own way."""
    envs = MazeVectorEnv(4, obstacles="random", max_steps=15)
    envs.reset(seed=5)
    actions = random_actions(1, 60, 4)
    for action in actions[:20]:
        envs.step(action)
    twin = clone(envs)
    logs = [[some.step(action) for action in actions] for some in (twin, envs)]
    assert data_equivalence(*logs, exact=True)


def test_what_a_step_gives_is_not_written_again() -> None:
    """Later steps leave earlier observations, rewards, ends and infos as they were."""
    envs = MazeVectorEnv(6, obstacles="random", max_steps=5, autoreset_mode="SameStep", action_masks=True)
    envs.reset(seed=0)
    kept = []
    for actions in random_actions(4, 25, 6):
        given_back = envs.step(actions)
        kept.append((given_back, copy.deepcopy(given_back)))
    assert all(data_equivalence(*pair, exact=True) for pair in kept)


def test_a_reset_without_a_seed_goes_on() -> None:
    """The first draws a seed; later ones begin the next episodes; a seed begins again."""
    one, other = MazeVectorEnv(20), MazeVectorEnv(20)
    assert one.reset()[0].tolist() != other.reset()[0].tolist()
    first = one.reset(seed=8)[0].tolist()
    assert one.reset()[0].tolist() != first
    assert one.reset(seed=8)[0].tolist() == first


def test_options_are_for_the_episodes_that_a_reset_begins() -> None:
    """Marks given to a reset hold until the environment resets itself."""
    envs = MazeVectorEnv(30, max_steps=1, autoreset_mode="SameStep")
    observations, _ = envs.reset(seed=0, options={"trigger": "T1", "goal": "G4", "start": (7, 3)})
    assert {tuple(row[:3]) for row in observations.tolist()} == {(59, 0, 3)}
    observations, *_ = envs.step(np.zeros(30, dtype=int))
    assert len({tuple(row[:3]) for row in observations.tolist()}) > 15


def test_a_partial_reset_leaves_the_others() -> None:
    """Only the environments in the mask begin anew; a seed there is for them alone."""
    envs = MazeVectorEnv(4, autoreset_mode="Disabled")
    first, _ = envs.reset(seed=2)
    envs.step(np.array([0, 1, 2, 3]))
    before = envs.step(np.array([1, 1, 2, 3]))[0]
    mask = np.array([True, False, True, False])
    observations, info = envs.reset(seed=2, options={"reset_mask": mask})
    assert observations[mask].tolist() == first[mask].tolist()
    assert observations[~mask].tolist() == before[~mask].tolist()
    assert info["_steps"].tolist() == mask.tolist()


def test_steps_need_running_episodes() -> None:
    """Before the first reset, and with autoreset disabled after an end, the error says to reset."""
    envs = MazeVectorEnv(3, max_steps=2, autoreset_mode="Disabled")
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"call reset\(\) before step\(\)"):
        envs.step(np.zeros(3, dtype=int))
    envs.reset(seed=0)
    envs.step(np.zeros(3, dtype=int))
    envs.reset(options={"reset_mask": np.array([False, True, False])})
    envs.step(np.zeros(3, dtype=int))
    with pytest.raises(gymnasium.error.ResetNeeded, match="environments 0, 2 are over; call reset"):
        envs.step(np.zeros(3, dtype=int))
    envs.reset(options={"reset_mask": np.array([True, False, False])})
    with pytest.raises(gymnasium.error.ResetNeeded, match="environments 2 are over"):
        envs.step(np.zeros(3, dtype=int))
    envs.reset(options={"reset_mask": np.array([False, False, True])})
    assert envs.step(np.zeros(3, dtype=int))[4]["steps"].tolist() == [1, 2, 1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "num_envs 0 is not possible; give an integer of 1 or more"),
        ({"autoreset_mode": "SameStp"}, "autoreset_mode 'SameStp' is not possible; did you mean 'SameStep'?"),
        ({"obstacles": "randm"}, "obstacles 'randm' is not possible; did you mean 'random'?"),
        ({"trigger": "T9"}, "trigger 'T9' is not possible; use one of T1, T2, T3, T4"),
        (
            {"render_mode": "rgb_array"},
            "render_mode 'rgb_array' is not possible; draw a single worlds.env.MazeEnv instead",
        ),
    ],
)
def test_bad_arguments_are_refused(arguments: Arguments, message: str) -> None:
    """The error names the argument and the mend."""
    with pytest.raises(UserError) as caught:
        MazeVectorEnv(**arguments)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("given_to", "message"),
    [
        ({"seed": -1}, "seed -1 is not possible; give an integer of 0 or more"),
        ({"seed": "x"}, "seed 'x' is not possible; give an integer of 0 or more"),
        ({"options": {"gaol": "G1"}}, "unknown option 'gaol'; did you mean 'goal'?"),
        ({"options": {"reset_mask": [True, False]}}, r"give an array of bool of shape \(2,\)"),
        ({"options": {"reset_mask": np.array([1, 0])}}, r"give an array of bool of shape \(2,\)"),
        ({"options": {"reset_mask": np.zeros(2, dtype=bool)}}, "True where an environment is to be reset"),
        (
            {"options": {"reset_mask": np.array([True, False])}},
            "reset_mask leaves environments out that have not begun; reset them all first",
        ),
    ],
)
def test_bad_resets_are_refused(given_to: dict[str, Any], message: str) -> None:
    """The error says what is wrong, and a good reset still works after it."""
    envs = MazeVectorEnv(2)
    with pytest.raises(UserError, match=message):
        envs.reset(**given_to)
    assert envs.reset(seed=0)[1]["steps"].tolist() == [0, 0]


def test_bad_actions_do_not_move_on() -> None:
    """The error names the environment; its episode has not moved."""
    envs = MazeVectorEnv(2, **EXAMPLE)
    envs.reset(seed=0)
    with pytest.raises(UserError, match="action 7 of environment 1 is not possible; give 0 to 3"):
        envs.step(np.array([0, 7]))
    assert envs.step(np.array([0, 0]))[4]["steps"].tolist() == [1, 1]
