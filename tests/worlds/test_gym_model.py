from collections import Counter
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

from worlds import Cell, TransitionModel, Variable, WorldError
from worlds.gym_model import gym_model
from worlds.taxi import SITES, taxi_model

Chances = dict[tuple[tuple[Any, ...], float], float]
DRAWS = 3000


def _chances(model: TransitionModel, state: int, action: int) -> Chances:
    """Return the probability of each next state and reward."""
    found: Counter[tuple[tuple[Any, ...], float]] = Counter()
    columns = model.outcomes, model.outcome_rewards, model.probabilities
    for to, reward, chance in zip(*(c[state, action].tolist() for c in columns), strict=True):
        if chance > 0:
            found[model.index.state(to), reward] += chance
    return dict(found)


def _observed(env: Any, before: int, action: int, draws: int = DRAWS) -> Counter[tuple[int, float, bool]]:
    """Return how often each observation, reward and end follow an action of the environment itself."""
    found: Counter[tuple[int, float, bool]] = Counter()
    for _ in range(draws):
        env.s = before
        after, reward, done, *_ = env.step(action)
        found[int(after), float(reward), bool(done)] += 1
    return found


def _agree(expected: Chances, found: dict[tuple[tuple[Any, ...], float], int]) -> bool:
    """Return whether frequencies lie within 4.5 standard deviations of their probabilities."""
    total = sum(found.values())
    return set(found) <= set(expected) and all(
        abs(found.get(key, 0) - total * p) <= 4.5 * np.sqrt(total * p * (1 - p)) + 1e-9
        for key, p in expected.items()
    )


def test_dry_taxi_steps_as_the_environment_does() -> None:
    """Every action from every state that can occur leads where the environment goes."""
    env = gymnasium.make("Taxi-v4").unwrapped
    model = gym_model(env)
    sites = tuple(SITES.values())
    checked = 0
    for number in range(500):
        row, col, passenger, destination = env.decode(number)
        if passenger == destination:
            continue  # only after an end
        state = model.index.number((Cell(row, col), (*sites, "aboard")[passenger], sites[destination]))
        for action in range(6):
            ((after, reward, done),) = _observed(env, number, action, draws=1)
            row, col, passenger, destination = env.decode(after)
            expected = (Cell(row, col), (*sites, "aboard")[passenger], sites[destination])
            if done:
                expected = (expected[0], "delivered", expected[2])
            assert _chances(model, state, action) == {(expected, reward): 1.0}
            checked += 1
    assert checked == 400 * 6
    assert model.starts.sum() == 300


def _as_taxi(observed: Counter[tuple[int, float, bool]], env: Any, mind: str) -> dict[Any, int]:
    """Return observations of a taxi as states of the model."""
    sites = tuple(SITES.values())
    states = {}
    for (number, reward, _), count in observed.items():
        row, col, passenger, destination = env.decode(number)
        state = (Cell(row, col), (*sites, "aboard")[passenger], sites[destination])
        states[(*state, mind) if mind else state, reward] = count
    return states


@pytest.mark.parametrize(("row", "col", "action"), [(2, 2, 1), (0, 1, 0), (3, 1, 3), (2, 1, 2), (0, 0, 1)])
def test_rain_slips_as_often_as_in_the_environment(row: int, col: int, action: int) -> None:
    """In the open, beside walls, against a wall: frequencies are the model's."""
    env = gymnasium.make("Taxi-v4", is_rainy=True).unwrapped
    env.reset(seed=5)
    model = gym_model(env)
    number = env.encode(row, col, 4, 2)
    state = model.index.number((Cell(row, col), "aboard", SITES["Y"]))
    assert _agree(_chances(model, state, action), _as_taxi(_observed(env, number, action), env, ""))


