import copy
import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import ACTION_NUMBERS, maze_layouts

from worlds import Cell, Outcome, UserError, load_layout, parse_layout
from worlds.env import MazeEnv
from worlds.registration import ENVIRONMENTS, register

NORTH, SOUTH, WEST, EAST = range(4)
IDS = list(ENVIRONMENTS)


def _run(env: gymnasium.Env[Any, Any], steps: int = 60) -> list[Any]:
    """Return what an environment gives for a fixed row of actions, resetting at each episode's end."""
    log: list[Any] = []
    for i in range(steps):
        given_back = env.step((i * i + i // 3) % 4)
        log.append(given_back)
        if given_back[2] or given_back[3]:
            log.append(env.reset())
    return log


def _example(**arguments: Any) -> MazeEnv:
    env = MazeEnv("two_rooms", trigger="T4", goal="G2", start=(1, 0), **arguments)
    env.reset(seed=0)
    return env


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
def test_gymnasium_s_checker_has_no_complaint(name: str, render_mode: str | None) -> None:
    """check_env passes, and warnings are errors in these tests."""
    check_env(gymnasium.make(name, render_mode=render_mode).unwrapped)


@pytest.mark.parametrize("name", IDS)
def test_the_same_seed_gives_the_same_run(name: str) -> None:
    """Two environments with one seed agree in all they return; another seed differs."""
    logs = []
    for seed in (3, 3, 4):
        env = gymnasium.make(name, max_steps=20)
        logs.append([env.reset(seed=seed), *_run(env)])
    assert data_equivalence(logs[0], logs[1], exact=True)
    assert not data_equivalence(logs[0], logs[2], exact=True)


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize(
    "clone",
    [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))],  # noqa: S301
    ids=["deepcopy", "pickle"],
)
def test_a_copy_goes_on_as_the_original_would(name: str, clone: Callable[[Any], Any]) -> None:
    """In the middle of an episode, a copy has the same state and the same random numbers to come."""
    env = gymnasium.make(name, max_steps=20).unwrapped
    env.reset(seed=5)
    _run(env, 7)
    twin = clone(env)
    assert data_equivalence(_run(twin), _run(env), exact=True)


@pytest.mark.parametrize("name", IDS)
def test_a_spec_builds_the_environment_again(name: str) -> None:
    """The spec survives JSON and keeps the arguments given."""
    spec = gymnasium.make(name, max_steps=7, trigger="T4").spec
    assert spec is not None
    again = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(spec.to_json())).unwrapped
    assert isinstance(again, MazeEnv)
    assert again.max_steps == 7
    assert again.obstacles == ENVIRONMENTS[name]["obstacles"]


@pytest.mark.parametrize("name", IDS)
def test_an_id_needs_no_import_but_gymnasium(name: str) -> None:
    """In a fresh process, the module before the colon registers the id."""
    code = (
        "import gymnasium, json, sys\n"
        f"env = gymnasium.make('worlds.registration:{name}', trigger='T4', goal='G2', start=(1, 0))\n"
        "heavy = sorted({'torch', 'pybullet', 'cv2', 'matplotlib'} & set(sys.modules))\n"
        "print(json.dumps([env.reset(seed=0)[0].tolist(), heavy]))"
    )
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    observation, heavy = json.loads(done.stdout)
    assert observation == [8, 3, 1, 0, 0, 0, 1, 0]
    assert heavy == []


def test_registering_twice_is_harmless() -> None:
    """No id is overridden, of which Gymnasium would warn."""
    before = {name: gymnasium.registry[name] for name in IDS}
    register()
    assert all(gymnasium.registry[name] is spec for name, spec in before.items())


def test_a_vector_of_environments_runs() -> None:
    """Masks and outcomes are stacked over three environments that reset by themselves."""
    envs = gymnasium.make_vec(IDS[1], num_envs=3, vectorization_mode="sync", max_steps=4)
    envs.reset(seed=1)
    infos = [envs.step(np.full(3, NORTH))[4] for _ in range(6)]
    assert infos[0]["action_mask"].shape == (3, 4)
    assert [info["steps"].tolist()[0] for info in infos] == [1, 2, 3, 4, 0, 1]
    assert list(infos[3]["outcome"]) == [Outcome.TRUNCATED] * 3


def test_the_example_run_step_by_step() -> None:
    """The layout's obstacles: S1 rolls, C1 blocks, and observation and mask say so beforehand."""
    env = _example(obstacles="layout")
    seen = [env.step(action) for action in (SOUTH, SOUTH, SOUTH, SOUTH)]
    assert [list(observation) for observation, *_ in seen] == [
        [16, 3, 1, 0, 0, 3, 1, 0],
        [24, 3, 1, 0, 0, 0, 1, 0],
        [32, 3, 1, 0, 0, 2, 1, 0],
        [32, 3, 1, 0, 0, 2, 1, 0],
    ]
    assert [list(step[4]["action_mask"]) for step in seen] == [
        [1, 1, 0, 1],
        [1, 1, 0, 1],
        [1, 0, 0, 1],
        [1, 0, 0, 1],
    ]
    assert [step[1:4] for step in seen] == [(-1.0, False, False)] * 4
    assert [step[4]["steps"] for step in seen] == [1, 2, 3, 4]
    assert all("outcome" not in step[4] for step in seen)


