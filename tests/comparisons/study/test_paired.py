"""Paired comparisons: against enumeration, against scipy's own, by hand, and by how often they err."""

from dataclasses import replace
from itertools import product
from math import inf
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import rankdata, wilcoxon
from study_rows import COST, OPTIMAL, RETURN, STEPS, samples

from comparisons.study.results.paired import compare, correct, paired_gaps
from comparisons.study.results.samples import Samples
from comparisons.study.results.significance import holm, leaning, signed_rank
from comparisons.study.results.statistics import estimate

CASES = 300


def enumerated(gaps: list[float]) -> float:
    """Return the p value by giving the ranks every combination of signs."""
    given = [gap for gap in gaps if gap]
    ranks = rankdata(np.abs(given))
    above = sum(rank for rank, gap in zip(ranks, given, strict=True) if gap > 0)
    sums = [
        sum(rank for rank, sign in zip(ranks, signs, strict=True) if sign)
        for signs in product((0, 1), repeat=len(given))
    ]
    least = min(sum(each <= above for each in sums), sum(each >= above for each in sums))
    return min(2 * least / len(sums), 1.0)


@given(st.lists(st.one_of(st.integers(-4, 4).map(float), st.sampled_from([inf, -inf])), max_size=9))
def test_p_values_are_exact_with_ties(gaps: list[float]) -> None:
    """With ties, zeros and infinities, p is what giving every combination of signs counts."""
    assert signed_rank(gaps) == pytest.approx(enumerated(gaps) if any(gaps) else 1.0)


@given(st.lists(st.integers(1, 10_000), unique=True, min_size=1, max_size=40), st.randoms())
def test_p_values_are_scipys_without_ties(values: list[float], random: Random) -> None:
    """Where nothing ties, p is that of scipy's exact test."""
    gaps = [random.choice((-1.0, 1.0)) * value for value in values]
    assert signed_rank(gaps) == pytest.approx(wilcoxon(gaps, method="exact").pvalue)


@pytest.mark.parametrize("shift", [0.0, 0.1, 0.3])
def test_many_pairs_are_tested_as_scipy_does(shift: float) -> None:
    """Beyond 200 pairs, p is that of scipy's normal approximation, near the exact one, ties and all."""
    gaps = np.random.default_rng(3).normal(shift, 1, 300).round(1)
    expected = wilcoxon(gaps, method="asymptotic", correction=False).pvalue
    assert signed_rank(gaps) == pytest.approx(expected)
    assert signed_rank(gaps[:200]) == pytest.approx(
        wilcoxon(gaps[:200], method="asymptotic", correction=False).pvalue, abs=0.01
    )


def test_holm_by_hand() -> None:
    """The least p is multiplied by the number of tests, the next by one less; their order stays."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


@given(st.lists(st.floats(0, 1), min_size=1, max_size=9))
def test_holm_lies_between_nothing_and_bonferroni(values: list[float]) -> None:
    """No corrected p is less than it was, or more than Bonferroni's; their order stays."""
    corrected = holm(values)
    for before, after in zip(values, corrected, strict=True):
        assert before <= after <= min(len(values) * before, 1.0)
    order = sorted(range(len(values)), key=lambda i: values[i])
    assert [corrected[i] for i in order] == sorted(corrected)


@given(st.lists(st.integers(-5, 5), max_size=9))
def test_the_leaning_is_that_of_the_test(gaps: list[int]) -> None:
    """Whichever signs have the larger sum of ranks, pairs that do not differ having none."""
    scipys = wilcoxon(gaps, alternative="greater", method="asymptotic") if any(gaps) else None
    middle = sum(rankdata(np.abs([gap for gap in gaps if gap]))) / 2
    assert leaning(gaps) == (np.sign(scipys.statistic - middle) if scipys else 0)