def test_a_fickle_passenger_changes_his_mind_as_often_as_in_the_environment() -> None:
    """After Pickup, a blocked move, and a move, episodes are spread as the model says; then it is settled."""
    env = gymnasium.make("Taxi-v4", fickle_passenger=True).unwrapped
    model = gym_model(env)
    pickup, north, south, east = 4, 1, 0, 2
    first, second = Counter(), Counter()
    env.reset(seed=11)
    for _ in range(DRAWS):
        env.reset()
        env.s = env.encode(0, 0, 0, 1)  # the passenger waits at R and wants to go to G
        for action in (pickup, north):
            env.step(action)
        assert env.decode(env.s) == (0, 0, 4, 1)  # nothing has moved, so nothing has changed
        first[(int(env.step(south)[0]), -1.0, False)] += 1
        before = env.decode(env.s)[3]
        second[env.decode(env.step(east)[0])[3] == before] += 1
    state = model.index.number((Cell(0, 0), SITES["R"], SITES["G"], "open"))
    assert model.starts[state]
    for action in (pickup, north):
        ((after, _),) = _chances(model, state, action)
        state = model.index.number(after)
    expected = _chances(model, state, south)
    assert sorted(expected.values()) == pytest.approx([0.1, 0.1, 0.1, 0.7])
    assert {after[3] for after, _ in expected} == {"settled"}
    assert _agree(expected, _as_taxi(first, env, "settled"))
    assert set(second) == {True}
    for after, _ in expected:
        ((later, _),) = _chances(model, model.index.number(after), east)
        assert later[2:] == after[2:]


@pytest.mark.parametrize("rain", [0.0, 0.2])
@pytest.mark.parametrize("fickle", [0.0, 0.3])
def test_our_taxi_is_gymnasium_s(rain: float, fickle: float) -> None:
    """By Gymnasium's rules both models are the same, state by state, until the passenger is delivered."""
    env = gymnasium.make("Taxi-v4", is_rainy=rain > 0, fickle_passenger=fickle > 0)
    theirs, ours = gym_model(env), taxi_model(rules="gymnasium", rain=rain, fickle=fickle)
    assert theirs.index == ours.index
    assert (theirs.starts == ours.starts).all()
    places = [theirs.actions.index(name) for name in ours.actions]
    # What cannot occur is left out: in P, a passenger waiting at the destination can be put down elsewhere.
    reached = np.flatnonzero(ours.reachable() & (ours.index.column("passenger") < 5))
    assert (theirs.reachable() == ours.reachable()).all()
    for state in reached.tolist():
        for action, place in enumerate(places):
            mine, other = _chances(ours, state, action), _chances(theirs, state, place)
            assert mine.keys() == other.keys()
            assert all(mine[key] == pytest.approx(other[key]) for key in mine)


@pytest.mark.parametrize("slippery", [False, True])
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("FrozenLake-v1", {}),
        ("FrozenLake-v1", {"map_name": "8x8"}),
        ("FrozenLake-v1", {"desc": ["SFHFS", "FFFFF", "HFGHF"], "reward_schedule": (10, -5, -1)}),
        ("CliffWalking-v1", {}),
    ],
)
def test_grids_step_as_the_environment_does(name: str, words: dict[str, Any], slippery: bool) -> None:
    """Each action's outcomes occur as often as in the environment; an end keeps to itself at no reward."""
    env = gymnasium.make(name, is_slippery=slippery, **words).unwrapped
    env.reset(seed=2)
    model = gym_model(env)
    assert model.is_deterministic is not slippery
    assert np.flatnonzero(model.starts).tolist() == np.flatnonzero(env.initial_state_distrib).tolist()
    ends = {int(to) for row in env.P.values() for found in row.values() for _, to, _, done in found if done}
    live = np.flatnonzero(model.reachable()).tolist()
    for state in ends:
        assert (model.outcomes[state][model.probabilities[state] > 0] == state).all()
        assert (model.rewards[state] == 0).all()
    draws = 200 if slippery else 1
    for state in sorted(set(live) - ends):
        for action in range(4):
            found = {
                (model.index.state(to), reward): count
                for (to, reward, _), count in _observed(env, state, action, draws).items()
            }
            assert _agree(_chances(model, state, action), found)


