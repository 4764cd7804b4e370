"""The quick environment is the readable one, step for step."""

import copy
import pickle
from typing import Any

import gymnasium
import numpy as np
import pytest
from batches import Arguments, kinds_of_maze, random_actions
from gymnasium.utils.env_checker import data_equivalence
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from worlds.env import MazeEnv
from worlds.quick_env import QuickMazeEnv


def _agree(arguments: Arguments, seed: int, steps: int, look: int) -> None:
    """Run both by the same actions; look at the episode every so many steps."""
    quick, plain = QuickMazeEnv(**arguments), MazeEnv(**arguments)
    assert data_equivalence(quick.reset(seed=seed), plain.reset(seed=seed), exact=True)
    for count, action in enumerate(random_actions(seed % 1000, steps, 1)[:, 0].tolist()):
        found, expected = quick.step(action), plain.step(action)
        assert data_equivalence(found, expected, exact=True)
        if count % look == 0:
            assert _episode(quick) == _episode(plain)
        if found[2] or found[3]:
            with pytest.raises(gymnasium.error.ResetNeeded):
                quick.step(action)
            assert data_equivalence(quick.reset(), plain.reset(), exact=True)


def _episode(env: MazeEnv) -> Any:
    episode = env.episode
    assert episode is not None
    return episode.state, episode.steps, episode.placed, episode._due, episode._pending


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(arguments=kinds_of_maze(), seed=st.integers(0, 2**31), look=st.integers(1, 40))
def test_it_gives_the_same_under_the_same_seed(arguments: Arguments, seed: int, look: int) -> None:
    """In any small maze with any obstacles: all that is returned, and the episode whenever looked at."""
    _agree(arguments, seed, steps=60, look=look)


@pytest.mark.parametrize("obstacles", ["none", "layout", "random"])
def test_a_long_run_is_the_same(obstacles: str) -> None:
    """So is the paper's maze over 10,000 steps."""
    _agree({"obstacles": obstacles, "max_steps": 150}, seed=1, steps=10_000, look=7)


def test_what_it_gives_is_not_written_again() -> None:
    """Its look-up tables are not handed out: a caller may write on what it got."""
    env = QuickMazeEnv(trigger="T4", goal="G2", start=(1, 0))
    env.reset(seed=0)
    first = env.step(2)
    first[0][:], first[4]["action_mask"][:] = 99, 99
    again = env.step(2)
    assert again[0].tolist() == [8, 3, 1, 0, 0, 0, 1, 0]
    assert again[4]["action_mask"].tolist() == [1, 1, 0, 1]


@pytest.mark.parametrize("action", [4, -1, 1.0, "1", None, np.float64(2)])
def test_what_is_no_action_is_refused(action: Any) -> None:
    """As the readable one does, and the episode has not moved on."""
    env = QuickMazeEnv()
    env.reset(seed=0)
    with pytest.raises(gymnasium.error.InvalidAction, match="give 0 to 3"):
        env.step(action)
    assert env.step(0)[4]["steps"] == 1


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])  # noqa: S301
def test_a_copy_goes_on_as_the_original_would(clone: Any) -> None:
    """In the middle of an episode, a copy has the same state."""
    env = QuickMazeEnv(obstacles="random")
    env.reset(seed=5)
    actions = random_actions(2, 60, 1)[:, 0].tolist()
    for action in actions[:20]:
        env.step(action)
    twin = clone(env)
    logs = [[some.step(action) for action in actions] for some in (twin, env)]
    assert data_equivalence(*logs, exact=True)


def test_a_picture_shows_where_it_is() -> None:
    """Drawing looks at the episode, which then is where the look-ups have come."""
    pictures = []
    for kind in (QuickMazeEnv, MazeEnv):
        env = kind(trigger="T4", goal="G2", start=(1, 0), render_mode="rgb_array")
        env.reset(seed=0)
        for action in (3, 3, 1):
            env.step(action)
        pictures.append(env.render())
    assert pictures[0] is not None
    assert (pictures[0] == pictures[1]).all()
