"""What sums up an answer of many comparisons."""

import pytest
from study_rows import MOSTLY_NEVER, OPTIMAL, STEPS, Asked, rows, wave

from comparisons.study.results.answers import answers
from comparisons.study.results.rows import Row


def over_obstacles(shares: dict[str, dict[str, float]], count: int = 20) -> list[Row]:
    """Return runs with shares by obstacles and strategy; seeds differ by up to 0.02."""
    return [
        row
        for obstacles, by_level in shares.items()
        for row in rows(
            OPTIMAL,
            {
                level: [share + 0.01 * (seed % 3 - 1) * (share < 1) for seed in range(count)]
                for level, share in by_level.items()
            },
            factor="strategy",
            obstacles=obstacles,
        )
    ]


HEADLINE = {
    "12": {"rule": 0.8, "sweep": 0.95, "oracle": 1.0},
    "1": {"rule": 0.9, "sweep": 0.9, "oracle": 1.0},
    "6": {"rule": 0.7, "sweep": 0.99, "oracle": 1.0},
}


def test_many_comparisons_are_summed_up() -> None:
    """Over numbers, from where to where levels go, beyond their ends too; and how many differ, and how."""
    asked = Asked(OPTIMAL.name, "strategy", "rule", ("obstacles",), "mean")
    found = answers(asked, OPTIMAL, over_obstacles(HEADLINE))
    assert len(found.told) == 6
    assert found.summary == (
        "From obstacles 1 to 12, the mean over 20 seeds of affordances that are proved optimal first actions "
        "goes from 90.0 % (89.5 to 90.3 %) to 80.0 % (79.6 to 80.3 %), down to 69.9 % at 6, with strategy "
        "rule; goes from 90.0 % (89.5 to 90.3 %) to 95.0 % (94.6 to 95.3 %), up to 98.9 % at 6, with "
        "strategy sweep; stays at 100.0 % (100.0 to 100.0 %) with strategy oracle.",
        "5 of 6 comparisons with strategy rule, of 20 seeds each, show a difference: strategy sweep is "
        "better in 2 of 3 (15.0 to 29.0 percentage points); strategy oracle is better in 3 of 3 (10.1 to "
        "30.1 percentage points).",
    )


def test_the_summing_up_counts_both_ways_and_what_is_not_ranked() -> None:
    """A level that is better here and worse there is told as both; a place with few seeds is no test."""
    shares = {str(n): {"rule": 0.5, "sweep": 0.5 + 0.1 * sign} for n, sign in enumerate((1, 1, -1, -2))}
    few = over_obstacles({"9": {"rule": 0.1, "sweep": 0.9}}, 4)
    asked = Asked(OPTIMAL.name, "strategy", "rule", ("obstacles",), "mean")
    (counts,) = answers(asked, OPTIMAL, [*over_obstacles(shares), *few]).summary
    assert counts == (
        "All 4 comparisons with strategy rule, of 20 seeds each, show a difference: strategy sweep is better "
        "in 2 of 4 (10.0 percentage points) and worse in 2 of 4 (10.0 to 20.0 percentage points); 1 more is "
        "not ranked."
    )
    alike = over_obstacles({str(n): {"rule": 0.5, "sweep": 0.5} for n in range(4)})
    assert answers(asked, OPTIMAL, alike).summary[1] == (
        "None of 4 comparisons with strategy rule, of 20 seeds each, shows a difference."
    )
    shares = {str(n): {"rule": 0.4, "sweep": 0.5} for n in range(4)}
    assert answers(asked, OPTIMAL, over_obstacles(shares, 6)).summary[1] == (
        "None of 4 comparisons with strategy rule, of 6 seeds each, shows a difference: so few cannot show "
        "any by this test."
    )


@pytest.mark.parametrize(
    ("places", "count"),
    [(["1", "2", "3"], 20), (["1", "2", "3", "4"], 4), (["small", "large", "wide", "deep"], 20)],
)
def test_few_comparisons_are_not_summed_up(places: list[str], count: int) -> None:
    """Three comparisons are read one by one, what is not ranked is not counted, and words have no ends."""
    asked = Asked(OPTIMAL.name, "strategy", "rule", ("obstacles",), "mean")
    found = answers(
        asked, OPTIMAL, over_obstacles({place: {"rule": 0.5, "sweep": 0.6} for place in places}, count)
    )
    assert [words.partition(" ")[0] for words in found.summary] == ["All"] * (places[0] == "small")


def test_ratios_are_summed_up_as_such() -> None:
    """Steps are summed up by their ratios; where some level never gets there, there is no range."""
    by_place = {
        str(n): {"1": wave(100), "0.9": [times * s for s in wave(100)]}
        for n, times in enumerate((2, 3, 4, 5))
    }
    asked = Asked(within=("doors",))
    finite = [row for place, by_level in by_place.items() for row in rows(STEPS, by_level, doors=place)]
    assert (
        answers(asked, STEPS, finite)
        .summary[1]
        .endswith("gamma 0.9 is worse in 4 of 4 (2.00 to 5.00 times).")
    )
    never = rows(STEPS, {"1": wave(100), "0.9": MOSTLY_NEVER}, doors="9")
    lead = answers(asked, STEPS, [*finite, *never]).summary
    assert lead[0].endswith(
        "stays at 100 steps (95 to 104) with gamma 1; goes from 199 steps (191 to 208) to never with "
        "gamma 0.9."
    )
    assert lead[1].endswith("gamma 0.9 is worse in 5 of 5.")
