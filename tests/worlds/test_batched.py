"""A batch is as many mazes, each stepped alone by the readable reference."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
import torch
from batches import Arguments, kinds_of_maze, obstacles_in_arrays, obstacles_of, one_of, random_actions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from worlds import Cell, Layout, Obstacle, UserError, load_layout, parse_layout
from worlds.batch_kernels import NEVER
from worlds.batch_reference import Wanted
from worlds.batched import MazeBatch
from worlds.batched_torch import TorchMazeBatch

Batch = MazeBatch | TorchMazeBatch
KINDS: list[type[Batch]] = [MazeBatch, TorchMazeBatch]


def _rows(batch: Batch) -> dict[str, Any]:
    """Return a batch's state as lists: robot, trigger, goal, doors, steps, next episode; grid; due."""
    if isinstance(batch, MazeBatch):
        state = batch.state[:, [0, 1, 2, 3, 4, 6]].tolist()
        return {"state": state, "grid": batch.grid.tolist(), "due": batch.due.tolist()}
    parts = (batch.robot, batch.trigger, batch.goal, batch.open, batch.steps, batch.episodes)
    cols = batch.tables.cols
    grid = batch.grid[:, cols : cols + batch.tables.cells]
    return {
        "state": torch.stack(parts, 1).tolist(),
        "grid": grid.tolist(),
        "due": batch.due.tolist(),
    }


def _hold(kind: type[Batch], arguments: Arguments, number: int, seed: int, steps: int) -> None:
    """Step a batch and its references by random actions; all they show and hold must be the same."""
    batch = kind(one_of(arguments), number, masks=True)
    references = [one_of(arguments, i) for i in range(number)]
    batch.seed(seed)
    views, masks = batch.reset()
    seen = [env.reset(seed=seed) for env in references]
    for actions in random_actions(seed, steps, number):
        assert views.tolist() == [view.tolist() for view, _ in seen]
        assert np.asarray(masks, dtype=int).tolist() == [info["action_mask"].tolist() for _, info in seen]
        _same_state(batch, references)
        given_back = [env.step(action) for env, action in zip(references, actions, strict=True)]
        stepped = batch.step(actions if kind is MazeBatch else torch.tensor(actions))
        views, masks = stepped.observations, stepped.masks
        assert stepped.rewards.tolist() == [reward for _, reward, *_ in given_back]
        assert stepped.terminated.tolist() == [row[2] for row in given_back]
        assert stepped.truncated.tolist() == [row[3] for row in given_back]
        seen = [(row[0], row[4]) for row in given_back]
        over = stepped.terminated | stepped.truncated
        if over.any():
            assert views.tolist() == [view.tolist() for view, _ in seen]
            _same_state(batch, references)
            views, masks = batch.reset(over)
            seen = [
                env.reset() if ended else at
                for env, ended, at in zip(references, over.tolist(), seen, strict=True)
            ]


def _same_state(batch: Batch, references: list[Any]) -> None:
    rows = _rows(batch)
    shared = len(rows["grid"]) == 1  # nothing may appear
    for i, env in enumerate(references):
        episode = env.episode
        state = episode.state
        trigger, goal = env._observation(state)[1:3]
        expected = [state.robot, trigger, goal, state.doors_open, episode.steps, env.episodes]
        assert rows["state"][i] == expected
        assert obstacles_in_arrays(rows["grid"][0 if shared else i], rows["due"][i]) == obstacles_of(env)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(arguments=kinds_of_maze(), seed=st.integers(0, 2**64))
def test_a_batch_is_its_reference(kind: type[Batch], arguments: Arguments, seed: int) -> None:
    """In any small maze with any obstacles, observations, masks, ends and all state agree."""
    _hold(kind, arguments, number=4, seed=seed, steps=40)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("obstacles", ["none", "layout", "random"])
def test_a_long_run_is_its_reference(kind: type[Batch], obstacles: str) -> None:
    """So do three mazes of the paper for 3000 steps, over many episodes."""
    _hold(kind, {"obstacles": obstacles, "max_steps": 100}, number=3, seed=5, steps=3000)


