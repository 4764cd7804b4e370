"""The search of any transition model in machine code equals the plain one."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from planners.field_kernels import search
from planners.fields import certify, distance_field, plain_distance_field

Problem = tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]


@st.composite
def problems(draw: st.DrawFn) -> Problem:
    """Draw any successors, some of which are perhaps no states, goals (perhaps none) and allowed actions."""
    states, actions = draw(st.integers(1, 30)), draw(st.integers(1, 4))
    low, high = draw(st.sampled_from([(0, states - 1), (-2, states + 2)]))
    successors = draw(arrays.arrays(np.int64, (states, actions), elements=st.integers(low, high)))
    goal = draw(arrays.arrays(np.bool_, states, elements=st.sampled_from([True, False, False, False])))
    return successors, goal, draw(arrays.arrays(np.bool_, (states, actions)))


@settings(max_examples=300, deadline=None)
@given(problems())
def test_the_kernel_equals_the_plain_search(problem: Problem) -> None:
    """Every distance is the same, and of the same type."""
    successors, goal, allowed = problem
    distance = search(successors, goal, allowed)
    plain = plain_distance_field(successors, goal, allowed).distance
    assert distance.dtype == plain.dtype
    assert np.array_equal(distance, plain)


def test_large_tables_go_to_the_kernel_with_equal_results() -> None:
    """Below and above the size that decides, in any memory order, both searches agree and are certified."""
    rng = np.random.default_rng(5)
    for states in (2**14 - 1, 2**14):
        successors = rng.integers(0, states, (states, 4))
        successors[:, 2:] = np.arange(states)[:, None]
        goal, allowed = rng.random(states) < 0.001, rng.random((states, 4)) < 0.6
        for table in (successors, np.asfortranarray(successors)):
            field = distance_field(table, goal, allowed)
            plain = plain_distance_field(table, goal, allowed)
            assert np.array_equal(field.distance, plain.distance)
            assert field.distance.dtype == plain.distance.dtype
            assert np.array_equal(field.optimal(), plain.optimal())
            assert certify(field) == ()
