"""A repaired field equals the field searched anew, after any sequence of changes."""

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from numpy.typing import NDArray

from planners.grid import certify_grid, grid_field, mutual, plain_first_actions, plain_grid_field
from planners.repair import SMALLEST, RepairableField
from worlds import Stream, UserError

Cell = tuple[int, int]


def _maze(rows: int, cols: int, stream: Stream) -> NDArray[np.bool_]:
    """Return a perfect maze: rooms on even rows and columns, joined without a ring."""
    free = np.zeros((rows, cols), np.bool_)
    free[0, 0] = True
    trail = [(0, 0)]
    while trail:
        row, col = trail[-1]
        ways = [
            (down, right)
            for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1))
            if 0 <= row + 2 * down < rows and 0 <= col + 2 * right < cols
            if not free[row + 2 * down, col + 2 * right]
        ]
        if not ways:
            trail.pop()
            continue
        down, right = stream.choose(ways)
        free[row + down, col + right] = free[row + 2 * down, col + 2 * right] = True
        trail.append((row + 2 * down, col + 2 * right))
    return free


def _grid(kind: str, rows: int, cols: int, stream: Stream) -> NDArray[np.bool_]:
    if kind == "open":
        return np.ones((rows, cols), np.bool_)
    if kind == "maze":
        return _maze(rows, cols, stream)
    return np.array([[stream.uniform() >= 0.3 for _ in range(cols)] for _ in range(rows)])


class Edits(RuleBasedStateMachine):
    """Obstacles appear and go on a grid of any kind, on the route and off it."""

    @initialize(
        kind=st.sampled_from(["open", "30 %", "maze"]),
        shape=st.tuples(st.integers(1, 13), st.integers(1, 13)),
        seed=st.integers(0, 2**32),
        goals=st.integers(0, 3),
        walls=st.booleans(),
        share=st.sampled_from([0.0, 0.05, 0.3, 1.0]),
    )
    def begin(self, *, kind: str, shape: Cell, seed: int, goals: int, walls: bool, share: float) -> None:
        """Draw the grid."""
        stream = Stream(seed)
        self.free = _grid(kind, *shape, stream)
        self.goals = [(stream.below(shape[0]), stream.below(shape[1])) for _ in range(goals)]
        ways = np.array([[stream.below(256) | 9 for _ in range(shape[1])] for _ in range(shape[0])])
        self.passages = (ways & 15).astype(np.uint8) if walls else None
        self.field = RepairableField(self.free, self.goals, self.passages, smallest=0, share=share)

    def _toggle(self, cell: Cell) -> None:
        change = self.field.block if self.free[cell] else self.field.free
        undo = self.field.free if self.free[cell] else self.field.block
        assert not undo(cell)
        assert change(cell)
        self.free[cell] ^= True

    @rule(row=st.integers(0, 12), col=st.integers(0, 12))
    def change(self, row: int, col: int) -> None:
        """Change any cell."""
        self._toggle((row % self.free.shape[0], col % self.free.shape[1]))

    @precondition(lambda self: (self.field.distance > 0).any())
    @rule(data=st.data())
    def obstruct(self, data: st.DataObject) -> None:
        """Put an obstacle where a route leads, perhaps on its goal."""
        cells = np.argwhere(self.field.distance >= 0)
        row, col = cells[data.draw(st.integers(0, len(cells) - 1))]
        self._toggle((int(row), int(col)))

    @rule(index=st.integers(0, 2))
    def change_a_goal(self, index: int) -> None:
        """Put an obstacle on a goal, or take it off."""
        if self.goals:
            self._toggle(self.goals[index % len(self.goals)])

    @invariant()
    def equals_a_search(self) -> None:
        """Distances, free cells and optimal first actions are those of a plain search now."""
        if not hasattr(self, "field"):
            return
        expected = plain_grid_field(self.free, self.goals, self.passages)
        assert np.array_equal(self.field.distance, expected)
        assert np.array_equal(self.field.free_cells, self.free)
        assert self.field.reached == np.count_nonzero(expected >= 0)
        sets = plain_first_actions(self.free, expected, self.passages)
        for cell in np.ndindex(self.free.shape):
            at = (cell[0], cell[1])
            assert self.field.first_actions(at) == int(sets[at])
            assert self.field.steps(at) == int(expected[at])


TestEdits = Edits.TestCase
TestEdits.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)


@pytest.mark.parametrize("kind", ["open", "30 %", "maze"])
@pytest.mark.parametrize("walls", [False, True])
def test_long_sequences_on_grids_of_the_size_repaired(kind: str, walls: bool) -> None:
    """Hundreds of changes at the default settings, most of them repaired, leave the right field."""
    stream = Stream(11, len(kind), walls)
    free = _grid(kind, 81, 91, stream)
    rolls = np.array([[stream.below(8) for _ in range(91)] for _ in range(81)])
    passages = mutual(np.where(rolls == 0, 13, 15).astype(np.uint8)) if walls else None
    goals = [(0, 0), (40, 40)]
    field = RepairableField(free, goals, passages)
    assert free.size >= SMALLEST
    changes = 400
    for k in range(changes):
        at = (stream.below(81), stream.below(91))
        if field.free_cells[at]:
            field.block(at)
        else:
            field.free(at)
        free[at] ^= True
        if k % 20 == 0:
            assert np.array_equal(field.distance, grid_field(free, goals, passages))
    assert certify_grid(free, goals, field.distance, passages) == ()
    assert field.searches < changes / 4


def test_small_grids_are_searched_anew() -> None:
    """Below 64 x 64 every change is followed by a search; from there on, one off every route is not."""
    for side, searches in ((63, 3), (64, 1)):
        field = RepairableField(np.ones((side, side), np.bool_), [(0, 0)])
        assert field.block((side - 1, side - 1))
        assert field.free((side - 1, side - 1))
        assert field.searches == searches


def test_a_search_anew_takes_over() -> None:
    """In a corridor an obstacle cuts off all cells behind it: few are repaired, many are searched anew."""
    field = RepairableField(np.ones((1, 64 * 64)), [(0, 0)])
    assert field.block((0, 4092))
    assert field.searches == 1
    assert field.block((0, 2))
    assert (field.searches, field.reached) == (2, 2)


def test_an_obstacle_on_the_only_goal() -> None:
    """No cell has a way while the goal is blocked, and the field comes back with it."""
    free = np.ones((70, 70), np.bool_)
    field = RepairableField(free, [(3, 4)])
    before = field.distance
    assert field.block((3, 4))
    assert (field.distance == -1).all()
    assert field.first_actions((3, 5)) == 0
    assert field.free((3, 4))
    assert np.array_equal(field.distance, before)


def test_cells_off_the_grid_are_refused() -> None:
    """A cell is checked before it is read or changed."""
    field = RepairableField(np.ones((3, 4)), [(0, 0)])
    for use in (field.block, field.free, field.steps, field.first_actions):
        for cell in ((-1, 0), (0, 4), (3, 0)):
            with pytest.raises(UserError, match="is not on the grid of 3 rows and 4 columns"):
                use(cell)