def test_the_goal_ends_an_episode() -> None:
    """Without obstacles the shortest route takes 15 steps, through open doors, and is called reached."""
    env = _example()
    route = [SOUTH] * 5 + [EAST] + [NORTH] + [EAST] * 3 + [NORTH] * 2 + [EAST] * 3
    steps = [env.step(action) for action in route]
    assert [step[2] for step in steps] == [False] * 14 + [True]
    observation, reward, terminated, truncated, info = steps[-1]
    assert list(observation) == [31, 3, 1, 1, 0, 0, 0, 1]
    assert (reward, terminated, truncated) == (-1.0, True, False)
    assert (info["steps"], info["outcome"]) == (15, Outcome.REACHED)


def test_the_last_step_may_still_reach_the_goal() -> None:
    """An episode that ends at the goal with its last step is not truncated."""
    env = _example(max_steps=15)
    route = [SOUTH] * 5 + [EAST] + [NORTH] + [EAST] * 3 + [NORTH] * 2 + [EAST] * 3
    assert [env.step(action) for action in route][-1][2:4] == (True, False)


def test_too_long_an_episode_is_truncated() -> None:
    """At max_steps, and named so."""
    env = _example(max_steps=3)
    steps = [env.step(WEST) for _ in range(3)]
    assert [step[2:4] for step in steps] == [(False, False), (False, False), (False, True)]
    assert steps[-1][4]["outcome"] is Outcome.TRUNCATED


def test_a_hemmed_in_robot_may_do_nothing() -> None:
    """With every way blocked the mask is all 0, and the episode runs on to its truncation."""
    obstacles = "obstacles\nC1 cube 0,1 middle #ffffff at start\nS1 sphere 1,0 middle #ffffff at start"
    layout = parse_layout(f"grid\n. . T1\n. . G1\nstart 0,0\ntrigger T1\ngoal G1\n{obstacles}")
    env = MazeEnv(layout, obstacles="layout", start=(0, 0), max_steps=2)
    observation, info = env.reset(seed=0)
    assert list(observation[4:]) == [1, 3, 1, 2]
    assert list(info["action_mask"]) == [0, 0, 0, 0]
    assert [env.step(SOUTH)[3] for _ in range(2)] == [False, True]


def test_steps_need_a_running_episode() -> None:
    """Before the first reset and after an end, the error says to reset."""
    env = MazeEnv(max_steps=1)
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"call reset\(\) before step\(\)"):
        env.step(NORTH)
    env.reset(seed=0)
    env.step(NORTH)
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"call reset\(\) before step\(\)"):
        env.step(NORTH)


def test_an_unknown_action_is_refused() -> None:
    """The error gives the range, and the episode has not moved on."""
    env = _example()
    with pytest.raises(gymnasium.error.InvalidAction, match="4 is not an action; give 0 to 3"):
        env.step(4)
    assert env.step(NORTH)[4]["steps"] == 1


def test_marks_and_start_are_drawn_at_each_reset() -> None:
    """600 resets show all 16 pairs and all 32 starts of room A, never the trigger itself."""
    env = MazeEnv()
    seen = [tuple(int(x) for x in env.reset(seed=7 if i == 0 else None)[0][:3]) for i in range(600)]
    assert len({(trigger, goal) for _, trigger, goal in seen}) == 16
    assert {start for start, _, _ in seen} == {r * 8 + c for r in range(8) for c in range(4)}
    triggers = [env.layout.number(cell) for cell in env.layout.triggers.values()]
    assert all(start != triggers[trigger] for start, trigger, _ in seen)


def test_options_hold_for_one_episode() -> None:
    """They overrule the constructor's choice until the next reset, and None asks for a draw."""
    env = _example()
    options = {"trigger": "T1", "goal": "G4", "start": Cell(7, 3)}
    assert list(env.reset(options=options)[0][:3]) == [59, 0, 3]
    assert list(env.reset()[0][:3]) == [8, 3, 1]
    assert len({int(env.reset(options={"start": None})[0][0]) for _ in range(20)}) > 5


