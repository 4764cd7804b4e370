"""The option-critic in the paper's experiment."""

from __future__ import annotations

import pytest

from comparisons.dynamic import judge, random_episode
from comparisons.eyes import Sight
from comparisons.learning import PairLearner
from comparisons.neural import ask_neural, learn_neural
from comparisons.outputs import untracked
from comparisons.results import affordances
from comparisons.robot import Robot
from hierarchy import checked, two_rooms
from perception.truth import Truth
from planners import LocalRule, Replanner, Replanning
from worlds import load_layout, maze_model

MAZE = load_layout("two_rooms")


@pytest.mark.slow
def test_one_option_critic_affords_what_the_paper_says() -> None:
    """After 100,000 steps it takes shortest ways from all starts, and gives table 4's affordances."""
    grounded = checked(two_rooms(MAZE), maze_model(MAZE))
    oracle = Replanner(MAZE, grounded)
    pair = PairLearner(MAZE, grounded, MAZE.trigger, MAZE.goal, seed=0, runs=1)
    pair.learn()
    verdicts = []
    for number in range(300):
        episode, *which = random_episode(MAZE, 0, number)
        if which == [MAZE.trigger, MAZE.goal]:
            robot = Robot(MAZE, grounded, Replanning(oracle, pair.learner), Sight(MAZE, Truth()))
            local = LocalRule(MAZE, pair.learner)
            met = [one for one in robot.run(episode).encounters if one.affordance.on_route]
            verdicts += [verdict for one in met if (verdict := judge(oracle, local, one)) is not None]
    found = ask_neural(MAZE, oracle, learn_neural(grounded, 0, untracked), verdicts)
    assert found.optimal_starts == found.starts == 496
    assert found.asked == len(verdicts) > 0
    assert 0 < found.same <= found.asked
    assert 0 < found.optimal <= found.asked
    rows = affordances(MAZE, grounded, found.example)
    assert {row["obstacle"]: row["action"] for row in rows} == {
        "C1": "East",
        "C2": None,
        "C3": "East",
        "S1": "South",
        "S2": "North",
        "S3": None,
    }
