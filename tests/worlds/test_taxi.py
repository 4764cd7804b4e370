from typing import Any

import gymnasium
import numpy as np
import pytest

from hierarchy import check, checked
from hierarchy.taxi import taxi_graph
from planners import (
    Exploration,
    LearningRate,
    MaxQ,
    Settings,
    flat_field,
    flat_optimum,
    polled_action,
    recursive_optimum,
)
from worlds import Cell, TransitionModel, UserError
from worlds.gym_model import gym_model
from worlds.taxi import SITES, TAXI_ACTIONS, taxi_model

R, G, Y, B = SITES.values()


def _after(model: TransitionModel, state: tuple[Any, ...], action: str) -> tuple[tuple[Any, ...], float]:
    """Return the next state and the reward of an action without chance."""
    number, place = model.index.number(state), model.actions.index(action)
    return model.index.state(int(model.successors[number, place])), float(model.rewards[number, place])


@pytest.fixture(scope="module")
def dry() -> TransitionModel:
    """Return Dietterich's Taxi without rain."""
    return taxi_model()


def test_taxi_has_the_published_size(dry: TransitionModel) -> None:
    """500 states until the passenger is delivered, 6 actions: 3000 values of flat Q; 400 starts."""
    waiting_or_aboard = dry.index.column("passenger") < 5
    assert waiting_or_aboard.sum() * len(dry.actions) == 3000
    assert dry.starts.sum() == 25 * 4 * 4
    assert dry.reachable().sum() == 500 + 4  # and the four ends: the taxi at the destination


@pytest.mark.parametrize(
    ("cell", "action", "to"),
    [
        ((0, 1), "East", (0, 1)),
        ((0, 2), "West", (0, 2)),
        ((2, 1), "East", (2, 2)),
        ((3, 0), "East", (3, 0)),
        ((4, 2), "East", (4, 2)),
        ((4, 3), "West", (4, 3)),
        ((3, 3), "North", (2, 3)),
        ((4, 3), "South", (4, 3)),
        ((0, 3), "North", (0, 3)),
        ((1, 4), "East", (1, 4)),
    ],
)
def test_walls_stop_the_taxi(
    dry: TransitionModel, cell: tuple[int, int], action: str, to: tuple[int, int]
) -> None:
    """A move costs 1 whether or not a wall or the border stops it."""
    assert _after(dry, (Cell(*cell), G, Y), action) == ((Cell(*to), G, Y), -1.0)


def test_pickup_and_putdown_cost_ten_where_they_are_illegal(dry: TransitionModel) -> None:
    """Dietterich's rules: putting down anywhere but at the destination is illegal."""
    assert _after(dry, (R, R, B), "Pickup") == ((R, "aboard", B), -1.0)
    assert _after(dry, (R, R, R), "Pickup") == ((R, "aboard", R), -1.0)
    for state, action in (
        ((G, R, B), "Pickup"),
        ((R, "aboard", B), "Pickup"),
        ((R, "aboard", B), "Putdown"),
        ((Cell(2, 2), "aboard", B), "Putdown"),
        ((B, R, B), "Putdown"),
    ):
        assert _after(dry, state, action) == (state, -10.0)
    assert _after(dry, (B, "aboard", B), "Putdown") == ((B, "delivered", B), 20.0)


def test_a_delivered_passenger_stays_delivered(dry: TransitionModel) -> None:
    """Nothing leads out of an end, and no action's reward is new there."""
    ended = dry.index.column("passenger") == 5
    for action in range(len(TAXI_ACTIONS)):
        assert (dry.successors[ended, action] == np.flatnonzero(ended)).all()
        assert set(dry.rewards[ended, action]) <= set(dry.rewards[~ended, action])


def test_gymnasium_s_rules_differ_at_the_sites() -> None:
    """There, a passenger may be put down at any site, and does not begin at the destination."""
    model = taxi_model(rules="gymnasium")
    assert _after(model, (R, "aboard", B), "Putdown") == ((R, R, B), -1.0)
    assert _after(model, (Cell(2, 2), "aboard", B), "Putdown") == ((Cell(2, 2), "aboard", B), -10.0)
    assert model.starts.sum() == 300


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"rain": 1.2}, "rain is a probability, not 1.2"),
        ({"fickle": -0.1}, "fickle is a probability, not -0.1"),
        ({"rules": "mine"}, "no rules 'mine'; there are 'dietterich' and 'gymnasium'"),
    ],
)
def test_wrong_words_are_refused(words: dict[str, Any], message: str) -> None:
    """The error says what may be given."""
    with pytest.raises(UserError, match=message):
        taxi_model(**words)


@pytest.mark.parametrize("rain", [0.0, 0.2])
@pytest.mark.parametrize("fickle", [0.0, 0.3])
def test_the_task_graph_runs_on_every_taxi(rain: float, fickle: float) -> None:
    """Ours and Gymnasium's, dry and rainy, with a firm and a fickle passenger: no findings."""
    env = gymnasium.make("Taxi-v4", is_rainy=rain > 0, fickle_passenger=fickle > 0)
    for model in (taxi_model(rain=rain, fickle=fickle), gym_model(env)):
        assert check(taxi_graph(model), model) == ()


def test_the_task_graph_loses_nothing_and_is_learnt(dry: TransitionModel) -> None:
    """Greedy steps are the fewest, and values exact, from every one of the 400 starts."""
    grounded = checked(taxi_graph(dry), dry)
    settings = Settings(rate=LearningRate(every=100), exploration=Exploration(half=100))
    learner = MaxQ(grounded, seed=(3,), settings=settings)
    starts = np.flatnonzero(dry.starts).tolist()
    learner.train(grounded.root, starts, episodes=3000)
    best = flat_field(dry, grounded.nodes[grounded.root].terminal).distance
    assert [learner.greedy_steps(grounded.root, state) for state in starts] == best[starts].tolist()
    values = [learner.value(grounded.root, state) for state in starts]
    assert values == pytest.approx((21 - best[starts]).tolist(), abs=0.01)


def test_what_a_fickle_passenger_costs_and_polling_saves() -> None:
    """In the rain, on average: 4.17 recursively, 6.61 at best, and 6.61 when the exact values are polled."""
    model = taxi_model(rain=0.2, fickle=0.3)
    grounded = checked(taxi_graph(model), model)
    solution, root = recursive_optimum(grounded), grounded.nodes[grounded.root]
    learner = MaxQ(grounded, (0,), Settings(tie=1e-9))
    waiting = np.flatnonzero(model.index.column("passenger") < 5)
    for place, node in enumerate(grounded.nodes):
        if node.leaf is not None:
            for state, row in enumerate(node.leaf.projection.tolist()):
                learner.reward[place][row] = float(model.rewards[state, place])
        ahead = np.where(node.terminal, 0.0, solution.value[place])
        for k, call in enumerate(node.calls):
            completion = solution.exits[call.child].kernel @ ahead
            for state in waiting[call.available[waiting]].tolist():
                learner.completion[place][k][call.projection[state]] = completion[state]
    live = np.flatnonzero(root.live & model.reachable())
    actions = [polled_action(learner, grounded.root, int(state)) for state in live]
    polled = np.zeros(model.index.size)
    for _ in range(400):
        polled[live] = (model.rewards + model.expectation(polled))[live, actions]
    best, recursive = flat_optimum(model, root.terminal).value, solution.value[grounded.root]
    assert (polled[live] >= recursive[live] - 1e-7).all()
    means = [float(value[model.starts].mean()) for value in (recursive, polled, best)]
    assert means == pytest.approx([4.174, 6.609, 6.614], abs=0.001)
