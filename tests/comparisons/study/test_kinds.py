"""Kinds of runs: what they say that they measure, and what their runs do measure."""

from collections.abc import Mapping

import pytest

from comparisons.study.kinds import Measure, kind
from comparisons.study.spec import Value
from worlds import UserError

SMALL: Mapping[str, Mapping[str, Value]] = {
    "learn": {"graph": "two_rooms", "steps": 2000},
    "episodes": {"episodes": 2},
    "perceive": {"frames": 6},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_runs_measure_what_their_kind_says(name: str) -> None:
    """Every measure and every part of one, and no other: a study's answer can be about each of them."""
    of = kind(name)
    measured = of.run(of.complete(SMALL[name]), 0).measures
    parts = [f"{measure.name}.{part}" for measure in of.measures for part in measure.parts]
    assert sorted(measured) == sorted([*(measure.name for measure in of.measures), *parts])


def test_a_part_is_measured_as_the_whole_is() -> None:
    """It has a name and words of its own."""
    part = kind("episodes").measure("optimal.cube")
    whole = kind("episodes").measure("optimal")
    assert part == Measure("optimal.cube", f"{whole.about}, cube", whole.unit, whole.better)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("optimum", "runs of kind episodes measure no such thing; did you mean 'optimal'?"),
        ("optimal.GotoDor", "optimal has no such part; did you mean 'GotoDoor'?"),
        ("optimal.", "optimal has no such part; its parts: GotoTrigger, GotoDoor, GotoGoal, cube, sphere"),
        ("reached.cube", "reached has no such part; use reached"),
    ],
)
def test_what_is_not_measured_is_refused(name: str, expected: str) -> None:
    """With the name that may be meant."""
    with pytest.raises(UserError) as caught:
        kind("episodes").measure(name)
    assert str(caught.value) == f"{name}: {expected}"
