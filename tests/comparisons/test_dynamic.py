"""Random episodes, held to the oracle."""

import pytest

from comparisons.dynamic import MOST_OBSTACLES, Tally, judge, random_episode
from comparisons.eyes import Sight
from comparisons.learning import PairLearner
from comparisons.robot import Robot, Run
from hierarchy import checked, two_rooms
from perception.truth import Truth
from planners import LocalRule, Replanner, Replanning
from worlds import Cell, Episode, Obstacle, Outcome, load_layout, maze_model

MAZE = load_layout("two_rooms")


@pytest.fixture(scope="module")
def learnt() -> PairLearner:
    """Return a learner of the pair (T4, G2), learnt."""
    learner = PairLearner(MAZE, checked(two_rooms(MAZE), maze_model(MAZE)), "T4", "G2", seed=0)
    learner.learn()
    return learner


def carry_out(learnt: PairLearner, episode: Episode) -> tuple[Run, Tally]:
    """Run an episode under replanning, told the truth, and judge it."""
    oracle, local = Replanner(MAZE, learnt.grounded), LocalRule(MAZE, learnt.learner)
    robot = Robot(MAZE, learnt.grounded, Replanning(oracle, learnt.learner), Sight(MAZE, Truth()))
    run, tally = robot.run(episode), Tally()
    tally.add(run, [judge(oracle, local, met) for met in run.encounters if met.affordance.on_route], oracle)
    return run, tally


def test_an_episode_is_named_by_its_seed_and_number() -> None:
    """The same name gives the same episode, another name another."""
    episodes = [random_episode(MAZE, seed, n) for seed, n in ((1, 2), (1, 2), (1, 3), (2, 2))]
    specs = [(e.state.robot, t, g, tuple(e.obstacles.values())) for e, t, g in episodes]
    assert specs[0] == specs[1]
    assert len(set(specs)) == 3


def test_episodes_keep_to_their_bounds() -> None:
    """One to six obstacles, none on the start, the trigger or the goal; every pair comes up."""
    pairs, counts = set(), set()
    for number in range(200):
        episode, trigger, goal = random_episode(MAZE, 0, number)
        marks = {MAZE.triggers[trigger], MAZE.goals[goal], MAZE.cells[episode.state.robot]}
        assert not marks & {obstacle.cell for obstacle in episode.obstacles.values()}
        pairs.add((trigger, goal))
        counts.add(len(episode.obstacles))
    assert len(pairs) == 16
    assert counts == set(range(1, MOST_OBSTACLES + 1))


def test_replanning_is_proved_optimal_where_the_local_rule_is_refuted(learnt: PairLearner) -> None:
    """A cube two cells ahead on a straight way to T4: stepping back South or aside is judged by proof."""
    obstacles = [Obstacle("C1", "cube", Cell(4, 1))]
    _, tally = carry_out(learnt, Episode(MAZE, "T4", "G2", Cell(2, 1), obstacles))
    (verdict,) = tally.verdicts
    assert verdict.replanned.optimal
    assert verdict.replanned.faults == ()
    assert verdict.local is not None
    assert (verdict.local.optimal, verdict.local.loss) == (False, 2)  # North, the first of three equals
    assert tally.counterexample() is verdict
    assert tally.local_rule_by() == {"cube, 2 ahead": (1, 0)}
    assert (tally.local_optimal, tally.replanned_optimal) == (0, 1)


def test_a_subtask_without_a_way_is_counted_apart(learnt: PairLearner) -> None:
    """The cube before D2 leaves GotoDoor(D2) nothing: no affordance to judge, and the robot arrives."""
    run, tally = carry_out(
        learnt, Episode(MAZE, "T4", "G2", MAZE.start, [Obstacle("C1", "cube", Cell(5, 3))])
    )
    assert run.outcome is Outcome.REACHED
    assert tally.boxed_in == 1
    assert tally.verdicts == []


def test_the_example_run_gives_table_4(learnt: PairLearner) -> None:
    """Replanning agrees with table 4, and every row is proved optimal for the whole task as well."""
    episode = Episode(MAZE, "T4", "G2", MAZE.start, MAZE.obstacles)
    run, tally = carry_out(learnt, episode)
    rows = {e.obstacle: (learnt.grounded.nodes[e.task].task, e.affordance.action) for e in run.encounters}
    north, south, east = 0, 1, 3
    assert rows == {
        "S1": ("GotoTrigger", south),
        "C1": ("GotoTrigger", east),
        "S2": ("GotoGoal", north),
        "C3": ("GotoGoal", east),
    }
    assert tally.replanned_optimal == tally.local_optimal == 4
    assert tally.globally_optimal(Replanner(MAZE, learnt.grounded)) == 4


def test_no_route_is_told_apart_from_no_way_at_all(learnt: PairLearner) -> None:
    """Cubes in both doors' grids leave no way; a wall of cubes in room B leaves one around through room A."""
    both = [Obstacle("C1", "cube", Cell(2, 3)), Obstacle("C2", "cube", Cell(5, 3))]
    run, tally = carry_out(learnt, Episode(MAZE, "T4", "G2", MAZE.start, both))
    assert (run.outcome, tally.hopeless) == (Outcome.NO_ROUTE, 1)
    wall = [Obstacle(f"C{col}", "cube", Cell(4, col)) for col in range(4, 8)]
    run, tally = carry_out(learnt, Episode(MAZE, "T4", "G2", MAZE.start, wall))
    assert (run.outcome, tally.hopeless) == (Outcome.NO_ROUTE, 0)


@pytest.mark.slow
def test_replanning_is_optimal_in_every_random_episode(learnt: PairLearner) -> None:
    """In 150 episodes of the learnt pair every affordance is proved, and every episode has its end."""
    total = Tally()
    oracle, local = Replanner(MAZE, learnt.grounded), LocalRule(MAZE, learnt.learner)
    robot = Robot(MAZE, learnt.grounded, Replanning(oracle, learnt.learner), Sight(MAZE, Truth()))
    for number in range(150):
        drawn, _, _ = random_episode(MAZE, 5, number)
        start = MAZE.cells[drawn.state.robot]
        if start == MAZE.triggers["T4"]:
            continue
        run = robot.run(Episode(MAZE, "T4", "G2", start, drawn.obstacles.values()))
        met = [encounter for encounter in run.encounters if encounter.affordance.on_route]
        total.add(run, [judge(oracle, local, encounter) for encounter in met], oracle)
    assert total.replanned_optimal == len(total.verdicts) > 100
    assert 0 < total.local_optimal < len(total.verdicts)
    assert total.outcomes[Outcome.WRONG_SHAPE] == total.misread == 0
    assert sum(total.outcomes.values()) == total.episodes