def _rooms(side: int) -> Layout:
    """Return two rooms of a square maze, with pillars to go round."""
    middle = side // 2
    cells = [
        ["X" if r % 4 == 2 and c % 4 == 1 else "T1" if (r, c) == (side - 1, 0) else "." for c in range(side)]
        for r in range(side)
    ]
    cells[0][side - 1] = "G1"
    cells[0][1] = "T2"
    cells[side // 3][middle] = "D1"
    rows = [
        " ".join([*row[:middle], ":" if r == side // 3 else "|", *row[middle:]])
        for r, row in enumerate(cells)
    ]
    return parse_layout("grid\n" + "\n".join(rows) + "\nstart 0,0\ntrigger T1\ngoal G1")


@pytest.mark.parametrize("kind", KINDS)
def test_a_large_maze_is_its_reference(kind: type[Batch]) -> None:
    """64 x 64 cells, whose numbers pass a byte, with many obstacles at a time."""
    layout = _rooms(64)
    arguments = {"layout": layout, "obstacles": "random", "max_steps": 40, "most_obstacles": 40}
    _hold(kind, arguments, number=3, seed=1, steps=90)


@pytest.mark.parametrize("kind", KINDS)
def test_an_environment_is_the_same_in_a_batch_of_any_size(kind: type[Batch]) -> None:
    """Environments 0 to 4 of 300 are those of a batch of 5, resets and all."""
    arguments = {"obstacles": "random", "max_steps": 12}
    batches = [kind(one_of(arguments), number) for number in (5, 300)]
    for batch in batches:
        batch.seed(3)
        batch.reset()
    for actions in random_actions(2, 80, 300):
        shown = []
        for batch in batches:
            given_to = actions[: batch.number]
            stepped = batch.step(given_to if isinstance(batch, MazeBatch) else torch.tensor(given_to))
            over = stepped.terminated | stepped.truncated
            views = batch.reset(over)[0] if over.any() else stepped.observations
            shown.append(views[:5].tolist())
        assert shown[0] == shown[1]


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_names_a_batch(kind: type[Batch]) -> None:
    """Seeding again gives the same episodes, seeding some leaves the others' to go on, and seeds differ."""
    batch = kind(one_of({}), 50)
    batch.seed(4)
    first, second = batch.reset()[0].tolist(), batch.reset()[0].tolist()
    batch.seed(4)
    assert batch.reset()[0].tolist() == first
    assert first != second
    some: Any = np.arange(50) < 10
    some = some if kind is MazeBatch else torch.tensor(some)
    batch.seed(4, some)
    assert batch.reset()[0].tolist() == first[:10] + second[10:]
    batch.seed(5)
    assert batch.reset()[0].tolist() != first


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_wanted_holds_for_one_reset(kind: type[Batch]) -> None:
    """Marks and start given to a reset are those of the episodes that it begins, and no later ones."""
    batch = kind(one_of({}), 40)
    batch.seed(1)
    views = batch.reset(wanted=Wanted(trigger=2, goal=1, start=0))[0]
    assert {tuple(row) for row in views[:, :3].tolist()} == {(0, 2, 1)}
    assert len({tuple(row) for row in batch.reset()[0][:, :3].tolist()}) > 20


@pytest.mark.parametrize("kind", KINDS)
def test_obstacles_that_want_one_cell_come_in_the_order_of_their_time(kind: type[Batch]) -> None:
    """Declared second but due first, the sphere goes first; the cube follows once it has rolled away."""
    obstacles = "obstacles\nC1 cube 0,1 middle #ffffff at step 2\nS1 sphere 0,1 middle #ffffff at step 1"
    layout = parse_layout(f"grid\nT1 . . .\n. . . G1\nstart 0,1\ntrigger T1\ngoal G1\n{obstacles}")
    batch = kind(one_of({"layout": layout, "obstacles": "layout", "start": Cell(0, 1)}), 1)
    batch.seed(0)
    batch.reset()
    beside = []
    for action in (0, 0, 2, 3, 3):  # stay, stay, aside; push, and on
        given_to: Any = np.array([action])
        beside.append(batch.step(given_to if kind is MazeBatch else torch.tensor(given_to)))
    assert [row.observations[0, 7].item() for row in beside] == [0, 0, 3, 0, 3]  # East of the robot
    assert beside[-1].observations[0, 6] == 2  # West of it


def test_both_give_the_same_obstacles() -> None:
    """What is drawn for each episode, numba and PyTorch agree on to the last column."""
    batches = [kind(one_of({"obstacles": "random"}), 200) for kind in KINDS]
    for batch in batches:
        batch.seed(9)
        batch.reset()
    used = np.asarray(batches[0].due) != -2
    slots = [np.asarray(batch.slots) for batch in batches]
    assert (slots[0][used] == slots[1][used]).all()
    assert used.any(axis=0).all()


def test_the_kernel_draws_on_the_way_as_the_reference_does() -> None:
    """The obstacles of 200 episodes, by cell, kind and step, are those of `random_obstacles`."""
    batch = MazeBatch(one_of({"obstacles": "random"}), 200)
    batch.seed(11)
    batch.reset()
    for i in range(200):
        env = one_of({"obstacles": "random"}, i)
        env.reset(seed=11)
        assert env.episode is not None
        expected = [_row(env.layout, obstacle) for obstacle in env.episode.obstacles.values()]
        assert batch.slots[i, : len(expected), [0, 1, 3]].T.tolist() == expected


def _row(layout: Layout, obstacle: Obstacle) -> list[int]:
    return [layout.number(obstacle.cell), int(obstacle.kind == "sphere"), obstacle.appears.step]


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.zeros(3), "actions of type float64 are not possible; give integers of 0 to 3"),
        (np.zeros(3, dtype=bool), "actions of type bool are not possible; give integers of 0 to 3"),
        (
            [0, 1],
            "actions of shape (2,) are not possible; give one for each of the 3 environments, shape (3,)",
        ),
        ([0, 4, 1], "action 4 of environment 1 is not possible; give 0 to 3"),
        ([0, 1, -1], "action -1 of environment 2 is not possible; give 0 to 3"),
    ],
)
def test_bad_actions_are_refused(actions: Any, message: str) -> None:
    """The error names what is wrong and the mend, and no maze has moved."""
    batch = MazeBatch(one_of({}), 3)
    batch.seed(0)
    batch.reset()
    before = batch.state.copy()
    with pytest.raises(UserError) as caught:
        batch.step(actions)
    assert str(caught.value) == message
    assert (batch.state == before).all()