def test_a_lake_of_any_shape_is_read_as_its_cells() -> None:
    """By rows and columns: a wide lake with two starts, whose holes and goal have rewards of their own.

    With success in half of the cases, a step right from beside the goal slips up or down in a quarter each.
    """
    words = {"desc": ["SFHFS", "FFFFF", "HFGHF"], "reward_schedule": (10, -5, -1), "success_rate": 0.5}
    model = gym_model(gymnasium.make("FrozenLake-v1", **words))
    assert [model.index.state(int(state)) for state in np.flatnonzero(model.starts)] == [
        (Cell(0, 0),),
        (Cell(0, 4),),
    ]
    beside, right = model.index.number((Cell(2, 1),)), model.actions.index("Right")
    assert _chances(model, beside, right) == {
        ((Cell(2, 2),), 10.0): 0.5,
        ((Cell(1, 1),), -1.0): 0.25,
        ((Cell(2, 1),), -1.0): 0.25,
    }
    left = model.actions.index("Left")
    assert _chances(model, beside, left)[(Cell(2, 0),), -5.0] == 0.5


class _Toy(gymnasium.Env[int, int]):
    """Two rooms: `go` changes the room, and sometimes ends the episode there."""

    observation_space, action_space = Discrete(2), Discrete(1)

    def __init__(self) -> None:
        self.P = [[[(0.25, 1, 5, True), (0.75, 1, -1, False)]], {0: [(1.0, 0, -1, False)]}]
        self.initial_state_distrib = [1.0, 0.0]


def test_an_end_may_need_a_variable_of_its_own() -> None:
    """A state that ends an episode on one way only is refused, and mended by a variable for the end."""
    with pytest.raises(WorldError, match="observation 1 ends an episode on one way to it"):
        gym_model(_Toy())
    room, over = Variable("room", ("west", "east")), Variable("over", ("no", "yes"))
    model = gym_model(
        _Toy(),
        variables=[room, over],
        decode=lambda number: (room.values[number], "no"),
        actions=["go"],
        ended=("over", "yes"),
    )
    assert model.actions == ("go",)
    state = model.index.number(("west", "no"))
    assert _chances(model, state, 0) == {(("east", "yes"), 5.0): 0.25, (("east", "no"), -1.0): 0.75}
    assert _chances(model, model.index.number(("east", "yes")), 0) == {(("east", "yes"), 0.0): 1.0}


