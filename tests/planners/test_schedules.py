import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from learning_worlds import legs, two_exits

from hierarchy import ground, two_rooms
from planners import Boltzmann, Exploration, LearningRate, MaxQ, Settings
from worlds import UserError, load_layout, maze_model

EPISODES = st.integers(0, 100_000)


def test_the_paper_s_learning_rate() -> None:
    """0.9, multiplied by 0.9 every 40 episodes (section 6.2)."""
    rate = LearningRate()
    assert [rate(n) for n in (0, 39)] == [0.9, 0.9]
    assert [rate(n) for n in (40, 79, 80, 400)] == pytest.approx([0.81, 0.81, 0.729, 0.9**11])
    assert rate(1199) == pytest.approx(0.9**30)


@given(st.floats(0.01, 1), st.floats(0.5, 1), st.integers(1, 500), st.integers(0, 5000), st.integers(0, 5000))
def test_a_learning_rate_never_rises(start: float, factor: float, every: int, n: int, later: int) -> None:
    """It starts at `start`, falls with episodes, and is constant between steps of `every`."""
    rate = LearningRate(start, factor, every)
    assert rate(0) == start
    assert 0 <= rate(n + later) <= rate(n) <= start
    assert rate(every * (n // every)) == rate(n)


@pytest.mark.parametrize(
    "settings",
    [
        {"start": 0.0},
        {"start": 1.1},
        {"start": -0.5},
        {"factor": 0.0},
        {"factor": 1.5},
        {"every": 0},
        {"every": -40},
    ],
)
def test_a_bad_learning_rate_is_refused(settings: dict[str, float]) -> None:
    """The error says what is needed and shows what was given."""
    ((name, value),) = settings.items()
    with pytest.raises(ValueError, match=rf"learning rate needs 0 < start <= 1.*{name}={value}"):
        LearningRate(**settings)  # type: ignore[arg-type]


@given(st.integers(1, 1000), EPISODES)
def test_exploration_is_a_share_that_falls_to_half_in_time(half: int, n: int) -> None:
    """All random at first, half after `half` episodes, falling, and never 0: every child is always tried."""
    share = Exploration(half)
    assert share(0) == 1.0
    assert share(half) == 0.5
    assert 0 < share(n + 1) < share(n) <= 1


@given(st.integers(1, 50))
def test_exploration_is_glie(half: int) -> None:
    """The shares fall below any bound, while their sum passes any bound (here 0.01, and 2 half)."""
    share = Exploration(half)
    assert share(100 * half) < 0.01
    assert sum(share(n) for n in range(20 * half)) > 2 * half


@pytest.mark.parametrize("half", [0, -1])
def test_a_bad_exploration_is_refused(half: int) -> None:
    """The error shows what was given."""
    with pytest.raises(ValueError, match=f"half > 0, not {half}"):
        Exploration(half)


def test_each_task_may_have_schedules_of_its_own() -> None:
    """A ground task's own come before its task's, and the default is for the rest."""
    grounded = legs(7, 2, 4)
    fast, slow = LearningRate(1.0, 1.0), LearningRate(0.5, 1.0)
    settings = Settings(rate=slow, rates={"Leg1": fast}, explorations={"Root": Boltzmann()})
    learner = MaxQ(grounded, (0,), settings)
    learner.reward[0][0] = -1.0
    learner.train(grounded.root, [0], episodes=1)
    # From V(right) = -1 the cells before the last of a leg have learnt V(leg, s') = -1, in full or by half.
    assert learner.completion[grounded.place("Leg0")][0][:3] == [-0.5, 0.0, 0.0]
    assert learner.completion[grounded.place("Leg1")][0][2:5] == [-1.0, 0.0, 0.0]
    assert hash(settings) == hash(Settings(rate=slow))
    with pytest.raises(UserError, match="settings name 'Leg3', which is no task of legs; did you mean 'Leg"):
        MaxQ(grounded, (0,), Settings(rates={"Leg3": fast}))


def test_a_ground_task_s_own_schedule_comes_before_its_task_s() -> None:
    """One door's rate, the rate of the other doors, and the default for the rest."""
    layout = load_layout("two_rooms")
    grounded = ground(two_rooms(layout), maze_model(layout))
    one, doors = LearningRate(0.25, 1.0), LearningRate(0.5, 1.0)
    settings = Settings(LearningRate(1.0, 1.0), rates={"GotoDoor": doors, "GotoDoor(D2)": one})
    learner = MaxQ(grounded, (0,), settings)
    names = "GotoDoor(D1)", "GotoDoor(D2)", "GotoTrigger(T4)"
    assert [learner._rates[grounded.place(name)](0) for name in names] == [0.5, 0.25, 1.0]


def test_each_task_explores_by_its_own_schedule() -> None:
    """Out walks at random for ever and Back is greedy: the share of needless steps tells them apart."""
    grounded = two_exits()
    settings = Settings(
        exploration=Exploration(half=1), explorations={"Out": Exploration(half=10**9)}, rate=LearningRate()
    )
    learner = MaxQ(grounded, (4,), settings)
    learner.train(grounded.place("Out"), [2], episodes=300)
    out = learner.train(grounded.place("Out"), [2], episodes=400)
    learner.train(grounded.place("Back"), [0], episodes=300)
    back = learner.train(grounded.place("Back"), [0], episodes=400)
    assert np.mean(out) == pytest.approx(2 * 3, abs=0.5), "a random walk from 2 to 0 or 5 takes 2 x 3 steps"
    assert np.mean(back) == pytest.approx(3.0, abs=0.1)
