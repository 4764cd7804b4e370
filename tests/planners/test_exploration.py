from math import exp

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners import Boltzmann, Exploration, HarmonicRate, boltzmann, first_best
from worlds import Stream

VALUES = st.lists(st.floats(-1000, 1000), min_size=1, max_size=6)
DRAWS = 20_000


def _frequencies(explorer: Boltzmann | Exploration, level: float, values: list[float]) -> list[float]:
    """Return how often each child is chosen in many draws of one stream."""
    random, choices = Stream(11), range(len(values))
    chosen = [explorer.choose(level, choices, lambda: values, 0.01, random) for _ in range(DRAWS)]
    return [chosen.count(k) / DRAWS for k in choices]


def test_boltzmann_probabilities_are_the_formula_s() -> None:
    """exp(v / T) over the sum of them, for values small enough to write it down as it is."""
    values, temperature = [-1.0, -2.0, -4.5], 1.5
    weights = [exp(value / temperature) for value in values]
    expected = [weight / sum(weights) for weight in weights]
    assert boltzmann(values, temperature) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("temperature", [0.5, 2.0, 50.0])
def test_boltzmann_choices_are_as_frequent_as_the_formula_says(temperature: float) -> None:
    """Within four standard errors of 20,000 draws."""
    values = [-3.0, -2.0, -4.0, -2.0]
    found = _frequencies(Boltzmann(), temperature, values)
    for share, chance in zip(found, boltzmann(values, temperature), strict=True):
        assert abs(share - chance) < 4 * (chance * (1 - chance) / DRAWS) ** 0.5


@given(VALUES, st.floats(0.01, 100), st.floats(-500, 500))
def test_boltzmann_probabilities_sum_to_one_and_follow_the_values(
    values: list[float], temperature: float, shift: float
) -> None:
    """A better child is never less likely, and adding the same to all values changes nothing."""
    chances = boltzmann(values, temperature)
    assert sum(chances) == pytest.approx(1.0)
    order = sorted(range(len(values)), key=lambda k: values[k])
    assert [chances[k] for k in order] == sorted(chances)
    shifted = boltzmann([value + shift for value in values], temperature)
    assert shifted == pytest.approx(chances, abs=1e-8)


def test_a_cold_choice_is_the_best_and_a_hot_one_is_any() -> None:
    """Far apart values do not overflow, and a very hot choice hardly looks at them."""
    assert boltzmann([-5000.0, 0.0], 0.01) == [0.0, 1.0]
    assert boltzmann([-2.0, -1.0, 0.0], 1e6) == pytest.approx([1 / 3] * 3, abs=1e-5)


@given(st.floats(0.5, 100), st.floats(0.5, 1), st.integers(0, 2000))
def test_cooling_never_warms_and_stops_at_its_floor(start: float, factor: float, n: int) -> None:
    """The temperature starts at `start`, falls, and never passes below `least`."""
    cooling = Boltzmann(start, factor, least=0.25)
    assert cooling(0) == start
    assert 0.25 <= cooling(n + 1) <= cooling(n)
    assert cooling(n) == pytest.approx(max(start * factor**n, 0.25))


@pytest.mark.parametrize("settings", [{"least": 0.0}, {"start": 0.001}, {"factor": 0.0}, {"factor": 1.01}])
def test_a_bad_cooling_is_refused(settings: dict[str, float]) -> None:
    """The error says what is needed and shows what was given."""
    ((name, value),) = settings.items()
    with pytest.raises(ValueError, match=rf"start >= least > 0 and 0 < factor <= 1.*{name}={value}"):
        Boltzmann(**settings)


def test_a_share_of_the_choices_is_random() -> None:
    """At a level of 0.4 the first best of four is chosen in 0.6 + 0.1 of the cases, each other in 0.1."""
    found = _frequencies(Exploration(), 0.4, [-3.0, -1.0, -2.0, -1.0])
    assert found == pytest.approx([0.1, 0.7, 0.1, 0.1], abs=0.015)


def test_a_random_choice_asks_for_no_values() -> None:
    """What is not needed is not computed: values are asked for by a greedy choice alone."""
    asked = []

    def values() -> list[float]:
        asked.append(1)
        return [0.0, 0.0]

    Exploration().choose(1.0, (0, 1), values, 0.0, Stream(1))
    assert asked == []
    Exploration().choose(0.0, (0, 1), values, 0.0, Stream(1))
    assert asked == [1]


@given(VALUES, st.floats(0, 10))
def test_the_first_best_is_the_first_within_the_tie(values: list[float], tie: float) -> None:
    """It is within `tie` of the best, and nothing before it is."""
    choices = [10 + k for k in range(len(values))]
    at = first_best(choices, values, tie) - 10
    assert values[at] >= max(values) - tie
    assert all(value < max(values) - tie for value in values[:at])


@given(st.integers(1, 50))
def test_a_harmonic_rate_meets_the_conditions_of_convergence(half: int) -> None:
    """Its sum passes any bound (here 2 half); the sum of its squares does not pass half + 1."""
    rate = HarmonicRate(half)
    rates = [rate(n) for n in range(20 * half)]
    assert rates[0] == 1.0
    assert sum(rates) > 2 * half
    assert sum(r * r for r in rates) < half + 1


def test_a_bad_harmonic_rate_is_refused() -> None:
    """The error shows what was given."""
    with pytest.raises(ValueError, match="half > 0, not 0"):
        HarmonicRate(0)