def test_an_unknown_environment_is_one_variable() -> None:
    """Its states and actions go by number, and its starts may be given."""
    toy = _Toy()
    toy.P[0][0] = [(1.0, 1, 5, True)]
    del toy.initial_state_distrib
    with pytest.raises(WorldError, match="_Toy does not tell where an episode begins; give starts="):
        gym_model(toy)
    model = gym_model(toy, starts=[0])
    assert (model.index.names, model.actions) == (("state",), ("action0",))
    assert model.successors[:, 0].tolist() == [1, 1]
    assert model.starts.tolist() == [True, False]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"variables": [Variable("a", (0, 1))]}, "variables and decode belong together"),
        ({"decode": lambda number: (number,)}, "variables and decode belong together"),
        ({"ended": ("a", 1)}, "ended names one of your variables"),
        ({"actions": ["go", "stop"]}, "2 names for 1 actions"),
        (
            {"variables": [Variable("a", (0, 1))], "decode": lambda _: (0,)},
            r"observations 0 and 1 are both \(0,\)",
        ),
        (
            {
                "variables": [Variable("a", (0, 1))],
                "decode": lambda number: (number,),
                "ended": ("over", "yes"),
            },
            r"there is no over = 'yes'; variables and values: a \(0, 1\)",
        ),
        (
            {"variables": [Variable("a", (0, 1))], "decode": lambda number: (number,), "ended": ("a", 1)},
            "observation 1 has a = 1 already",
        ),
        (
            {"variables": [Variable("a", (0, 1))], "decode": lambda n: n},
            "observation 0: 0 is no state; give 1",
        ),
        (
            {"variables": [Variable("a", (0, 1))], "decode": lambda n: (n, n)},
            r"decode of observation 0: \(0, 0\) is no state; give 1 values: a",
        ),
        (
            {"variables": [Variable("a", (0, 1))], "decode": lambda n: (2 * n,)},
            "decode of observation 1: a would be 2, which is outside its domain; its values are 0, 1",
        ),
        (
            {"variables": [Variable("a", (0, 1))], "decode": lambda n: ([n],)},
            r"decode of observation 0: a would be \[0\], which is outside",
        ),
        ({"starts": [2]}, "starts: an episode would begin with 2, which is no observation; they are 0 to 1"),
        ({"starts": [-1]}, "begin with -1, which is no observation"),
        ({"starts": []}, "no state is a start"),
    ],
)
def test_wrong_readings_are_refused(words: dict[str, Any], message: str) -> None:
    """The error says what does not fit, and the mend."""
    with pytest.raises(WorldError, match=message):
        gym_model(_Toy(), **words)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, r"P\[0\]\[0\] is missing; each action needs entries"),
        ({0: {}}, r"P\[0\]\[0\] is missing"),
        ({0: {0: [(1.0, 1, 0, False)]}}, r"P\[1\]\[0\] is missing"),
        ([[[(1.0, 1, 0)]]], r"P\[0\]\[0\] has the entry \(1.0, 1, 0\); give \(probability, next observation"),
        ([[[0.5, 0.5]]], r"P\[0\]\[0\] has the entry 0.5; give"),
        ([[[("half", 1, 0, False)]]], r"P\[0\]\[0\] has the entry \('half', 1, 0, False\); give"),
        ([[[(1.0, 2, 0, True)]]], r"P\[0\]\[0\] leads to 2, which is no observation; they are 0 to 1"),
        ([[[(1.0, -1, 0, True)]]], r"P\[0\]\[0\] leads to -1, which is no observation"),
        ([[[(0.5, 1, 0, True)]]], "state state = 0, action action0: the probabilities sum to 0.5, not to 1"),
    ],
)
def test_a_wrong_table_is_refused(table: Any, message: str) -> None:
    """The error names the place in P, what is wrong, and the mend."""
    toy = _Toy()
    toy.P = table
    with pytest.raises(WorldError, match=message):
        gym_model(toy)


def test_an_error_in_the_user_s_decode_says_where() -> None:
    """It keeps its type, and gains a note."""
    with pytest.raises(ZeroDivisionError) as caught:
        gym_model(_Toy(), variables=[Variable("a", (0, 1))], decode=lambda number: (1 // (1 - number),))
    assert caught.value.__notes__ == ["while observation 1 was decoded"]


def test_counting_from_one_is_refused() -> None:
    """Gymnasium allows it; P is read from 0 on."""
    toy = _Toy()
    toy.observation_space = Discrete(2, start=1)
    with pytest.raises(
        WorldError, match="_Toy counts its observations or actions from another number than 0"
    ):
        gym_model(toy)


def test_actions_may_be_named_in_one_string() -> None:
    """As in `finite_world`."""
    toy = _Toy()
    toy.P[0][0] = [(1.0, 1, 5, True)]
    assert gym_model(toy, actions="go").actions == ("go",)


def test_an_environment_without_a_model_is_refused() -> None:
    """No P, or observations that are no numbers."""
    toy = _Toy()
    toy.observation_space = Box(0.0, 1.0)
    with pytest.raises(WorldError, match="_Toy exposes no model P over discrete"):
        gym_model(toy)
    toy = _Toy()
    del toy.P
    with pytest.raises(WorldError, match=r"describe the world with worlds\.finite\.finite_world"):
        gym_model(toy)


def test_a_fickle_passenger_needs_our_reading() -> None:
    """His mind is not in P, so that a reading of one's own would lose it."""
    env = gymnasium.make("Taxi-v4", fickle_passenger=True)
    with pytest.raises(WorldError, match="a fickle passenger is not in P"):
        gym_model(env, variables=[Variable("state", tuple(range(500)))], decode=lambda number: (number,))
