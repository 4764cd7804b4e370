from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import pytest

from hierarchy import TaskGraph, TaskGraphError, ground
from planners import Exploration, HarmonicRate, Settings, recursive_optimum
from planners.black_box import BlackBoxMaxQ, ground_black_box
from worlds import UserError, Variable, WorldError
from worlds.black_box import BlackBox
from worlds.gym_model import gym_model

CLIFF = (Variable("row", (0, 1, 2, 3)), Variable("col", tuple(range(12))))
CLIFF_ACTIONS = ("Up", "Right", "Down", "Left")
LAKE_ACTIONS = ("Left", "Down", "Right", "Up")
SETTINGS = Settings(rate=HarmonicRate(20), exploration=Exploration(30))


class Closed(gymnasium.Env[Any, Any]):
    """An environment with everything but reset and step hidden."""

    def __init__(self, name: str, **options: Any) -> None:
        self._inner = gymnasium.make(name, **options)
        self.observation_space = self._inner.observation_space
        self.action_space = self._inner.action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Begin an episode."""
        return self._inner.reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, Any]:
        """Carry out an action."""
        return self._inner.step(action)


def _cell(number: int) -> Sequence[int]:
    return divmod(int(number), 12)


def _cliff(**options: Any) -> BlackBox:
    return BlackBox(Closed("CliffWalking-v1", **options), CLIFF, _cell, CLIFF_ACTIONS)


def _cliff_graph() -> TaskGraph:
    """Return Root -> Climb, from the lowest row, and Home, to the last cell."""
    graph = TaskGraph("cliff", CLIFF, CLIFF_ACTIONS)
    row, col = graph.variables
    home_cell = row.eq(3) & col.eq(11)
    climb = graph.task("Climb", until=row.ne(3) | col.eq(11), uses=[row, col], do=CLIFF_ACTIONS)
    home = graph.task("Home", until=home_cell, uses=[row, col], do=CLIFF_ACTIONS)
    graph.task("Root", until=home_cell, uses=[row, col], do=[climb(), home().when(row.ne(3))])
    return graph


def _lake(holes: Sequence[int] = (5, 7, 11, 12), *, slippery: bool = False) -> tuple[TaskGraph, BlackBox]:
    """Return a lake and a flat root, which ends at the goal and at `holes`."""
    cell = Variable("cell", tuple(range(16)))
    env = Closed("FrozenLake-v1", is_slippery=slippery)
    box = BlackBox(env, [cell], lambda n: (n,), LAKE_ACTIONS)
    graph = TaskGraph("lake", box.index.variables, box.actions)
    (at,) = graph.variables
    graph.task("Root", until=at.isin([*holes, 15]), uses=[at], do=box.actions)
    return graph, box


def _exact(graph: TaskGraph, name: str, box: BlackBox, **options: Any) -> tuple[float, float]:
    """Return value and steps of the start by dynamic programming on the model that the box hides."""
    decode = _cell if name.startswith("Cliff") else (lambda n: (n,))
    model = gym_model(
        gymnasium.make(name, **options), variables=box.index.variables, decode=decode, actions=box.actions
    )
    grounded = ground(graph, model)
    solution = recursive_optimum(grounded, gamma=0.9 if "Lake" in name else 1.0)
    (start,) = np.flatnonzero(model.starts)
    root = grounded.root
    return float(solution.value[root, start]), float(solution.steps[root, start])


def test_two_tasks_learn_the_shortest_way_along_the_cliff() -> None:
    """Value and greedy steps from the start equal the exact solution of the model that is hidden."""
    graph, box = _cliff_graph(), _cliff()
    learner = BlackBoxMaxQ(graph, box, seed=(3,), settings=SETTINGS)
    learner.learn(episodes=400)
    route = learner.greedy_episode()
    value, steps = _exact(graph, "CliffWalking-v1", box)
    assert steps == 13
    assert route is not None
    assert len(route) == steps
    assert learner.value(learner.grounded.root, box.reset()) == pytest.approx(value, abs=0.01)


def test_a_flat_root_learns_the_lake() -> None:
    """Where the way ends in holes, too, the learnt way is as short, and worth as much, as the exact one."""
    graph, box = _lake()
    settings = Settings(gamma=0.9, tie=0.001)
    learner = BlackBoxMaxQ(graph, box, seed=(1,), settings=settings)
    learner.learn(episodes=500)
    route = learner.greedy_episode()
    value, steps = _exact(graph, "FrozenLake-v1", box, is_slippery=False)
    assert route is not None
    assert len(route) == steps == 6
    assert learner.value(learner.grounded.root, 0) == pytest.approx(value, abs=0.01)


def test_a_slippery_episode_repeats_with_its_seed() -> None:
    """Chance is the environment's, seeded at each reset; a greedy episode in between changes nothing."""
    counts = []
    for measured in (False, True):
        graph, box = _lake(slippery=True)
        learner = BlackBoxMaxQ(graph, box, seed=(5,))
        counts.append(learner.learn(40, after_each=learner.greedy_episode if measured else None))
    assert counts[0] == counts[1]
    assert len(set(counts[0])) > 1


