"""The answer to a study's question: its words stay right whatever the runs did."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from study_rows import COST, MOSTLY_NEVER, OPTIMAL, RETURN, STEPS, Asked, rows, wave

from comparisons.study.kinds import Measure
from comparisons.study.results.answers import Answered, answers
from comparisons.study.results.rows import Row
from comparisons.study.results.sizes import has_ratio
from comparisons.study.results.summaries import comparisons_table, study_table

SLOWER = [1.42 * steps + (seed % 3) for seed, steps in enumerate(wave(1000))]
TIED = [steps + (-1) ** seed * (5 + seed) for seed, steps in enumerate(wave(1000))]


@pytest.mark.parametrize(
    ("measure", "by_level", "sentence"),
    [
        (
            STEPS,
            {"1": wave(1000), "0.9": SLOWER},
            "gamma 0.9 needs 1.42 times (95 % 1.42 to 1.42) the environment steps of gamma 1 until every "
            "start is optimal; IQMs of 20 seeds each, paired, p < 0.0001.",
        ),
        (
            STEPS,
            {"1": wave(1000), "0.9": TIED},
            "no difference between gamma 0.9 and gamma 1 that 20 seeds can show, in environment steps "
            "until every start is optimal: 1.003 times (95 % 0.991 to 1.012); IQMs of 20 seeds each, "
            "paired, p = 0.87.",
        ),
        (
            STEPS,
            {"1": wave(1000), "0.9": wave(1000)},
            "no difference between gamma 0.9 and gamma 1 in environment steps until every start is optimal: "
            "all 20 pairs are alike; IQMs of 20 seeds each, paired, p = 1.",
        ),
        (
            STEPS,
            {"1": wave(1000), "0.9": MOSTLY_NEVER},
            "gamma 0.9 is worse than gamma 1, in environment steps until every start is optimal: with gamma "
            "0.9, 12 of 20 runs never got there, so that there is no finite IQM; with gamma 1, 0 of 20 runs "
            "never got there, and the IQM is 996 steps (954 to 1,040); IQMs of 20 seeds each, paired, "
            "p < 0.0001.",
        ),
        (
            STEPS,
            {"1": [None] * 20, "0.9": MOSTLY_NEVER},
            "gamma 0.9 is better than gamma 1, in environment steps until every start is optimal: with gamma "
            "0.9, 12 of 20 runs never got there, so that there is no finite IQM; with gamma 1, 20 of 20 runs "
            "never got there, so that there is no finite IQM; IQMs of 20 seeds each, paired, p = 0.0078.",
        ),
        (
            STEPS,
            {"1": [None] * 6, "0.9": [None] * 6},
            "no difference between gamma 0.9 and gamma 1 that 6 seeds can show, in environment steps until "
            "every start is optimal: with gamma 0.9, 6 of 6 runs never got there, so that there is no finite "
            "IQM; with gamma 1, 6 of 6 runs never got there, so that there is no finite IQM; IQMs of 6 seeds "
            "each, paired, p = 1.",
        ),
        (
            STEPS,
            {"1": wave(1000), "0.9": [*wave(3000, 15), *[None] * 5]},
            "gamma 0.9 needs 3.13 times (95 % at least 3.01) the environment steps of gamma 1 until every"
            " start is optimal; 5 of 20 runs never got there with gamma 0.9, and 0 with gamma 1; IQMs of "
            "20 seeds each, paired, p < 0.0001.",
        ),
        (
            STEPS,
            {"1": wave(1000, 3), "0.9": wave(1500, 3)},
            "not ranked, for there are 3 seeds and 5 are needed; IQM of environment steps until every "
            "start is optimal: gamma 0.9 1,450 steps (1,350 to 1,560), gamma 1 967 steps (900 to 1,040).",
        ),
        (
            STEPS,
            {"1": wave(1000, 5), "0.9": wave(1500, 5)},
            "no difference between gamma 0.9 and gamma 1 that 5 seeds can show (so few cannot show any by"
            " this test), in environment steps until every start is optimal: 1.50 times (95 % 1.50 to "
            "1.50); IQMs of 5 seeds each, paired, p = 0.062.",
        ),
        (
            OPTIMAL,
            {"1": wave(0.9), "12": [share - 0.1 for share in wave(0.9)]},
            "gamma 12 is 10.0 percentage points (95 % 10.0 to 10.0) below gamma 1 in affordances that are"
            " proved optimal first actions: 79.6 % against 89.6 %; IQMs of 20 seeds each, paired, "
            "p < 0.0001.",
        ),
        (
            OPTIMAL,
            {"1": wave(0.8), "12": [0.75 + 0.01 * (seed % 5) for seed in range(20)]},
            # 0.797 and 0.77 by hand.
            "pair by pair gamma 12 mostly lies below gamma 1 in affordances that are proved optimal first "
            "actions, though the interval of their IQMs takes in no difference: -2.68 percentage points (95 %"
            " -6.12 to 0.64); IQMs of 20 seeds each, paired, p = 0.035.",
        ),
        (
            OPTIMAL,
            {"1": [None] * 4 + [0.5] * 6, "12": [0.75] * 10},
            "gamma 12 is 25.0 percentage points (95 % 25.0 to 25.0) above gamma 1 in affordances that are"
            " proved optimal first actions: 75.0 % against 50.0 %; IQMs of 6 seeds each, paired, p = 0.031; "
            "4 runs left out for want of a twin; 4 runs had nothing to tell.",
        ),
        (
            RETURN,
            {"1": [-20.0 + seed for seed in range(10)], "0.9": [-25.0 + seed for seed in range(10)]},
            "gamma 0.9 has 5.00 reward (95 % 5.00 to 5.00) less than gamma 1 in mean return at the end; "
            "IQMs of 10 seeds each, paired, p = 0.002.",
        ),
        (
            COST,
            {"1": [2.0] * 10, "0.9": [3.0] * 10},
            "gamma 0.9 has 1.50 times (95 % 1.50 to 1.50) the steps of gamma 1 that a mistake costs; IQMs"
            " of 10 seeds each, paired, p = 0.002.",
        ),
    ],
)
def test_sentences(measure: Measure, by_level: dict[str, list[float | None]], sentence: str) -> None:
    """Each outcome has its words: a ratio, a difference, none to be seen, never reached, too few."""
    (told,) = answers(Asked(measure.name), measure, rows(measure, by_level)).told
    assert told.sentence == sentence
    assert (told.factor, told.against, told.missing) == ("gamma", "1", 0)


def two_graphs() -> list[Row]:
    """Return runs on two graphs, of three levels."""
    by_level = {"1": wave(1000), "0.99": TIED, "0.9": SLOWER}
    return [row for graph in ("A", "B") for row in rows(STEPS, by_level, graph=graph)]


def test_comparisons_are_made_within_and_corrected_together() -> None:
    """Each level of `within` has its own comparisons, and all p values are corrected for each other."""
    told = answers(Asked(within=("graph",)), STEPS, two_graphs()).told
    assert [(each.within["graph"], each.level) for each in told] == [
        ("A", "0.99"),
        ("A", "0.9"),
        ("B", "0.99"),
        ("B", "0.9"),
    ]
    assert told[1].sentence == (
        "graph A: gamma 0.9 needs 1.42 times (95 % 1.42 to 1.42) the environment steps of gamma 1 until "
        "every start is optimal; IQMs of 20 seeds each, paired, p < 0.0001 after Holm's correction for 4 "
        "comparisons."
    )
    assert {each.comparison.tests for each in told} == {4}


def test_other_factors_are_tasks() -> None:
    """A factor that is neither compared nor of `within` makes tasks, paired each by itself."""
    told = answers(Asked(), STEPS, two_graphs()).told
    assert told[1].comparison.tasks == 2
    assert told[1].comparison.pairs == 40
    assert "IQMs of 20 seeds each in 2 tasks, paired" in told[1].sentence


def test_missing_runs_are_told() -> None:
    """Runs that failed are counted where they were to be compared, and their twins are left out."""
    everything = two_graphs()
    missing = [
        row for row in everything if row.seed in (3, 5) and row.levels == {"gamma": "0.9", "graph": "B"}
    ]
    there = [row for row in everything if row not in missing]
    found = answers(Asked(within=("graph",)), STEPS, there, missing).told
    told = {(each.within["graph"], each.level): each for each in found}
    left = "; 2 runs failed or not run yet; 2 runs left out for want of a twin."
    assert told["B", "0.9"].sentence.endswith(left)
    assert told["B", "0.9"].missing == 2
    assert told["B", "0.9"].comparison.pairs == 18
    assert "failed" not in told["B", "0.99"].sentence + told["A", "0.9"].sentence


def test_a_level_without_any_result_is_told() -> None:
    """A level of which every run failed still has its sentence."""
    everything = rows(STEPS, {"1": wave(1000), "0.9": SLOWER})
    there, missing = everything[:20], everything[20:]
    (told,) = answers(Asked(), STEPS, there, missing).told
    assert told.sentence == (
        "nothing can be said of gamma 0.9 against gamma 1: no seed has both; 20 runs failed or not run yet."
    )
    assert answers(Asked(), STEPS, []) == Answered((), (), (), STEPS)


def test_what_is_not_ranked_is_no_test() -> None:
    """Comparisons on too few seeds are not corrected for, and have no say in the correction of others."""
    by_level = {"1": wave(1000), "0.99": SLOWER[:4], "0.9": SLOWER}
    few, enough = answers(Asked(), STEPS, rows(STEPS, by_level)).told
    assert "not ranked, for there are 4 seeds" in few.sentence
    assert enough.comparison.tests == 1


def test_one_task_of_few_seeds_is_told_as_such() -> None:
    """Where one task of several has four seeds, nobody is told that there are no more."""
    short = [row for row in two_graphs() if row.levels["graph"] == "A" or row.seed < 4]
    told = answers(Asked(), STEPS, short).told[1]
    assert told.sentence.startswith(
        "not ranked, for a task has but 4 seeds and 5 are needed; IQM of environment"
    )


def test_a_doubtful_difference_is_told_as_such() -> None:
    """Where nearly all pairs lean one way and one outlier the other, both are said."""
    second = wave(1000)
    first = [steps - 60 * (seed == 4) + (seed != 4) for seed, steps in enumerate(second)]
    (told,) = answers(Asked(statistic="mean"), STEPS, rows(STEPS, {"1": second, "0.9": first})).told
    assert told.comparison is not None
    assert told.comparison.ratio is not None
    assert told.comparison.ratio.low < 1 < told.comparison.ratio.high
    assert told.comparison.significant
    assert told.sentence.startswith("pair by pair gamma 0.9 mostly lies above gamma 1 in environment steps")
    assert "though the interval of their means takes in no difference: 0.998 times" in told.sentence


HUNDREDS = [100.0 * seed for seed in range(1, 31)]
AHEAD = [4000.0] * 4 + [steps - 1 for steps in HUNDREDS[4:]]
MISSED = [None] * 4 + AHEAD[4:]


@pytest.mark.parametrize(
    ("by_level", "beginning"),
    [
        (
            {"1": HUNDREDS, "0.9": AHEAD},
            "pair by pair gamma 0.9 mostly lies below gamma 1 in environment steps until every start is "
            "optimal, though the means lie the other way: 1.32 times (95 % 1.06 to 1.80);",
        ),
        (
            {"1": AHEAD, "0.9": HUNDREDS},
            "pair by pair gamma 0.9 mostly lies above gamma 1 in environment steps until every start is "
            "optimal, though the means lie the other way: 0.756 times",
        ),
        (
            {"1": HUNDREDS, "0.9": MISSED},
            "pair by pair gamma 0.9 is better than gamma 1, though more of the runs with gamma 0.9 never got "
            "there, in environment steps",
        ),
        (
            {"1": MISSED, "0.9": HUNDREDS},
            "pair by pair gamma 0.9 is worse than gamma 1, though more of the runs with gamma 1 never got "
            "there, in environment steps",
        ),
    ],
)
def test_a_test_that_leans_the_other_way_is_told(
    by_level: dict[str, list[float | None]], beginning: str
) -> None:
    """Where most pairs lean one way and the means another, p is not claimed for the means."""
    (told,) = answers(Asked(statistic="mean"), STEPS, rows(STEPS, by_level)).told
    assert told.comparison.significant
    assert told.sentence.startswith(beginning)


def test_intervals_that_are_surer_than_the_test_are_explained() -> None:
    """An interval that leaves no difference out where p is 0.05 or more is said not to be the test's."""
    same = [100.0] * 8
    # p is 0.039, and 0.078 of two.
    most = [100.0 + gap for gap in (-1, -2, 30, 31, 32, 33, 34, 35)]
    alone, *two = (
        answers(Asked(), STEPS, rows(STEPS, {"1": same, "0.9": most, "0.8": other})).told[0]
        for other in ([1.0] * 4, same)
    )
    assert "gamma 0.9 needs 1.31 times" in alone.sentence
    assert ", an interval that is not corrected for 2 comparisons; IQMs" in two[0].sentence
    # One pair of six does not differ: p is 0.0625.
    some = [100.0, *[130.0] * 5]
    (weak,) = answers(Asked(), STEPS, rows(STEPS, {"1": same[:6], "0.9": some})).told
    assert ", though pair by pair neither side is surely ahead; IQMs" in weak.sentence


