"""Two stores compared: what only one has, what differs and where that may come from, and what is the same."""

from dataclasses import replace
from typing import Any

import pytest
from study_rows import Kept, Shelf

from comparisons.study.kinds import Result
from comparisons.study.results.differences import Difference, diff
from comparisons.study.spec import RunSpec


def run(seed: int, gamma: float = 1.0, torch: str = "2.13", **changes: Any) -> Kept:
    """Return a run with its result."""
    result = Result(
        {"steps": 100.0 + seed, "never": None},
        {"learning": {"x": [1, 2], "y": [0.5, None]}},
        {"cells": [[1, 2]]},
    )
    told = {"libraries": {"torch": torch}, "host": "here", "pid": seed, "wall_seconds": 0.1 * seed}
    return Kept(RunSpec("learn", 1, {"gamma": gamma}, seed), replace(result, **changes), told)


def test_the_same_is_the_same() -> None:
    """The same results make no difference, wherever and however long they took."""
    first = Shelf(*(run(seed) for seed in range(3)))
    second = Shelf(
        *(replace(run(seed), provenance={"host": "there", "wall_seconds": 99}) for seed in (2, 1, 0))
    )
    found = diff(first, second)
    assert (found, found.status) == (Difference({}, {}, (), 3), 0)
    assert found.text("a", "b") == "3 runs have the same results in a and in b."


def test_runs_of_one_store_only() -> None:
    """Runs that only one has a result of are named by what tells them apart."""
    found = diff(Shelf(run(0), run(1, 0.9)), Shelf(run(0), run(2), run(3, 0.5)))
    assert found.status == 1
    assert (found.same, len(found.only_first), len(found.only_second)) == (1, 1, 2)
    lines = found.text("a", "b").splitlines()
    assert lines[:3] == [
        "1 run has the same results in a and in b.",
        "1 run has a result only in a:",
        f"  {run(1, 0.9).spec.hash}  seed 1, gamma 0.9",
    ]
    assert sorted(line.partition("seed ")[2] for line in lines[4:]) == ["2, gamma 1.0", "3, gamma 0.5"]


def test_the_same_settings_of_another_version_are_told_apart() -> None:
    """Where a kind's version or a file's text makes other runs of the same settings, that is told."""
    one = run(0)
    newer = replace(one, spec=replace(one.spec, version=2))
    lines = diff(Shelf(one), Shelf(newer)).text("a", "b").splitlines()
    assert lines[2::2] == [f"  {one.spec.hash}  seed 0, version 1", f"  {newer.spec.hash}  seed 0, version 2"]
    edited = [replace(one, spec=replace(one.spec, files={"my.maze": text})) for text in ("#", "##")]
    first, second = diff(*map(Shelf, edited)).text().splitlines()[2::2]
    assert "seed 0, text of my.maze " in first
    assert first.split()[-1] != second.split()[-1]


def test_results_that_differ() -> None:
    """A measure that differs is told with both numbers, and with the provenance that may explain it."""
    other = run(0, torch="2.14", measures={"steps": 130.5, "never": 3.0})
    found = diff(Shelf(run(0), run(1)), Shelf(other, run(1)))
    (differing,) = found.differing
    assert differing.measures == {"steps": (100.0, 130.5), "never": (None, 3.0)}
    assert differing.provenance == {"libraries.torch": ("2.13", "2.14")}
    assert (differing.others, found.same, found.status) == ((), 1, 1)
    assert found.text().splitlines()[1:] == [
        "1 run has other results in the second than in the first:",
        f"  {other.spec.hash}  seed 0: steps 100.0 -> 130.5 (+30.5), never nothing -> 3.0",
        "What differs in their provenance:",
        "  libraries.torch: 2.13 -> 2.14 (1 of 1)",
    ]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"curves": {"learning": {"x": [1, 2], "y": [0.5, 0.5]}}}, "curves.learning differs"),
        ({"curves": {}}, "curves.learning differs"),
        ({"details": {"cells": [[1, 3]]}}, "details.cells differs"),
        ({"details": {"cells": [[1, 2]], "more": None}}, "details.more differs"),
        ({"measures": {"steps": 100.0, "never": 0.0}}, "never nothing -> 0.0"),
    ],
)
def test_any_part_of_a_result_counts(changes: dict[str, Any], words: str) -> None:
    """A curve, a detail, and a number in place of nothing are differences like any other."""
    found = diff(Shelf(run(0)), Shelf(run(0, **changes)))
    assert words in found.text()
    assert "Their provenance is the same: a kind of run may not be repeatable." in found.text()


def test_a_measure_left_out_is_none() -> None:
    """A measure that is left out and one that is None are the same, as kinds have it."""
    assert diff(Shelf(run(0)), Shelf(run(0, measures={"steps": 100.0}))).status == 0


def test_long_lists_are_cut() -> None:
    """Of many runs the first twenty are told one by one, and how many more there are."""
    found = diff(Shelf(*map(run, range(25))), Shelf())
    assert len(found.text().splitlines()) == 2 + 20 + 1
    assert found.text().endswith("and 5 more")
    assert len(found.only_first) == 25