def test_a_truncated_episode_is_given_up() -> None:
    """Cut episodes have the length of the limit, teach what went before, and do not stop the learning."""
    learner = BlackBoxMaxQ(_cliff_graph(), _cliff(max_episode_steps=60), seed=(2,), settings=SETTINGS)
    counts = learner.learn(episodes=400)
    assert counts[0] == max(counts) == 60
    assert learner.episodes[learner.grounded.root] == 400
    route = learner.greedy_episode()
    assert route is not None
    assert len(route) == 13


def test_a_task_that_goes_on_after_the_end_is_refused() -> None:
    """A hole that the root's until leaves out ends the episode, and the message names it."""
    graph, box = _lake(holes=(5, 7, 11))
    with pytest.raises(UserError, match="ended the episode in cell = 12"):
        BlackBoxMaxQ(graph, box, seed=(1,)).learn(500)


def test_each_state_has_its_own_leaf_value() -> None:
    """Rewards are unknown, so no two states share a primitive action's value."""
    grounded = ground_black_box(_cliff_graph(), _cliff())
    leaves = [node.leaf for node in grounded.nodes if node.leaf is not None]
    assert [leaf.rows for leaf in leaves] == [48] * 4
    assert all((leaf.projection == np.arange(48)).all() for leaf in leaves)


def test_what_needs_the_model_is_refused() -> None:
    """Exact solutions, working spaces, chosen starts and jumps are refused, each with its mend."""
    graph, box = _cliff_graph(), _cliff()
    grounded = ground_black_box(graph, box)
    with pytest.raises(UserError, match="a black box shows none"):
        recursive_optimum(grounded)
    learner = BlackBoxMaxQ(graph, box, seed=(1,))
    with pytest.raises(UserError, match=r"call learn\(episodes\)"):
        learner.train(grounded.root, [0], 1)
    with pytest.raises(UserError, match="the state it is in"):
        learner.greedy_steps(grounded.root, 0)
    fenced = TaskGraph("fenced", CLIFF, CLIFF_ACTIONS)
    row, col = fenced.variables
    fenced.task("Root", until=col.eq(11), within=row.ne(3), uses=[row, col], do=CLIFF_ACTIONS)
    with pytest.raises(TaskGraphError, match="task Root: its working space"):
        ground_black_box(fenced, box)


def test_faults_that_no_model_could_mend_are_found() -> None:
    """A misspelt child and a guard that never holds are refused; so is a graph of another world."""
    row, col = TaskGraph("wrong", CLIFF, CLIFF_ACTIONS).variables
    misspelt = TaskGraph("misspelt", CLIFF, CLIFF_ACTIONS)
    misspelt.task("Root", until=col.eq(11), uses=[row, col], do="Up Rihgt")
    with pytest.raises(TaskGraphError, match="did you mean 'Right'"):
        ground_black_box(misspelt, _cliff())
    never = TaskGraph("never", CLIFF, CLIFF_ACTIONS)
    go = never.task("Go", until=col.eq(11), uses=[col], do=CLIFF_ACTIONS)
    never.task("Root", until=row.eq(0), uses=[row, col], do=[go().when(col.eq(11)), "Up"])
    with pytest.raises(TaskGraphError, match="the child can never run"):
        ground_black_box(never, _cliff())
    with pytest.raises(TaskGraphError, match="not of this world"):
        ground_black_box(_lake()[0], _cliff())


def test_observations_and_actions_must_fit() -> None:
    """Values out of a variable's domain, or too few, and too few names of actions are told."""
    env = Closed("CliffWalking-v1")
    with pytest.raises(WorldError, match="col = 0, which is none of its values"):
        BlackBox(env, (CLIFF[0], Variable("col", (1, 2))), _cell).reset()
    with pytest.raises(WorldError, match="give a value each for row, col"):
        BlackBox(env, CLIFF, lambda n: (n,)).reset()
    with pytest.raises(WorldError, match="2 names for 4 actions"):
        BlackBox(env, CLIFF, _cell, ["Up", "Down"])
    assert BlackBox(env, CLIFF, _cell).actions == ("action0", "action1", "action2", "action3")
    pendulum = gymnasium.make("Pendulum-v1")
    with pytest.raises(WorldError, match="not discrete"):
        BlackBox(pendulum, CLIFF, _cell)
