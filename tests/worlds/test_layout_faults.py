from pathlib import Path

import pytest
from strategies import SMALL

from worlds import LayoutError, UserError, load_layout, parse_layout

ROW = ".   T1  |  .   ."
ROW_1 = ".   .   :  D1  G1"
OBSTACLE = "S1  sphere  0,0  middle  #D9332B  at start"
MOVE = "move it, open a wall, or move the start"
BESIDE = "put a cell on either side"
CELLS = "write '.', 'X' (solid), or a mark that begins with T, G or D; separate cells by blanks"
WHEN = "write 'at start', 'at step N', 'when robot R,C' or 'when doors open'"
OWN_NAME = "give each obstacle its own name"
DOORS = "the door between 1,1 and 1,2 needs one D mark beside it"
SHAPE = "write: name kind cell size colour when (S1 sphere 3,0 middle #d9332b at start)"
FAULTS = {
    "no grid": (
        f"grid\n{ROW}\n{ROW_1}\n",
        "",
        None,
        "the layout has no grid",
        "add 'grid' and its rows below it",
    ),
    "empty grid": (f"{ROW}\n{ROW_1}\n", "", 2, "the layout has no grid", "add 'grid' and its rows below it"),
    "missing trigger mark": (
        ROW,
        ROW.replace("T1", ". "),
        2,
        "missing mark: no trigger in the grid",
        "mark a cell T1 in place of '.'",
    ),
    "missing goal mark": (
        "D1  G1",
        "D1  .",
        2,
        "missing mark: no goal in the grid",
        "mark a cell G1 in place of '.'",
    ),
    "missing door mark": (
        "D1  G1",
        ".   G1",
        4,
        f"missing mark: {DOORS}, and has 0",
        "mark the grid behind the door D1, D2, ...",
    ),
    "two marks at a door": (
        ".   .   :",
        ".   D2  :",
        4,
        f"missing mark: {DOORS}, and has 2",
        "mark the grid behind the door D1, D2, ...",
    ),
    "mark away from doors": (
        ROW,
        ROW.replace("T1  |  .", "T1  |  D2"),
        3,
        "D2 is not beside a door",
        "write ':' between it and its neighbour",
    ),
    "trigger not in the grid": (
        "trigger T1",
        "trigger T2",
        6,
        "missing mark: trigger 'T2' is not in the grid",
        "mark its cell, or name one of T1",
    ),
    "goal that is a trigger": (
        "goal G1",
        "goal T1",
        7,
        "missing mark: goal 'T1' is not in the grid",
        "mark its cell, or name one of G1",
    ),
    "doubled mark": (
        "D1  G1",
        "D1  T1",
        4,
        "doubled mark T1 (first: line 3)",
        "rename or remove one of the two",
    ),
    "ragged rows": (
        "D1  G1",
        "D1  G1 .",
        4,
        "ragged rows: this row has 5 cells, the first has 4",
        "give every row the same number of cells",
    ),
    "wall at a row's end": (ROW, ROW + " |", 3, "'|' does not stand between two cells", BESIDE),
    "wall at a row's start": (ROW, "| " + ROW, 3, "'|' does not stand between two cells", BESIDE),
    "door beside a wall": (ROW, ROW.replace("|", "| :"), 3, "':' does not stand between two cells", BESIDE),
    "bad cell": (ROW, ROW.replace(".   T1", "?   T1"), 3, "unknown cell '?'", CELLS),
    "cells without blanks": (ROW, ".T1|..", 3, "unknown cell '.T1|..'", CELLS),
    "missing start": ("start 1,0\n", "", None, "missing line 'start'", "add 'start' and its value"),
    "missing trigger": ("trigger T1\n", "", None, "missing line 'trigger'", "add 'trigger' and its value"),
    "missing goal": ("goal G1\n", "", None, "missing line 'goal'", "add 'goal' and its value"),
    "start without value": ("start 1,0", "start", 5, "'start' takes one value, not 0", "write 'start VALUE'"),
    "start with two values": (
        "start 1,0",
        "start 1 0",
        5,
        "'start' takes one value, not 2",
        "write 'start VALUE'",
    ),
    "key twice": ("goal G1", "start 0,0", 7, "'start' is given twice", "keep one (first: line 5)"),
    "heading with a value": (
        "grid\n",
        "grid . .\n",
        2,
        "'grid' stands alone on its line",
        "move the rest to the lines below it",
    ),
    "unknown key": ("trigger T1", "triger T1", 6, "unknown key 'triger'", "did you mean 'trigger'?"),
    "unknown key after the grid": (
        "start 1,0",
        "strat 1,0",
        5,
        "unknown key 'strat'",
        "did you mean 'start'?",
    ),
    "unknown key after obstacles": (
        OBSTACLE,
        "chosne T1",
        9,
        "unknown key 'chosne'",
        "did you mean 'chosen'?",
    ),
    "key like no other": (
        "name small",
        "xyzzy small",
        1,
        "unknown key 'xyzzy'",
        "use one of name, grid, start, trigger, goal, chosen, obstacles",
    ),
    "start is no cell": (
        "start 1,0",
        "start 1;0",
        5,
        "'1;0' is not a cell",
        "write row,column (such as 3,0) or a mark of the grid",
    ),
    "start outside": (
        "start 1,0",
        "start 2,0",
        5,
        "cell 2,0 is outside the grid of 2 x 4",
        "rows run 0 to 1, columns 0 to 3",
    ),
    "start in a solid cell": (".   .   :", "X   .   :", 5, "cell 1,0 is solid", "choose a free cell"),
    "start on the trigger": (
        "start 1,0",
        "start T1",
        5,
        "the robot starts on its trigger T1",
        "start it elsewhere",
    ),
    "trigger behind the door": (
        ROW,
        ROW[:-1] + "T2",
        3,
        "unreachable: T2 cannot be reached from start 1,0 with doors shut",
        MOVE,
    ),
    "walled-in goal": (
        f"{ROW}\n{ROW_1}",
        f"{ROW.replace('.   .', '. | .')}\n{ROW_1.replace('D1', 'D1 |')}",
        4,
        "unreachable: G1 cannot be reached from start 1,0 with doors open",
        MOVE,
    ),
    "unknown chosen": (
        "goal G1",
        "goal G1\nchosen T1 T7",
        8,
        "'chosen' names 'T7', which the layout does not have",
        "known names: D1, G1, S1, T1, start",
    ),
    "obstacle too short": (OBSTACLE, "S1 sphere 0,0", 9, "an obstacle's line is too short", SHAPE),
    "unknown kind": ("sphere", "spere", 9, "unknown obstacle kind 'spere'", "did you mean 'sphere'?"),
    "kind like no other": (
        "sphere",
        "pyramid",
        9,
        "unknown obstacle kind 'pyramid'",
        "use one of cube, sphere",
    ),
    "unknown size": ("middle", "midle", 9, "unknown size 'midle'", "did you mean 'middle'?"),
    "size like no other": ("middle", "medium", 9, "unknown size 'medium'", "use one of small, middle, large"),
    "bad colour": ("#D9332B", "red", 9, "'red' is not a colour", "write it as #rrggbb, such as #d9332b"),
    "bad event": ("at start", "at noon", 9, "cannot read when the obstacle appears: 'at noon'", WHEN),
    "negative step": (
        "at start",
        "at step -1",
        9,
        "cannot read when the obstacle appears: 'at step -1'",
        WHEN,
    ),
    "event outside": (
        "at start",
        "when robot 0,9",
        9,
        "cell 0,9 is outside the grid of 2 x 4",
        "rows run 0 to 1, columns 0 to 3",
    ),
    "name taken by a mark": (
        "S1  sphere",
        "T1  sphere",
        9,
        "obstacle name 'T1' is taken or not a word",
        OWN_NAME,
    ),
    "name taken by an obstacle": (
        OBSTACLE,
        f"{OBSTACLE}\n{OBSTACLE}",
        10,
        "obstacle name 'S1' is taken or not a word",
        OWN_NAME,
    ),
    "name that is no word": (
        "S1  sphere",
        "S-1  sphere",
        9,
        "obstacle name 'S-1' is taken or not a word",
        OWN_NAME,
    ),
    "obstacle on the robot": (
        "0,0  middle",
        "1,0  middle",
        9,
        "S1 appears on the robot",
        "move one of the two",
    ),
    "obstacle on an obstacle": (
        OBSTACLE,
        f"{OBSTACLE}\n{OBSTACLE.replace('S1', 'S2')}",
        10,
        "S2 appears on S1",
        "move one of the two",
    ),
    "obstacle in a shut door": (
        "0,0  middle",
        "D1  middle",
        9,
        "S1 appears in a door that is shut at the start",
        "move it, or let it appear 'when doors open'",
    ),
}


