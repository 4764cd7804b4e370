"""The shortcut audit: groups of frames, and what becomes of those that were kept out of training."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shortcuts import ByColour, painted

from perception.audit import (
    HUES,
    accuracies,
    audit,
    confusion_of,
    groups,
    groups_to_hold_out,
    held_out_audit,
    hues,
    shared_groups,
    without,
)
from perception.labelled import Labelled
from perception.percepts import Percepts
from perception.protocol import Frames

DATA, TEST = painted(range(300), 0), painted(range(200), 200)


def fit_by_colour(data: Labelled) -> Callable[[Frames], Percepts]:
    """Return what goes by mean colour alone."""
    return ByColour().fit(data, 0).perceive


def test_every_obstacle_has_one_colour_one_size_and_one_distance() -> None:
    """Groups of each kind hold every obstacle once; the rest is a group of its own."""
    found = groups(TEST)
    for kind in ("colour", "size", "distance"):
        total = sum(rows.astype(int) for name, rows in found.items() if name.startswith(kind))
        assert np.array_equal(total, (TEST.labels > 0).astype(int))
    counted = audit(fit_by_colour(DATA), TEST)
    assert sum(of for _, of in counted.values()) == (TEST.labels == 0).sum() + 3 * (TEST.labels > 0).sum()
    assert all(right == of for right, of in counted.values())


def test_hues_kept_out_show_who_goes_by_colour() -> None:
    """Next to each hue lie hues of the other label: a backend that goes by colour is always wrong on it."""
    found = {one.group: one for one in held_out_audit(fit_by_colour, DATA, TEST)}
    assert tuple(found) == groups_to_hold_out()
    for hue, paint in zip(HUES, range(6), strict=True):
        one = found[f"colour {hue}"]
        label = 1 + paint % 2
        assert one.frames > 10
        assert (one.reference_right, one.right, one.both) == (one.frames, 0, 0)
        assert one.errors[3 - label] == one.frames  # taken for the other shape
        assert one.apart[label][3 - label] == one.frames
    for group in groups_to_hold_out()[6:]:
        assert (found[group].right, found[group].errors) == (found[group].frames, (0, 0, 0))


def test_a_group_kept_out_is_not_learnt_from() -> None:
    """Everything is learnt from once, for the reference, and all but the group once for each group."""
    learnt: list[Any] = []

    def fit(data: Labelled) -> Callable[[Frames], Percepts]:
        learnt.append(data)
        return fit_by_colour(data)

    (one,) = held_out_audit(fit, DATA, TEST, ("distance 2",))
    assert [len(data.labels) for data in learnt] == [len(DATA), one.learnt_from]
    assert set(learnt[1].distances[learnt[1].labels > 0].tolist()) == {1}
    assert one.learnt_from == len(DATA) - ((DATA.labels > 0) & (DATA.distances == 2)).sum()


@pytest.mark.parametrize(
    ("data", "group", "message"),
    [
        (DATA, "colour of the wind", "no group 'colour of the wind'; groups: nothing ahead, colour red"),
        (DATA, "colour grey", "no group 'colour grey'"),
        (DATA[:0], "colour red", "no group 'colour red'"),
        (DATA[groups(DATA)["colour red"]], "colour red", "all there is to learn from"),
    ],
)
def test_a_group_that_cannot_be_kept_out_is_refused(data: Any, group: str, message: str) -> None:
    """It is not there, or there is nothing else."""
    with pytest.raises(ValueError, match=re.escape(message)):
        without(data, group)


def test_groups_that_only_one_of_the_data_holds_are_left_out() -> None:
    """What is not learnt from cannot be kept out, and what is not tested cannot be measured."""
    blueless = DATA[~groups(DATA)["colour blue"]]
    for pair in ((blueless, TEST), (TEST, blueless)):
        assert set(groups_to_hold_out()) - set(shared_groups(*pair)) == {"colour blue"}


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 2)), max_size=30))
def test_a_confusion_counts_every_frame_once(pairs: list[tuple[int, int]]) -> None:
    """In the row of what it is and the column of what it was taken for."""
    labels, seen = np.array(pairs, np.int64).reshape(-1, 2).T
    matrix = confusion_of(labels, seen)
    assert all(matrix[true][told] == pairs.count((true, told)) for true in range(3) for told in range(3))


def test_primary_colours_have_their_names() -> None:
    """Each hue's own colour and its darker shade bear its name, and accuracies leave empty groups out."""
    pure = np.array(
        [[255, 0, 0], [255, 255, 0], [0, 255, 0], [0, 255, 255], [0, 0, 255], [255, 0, 255]], np.uint8
    )
    assert hues(pure).tolist() == hues(pure // 3).tolist()
    assert hues(pure).tolist() == ["red", "yellow", "green", "cyan", "blue", "magenta"]
    assert accuracies(np.zeros(1), np.zeros(1), {"none": np.array([False])}) == {}
