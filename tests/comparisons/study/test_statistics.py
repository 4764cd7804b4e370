"""Estimates over runs: against hand-worked numbers, against scipy's own, and by how often they cover."""

from math import inf, isnan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import bootstrap, mannwhitneyu, norm, trim_mean
from study_rows import COST, OPTIMAL, RETURN, STEPS, rows, samples

from comparisons.intervals import wilson
from comparisons.study.kinds import kind
from comparisons.study.results.resampling import expanded_tail, inner, resampled
from comparisons.study.results.samples import Samples, samples_of, worst
from comparisons.study.results.statistics import (
    STATISTICS,
    aggregate,
    checked_statistic,
    estimate,
    improvement,
    profile,
)
from worlds import UserError

CASES = 300
numbers = st.lists(st.integers(-50, 50).map(float), min_size=2, max_size=12)


def covers(low: float, truth: float, high: float) -> bool:
    """Return whether an interval holds the truth."""
    return low <= truth <= high


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30))
def test_aggregates_are_those_of_scipy_and_numpy(values: list[float]) -> None:
    """The IQM is scipy's mean trimmed by a quarter at each end, and the others are numpy's."""
    array = np.array(values)
    expected = {"iqm": trim_mean(array, 0.25), "median": np.median(array), "mean": array.mean()}
    for statistic in STATISTICS:
        assert float(aggregate(array, statistic)) == pytest.approx(expected[statistic], rel=1e-9, abs=1e-6)


@pytest.mark.parametrize(
    ("statistic", "never", "value"),
    [
        ("iqm", 0, 4.5),
        ("iqm", 2, 4.5),  # of 1..6, never, never, the quarters at the ends go: 3, 4, 5, 6 are left
        ("iqm", 3, inf),
        ("median", 3, 4.5),
        ("median", 4, inf),
        ("mean", 0, 4.5),
        ("mean", 1, inf),
    ],
)
def test_runs_that_never_got_there_count_as_infinitely_bad(statistic: str, never: int, value: float) -> None:
    """A statistic is finite as long as what it looks at is, and infinite beyond that."""
    runs = [1.0, 2, 3, 4, 5, 6, 7, 8][: 8 - never] + [inf] * never
    found = estimate(samples(runs), statistic)
    assert (found.value, found.reached, found.runs) == (value, 8 - never, 8)
    mirrored = estimate(samples([-run for run in runs], measure=RETURN), statistic)
    assert (mirrored.value, mirrored.reached) == (-value, 8 - never)


def test_an_interval_says_that_a_goal_may_be_missed() -> None:
    """With nearly a quarter of runs missing, the IQM is finite and its upper bound is not."""
    found = estimate(samples([float(n) for n in range(16)] + [inf] * 4))
    assert found.value < inf
    assert found.high == inf
    assert 0 < found.low < found.value
    assert not isnan(found.high)


@given(numbers, st.permutations(range(12)), st.sampled_from(STATISTICS))
def test_an_interval_holds_its_estimate_whatever_the_order(
    values: list[float], order: list[int], statistic: str
) -> None:
    """The same runs give the same interval in any order, and it holds the estimate."""
    plain = samples(values)
    shuffled = dict(sorted(plain.tasks["task 0"].items(), key=lambda item: order[item[0]]))
    found = estimate(plain, statistic)
    assert found == estimate(Samples(STEPS, {"task 0": shuffled}), statistic)
    assert covers(found.low, found.value, found.high)
    assert min(values) <= found.low
    assert found.high <= max(values)


@given(numbers, st.sampled_from(STATISTICS))
def test_estimates_grow_with_their_numbers(values: list[float], statistic: str) -> None:
    """Twice the numbers have twice the estimate and twice the bounds: resamples depend on counts alone."""
    found, twice = (estimate(samples([times * value for value in values]), statistic) for times in (1, 2))
    bounds = (found.value, found.low, found.high)
    assert (twice.value, twice.low, twice.high) == tuple(2 * bound for bound in bounds)


def test_bounds_are_those_of_scipys_percentile_bootstrap() -> None:
    """At the widened level, scipy's own percentile interval has the same bounds but for resampling noise."""
    values = np.random.default_rng(1).normal(100, 10, 12)
    found = estimate(samples(values), "mean")
    level = 1 - 2 * expanded_tail(12, 1)
    rng = np.random.default_rng(2)
    expected = bootstrap(
        (values,), np.mean, confidence_level=level, method="percentile", n_resamples=50_000, rng=rng
    ).confidence_interval
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=0.35)


