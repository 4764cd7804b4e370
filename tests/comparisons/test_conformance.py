"""The conformance kit accepts ours and refuses, by name, what breaks a promise."""

import random
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from comparisons.conformance import (
    ConformanceError,
    check_backend,
    check_graph,
    check_learner,
    check_world,
    conformance_maze,
)
from hierarchy import GroundGraph, TaskGraph, two_rooms
from perception import NOTHING, Detection, View, load_backend
from perception.frames import fresh_views
from planners import MaxQ
from worlds import ACTIONS, TransitionModel, load_layout, maze_model
from worlds.camera import Camera

MAZE = load_layout("two_rooms")
MODEL = maze_model(MAZE)


def test_ours_conform() -> None:
    """The paper's world and graph, MAXQ-0 and the Hough backend pass."""
    check_world(MODEL)
    check_graph(two_rooms(MAZE), MODEL)
    check_learner(MaxQ)
    camera = Camera(pixels=96)
    check_backend(load_backend("hough", camera), list(fresh_views(MAZE, 6, seed=1, camera=camera)))


def test_a_world_without_starts_or_with_endless_rewards_is_refused() -> None:
    """Each fault is named."""
    arrays = MODEL.successors, MODEL.rewards
    with pytest.raises(ConformanceError, match="no state is a start"):
        check_world(TransitionModel(MODEL.index, ACTIONS, *arrays, np.zeros_like(MODEL.starts)))
    rewards = MODEL.rewards.copy()
    rewards[:, 1] = np.inf
    with pytest.raises(ConformanceError, match="not finite in robot = 0,0"):
        check_world(TransitionModel(MODEL.index, ACTIONS, arrays[0], rewards, MODEL.starts))


def test_a_graph_that_cannot_run_is_refused() -> None:
    """The findings are told; so is a graph of another world."""
    graph = TaskGraph("wrong", MODEL.index.variables, ACTIONS)
    robot, _, goal, _ = graph.variables
    graph.task("Root", until=robot.eq(goal), uses=[robot], do="North South")
    with pytest.raises(ConformanceError, match="add 'goal' to the uses of Root"):
        check_graph(graph, MODEL)
    with pytest.raises(ConformanceError, match="different state variables"):
        check_graph(two_rooms(conformance_maze()), MODEL)


class Careless(MaxQ):
    """Draws from a global generator."""

    def __init__(self, grounded: GroundGraph, seed: Sequence[int]) -> None:
        super().__init__(grounded, (*seed, random.getrandbits(32)))


class Lazy(MaxQ):
    """Forgets what it learnt."""

    def value(self, task: int, state: int) -> float:
        """Return half of what was learnt."""
        return super().value(task, state) / 2


class Lost(MaxQ):
    """Never arrives."""

    def greedy_steps(self, task: int, state: int, limit: int = 1000) -> int | None:
        """Follow the policy for no step at all."""
        return super().greedy_steps(task, state, min(limit, 0))


@pytest.mark.parametrize(
    ("learner", "message"),
    [
        (Careless, "the same seed gave different values"),
        (Lazy, "it values robot = .* at -"),
        (Lost, "its policy takes None steps"),
    ],
)
def test_a_learner_that_breaks_a_promise_is_refused(learner: type[MaxQ], message: str) -> None:
    """Seeds, values and policies are held to what is known."""
    with pytest.raises(ConformanceError, match=message):
        check_learner(learner, episodes=300)


class Moody:
    """A backend whose answer depends on the company."""

    name = "moody"
    needs_frames = True

    def __init__(self, fault: str) -> None:
        self.fault = fault

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Return detections that are wrong in one way."""
        found = [NOTHING] * len(views)
        if self.fault == "short":
            return found[1:]
        if self.fault == "company" and len(views) > 1:
            found[0] = replace(NOTHING, confidence=0.5)
        if self.fault == "paints" and views and views[0].frame is not None:
            views[0].frame[:] = 0
        return found


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("short", "2 views got 1 detections"),
        ("company", "view 0 got another detection alone"),
        ("paints", "the frame of view 0 was changed"),
    ],
)
def test_a_backend_that_breaks_a_promise_is_refused(fault: str, message: str) -> None:
    """Number, order and frames are held."""
    views = [View(np.full((4, 4, 3), 9, np.uint8), NOTHING) for _ in range(2)]
    with pytest.raises(ConformanceError, match=message):
        check_backend(Moody(fault), views)