@pytest.mark.parametrize(("old", "new", "line", "problem", "mend"), FAULTS.values(), ids=FAULTS)
def test_a_fault_is_told_with_file_line_and_mend(
    old: str, new: str, line: int | None, problem: str, mend: str
) -> None:
    """One message says where the fault is, what it is and what to change."""
    assert SMALL.count(old) == 1, "the fault has to be put in"
    text = SMALL.replace(old, new)
    with pytest.raises(LayoutError) as caught:
        parse_layout(text, source="bad.maze")
    error = caught.value
    assert (error.source, error.line, error.problem, error.mend) == ("bad.maze", line, problem, mend)
    where = "bad.maze" if line is None else f"bad.maze, line {line}"
    assert str(error) == f"{where}: {problem}; {mend}"


def test_a_fault_in_a_file_names_its_path(tmp_path: Path) -> None:
    """The message holds the path as the user gave it."""
    path = tmp_path / "mine.maze"
    path.write_text(SMALL.replace("sphere", "pyramid"), encoding="utf-8")
    with pytest.raises(LayoutError) as caught:
        load_layout(path)
    assert str(caught.value).startswith(f"{path}, line 9: ")


@pytest.mark.parametrize(
    ("name", "hint"), [("two_room", "did you mean 'two_rooms'?"), ("x", "layouts by name: two_rooms")]
)
def test_a_missing_layout_is_named_with_the_nearest(name: str, hint: str) -> None:
    """The error suggests a name, or lists them."""
    with pytest.raises(UserError) as caught:
        load_layout(name)
    assert str(caught.value) == f"{name}: no layout of this name and no such file; {hint}"


def test_a_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    """Bytes that are not UTF-8 do not end in a decoder's traceback."""
    path = tmp_path / "noise.maze"
    path.write_bytes(b"\xff\xfe\x00grid")
    with pytest.raises(UserError, match=r"noise\.maze: cannot be read as UTF-8 text"):
        load_layout(path)