def test_the_bootstrap_stays_within_tasks() -> None:
    """Tasks far apart, each without any spread, leave the mean none; as one task they would leave much."""
    apart = estimate(samples([10.0] * 6, [1000.0] * 6), "mean")
    assert (apart.value, apart.low, apart.high) == (505, 505, 505)
    assert (apart.tasks, apart.seeds, apart.runs) == (2, 6, 12)
    together = estimate(samples([10.0] * 6 + [1000.0] * 6), "mean")
    assert together.high - together.low > 500


def test_too_few_runs_have_no_interval() -> None:
    """One run shows no spread, and none at all has no estimate; few seeds are marked."""
    one = estimate(samples([7.0]))
    assert (one.value, one.low, one.high, one.bounded) == (7, -inf, inf, False)
    assert estimate(samples()) is None
    assert [estimate(samples(range(n))).few for n in (4, 5)] == [True, False]
    assert not estimate(samples(range(9), [1.0])).bounded


def test_an_unknown_statistic_is_told() -> None:
    """A statistic's name with a slip is answered with the name that was meant."""
    with pytest.raises(UserError, match="meen: there is no such statistic; did you mean 'mean'"):
        checked_statistic("meen")


@given(st.lists(st.one_of(st.integers(0, 9).map(float), st.just(inf)), min_size=1, max_size=20))
def test_a_profile_counts_runs(values: list[float]) -> None:
    """At each threshold a profile gives the share of runs at most there, and Wilson's interval of it."""
    found = profile(samples(values))
    assert found.thresholds.tolist() == sorted({value for value in values if value < inf})
    for place, threshold in enumerate(found.thresholds):
        right = sum(value <= threshold for value in values)
        assert found.shares[place] == right / len(values)
        assert (found.low[place], found.high[place]) == wilson(right, len(values))


def test_a_profile_of_what_should_be_large_counts_from_above() -> None:
    """Where more is better, the share is that of runs at least at the threshold."""
    found = profile(samples([0.2, 0.5, 0.9, -inf], measure=RETURN), thresholds=[0.0, 0.5, 1.0])
    assert found.shares.tolist() == [0.75, 0.5, 0.0]


def test_improvement_by_hand() -> None:
    """Pairs are counted, ties as half, never reached twice as a tie, and tasks are averaged."""
    one, other = samples([1, 2, inf]), samples([2, 3, inf])
    # 1 beats all three; 2 ties once and beats two; never loses two and ties once.
    assert improvement(one, other).value == pytest.approx((3 + 2.5 + 0.5) / 9)
    both = improvement(samples([1, 2, inf], [5, 5]), samples([2, 3, inf], [4, 5]))
    assert both.value == pytest.approx((6 / 9 + 1 / 4) / 2)
    mirrored = improvement(samples([-1, -2], measure=RETURN), samples([-2, -3], measure=RETURN))
    assert mirrored.value == pytest.approx(3.5 / 4)


@given(numbers, numbers)
def test_improvement_is_mann_and_whitneys(first: list[float], second: list[float]) -> None:
    """The chance is their U by the number of pairs, and that of the other way round is what is left."""
    one, other = samples(first), samples(second)
    found, back = improvement(one, other), improvement(other, one)
    pairs = len(first) * len(second)
    assert found.value == pytest.approx(mannwhitneyu(second, first).statistic / pairs)
    assert found.value + back.value == pytest.approx(1)
    assert 0 <= found.low <= found.value <= found.high <= 1


def test_complete_separation_is_no_certainty() -> None:
    """Where resampling shows no spread, since all seeds win, lose or tie, there is doubt left."""
    found = improvement(samples(range(5)), samples(range(10, 15)))
    assert (found.value, found.low, found.high) == (1, *wilson(5, 5))
    assert improvement(samples([1.0, 2.0]), Samples(STEPS, {"another task": {0: 1.0}})) is None
    half = improvement(samples(range(5), range(10, 15)), samples(range(10, 15), range(5)))
    assert (half.value, half.low, half.high) == (0.5, *wilson(2, 5))
    alike = improvement(samples([3.0] * 20), samples([3.0] * 20))
    assert (alike.value, alike.low, alike.high) == (0.5, *wilson(10, 20))


