import copy
import pickle
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from worlds import StateIndex, Variable

sizes = st.lists(st.integers(1, 4), min_size=1, max_size=4)


def _index(domain_sizes: list[int]) -> StateIndex:
    return StateIndex(tuple(Variable(f"v{i}", tuple(range(n))) for i, n in enumerate(domain_sizes)))


def test_a_variable_knows_its_values() -> None:
    """Positions follow the order given, labels default to the values' own words."""
    variable = Variable("size", (3, 1, 2))
    assert [variable.position(value) for value in (3, 1, 2)] == [0, 1, 2]
    assert variable.labels == ("3", "1", "2")
    assert len(variable) == 3
    assert 1 in variable
    assert 4 not in variable


def test_labels_replace_the_values_in_print() -> None:
    """A label is found by its value."""
    assert Variable("doors", (0, 1), ("shut", "open")).label(1) == "open"


@pytest.mark.parametrize(
    ("values", "labels", "message"),
    [
        ((), (), "variable 'v' has no values; give it at least one"),
        ((1, 2, 1), (), "variable 'v' holds a value twice; make its values distinct"),
        ((1, 2), ("one",), "variable 'v' has 2 values but 1 labels"),
    ],
)
def test_a_bad_domain_is_refused(values: tuple[int, ...], labels: tuple[str, ...], message: str) -> None:
    """The error names the variable and the mend."""
    with pytest.raises(ValueError, match=f"^{message}$"):
        Variable("v", values, labels)


def test_an_unknown_value_is_named() -> None:
    """The error lists what the domain holds."""
    with pytest.raises(KeyError, match=r"'ajar' is not a value of variable 'doors' \(shut, open\)"):
        Variable("doors", ("shut", "open")).position("ajar")


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])  # noqa: S301
def test_variables_travel_between_processes(clone: object) -> None:
    """A copy and a pickle equal the original and still find values."""
    assert callable(clone)
    index = _index([2, 3])
    twin = clone(index)
    assert twin == index
    assert twin.number((1, 2)) == 5


@given(sizes)
def test_numbering_is_one_to_one_in_c_order(domain_sizes: list[int]) -> None:
    """States are numbered as itertools.product lists them, and a number gives its state back."""
    index = _index(domain_sizes)
    states = list(product(*(range(n) for n in domain_sizes)))
    assert index.size == len(states)
    assert [index.number(state) for state in states] == list(range(len(states)))
    assert list(index) == states


@given(sizes)
def test_columns_hold_each_state_s_values(domain_sizes: list[int]) -> None:
    """Column v of state s is what `state` says of it."""
    index = _index(domain_sizes)
    columns = np.stack([index.column(name) for name in index.names])
    assert [tuple(column) for column in columns.T] == list(index)
    assert index.shape == tuple(domain_sizes)


@given(sizes, st.data())
def test_a_projection_tells_states_apart_by_the_named_variables_alone(
    domain_sizes: list[int], data: st.DataObject
) -> None:
    """Two states share a number exactly if they agree on the named variables."""
    index = _index(domain_sizes)
    names = data.draw(st.lists(st.sampled_from(index.names), unique=True))
    places = [index.names.index(name) for name in names]
    seen: dict[int, tuple[object, ...]] = {}
    for number, state in zip(index.project(names), index, strict=True):
        assert seen.setdefault(int(number), tuple(state[i] for i in places)) == tuple(
            state[i] for i in places
        )
    assert len(seen) == np.prod([domain_sizes[i] for i in places], dtype=int)


def test_two_variables_of_one_name_are_refused() -> None:
    """Names tell variables apart."""
    x = Variable("x", (0, 1))
    with pytest.raises(ValueError, match="two state variables share a name: x, x"):
        StateIndex((x, x))