def test_a_start_on_a_trigger_draws_another_trigger() -> None:
    """From T4's cell, only T1, T2 and T3 can be drawn."""
    env = MazeEnv(start=(6, 1))
    env.reset(seed=0)
    assert {int(env.reset()[0][1]) for _ in range(60)} == {0, 1, 2}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"triger": "T1"}, "unknown option 'triger'; did you mean 'trigger'?"),
        ({"speed": 3}, "unknown option 'speed'; use one of trigger, goal, start"),
        ({"trigger": "T44"}, "trigger 'T44' is not possible; did you mean 'T4'?"),
        ({"goal": "exit"}, "goal 'exit' is not possible; use one of G1, G2, G3, G4"),
        ({"goal": 2}, "goal 2 is not possible; did you mean 'G2'?"),
        ({"start": "1,0"}, "start '1,0': give a cell as (row, column)"),
        ({"start": (1.5, 0)}, "start (1.5, 0): give a cell as (row, column)"),
        (
            {"start": (0, 5)},
            "start 0,5 is not possible; choose a cell that 1,0 connects to with doors shut, such as 1,0",
        ),
        (
            {"trigger": "T4", "start": (6, 1)},
            "start 6,1 is not possible; it is the trigger's cell; choose another",
        ),
    ],
)
def test_bad_options_are_refused(options: dict[str, Any], message: str) -> None:
    """The error names the option and the mend, and a good reset still works after it."""
    env = MazeEnv()
    with pytest.raises(UserError) as caught:
        env.reset(seed=0, options=options)
    assert str(caught.value) == message
    assert env.reset(seed=0)[1]["steps"] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"layout": "two_room"},
            "two_room: no layout of this name and no such file; did you mean 'two_rooms'?",
        ),
        ({"obstacles": "randm"}, "obstacles 'randm' is not possible; did you mean 'random'?"),
        ({"render_mode": "human"}, "render_mode 'human' is not possible; use None or 'rgb_array'"),
        ({"max_steps": 0}, "max_steps 0 is not possible; give 1 or more"),
        ({"obstacles": "random", "most_obstacles": 62}, "most_obstacles 62 is not possible; give 1 to 61"),
        ({"trigger": "G1"}, "trigger 'G1' is not possible; use one of T1, T2, T3, T4"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    """The error names the argument and the mend."""
    with pytest.raises(UserError) as caught:
        MazeEnv(**arguments)
    assert str(caught.value) == message


def test_random_obstacles_differ_by_episode() -> None:
    """Each reset draws one to the most, none of them on the start, the trigger or the goal."""
    env = MazeEnv(obstacles="random", most_obstacles=4)
    env.reset(seed=2)
    drawn = []
    for _ in range(80):
        env.reset()
        assert env.episode is not None
        obstacles = tuple(env.episode.obstacles.values())
        cells = {env.layout.number(obstacle.cell) for obstacle in obstacles}
        state = env.episode.state
        assert cells.isdisjoint({state.robot, state.trigger, state.goal})
        drawn.append(obstacles)
    assert {len(obstacles) for obstacles in drawn} == {1, 2, 3, 4}
    assert len(set(drawn)) == 80


@settings(max_examples=60, deadline=None)
@given(maze_layouts(), st.integers(0, 2**31), st.lists(ACTION_NUMBERS, max_size=25))
def test_the_mask_and_the_surroundings_tell_the_truth(layout: Any, seed: int, actions: list[int]) -> None:
    """In any maze, an action moves the robot exactly if the mask says so; what is beside it agrees."""
    room = len(layout.cells) - len(layout.solid) - 3
    env = MazeEnv(layout, obstacles="random" if room > 0 else "none", most_obstacles=max(1, min(6, room)))
    observation, info = env.reset(seed=seed)
    for action in actions:
        assert env.observation_space.contains(observation)
        beside, mask = observation[4 + action], info["action_mask"][action]
        assert mask == {0: 1, 1: 0, 2: 0}.get(int(beside), mask)
        after, _, terminated, truncated, info = env.step(action)
        assert (after[0] != observation[0]) == bool(mask)
        observation = after
        if terminated or truncated:
            break


def test_pictures_follow_the_episode() -> None:
    """A picture is bytes of 32 pixels a cell and a border, and changes as the robot moves."""
    env = _example(render_mode="rgb_array", obstacles="layout")
    before = env.render()
    env.step(EAST)
    after = env.render()
    assert before is not None
    assert after is not None
    assert before.shape == (272, 272, 3)
    assert (before != after).any()
    red = np.array([0xD9, 0x33, 0x2B])  # S1's colour in the layout
    assert (after == red).all(axis=-1).sum() > 50


def test_no_picture_without_a_render_mode_or_an_episode() -> None:
    """Gymnasium asks for None in the first case; the second is an error that says what to do."""
    assert _example().render() is None
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"call reset\(\) before render\(\)"):
        MazeEnv(render_mode="rgb_array").render()


def test_a_layout_can_be_given_as_such() -> None:
    """Its name and the layout itself make the same environment."""
    logs = []
    for layout in ("two_rooms", load_layout("two_rooms")):
        env = MazeEnv(layout)
        logs.append([env.reset(seed=1), *_run(env)])
    assert data_equivalence(logs[0], logs[1], exact=True)