def test_runs_of_the_same_task_and_seed_are_pairs() -> None:
    """Only seeds that both sides have count, task by task; the others are told."""
    first = Samples(STEPS, {"A": {0: 10, 1: 20, 2: 30}, "B": {0: 100, 7: 1}, "C": {0: 5}})
    second = Samples(STEPS, {"A": {2: 15, 0: 5, 9: 1}, "B": {0: 50}})
    found = compare(first, second, "mean")
    assert (found.pairs, found.seeds, found.tasks, found.unpaired) == (3, 1, 2, 4)
    assert found.first.value == pytest.approx((10 + 30 + 100) / 3)
    assert (found.difference.value, found.ratio.value) == (pytest.approx(70 / 3), 2)
    assert compare(Samples(STEPS, {"A": {0: 1}}), Samples(STEPS, {"A": {1: 1}})) is None


def test_pairs_share_their_luck() -> None:
    """Where seeds make the spread, the same on both sides, pairs show a difference all the same."""
    luck = np.random.default_rng(4).lognormal(6, 1, 20)
    found = compare(samples(1.5 * luck), samples(luck))
    assert (found.ratio.value, found.ratio.low, found.ratio.high) == pytest.approx((1.5, 1.5, 1.5))
    alone = estimate(samples(luck))
    assert alone.high > 1.5 * alone.low
    assert found.p == pytest.approx(2**-19)


@pytest.mark.parametrize(
    ("first", "second", "difference", "ratio"),
    [
        ([inf] * 6, [10.0] * 6, (inf, inf, inf), (inf, inf, inf)),
        ([10.0] * 6, [inf] * 6, (-inf, -inf, -inf), (0, 0, 0)),
        ([inf] * 6, [inf] * 6, None, None),
        ([10.0] * 6, [5.0] * 6, (5, 5, 5), (2, 2, 2)),
        ([0.0] * 6, [5.0] * 6, (-5, -5, -5), (0, 0, 0)),
        ([5.0] * 6, [0.0] * 6, (5, 5, 5), None),
    ],
)
def test_differences_and_ratios_by_hand(
    first: list[float],
    second: list[float],
    difference: tuple[float, ...] | None,
    ratio: tuple[float, ...] | None,
) -> None:
    """A side that never gets there is infinitely far; if neither does, nothing is known."""
    found = compare(samples(first), samples(second))
    for interval, expected in ((found.difference, difference), (found.ratio, ratio)):
        assert (interval and (interval.value, interval.low, interval.high)) == expected


def test_resamples_of_two_infinities_bound_nothing() -> None:
    """If both sides may be infinite, the interval of their ratio says nothing on either side."""
    found = compare(samples([1, 2, 3, 4, inf, inf]), samples([2, 3, 4, 5, inf, inf]), "median")
    assert found.ratio.value == pytest.approx(3.5 / 4.5)
    assert (found.ratio.low, found.ratio.high) == (0, inf)
    assert (found.difference.low, found.difference.high) == (-inf, inf)
    assert not found.difference.bounded


def test_what_has_no_ratio() -> None:
    """Shares and rewards have differences alone; what has no better has no chance."""
    for measure in (OPTIMAL, RETURN):
        sign = -1 if measure is RETURN else 0.01
        one, other = (
            samples([sign * n for n in side], measure=measure) for side in (range(1, 7), range(2, 8))
        )
        found = compare(one, other)
        assert found.ratio is None
        assert found.difference.value == pytest.approx(-sign)
    gain = compare(samples(range(1, 7), measure=RETURN), samples(range(2, 8), measure=RETURN))
    assert gain.ratio is None
    cost = compare(samples(range(1, 7), measure=COST), samples(range(2, 8), measure=COST))
    assert (cost.chance, cost.ratio.value) == (None, pytest.approx(3.5 / 4.5))


