import pytest

from hierarchy import ground, two_rooms
from planners import Proof, Replanner, prove, verify
from worlds import ACTIONS, Layout, MazeState, load_layout, maze_model, parse_layout

NORTH, SOUTH, WEST, EAST = range(4)

# T1 lies at the end of a passage one cell wide; whatever is pushed into it stays there.
POCKET = """\
name pocket
grid
.  .   .  :  D1  G1
.  .   .  |  X   X
X  .   X  |  X   X
X  T1  X  |  X   X
start 0,0
trigger T1
goal G1
"""


def _oracle(layout: Layout) -> Replanner:
    return Replanner(layout, ground(two_rooms(layout), maze_model(layout)))


@pytest.fixture(scope="module")
def rooms() -> Replanner:
    """Return the oracle of the paper's maze."""
    return _oracle(load_layout("two_rooms"))


@pytest.fixture(scope="module")
def pocket() -> Replanner:
    """Return the oracle of the maze with a pocket."""
    return _oracle(parse_layout(POCKET))


def _proofs(oracle: Replanner, task: str, belief: MazeState) -> list[Proof]:
    found = [prove(oracle, oracle.grounded.place(task), belief, a) for a in range(len(ACTIONS))]
    return [proof for proof in found if proof is not None]


def test_table_4_s_cube_by_hand(rooms: Replanner) -> None:
    """Beside C1, met at 4,0, East is proved; North costs 2 steps, bumping to the South or West 1."""
    belief = MazeState(robot=32, trigger=49, goal=31, cubes=frozenset({40}))
    proofs = _proofs(rooms, "GotoTrigger(T4)", belief)
    assert [proof.optimal for proof in proofs] == [False, False, False, True]
    assert [proof.loss for proof in proofs] == [2, 1, 1, 0]
    assert all(proof.best.actions == (EAST, SOUTH, SOUTH) for proof in proofs)
    assert [len(proof.after.actions) for proof in proofs if proof.after] == [4, 3, 3, 2]
    assert [proof.action for proof in proofs] == [0, 1, 2, 3]


def test_ties_are_all_proved(rooms: Replanner) -> None:
    """In the open both South and East begin a shortest way to T4 from 4,0."""
    proofs = _proofs(rooms, "GotoTrigger(T4)", MazeState(robot=32, trigger=49, goal=31))
    assert [proof.optimal for proof in proofs] == [False, True, False, True]


def test_a_push_that_blocks_the_only_way_is_refuted_without_a_loss(pocket: Replanner) -> None:
    """South from 0,1 sends the sphere to T1 for good; West, South and East push it aside first."""
    belief = MazeState(robot=1, trigger=16, goal=4, spheres=frozenset({6}))
    north, south, west, east = _proofs(pocket, "GotoTrigger(T1)", belief)
    assert south.after is None
    assert south.loss is None
    assert not south.optimal
    assert south.faults == ()
    assert south.best.actions == (WEST, SOUTH, EAST, SOUTH, SOUTH)
    assert west.optimal
    assert east.optimal
    assert (north.optimal, north.loss) == (False, 1)


def test_no_action_is_optimal_where_there_is_no_way(pocket: Replanner) -> None:
    """With a cube in the passage the task cannot be ended, and nothing is proved or refuted."""
    belief = MazeState(robot=1, trigger=16, goal=4, cubes=frozenset({11}))
    assert _proofs(pocket, "GotoTrigger(T1)", belief) == []


def test_the_last_action_is_proved_by_the_end_itself(rooms: Replanner) -> None:
    """From 5,1 South ends the task: after it no step is left, and the loss is 0."""
    proof = prove(
        rooms, rooms.grounded.place("GotoTrigger(T4)"), MazeState(robot=41, trigger=49, goal=31), SOUTH
    )
    assert proof is not None
    assert proof.optimal
    assert proof.after is not None
    assert proof.after.actions == ()


def test_leaving_the_working_space_is_no_way(rooms: Replanner) -> None:
    """East from 5,3, doors open, is the way into room B, and ends GotoDoor(D2) but not GotoDoor(D1)."""
    belief = MazeState(robot=43, trigger=49, goal=31, doors_open=True)
    assert [p.loss for p in _proofs(rooms, "GotoDoor(D2)", belief)] == [2, 2, 2, 0]
    to_first = _proofs(rooms, "GotoDoor(D1)", belief)
    assert to_first[NORTH].optimal
    assert to_first[EAST].loss is None


def test_a_wrong_oracle_proves_nothing(rooms: Replanner, monkeypatch: pytest.MonkeyPatch) -> None:
    """If a certificate is refused, its fault is told and the action does not count as optimal."""
    belief = MazeState(robot=32, trigger=49, goal=31)
    task = rooms.grounded.place("GotoTrigger(T4)")
    right = rooms.plan

    def forgetful(task: int, belief: MazeState) -> object:
        plan = right(task, belief)
        assert plan is not None
        plan.depths.clear()
        return plan

    monkeypatch.setattr(rooms, "plan", forgetful)
    proof = prove(rooms, task, belief, SOUTH)
    assert proof is not None
    assert proof.loss == 0
    assert not proof.optimal
    assert "the start's depth is not 0" in proof.faults
    assert proof.faults[0] in verify(rooms.layout, rooms.area(task, belief), belief, proof.best)