@pytest.mark.parametrize(
    "dtype", [np.int8, np.uint8, np.int16, np.uint16, np.int32, np.uint32, np.int64, np.uint64]
)
def test_any_integers_are_actions(dtype: Any) -> None:
    """Also those that lie apart in memory."""
    batch = MazeBatch(one_of({"trigger": "T4", "goal": "G2", "start": (1, 0)}), 3)
    batch.seed(0)
    batch.reset()
    actions = np.array([1, 9, 3, 9, 0, 9], dtype=dtype)[::2]
    assert batch.step(actions).observations[:, 0].tolist() == [16, 9, 0]


def test_bad_tensors_are_refused() -> None:
    """The pure PyTorch batch looks at type and shape, not at values."""
    batch = TorchMazeBatch(one_of({}), 3)
    batch.reset()
    for wrong in (torch.zeros(3), torch.zeros(2, dtype=torch.int64), torch.zeros(3, dtype=torch.bool)):
        with pytest.raises(UserError, match=r"give an integer for each environment, shape \(3,\)"):
            batch.step(wrong)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("number", [0, -1, 1.5, None])
def test_a_batch_has_a_number(kind: type[Batch], number: Any) -> None:
    """None and fewer than one are refused."""
    with pytest.raises(UserError, match=f"num_envs {number!r} is not possible; give an integer of 1 or more"):
        kind(one_of({}), number)


def test_a_maze_without_a_way_is_refused() -> None:
    """Random obstacles appear on a way, so that there must be one."""
    layout = load_layout("two_rooms")
    shut = Layout(
        "shut", 1, 4, frozenset(), frozenset({(Cell(0, 1), Cell(0, 2))}), frozenset(), {"T1": Cell(0, 1)},
        {"G1": Cell(0, 3)}, {}, Cell(0, 0), "T1", "G1",
    )  # fmt: skip
    with pytest.raises(UserError, match="no way leads from T1 to G1 in layout 'shut'"):
        MazeBatch(one_of({"layout": shut, "obstacles": "random", "most_obstacles": 1}), 1)
    assert MazeBatch(one_of({"layout": layout, "obstacles": "random"}), 1).number == 1


def test_65536_mazes_fit_in_little_memory() -> None:
    """A maze of 64 cells with six random obstacles takes less than 300 bytes."""
    number = 1 << 16
    batch = MazeBatch(one_of({"obstacles": "random"}), number)
    batch.seed(0)
    batch.reset()
    stepped = batch.step(np.zeros(number, dtype=np.int64))
    arrays = (batch.state, batch._grid, batch.slots, batch.due, batch.keys)
    assert sum(array.nbytes for array in arrays) < 300 * number
    assert stepped.observations.shape == (number, 8)


def test_an_empty_world_never_looks_for_obstacles() -> None:
    """The step by which to look is out of reach where nothing can appear, or nothing is left."""
    batch = MazeBatch(one_of({}), 2)
    batch.seed(0)
    batch.reset()
    assert batch.state[:, 5].tolist() == [NEVER, NEVER]


def test_importing_the_package_loads_no_kernel() -> None:
    """`import worlds` and its environment leave numba and PyTorch alone."""
    code = "import worlds, worlds.registration, sys; print(sorted({'numba', 'torch'} & set(sys.modules)))"
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.strip() == "[]"
