"""The four rooms: their plan, both published dynamics, and the exact optimum of each."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners import flat_optimum
from worlds import ACTIONS, Cell, TransitionModel, UserError
from worlds.four_rooms import (
    AREAS,
    CELLS,
    DOORS,
    FIRST_GOAL,
    HALLWAYS,
    LATER_GOALS,
    ROOMS,
    Rules,
    four_rooms_model,
    starts_for,
)


def _outcomes(model: TransitionModel, cell: Cell, action: str) -> dict[Cell, float]:
    """Return where an action leads from a cell, with probabilities."""
    state, k = model.index.number((cell, FIRST_GOAL)), ACTIONS.index(action)
    found: dict[Cell, float] = {}
    for to, chance in zip(model.outcomes[state, k], model.probabilities[state, k], strict=True):
        if chance:
            robot = model.index.state(int(to))[0]
            assert isinstance(robot, Cell)
            found[robot] = float(chance)
    return found


def _beside(cell: Cell) -> list[Cell]:
    near = [Cell(cell.row + rows, cell.col + cols) for rows, cols in ((-1, 0), (1, 0), (0, -1), (0, 1))]
    return [to for to in near if to in CELLS]


def _steps(model: TransitionModel, *goals: Cell) -> float:
    """Return the mean expected steps of an optimal policy over all starts with the goal in some cells."""
    robot, goal = model.index.column("robot"), model.index.column("goal")
    best = flat_optimum(model, robot == goal).value
    return -float(np.mean([best[starts_for(model.index, cell)].mean() for cell in goals]))


def test_the_plan_is_the_published_one() -> None:
    """104 cells in rooms of 25, 30, 25 and 20 and four hallways; the first goal is the code's cell 62."""
    assert len(CELLS) == 104
    assert {name: len(room) for name, room in ROOMS.items()} == {"NW": 25, "NE": 30, "SW": 25, "SE": 20}
    assert sorted([*HALLWAYS.values(), *(cell for room in ROOMS.values() for cell in room)]) == sorted(CELLS)
    assert CELLS.index(FIRST_GOAL) == 62
    assert set(LATER_GOALS) == ROOMS["SE"]


def test_hallways_join_the_rooms_that_name_them() -> None:
    """Each hallway has one neighbour in either of its rooms, and no other; rooms touch nowhere else."""
    for name, hall in HALLWAYS.items():
        joined = [room for room, halls in DOORS.items() if name in halls]
        assert len(joined) == 2
        assert sorted(next(r for r in ROOMS if to in ROOMS[r]) for to in _beside(hall)) == sorted(joined)
    for room, cells in ROOMS.items():
        outside = {to for cell in cells for to in _beside(cell)} - cells
        assert outside == {HALLWAYS[name] for name in DOORS[room]}
        assert AREAS[room] == cells | outside


def test_a_second_move_may_follow_by_the_code_s_rules() -> None:
    """To any free cell beside where the first has led, one in three; a move that a wall stops has none."""
    model = four_rooms_model()
    assert _outcomes(model, Cell(1, 1), "North") == {Cell(1, 1): 1.0}
    assert _outcomes(model, Cell(1, 2), "West") == pytest.approx(
        {Cell(1, 1): 2 / 3, Cell(2, 1): 1 / 6, Cell(1, 2): 1 / 6}
    )
    through = {Cell(7, 9): 2 / 3, Cell(6, 9): 1 / 6, Cell(8, 9): 1 / 6}
    assert _outcomes(model, Cell(6, 9), "South") == pytest.approx(through)


