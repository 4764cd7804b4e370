"""The tabular option-critic: updates worked by hand, and worlds that it learns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners import flat_optimum
from planners.option_critic_tabular import (
    TabularOptionCritic,
    TabularOptionCriticConfig,
    softmax,
    upon_arrival,
)
from worlds import StateIndex, TransitionModel, UserError, Variable
from worlds.four_rooms import FIRST_GOAL, four_rooms_model, starts_for

NUMBERS = st.lists(st.floats(-100, 100), min_size=1, max_size=5).map(np.array)


def corridor(length: int = 3) -> tuple[TransitionModel, np.ndarray]:
    """Return a corridor whose right end is worth 1, and where it ends."""
    here = np.arange(length)
    moves = np.stack([np.maximum(here - 1, 0), np.minimum(here + 1, length - 1)], axis=1)
    index = StateIndex((Variable("x", tuple(range(length))),))
    rewards = (moves == length - 1).astype(float)
    return TransitionModel(index, ("left", "right"), moves, rewards, here < 1), here == length - 1


def four_rooms(reward: str) -> tuple[TransitionModel, np.ndarray]:
    """Return the published four rooms and their end, by the published reward or at a cost for every step."""
    model = four_rooms_model()
    goal = model.index.column("robot") == model.index.column("goal")
    rewards = goal[model.outcomes].astype(float) if reward == "goal" else np.full(model.outcomes.shape, -1.0)
    starts = starts_for(model.index, FIRST_GOAL)
    return TransitionModel(
        model.index, model.actions, model.outcomes, rewards, starts, probabilities=model.probabilities
    ), goal


def learner_of_two(**settings: float) -> TabularOptionCritic:
    """Return a learner of two options on a corridor of three, with values of its own in the middle."""
    config = TabularOptionCriticConfig(options=2, gamma=0.5, temperature=1.0, **settings)
    learner = TabularOptionCritic(*corridor(), seed=(1,), config=config)
    learner.q_u[0, 1], learner.q_u[1, 1] = [1.0, 3.0], [4.0, 8.0]  # Q = 2 and 6 under even policies
    return learner


def test_a_step_is_worth_its_reward_and_what_going_on_or_ending_is_worth_on_arrival() -> None:
    """Q_U goes half of the way to r + gamma ((1 - beta) Q(s', w) + beta max Q(s', .)), beta that of s'."""
    learner = learner_of_two(critic_rate=0.5)
    learner.endings[0] = [50.0, np.log(1 / 3), 50.0]  # it ends in one of four cases in the middle
    learner.update(0, 0, 1, reward=-1.0, after=1)
    assert learner.q_u[0, 0, 1] == pytest.approx(0.5 * (-1 + 0.5 * (0.75 * 2 + 0.25 * 6)))


def test_nothing_follows_the_end() -> None:
    """At a terminal state only the reward counts, and no termination is taught there."""
    learner = learner_of_two(critic_rate=0.5)
    learner.q_u[:, 2] = 100.0
    learner.update(1, 0, 1, reward=1.0, after=2)
    assert learner.q_u[0, 1, 1] == 3.0 + 0.5 * (1.0 - 3.0)
    assert not learner.endings.any()


def test_the_policy_climbs_the_advantage_of_what_was_done() -> None:
    """The preference of an action rises by rate x (Q_U - Q) x (1 - chance), the others fall by as much."""
    learner = learner_of_two(critic_rate=0.0, actor_rate=0.1)
    learner.update(1, 1, 1, reward=0.0, after=0)
    np.testing.assert_allclose(learner.preferences[1, 1], [-0.1 * 2 * 0.5, 0.1 * 2 * 0.5])
    assert not learner.preferences[0].any()


def test_without_a_baseline_the_policy_climbs_the_value() -> None:
    """Q_U itself stands in for the advantage then."""
    learner = learner_of_two(critic_rate=0.0, actor_rate=0.1, baseline=False)
    learner.update(1, 1, 1, reward=0.0, after=0)
    np.testing.assert_allclose(learner.preferences[1, 1], [-0.1 * 8 * 0.5, 0.1 * 8 * 0.5])


