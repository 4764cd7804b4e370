"""What networks see of states: which columns there are, and which of them are on."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from worlds import Cell, StateIndex, UserError, Variable, encoding, load_layout, maze_variables
from worlds.encoding import Encoding

_CELLS = st.builds(Cell, st.integers(-2, 9), st.integers(0, 9))


@st.composite
def _indices(draw: st.DrawFn) -> StateIndex:
    """Draw state variables whose values are words, integers or cells."""
    domains = st.one_of(
        st.lists(st.integers(), min_size=1, max_size=4, unique=True),
        st.lists(st.text(), min_size=1, max_size=4, unique=True),
        st.lists(_CELLS, min_size=1, max_size=5, unique=True),
    )
    values = draw(st.lists(domains, min_size=1, max_size=3))
    labels = (tuple(f"{place}" for place in range(len(domain))) for domain in values)
    return StateIndex(
        tuple(
            Variable(f"v{i}", tuple(domain), label)
            for i, (domain, label) in enumerate(zip(values, labels, strict=True))
        )
    )


def _by_hand(index: StateIndex, state: int) -> list[float]:
    """Return the columns of a state, told value by value."""
    found: list[bool] = []
    for variable, value in zip(index.variables, index.state(state), strict=True):
        found += [value == other for other in variable.values]
        if all(isinstance(other, Cell) for other in variable.values):
            cells = [other for other in variable.values if isinstance(other, Cell)]
            assert isinstance(value, Cell)
            found += [value.row == row for row in sorted({cell.row for cell in cells})]
            found += [value.col == col for col in sorted({cell.col for cell in cells})]
    return [float(on) for on in found]


@given(_indices())
def test_each_column_is_on_where_its_value_is(index: StateIndex) -> None:
    """A column for every value, and of cells for every row and column, in the order of the variables."""
    seen = Encoding(index)(torch.arange(index.size))
    assert seen.dtype == torch.float32
    assert seen.tolist() == [_by_hand(index, state) for state in range(index.size)]


@given(_indices())
def test_large_worlds_look_the_same(index: StateIndex) -> None:
    """Where one table of all states would be too large, the variables' own tables give the same."""
    whole = Encoding(index)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(encoding, "_MOST", 0)
        parted = Encoding(index)
    states = torch.arange(index.size)
    assert parted(states).equal(whole(states))


def test_a_world_too_large_for_a_table_is_seen() -> None:
    """A billion states need no more memory than their variables' values."""
    index = StateIndex(tuple(Variable(f"v{i}", tuple(range(32))) for i in range(6)))
    last = Encoding(index)(torch.tensor([index.size - 1]))
    assert last.nonzero()[:, 1].tolist() == [31, 63, 95, 127, 159, 191]


def test_states_may_stand_in_any_shape() -> None:
    """Columns come last, also of a single state."""
    index = StateIndex(maze_variables(load_layout("two_rooms")))
    seen = Encoding(index)
    states = torch.arange(24).reshape(2, 3, 4)
    assert seen(states).shape == (2, 3, 4, len(seen.columns))
    assert seen(states)[1, 2, 3].equal(seen(torch.tensor(23)))


def test_a_maze_has_rows_and_columns_besides_cells() -> None:
    """A cell has its own column, one for its row and one for its column of the grid; the doors have two."""
    variables = maze_variables(load_layout("two_rooms"))
    seen = Encoding(StateIndex(variables))
    lines = {v.name: len({c.row for c in v.values}) + len({c.col for c in v.values}) for v in variables[:3]}  # type: ignore[attr-defined]
    assert {name: seen.columns.count(name) for name in ("robot", "trigger", "goal", "doors")} == {
        "robot": 64 + lines["robot"],
        "trigger": 4 + lines["trigger"],
        "goal": 4 + lines["goal"],
        "doors": 2,
    }


def test_reading_some_variables_is_reading_their_columns() -> None:
    """The columns of others are left out; of no variable there are none."""
    seen = Encoding(StateIndex(maze_variables(load_layout("two_rooms"))))
    chosen = seen.reading(["robot", "doors"])
    assert [name in ("robot", "doors") for name in seen.columns] == chosen.tolist()
    assert not seen.reading([]).any()
    assert seen.reading(seen.index.names).all()


def test_an_unknown_variable_is_refused() -> None:
    """The error suggests the right name."""
    seen = Encoding(StateIndex(maze_variables(load_layout("two_rooms"))))
    with pytest.raises(UserError, match="there is no state variable 'goals'; did you mean 'goal'"):
        seen.reading(["robot", "goals"])


def test_an_encoding_of_ones_own_is_taken_as_it_is() -> None:
    """A table of numbers is looked up by state, and its columns are read by the variables they tell of."""
    index = StateIndex((Variable("x", (0, 1, 2)), Variable("door", ("shut", "open"))))
    seen = np.arange(18, dtype=np.float32).reshape(6, 3)
    encoding = Encoding.of_table(index, seen, ["x", "x", "door"])
    assert encoding(torch.tensor([[5], [0]])).tolist() == [[[15.0, 16.0, 17.0]], [[0.0, 1.0, 2.0]]]
    assert encoding.reading(["x"]).tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("shape", "columns", "message"),
    [((5, 1), ["x"], r"shape \(5, 1\) does not fit"), ((6, 1), ["y"], "no state variable 'y'")],
)
def test_a_table_that_does_not_fit_is_refused(
    shape: tuple[int, int], columns: list[str], message: str
) -> None:
    """Too few rows, or a column of a variable that the world lacks."""
    index = StateIndex((Variable("x", (0, 1, 2)), Variable("door", ("shut", "open"))))
    with pytest.raises(UserError, match=message):
        Encoding.of_table(index, np.zeros(shape, np.float32), columns)
