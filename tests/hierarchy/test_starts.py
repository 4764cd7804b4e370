"""Where episodes begin: a predicate chooses among a world's starts, and nothing else changes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hierarchy import GroundGraph, ground
from hierarchy.four_rooms import four_rooms_graph
from hierarchy.starts import beginning_where
from hierarchy.text_words import PredicateError
from worlds import Cell, UserError
from worlds.four_rooms import CELLS, four_rooms_model, starts_for


@cache
def rooms() -> GroundGraph:
    """Return the four rooms."""
    return ground(four_rooms_graph(), four_rooms_model())


@given(st.sampled_from(CELLS))
def test_a_goal_is_chosen(goal: Cell) -> None:
    """The starts are those of the world in which it is there."""
    starts = beginning_where(rooms(), f"goal = {goal}").model.starts
    np.testing.assert_array_equal(starts, starts_for(rooms().model.index, goal))


@given(st.sets(st.sampled_from(CELLS), min_size=1), st.sets(st.sampled_from(CELLS), min_size=1))
def test_it_chooses_among_the_starts(robots: set[Cell], goals: set[Cell]) -> None:
    """Never a state that was no start, and of two predicates what both choose."""
    one, other = (
        f"{name} in {{{', '.join(map(str, cells))}}}" for name, cells in (("robot", robots), ("goal", goals))
    )
    whole = rooms().model.starts
    masks = []
    for text in (one, other, f"{one} and {other}"):
        try:
            masks.append(beginning_where(rooms(), text).model.starts)
        except UserError:
            masks.append(np.zeros_like(whole))
    assert not (masks[0] & ~whole).any()
    np.testing.assert_array_equal(masks[2], masks[0] & masks[1])


def test_nothing_else_changes() -> None:
    """The world's moves, the tasks and the graph given are as they were."""
    before = rooms().model.starts.copy()
    found = beginning_where(rooms(), "goal = 7,9")
    assert found.graph is rooms().graph
    assert found.nodes is rooms().nodes
    for name in ("outcomes", "outcome_rewards", "probabilities"):
        np.testing.assert_array_equal(getattr(found.model, name), getattr(rooms().model, name))
    np.testing.assert_array_equal(rooms().model.starts, before)


def test_twice_is_both() -> None:
    """A second predicate chooses among what the first has left."""
    once = beginning_where(rooms(), "goal = 7,9 and robot in {1,1, 1,2}").model.starts
    twice = beginning_where(beginning_where(rooms(), "goal = 7,9"), "robot in {1,1, 1,2}").model.starts
    np.testing.assert_array_equal(once, twice)
    assert once.sum() == 2


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("gaol = 7,9", "did you mean 'goal'"),
        ("goal = 0,0", "0,0"),
        ("goal 7,9", "goal 7,9"),
        ("", "is missing before 'the end'"),
    ],
)
def test_what_is_no_predicate_is_told(text: str, problem: str) -> None:
    """An unknown variable or value, and what cannot be read."""
    with pytest.raises(PredicateError, match=problem):
        beginning_where(rooms(), text)


@pytest.mark.parametrize("text", ["robot = 7,9 and goal = 7,9", "robot = goal"])
def test_no_start_is_told(text: str) -> None:
    """Where it holds in none of the starts, the message says how many there are to choose among."""
    with pytest.raises(UserError, match=r"no start has .*; choose among the world's 10712 starts"):
        beginning_where(rooms(), text)
