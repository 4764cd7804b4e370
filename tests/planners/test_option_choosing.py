from itertools import product

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from planners.option_critic.choosing import any_of, first_ended, greedy, of_option, permitted, upon_arrival
from worlds.torch_stream import generator


def test_one_level_is_the_published_equation() -> None:
    """U = (1 - beta) Q(s', o) + beta max Q(s', .), and its advantage (Bacon et al., equations 3 and 7)."""
    values = torch.tensor([[2.0, 10.0, 6.0]])
    option, ending = torch.tensor([0]), torch.tensor([[0.25]])
    worth, ahead = upon_arrival(values, option, ending, torch.ones(1, 1, 3, dtype=torch.bool), 0.0)
    assert worth.tolist() == [0.75 * 2 + 0.25 * 10]
    assert ahead.tolist() == [[2.0 - 10]]


def test_what_may_not_be_chosen_is_not_counted_on() -> None:
    """The best that may begin here is worth 6, and to change over costs 1."""
    may = torch.tensor([[[True, False, True]]])
    worth, ahead = upon_arrival(
        torch.tensor([[2.0, 10.0, 6.0]]), torch.tensor([0]), torch.tensor([[0.5]]), may, 1.0
    )
    assert worth.tolist() == [0.5 * 2 + 0.5 * (6 - 1)]
    assert ahead.tolist() == [[2.0 - 5]]


def test_two_levels_by_hand() -> None:
    """The upper level ends in a half of the cases, the lower in a half of the others."""
    may = torch.tensor([[True, True, True, True], [True, True, False, False]])
    values = torch.tensor([1.0, 3.0, 8.0, 0.0])
    worth, ahead = upon_arrival(values, torch.tensor(0), torch.tensor([0.5, 0.5]), may, 0.0)
    assert float(worth) == 0.5 * 8 + 0.25 * 3 + 0.25 * 1
    # Above, it is better to end by what is lost until then; below, only in the half that gets there.
    assert ahead.tolist() == [(3 + 1) / 2 - 8, 0.5 * (1 - 3)]


def test_with_nothing_to_choose_an_option_goes_on() -> None:
    """Its worth is its own, whatever ends, and nothing draws its termination either way."""
    may = torch.zeros(1, 2, 3, dtype=torch.bool)
    worth, ahead = upon_arrival(
        torch.tensor([[4.0, 5.0, 6.0]]), torch.tensor([1]), torch.ones(1, 2), may, 9.0
    )
    assert worth.tolist() == [5.0]
    assert ahead.tolist() == [[0.0, 0.0]]


class _Arrival:
    """Random values, masks and endings of some levels and options."""

    def __init__(self, seed: int, levels: int, options: int) -> None:
        draw = generator(seed)
        self.values = torch.randn(options, generator=draw, dtype=torch.float64)
        self.option = int(torch.randint(options, (), generator=draw))
        self.ending = torch.rand(levels, generator=draw, dtype=torch.float64)
        self.may = torch.rand(levels, options, generator=draw) < 0.6
        self.cost = float(torch.rand((), generator=draw))

    def worth(self, ending: torch.Tensor) -> torch.Tensor:
        found, _ = upon_arrival(self.values, torch.tensor(self.option), ending, self.may, self.cost)
        return found


arrivals = st.builds(_Arrival, st.integers(0, 10**6), st.integers(1, 4), st.integers(1, 5))


@settings(max_examples=60, deadline=None)
@given(arrivals)
def test_worth_is_the_mean_over_all_that_may_end(arrival: _Arrival) -> None:
    """Every level ends or not; the outermost that has ended says what may be chosen."""
    mean = 0.0
    values = arrival.values.tolist()
    for ends in product([False, True], repeat=len(arrival.ending)):
        chance = np.prod([p if end else 1 - p for end, p in zip(ends, arrival.ending.tolist(), strict=True)])
        may = arrival.may[ends.index(True)].tolist() if any(ends) else []
        best = max((value for value, one in zip(values, may, strict=False) if one), default=None)
        mean += chance * (values[arrival.option] if best is None else best - arrival.cost)
    assert float(arrival.worth(arrival.ending)) == pytest.approx(mean)


@settings(max_examples=60, deadline=None)
@given(arrivals)
def test_ahead_is_minus_the_gradient_by_what_ends(arrival: _Arrival) -> None:
    """By finite differences, which are exact: the worth is linear in each level's ending."""
    option = torch.tensor(arrival.option)
    _, ahead = upon_arrival(arrival.values, option, arrival.ending, arrival.may, arrival.cost)
    for level in range(len(arrival.ending)):
        changed = [arrival.ending.clone(), arrival.ending.clone()]
        for value, ending in enumerate(changed):
            ending[level] = value
        slope = float(arrival.worth(changed[1]) - arrival.worth(changed[0]))
        assert float(ahead[level]) == pytest.approx(-slope, abs=1e-12)


masks = st.lists(st.lists(st.booleans(), min_size=4, max_size=4), min_size=1, max_size=5)


@given(masks, st.floats(0, 1, exclude_max=True, width=32))
def test_any_of_gives_the_one_that_a_draw_names(rows: list[list[bool]], draw: float) -> None:
    """Of n that may be chosen the draw names one each n-th of the way; where there is none, some option."""
    found = any_of(torch.tensor(rows), torch.full((len(rows),), draw)).tolist()
    for row, one in zip(rows, found, strict=True):
        may = [k for k, allowed in enumerate(row) if allowed]
        assert one == may[min(int(np.float32(draw) * len(may)), len(may) - 1)] if may else 0 <= one < len(row)


@given(masks)
def test_first_ended_is_the_outermost(rows: list[list[bool]]) -> None:
    """As Python's index has it."""
    switch, level = first_ended(torch.tensor(rows))
    assert switch.tolist() == [any(row) for row in rows]
    assert level.tolist() == [row.index(True) if any(row) else 0 for row in rows]


@given(masks, st.lists(st.integers(-3, 3), min_size=4, max_size=4))
def test_greedy_takes_the_first_of_the_best(rows: list[list[bool]], values: list[int]) -> None:
    """Among those that may be chosen only."""
    assume(all(map(any, rows)))
    found = greedy(torch.tensor([values] * len(rows)).float(), torch.tensor(rows)).tolist()
    for row, one in zip(rows, found, strict=True):
        best = max(value for value, may in zip(values, row, strict=True) if may)
        assert one == next(k for k in range(4) if row[k] and values[k] == best)


@given(masks, st.lists(st.floats(-5, 5), min_size=4, max_size=4))
def test_permitted_shares_out_among_what_may_be_taken(rows: list[list[bool]], logits: list[float]) -> None:
    """As the textbook's softmax over them alone, or over all where none may be."""
    found = permitted(torch.tensor([logits] * len(rows), dtype=torch.float64), torch.tensor(rows)).exp()
    for row, chances in zip(rows, found.tolist(), strict=True):
        odds = [np.exp(x) * (may or not any(row)) for x, may in zip(logits, row, strict=True)]
        assert chances == pytest.approx([x / sum(odds) for x in odds])


def test_of_option_takes_rows_of_any_batch() -> None:
    """One row of each table, and flags as well as numbers."""
    found = torch.arange(2 * 3 * 4 * 5).view(2, 3, 4, 5)
    option = torch.tensor([[0, 3, 1], [2, 2, 0]])
    rows = of_option(found, option)
    for i, j in product(range(2), range(3)):
        assert rows[i, j].tolist() == found[i, j, option[i, j]].tolist()
    assert of_option(found > 50, option).tolist() == (rows > 50).tolist()
