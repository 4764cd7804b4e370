import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners import Exploration, LearningRate

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