def test_what_has_no_better_is_not_ranked() -> None:
    """A measure of which neither less nor more is better has estimates, and no ranks."""
    plain = samples(range(8), measure=COST)
    assert estimate(plain).value == 3.5
    for rank in (profile, lambda given: improvement(given, given)):
        with pytest.raises(UserError, match="cost_per_mistake: neither less nor more"):
            rank(plain)


def test_none_counts_by_what_it_means() -> None:
    """Steps never reached are infinitely many; a share of nothing, and what no run has, are left out."""
    assert [worst(measure) for measure in (STEPS, RETURN, OPTIMAL, COST)] == [inf, -inf, None, None]
    # Learners without tables do not need infinitely large ones.
    assert worst(kind("learn").measure("stored_values")) is None
    for measure, kept in ((STEPS, [3, inf]), (RETURN, [3, -inf]), (OPTIMAL, [3]), (COST, [3])):
        found = samples_of(rows(measure, {"1": [3, None]}), measure)
        assert (found.values.tolist(), found.untold) == (kept, 2 - len(kept))
    absent = samples_of(rows(COST, {"1": [3.0]}), STEPS)
    assert (absent.values.tolist(), absent.untold) == ([], 1)


def test_tasks_keep_seeds_apart() -> None:
    """Two runs of one seed are of two tasks, or a mistake that is told."""
    both = rows(STEPS, {"1": [1, 2]}, graph="A") + rows(STEPS, {"1": [3, 4]}, graph="B")
    assert samples_of(both, STEPS, ["graph"]).tasks == {"graph A": {0: 1, 1: 2}, "graph B": {0: 3, 1: 4}}
    with pytest.raises(
        UserError, match="seed 0 was run twice, with gamma 1, graph A and with gamma 1, graph B"
    ):
        samples_of(both, STEPS)


def test_resamples_of_one_number_are_refused() -> None:
    """A single number shows no spread: there are no resamples, and the bounds are infinite."""
    assert resampled([np.ones(3), np.ones(1)], lambda *_, axis: np.ones(axis)) is None
    assert inner(None, 4, 2) == (-inf, inf)


@pytest.mark.parametrize("statistic", ["iqm", "median"])
@pytest.mark.parametrize("runs", [10, 20])
def test_intervals_cover_the_truth(statistic: str, runs: int) -> None:
    """Of skewed runs, of which some never get there, 92 to 98 % of intervals hold the true statistic."""
    random = np.random.default_rng(7)
    low, high = norm.cdf(norm.ppf([0.25, 0.75]) - 1)
    truth = {"median": 1.0, "iqm": np.exp(0.5) * (high - low) / 0.5}[statistic]
    held = 0
    for _ in range(CASES):
        values = np.exp(random.normal(size=runs))
        # A tenth of all runs never get there, which moves neither statistic: they are the slowest ones.
        values[values > np.exp(norm.ppf(0.9))] = inf
        found = estimate(samples(values), statistic)
        held += covers(found.low, truth, found.high)
    assert 0.92 * CASES <= held <= 0.98 * CASES


def test_stratified_intervals_cover_the_truth() -> None:
    """Over two tasks far apart, with six seeds each, 92 to 98 % of intervals hold the true mean."""
    random = np.random.default_rng(8)
    held = 0
    for _ in range(CASES):
        found = estimate(samples(random.normal(0, 1, 6), random.normal(100, 3, 6)), "mean")
        held += covers(found.low, 50, found.high)
    assert 0.92 * CASES <= held <= 0.98 * CASES


@pytest.mark.slow
def test_intervals_of_chances_cover_the_truth() -> None:
    """Of runs that are better three times in four, 92 to 98 % of intervals hold that chance."""
    random = np.random.default_rng(9)
    shift = norm.ppf(0.75) * np.sqrt(2)
    held = 0
    for _ in range(CASES):
        found = improvement(samples(random.normal(-shift, 1, 15)), samples(random.normal(0, 1, 15)))
        held += covers(found.low, 0.75, found.high)
    assert 0.92 * CASES <= held <= 0.98 * CASES