def test_differences_of_floats_tie() -> None:
    """Differences that only rounding tells apart are ties, and what is the same does not differ."""
    first, second = samples([0.3, 0.4, 0.8, inf, 5.0]), samples([0.2, 0.3, 0.9, inf, 5.0])
    gaps = paired_gaps(first, second)
    assert (len(set(np.abs(gaps[:3]))), gaps[3:].tolist()) == (1, [0, 0])
    assert compare(first, second).differing == 3


def test_correction_counts_the_tests() -> None:
    """Each comparison knows for how many tests it is corrected, and whether any could show a difference."""
    strong = compare(samples(range(10, 16)), samples(range(6)))
    weak = compare(samples([1.0, 2, 3, 4, 5, 9]), samples([2.0, 1, 4, 3, 6, 9]))
    (alone,) = correct([strong])
    first, second = correct([strong, weak])
    assert (strong.p, alone.corrected, first.corrected) == (0.03125, 0.03125, 0.0625)
    assert (alone.significant, first.significant, second.significant) == (True, False, False)
    assert (alone.powerless, first.powerless, first.tests) == (False, True, 2)


def test_what_could_show_a_difference_is_not_called_powerless() -> None:
    """Six pairs cannot be the surest of two tests, but they can be the second one, beside a sure one."""
    weak = compare(samples([1.0, 2, 3, 4, 5, 9]), samples([2.0, 1, 4, 3, 6, 9]))
    sure = compare(samples(range(20, 40)), samples(range(20)))
    assert correct([sure, weak])[1].powerless is False
    strongest = compare(samples(range(10, 16)), samples(range(6)))
    assert correct([sure, strongest])[1].significant
    assert correct([sure, weak])[1].least == correct([sure, strongest])[1].corrected


@given(st.lists(st.tuples(st.integers(1, 12), st.integers(1, 64)), min_size=1, max_size=6), st.integers(0, 5))
def test_the_least_correction_is_that_of_pairs_that_all_agree(
    tests: list[tuple[int, int]], which: int
) -> None:
    """What a comparison could come to at best is what it comes to when all of its pairs lean one way."""
    any_one = compare(samples([1.0]), samples([2.0]))
    which %= len(tests)
    given = [replace(any_one, pairs=pairs, p=min(times * 2.0 ** (1 - pairs), 1)) for pairs, times in tests]
    agreed = [*given[:which], replace(given[which], p=2.0 ** (1 - tests[which][0])), *given[which + 1 :]]
    assert correct(given)[which].least == pytest.approx(correct(agreed)[which].corrected)


def contrary() -> tuple[list[float], list[float]]:
    """Return runs of which most are a little below their twins, and four far above."""
    second = [100.0 * seed for seed in range(1, 31)]
    return [4000.0] * 4 + [steps - 1 for steps in second[4:]], second


def test_the_side_ahead_is_that_of_the_pairs() -> None:
    """Where most pairs lean one way and the mean another, both are known."""
    found = compare(*map(samples, contrary()), "mean")
    assert found.significant
    assert (found.ahead, found.contrary, found.clear) == (-1, True, True)
    assert found.ratio.low > 1


@pytest.mark.slow
def test_intervals_of_ratios_cover_the_truth() -> None:
    """Of pairs that share half of their luck, 92 to 98 % of intervals hold the true ratio of IQMs, 1."""
    random = np.random.default_rng(5)
    held = 0
    for _ in range(CASES):
        luck, own = random.normal(0, 0.4, 20), random.normal(0, 0.4, (2, 20))
        found = compare(*(samples(np.exp(luck + each), measure=COST) for each in own))
        held += found.ratio.low <= 1 <= found.ratio.high
    assert 0.92 * CASES <= held <= 0.98 * CASES


def test_a_difference_that_is_none_is_seldom_seen() -> None:
    """Of pairs that do not differ but by chance, p is below 0.05 in 2 to 8 % of all cases."""
    random = np.random.default_rng(6)
    seen = sum(signed_rank(random.normal(size=20).round(1)) < 0.05 for _ in range(CASES))
    assert 0.02 * CASES <= seen <= 0.08 * CASES