@pytest.mark.parametrize(
    ("near", "words"),
    [
        (1.004, "needs 1.004 times (95 % 1.004 to 1.004)"),
        (0.99998, "needs 0.99998 times (95 % 0.99998 to 0.99998)"),
    ],
)
def test_a_ratio_next_to_one_does_not_look_like_one(near: float, words: str) -> None:
    """A difference that is one is not told as 1.00 times."""
    second = wave(1000)
    (told,) = answers(Asked(), STEPS, rows(STEPS, {"1": second, "0.9": [near * n for n in second]})).told
    assert words in told.sentence


ODD = st.none() | st.sampled_from([0.0, 1.0, -1.0, 1e-9, 1e12]) | st.floats(-100, 100)


@settings(max_examples=60)
@given(
    st.sampled_from([STEPS, OPTIMAL, RETURN, COST]),
    st.lists(st.lists(ODD, max_size=7), min_size=1, max_size=3),
    st.sampled_from(["iqm", "median", "mean"]),
    st.sets(st.integers(0, 20)),
    st.sampled_from(["none", "against"]),
)
def test_words_are_right_whatever_was_found(
    measure: Measure, found: list[list[float | None]], statistic: str, lost: set[int], normalise: str
) -> None:
    """No outcome leaves a sentence or a cell with what is no number, or ranks what may not be ranked."""
    everything = rows(measure, {str(level + 1): values for level, values in enumerate(found)})
    missing = [row for i, row in enumerate(everything) if i in lost]
    there = [row for i, row in enumerate(everything) if i not in lost]
    asked = Asked(measure.name, statistic=statistic, normalise=normalise if has_ratio(measure) else "none")
    told = answers(asked, measure, there, missing).told
    tables = [
        study_table(there, [measure], statistic=statistic, missing=missing),
        comparisons_table(told, measure),
    ]
    texts = [each.sentence for each in told] + [
        cell for table in tables for row in table.rows for cell in row
    ]
    for text in texts:
        assert not re.search(r"\bnan\b|\binf\b|None|  |\(\)", text)
    for each in told:
        assert each.sentence.endswith(".")
        ranks = re.search(r"needs|has \d|is [\d.]+ percentage|worse|better|lies|no difference", each.sentence)
        assert bool(ranks) == (each.comparison is not None and not each.comparison.few)
