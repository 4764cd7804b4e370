"""Snapshots counted: over verdicts of episodes, and over every placement in a small room."""

import re
from pathlib import Path

import numpy as np
import pytest

from comparisons.dynamic import Verdict
from comparisons.robot import Encounter
from comparisons.snapshots import exhaustive, judge_all, open_room
from hierarchy import ground, two_rooms
from planners import Affordance, Replanner, prove
from planners.dynamics import SNAPSHOTS, Fault, Reading, area_field
from planners.fields import UNREACHED
from planners.search import Area
from worlds import MazeState, load_layout, maze_model, step

MAZE = load_layout("two_rooms")


def _table() -> list[tuple[int, str, str, str, list[str]]]:
    """Return the rows of the page's last table: obstacles, cubes, spheres, ways, and a share a reading."""
    page = (Path(__file__).parents[2] / "docs" / "dynamics.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d) \| (\d) \| ([\d,]+) \| (.*) \|$", page, flags=re.MULTILINE)
    assert len(rows) == 6
    return [(int(c) + int(s), c, s, ways, shares.split(" | ")) for c, s, ways, shares in rows]


def area_of(cells: int, target: int) -> Area:
    """Return the area of a task that may do anything until it reaches a cell."""
    anything, ends = ((0, 1, 2, 3),) * cells, tuple(cell == target for cell in range(cells))
    return Area((anything, anything), (ends, ends))


@pytest.mark.parametrize(("cubes", "spheres"), [(0, 2), (1, 1)])
def test_every_placement_is_counted_as_if_alone(cubes: int, spheres: int) -> None:
    """In a room of two by three: each placement once, each field from it alone."""
    room = open_room(2, 3)
    found = exhaustive(room, cubes=cubes, spheres=spheres)
    faults = {reading: dict.fromkeys(Fault, 0) for reading in SNAPSHOTS}
    lost, hopeless, fooled, alike = (dict.fromkeys(SNAPSHOTS, 0) for _ in range(4))
    for target in range(6):
        area = area_of(6, target)
        for state in _placements(cubes, spheres):
            if target == state.robot or target in state.cubes:
                continue
            moves, exact = area_field(room, area, state, Reading.MOVING)
            best = int(exact.distance[0])
            for reading in SNAPSHOTS:
                held = area_field(room, area, state, reading)[1].optimal()[0]
                if best == UNREACHED:
                    hopeless[reading] += 1
                    fooled[reading] += bool(held.any())
                    continue
                alike[reading] += np.array_equal(held, exact.optimal()[0])
                if not held.any():
                    faults[reading][Fault.BLIND] += 1
                    continue
                after = moves.places[step(room, state, int(held.argmax()))[0]]
                if exact.distance[after] == UNREACHED:
                    faults[reading][Fault.TRAP] += 1
                    continue
                loss = 1 + int(exact.distance[after]) - best
                faults[reading][Fault.LONGER if loss else Fault.NONE] += 1
                lost[reading] += loss
    assert {
        reading: {f: tally.faults[f] for f in Fault} for reading, tally in found.tallies.items()
    } == faults
    assert {reading: tally.lost for reading, tally in found.tallies.items()} == lost
    assert {reading: tally.alike for reading, tally in found.tallies.items()} == alike
    assert (found.fooled, set(hopeless.values())) == (fooled, {found.hopeless})
    asked = {tally.asked for tally in found.tallies.values()}
    assert asked == {found.beliefs - found.hopeless}


def _placements(cubes: int, spheres: int) -> list[MazeState]:
    """Return every placement in six cells, by brute force over what each cell holds."""
    found = []
    for code in range(4**6):
        holds = [code >> 2 * cell & 3 for cell in range(6)]
        if (holds.count(1), holds.count(2), holds.count(3)) == (1, cubes, spheres):
            blocks = frozenset(cell for cell in range(6) if holds[cell] == 2)
            balls = frozenset(cell for cell in range(6) if holds[cell] == 3)
            found.append(MazeState(holds.index(1), -1, -1, True, blocks, balls))
    return found


@pytest.mark.parametrize(
    "row", [pytest.param(row, marks=[pytest.mark.slow] * (row[0] > 2)) for row in _table()]
)
def test_the_page_s_table_is_what_is_counted(row: tuple[int, str, str, str, list[str]]) -> None:
    """Each row of docs/dynamics.md, from every placement in a room of four by four."""
    _, cubes, spheres, ways, shares = row
    found = exhaustive(open_room(4, 4), cubes=int(cubes), spheres=int(spheres))
    assert ways == f"{found.beliefs - found.hopeless:,}"
    for reading, share in zip(SNAPSHOTS, shares, strict=True):
        tally = found.tallies[reading]
        wrong = 1 - tally.faults[Fault.NONE] / tally.asked
        trap, blind = tally.faults[Fault.TRAP], tally.faults[Fault.BLIND]
        assert share == f"{100 * wrong:.1f} % ({trap:,} / {blind:,})"
        assert tally.most <= 2


def _verdict(oracle: Replanner, task: str, belief: MazeState) -> Verdict:
    """Return the verdict on replanning's affordance for what the robot knows."""
    place = oracle.grounded.place(task)
    plan = oracle.plan(place, belief)
    assert plan is not None
    proof = prove(oracle, place, belief, plan.actions[0])
    assert proof is not None
    met = Encounter(0, None, 0, place, belief, 1, Affordance("sphere", on_route=True, action=plan.actions[0]))
    return Verdict(met, None, proof)


def test_verdicts_with_a_sphere_are_judged_by_every_reading() -> None:
    """The sphere that South would roll on to the goal; a cube alone is no question."""
    oracle = Replanner(MAZE, ground(two_rooms(MAZE), maze_model(MAZE)))
    corner = MazeState(44, trigger=49, goal=60, doors_open=True, spheres=frozenset({52}))
    farther = MazeState(44, 49, 60, doors_open=True, spheres=frozenset({52}), cubes=frozenset({36}))
    cube = MazeState(44, trigger=49, goal=60, doors_open=True, cubes=frozenset({52}))
    marks = {name: MAZE.number(cell) for name, cell in MAZE.goals.items()}
    assert marks["G4"] == 60
    verdicts = [_verdict(oracle, "GotoGoal(G4)", belief) for belief in (farther, corner, cube)]
    tallies = judge_all(oracle, verdicts)
    traps = {reading: tally.faults[Fault.TRAP] for reading, tally in tallies.items()}
    assert traps == {Reading.STANDING: 2, Reading.FLOOR: 2, Reading.BLOCKS: 0}
    assert {tally.asked for tally in tallies.values()} == {2}
    smallest = tallies[Reading.STANDING].smallest
    assert smallest is not None
    assert (smallest.state, smallest.steps) == (corner, 4)
    assert tallies[Reading.BLOCKS].smallest is None
