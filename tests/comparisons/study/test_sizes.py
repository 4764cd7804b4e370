"""Tasks of different sizes: what they do to an answer, and what counting numbers in their sizes does."""

import pytest
from study_rows import COST, MOSTLY_NEVER, OPTIMAL, RETURN, STEPS, Asked, rows, samples, wave

from comparisons.study.declaring.declaration import StudyError, parse_study
from comparisons.study.results.answers import answers
from comparisons.study.results.rows import Row
from comparisons.study.results.sizes import apart, warning
from comparisons.study.results.summaries import comparisons_table


def two_worlds(large: float = 1.0) -> list[Row]:
    """Return runs of two worlds; 0.9 needs twice the steps in the small one, 0.8 times in the large one."""
    sizes = {"small": (1.0, 2.0), "large": (100.0 * large, 0.8)}
    return [
        row
        for world, (size, times) in sizes.items()
        for row in rows(
            STEPS,
            {
                "1": [size * steps for steps in wave(100)],
                "0.9": [size * times * steps for steps in wave(100)[::-1]],
            },
            world=world,
        )
    ]


def test_the_larger_world_decides_unless_numbers_are_normalised() -> None:
    """Mixed as they are, steps are those of the large world; in medians each world counts the same."""
    plain = answers(Asked(), STEPS, two_worlds())
    (told,) = plain.told
    assert told.comparison.apart == 100
    assert told.comparison.ratio.high < 1
    assert "20 seeds each in 2 tasks that differ much in size, paired" in told.sentence
    warned = (
        "Tasks differ up to 100-fold in size, and their numbers are mixed as they are, so that some tasks "
        "decide for all: give the answer normalise: against, or name the factor that makes them so under "
        "within."
    )
    assert plain.caution == (warned,)
    assert comparisons_table(plain.told, plain.measure).note.endswith(warned)

    counted = answers(Asked(normalise="against"), STEPS, two_worlds())
    (told,) = counted.told
    assert (counted.caution, told.comparison.apart) == ((), 1)
    assert told.comparison.ratio.value == pytest.approx((2 + 0.8) / 2, rel=0.03)
    assert told.comparison.ratio.low > 1
    assert told.comparison.ahead == 1
    assert told.sentence.startswith(
        "gamma 0.9 needs 1.37 times (95 % 1.32 to 1.43) what gamma 1 needs in environment steps until every "
        "start is optimal, in medians of gamma 1 by task; IQMs of 20 seeds each in 2 tasks, paired"
    )


@pytest.mark.parametrize("statistic", ["iqm", "median", "mean"])
def test_a_worlds_unit_does_not_count_once_numbers_are_normalised(statistic: str) -> None:
    """In a world whose steps are a thousand times as many, all is the same."""
    asked = Asked(normalise="against", statistic=statistic)
    one, other = (answers(asked, STEPS, two_worlds(large)).told[0].comparison for large in (1.0, 1000.0))
    for each in ("difference", "ratio"):
        bounds = [
            (found.value, found.low, found.high) for found in (getattr(one, each), getattr(other, each))
        ]
        assert bounds[0] == pytest.approx(bounds[1])
    assert (one.p, one.chance) == (other.p, other.chance)


def test_one_task_is_the_same_normalised() -> None:
    """Within one task, all numbers have the same divisor, and the ratio stays."""
    alone = [row for row in two_worlds() if row.levels["world"] == "large"]
    plain, counted = (
        answers(Asked(normalise=to), STEPS, alone).told[0].comparison for to in ("none", "against")
    )
    assert plain.ratio.value == pytest.approx(counted.ratio.value)
    assert (plain.ratio.low, plain.ratio.high) == pytest.approx((counted.ratio.low, counted.ratio.high))
    assert plain.p == counted.p


def test_what_cannot_be_normalised_is_told() -> None:
    """A task in which the level compared with mostly never gets there, or needs nothing, has no size."""
    asked = Asked(normalise="against")
    missed = rows(STEPS, {"1": MOSTLY_NEVER, "0.9": wave(100)}, world="hard")
    (told,) = answers(asked, STEPS, [*two_worlds(), *missed]).told
    assert told.sentence == (
        "nothing can be said of gamma 0.9 against gamma 1: the median of gamma 1 is never reached in world "
        "hard, and nothing can be counted in it."
    )
    free = rows(COST, {"1": [0.0] * 6, "0.9": [1.0] * 6})
    (told,) = answers(Asked(COST.name, normalise="against"), COST, free).told
    assert "the median of gamma 1 is 0, and nothing can be counted in it" in told.sentence
    (told,) = answers(asked, STEPS, rows(STEPS, {"0.9": wave(100)}), rows(STEPS, {"1": [0.0] * 20})).told
    assert "no seed has both; 20 runs failed" in told.sentence


def test_how_far_tasks_are_apart() -> None:
    """By their medians, whatever the sign; shares are of one size; nothing and never are infinitely far."""
    assert apart(samples([1, 2, 9], [-20, -30, -40], measure=RETURN)) == 15
    assert apart(samples([0.1] * 3, [0.9] * 3, measure=OPTIMAL)) == 1
    assert apart(samples([0, 0], [1, 2])) == apart(samples([float("inf")] * 2, [1, 2])) == float("inf")
    assert apart(samples([0, 0], [0, 0])) == apart(samples([5, 6])) == apart(samples()) == 1
    assert warning(2.0, STEPS) == ""
    assert "differ much in size" in warning(float("inf"), STEPS)
    assert "normalise" not in warning(3.0, RETURN)


STUDY = """
study: sizes
question: Does a discount below 1 slow it down in mazes small and large?
kind: learn
seeds: 5
vary:
  graph: [two_rooms, taxi]
  gamma: [1, 0.9]
answer: {measure: steps_to_optimal, compare: gamma, against: 1, normalise: against}
"""


def test_a_study_file_normalises_what_has_ratios() -> None:
    """Steps can be counted in a task's size; shares and returns cannot, and nothing else is understood."""
    study = parse_study(STUDY)
    assert study.answer.normalise == "against"
    assert study.describe().endswith("of each gamma against 1, in medians of that level by task")
    assert parse_study(STUDY.replace(", normalise: against", "")).answer.normalise == "none"
    for measure in ("share_optimal", "mean_return"):
        with pytest.raises(StudyError, match=f"answer.normalise: numbers of {measure} have no ratios"):
            parse_study(STUDY.replace("steps_to_optimal", measure))
    with pytest.raises(StudyError, match=r"answer\.normalise: .* 'agianst'; did you mean 'against'"):
        parse_study(STUDY.replace("normalise: against", "normalise: agianst"))