@pytest.mark.parametrize(("option", "ahead"), [(0, 2.0 - 6.0), (1, 0.0)])
def test_an_option_learns_to_end_where_another_is_worth_more(option: int, ahead: float) -> None:
    """The logit falls by rate x beta (1 - beta) x what going on is ahead by, in the state of arrival."""
    learner = learner_of_two(critic_rate=0.0, termination_rate=0.4)
    learner.update(0, option, 1, reward=0.0, after=1)
    wanted = np.zeros((2, 3))
    wanted[option, 1] = -0.4 * 0.25 * ahead
    np.testing.assert_allclose(learner.endings, wanted)


def test_a_deliberation_cost_makes_going_on_better() -> None:
    """Even the best option, for which nothing is lost by ending, learns to go on."""
    learner = learner_of_two(critic_rate=0.0, termination_rate=0.4, deliberation=0.5)
    learner.update(0, 1, 1, reward=0.0, after=1)
    assert learner.endings[1, 1] == pytest.approx(-0.4 * 0.25 * 0.5)


def test_it_learns_a_corridor_to_the_optimum() -> None:
    """From the left end its greedy route is the shortest."""
    learner = TabularOptionCritic(*corridor(8), seed=(3,))
    learner.train(300)
    assert learner.greedy_route(0) == list(range(8))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_it_learns_four_rooms_as_published(seed: int) -> None:
    """After a thousand episodes they take about 8.39 steps, the exact optimum's mean."""
    model, goal = four_rooms("goal")
    steps = TabularOptionCritic(model, goal, seed=(seed,)).train(1300)
    best = -flat_optimum(four_rooms("step")[0], goal).value[model.starts].mean()
    assert best == pytest.approx(8.39, abs=0.005)
    assert np.mean(steps[:50]) > 5 * best
    assert 0.93 * best < np.mean(steps[-500:]) < 1.15 * best


def test_seeds_name_runs() -> None:
    """The same seed gives the same bits, in one go or in two; another seed gives others."""
    model, goal = four_rooms("goal")
    config = TabularOptionCriticConfig(max_steps=40)
    one, two, other = (TabularOptionCritic(model, goal, (seed,), config) for seed in (5, 5, 6))
    assert one.train(20) == two.train(8) + two.train(12) != other.train(20)
    for name in ("q_u", "preferences", "endings"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def test_an_endless_route_is_told() -> None:
    """Where the likeliest actions lead nowhere there is no route."""
    learner = TabularOptionCritic(*corridor(), seed=(1,))
    learner.preferences[..., 0] = 1.0
    assert learner.greedy_route(0, limit=20) is None


@given(NUMBERS, st.floats(0, 1))
def test_arriving_is_worth_something_between_going_on_and_the_best(values: np.ndarray, ending: float) -> None:
    """U is a mean of the two."""
    found = upon_arrival(values, 0, ending)
    assert values[0] - 1e-9 <= found <= values.max() + 1e-9


@given(NUMBERS, st.floats(-1e3, 1e3))
def test_a_softmax_does_not_see_what_is_added_to_all(values: np.ndarray, more: float) -> None:
    """Its probabilities sum to 1, and only differences count."""
    found = softmax(values)
    assert found.sum() == pytest.approx(1)
    np.testing.assert_allclose(found, softmax(values + more), atol=1e-9)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"options": 0}, "options: 0 is not possible; give at least 1"),
        ({"gamma": 1.5}, "gamma: 1.5 is not possible; give 0 to 1"),
        ({"temperature": 0.0}, "temperature: 0.0 is not possible; give more than 0"),
    ],
)
def test_numbers_out_of_range_are_refused(settings: dict[str, float], told: str) -> None:
    """The message names the setting and the mend."""
    with pytest.raises(UserError) as caught:
        TabularOptionCriticConfig(**settings)
    assert told in str(caught.value)


def test_a_world_needs_a_start_that_is_not_its_end() -> None:
    """A world that is over before it begins is refused."""
    model, _ = corridor()
    with pytest.raises(UserError, match="a state to begin in that is not terminal"):
        TabularOptionCritic(model, np.ones(3, bool), seed=(1,))