def test_a_move_may_go_elsewhere_by_the_article_s_rules() -> None:
    """In one of the other three directions, one in nine each; at a wall the robot stays."""
    model = four_rooms_model(rules="sutton")
    assert _outcomes(model, Cell(1, 1), "North") == pytest.approx(
        {Cell(1, 1): 2 / 3 + 1 / 9, Cell(2, 1): 1 / 9, Cell(1, 2): 1 / 9}
    )
    assert _outcomes(model, Cell(2, 2), "East") == pytest.approx(
        {Cell(2, 3): 2 / 3, Cell(1, 2): 1 / 9, Cell(3, 2): 1 / 9, Cell(2, 1): 1 / 9}
    )


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(["bacon", "sutton"]), st.floats(0, 1))
def test_moves_follow_the_plan_whatever_the_slip(rules: Rules, slip: float) -> None:
    """The goal stays, the robot gets no further than its moves, and the move that is meant has 1 - slip."""
    model = four_rooms_model(rules=rules, slip=slip)
    robot, goal = model.index.column("robot"), model.index.column("goal")
    occurs = model.probabilities > 0
    assert (goal[model.outcomes] == goal[:, None, None])[occurs].all()
    cells = np.array(CELLS)
    gone = np.abs(cells[robot[model.outcomes]] - cells[robot][:, None, None]).sum(axis=3)
    assert gone[occurs].max() <= (2 if rules == "bacon" else 1)
    surely = four_rooms_model(rules=rules, slip=0.0)
    meant = (model.outcomes == surely.successors[..., None]) * model.probabilities
    assert meant.sum(axis=2).min() >= 1 - slip - 1e-9


def test_without_slips_both_rules_are_one() -> None:
    """Then every action has one outcome."""
    bacon, sutton = (four_rooms_model(rules=rules, slip=0) for rules in ("bacon", "sutton"))
    assert (bacon.successors == sutton.successors).all()


@pytest.mark.parametrize(
    ("rules", "slip", "first", "later"),
    [("bacon", 1 / 3, 8.3924, 9.5671), ("sutton", 1 / 3, 15.0117, 17.1404), ("bacon", 0.0, 7.5922, 8.7563)],
)
def test_the_exact_optimum(rules: Rules, slip: float, first: float, later: float) -> None:
    """8.39 steps is the optimum of the code's rules, over the 103 other cells, the goal in the east hallway.

    `later` is the mean over the goals in the lower right room. Without slips 7.5922 is a sum of shortest
    ways by breadth first search, over 103.
    """
    model = four_rooms_model(rules=rules, slip=slip)
    assert _steps(model, FIRST_GOAL) == pytest.approx(first, abs=5e-5)
    assert _steps(model, *LATER_GOALS) == pytest.approx(later, abs=5e-5)
    if not slip:
        away, front = {FIRST_GOAL: 0}, [FIRST_GOAL]
        for cell in front:
            for to in _beside(cell):
                if to not in away:
                    away[to] = away[cell] + 1
                    front.append(to)
        assert sum(away.values()) / 103 == pytest.approx(_steps(model, FIRST_GOAL))


def test_episodes_begin_anywhere_but_at_the_goal() -> None:
    """In any two cells, or 103 for one goal."""
    model = four_rooms_model()
    assert model.starts.sum() == 104 * 103
    each = [starts_for(model.index, cell) for cell in CELLS]
    assert (np.sum(each, axis=0) == model.starts).all()
    assert {int(mask.sum()) for mask in each} == {103}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"slip": 1.5}, "four rooms: slip is a probability, not 1.5; give 0 to 1"),
        ({"slip": float("nan")}, "four rooms: slip is a probability, not nan; give 0 to 1"),
        ({"rules": "bacn"}, "four rooms: no rules 'bacn'; did you mean 'bacon'?"),
    ],
)
def test_wrong_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    """The error says what is possible."""
    with pytest.raises(UserError) as caught:
        four_rooms_model(**arguments)
    assert str(caught.value) == message


def test_a_goal_in_a_wall_is_refused() -> None:
    """The error says where cells are listed."""
    with pytest.raises(UserError, match=r"goal 0,0 is no free cell; choose one of worlds\.four_rooms\.CELLS"):
        starts_for(four_rooms_model().index, Cell(0, 0))
