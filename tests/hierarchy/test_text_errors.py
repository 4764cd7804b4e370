"""Every mistake in a text is told with its line, its path and a mend."""

import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy import check
from hierarchy.text import TaskGraphTextError, load_graph, parse_graph
from hierarchy.text_nodes import LARGEST
from worlds import UserError

TEXT = """\
graph: mine
world: two_rooms
sets:
  corner: {of: robot, values: ["0,0", "0,1"]}
tasks:
  Goto:
    params: {target: {of: robot, values: {here: "1,0", there: "4,0"}}}
    until: robot = target
    pseudo_reward: -10
    within: robot in room A
    uses: [robot]
    do: [North, South, West, East]
  Root:
    until: doors = open or robot in corner
    uses: [robot, trigger, doors]
    do:
      - Goto: {target: there}
        when: doors = closed
        uses: [trigger]
      - North
"""


def test_the_text_without_mistakes_is_read() -> None:
    """The mistakes below are made in a text that says what it seems to."""
    graph, world = parse_graph(TEXT)
    assert world.name == "two_rooms"
    assert str(graph.root.until) == "doors = open or robot in corner"
    assert [str(call) for call in graph.root.do] == ["Goto(target=there)", "North"]
    assert graph.tasks["Goto"].pseudo_reward == -10
    assert graph.root.do[0].relevant == ("trigger",)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("graph: mine", "grap: mine", "line 1, grap: unknown key 'grap'; did you mean 'graph'?"),
        ("graph: mine\n", "", "line 1: 'graph' is missing; add graph: ..."),
        (
            "world: two_rooms",
            "world: two_room",
            "line 2, world: no world 'two_room'; did you mean 'two_rooms'?",
        ),
        ("world: two_rooms\n", "", "the text names no world, and none is given; add world: NAME"),
        (
            "of: robot, values: [",
            "of: robt, values: [",
            "line 4, sets.corner.of: unknown state variable 'robt'",
        ),
        (
            '"0,1"',
            '"0,l"',
            "line 4, sets.corner.values.0,l: unknown value '0,l' of robot; did you mean '0,",
        ),
        ("values: {here", "vales: {here", "line 7, tasks.Goto.params.target.vales: unknown key 'vales'"),
        ("{of: robot, values: {here", "{values: {here: 1}, x: {a", "params.target.x: unknown key 'x'"),
        ('{of: robot, values: {here: "1,0", there: "4,0"}}', "{}", "nothing says which values; give 'of'"),
        ('there: "4,0"', 'there: "1,0"', "'target' holds a value twice; make its values distinct"),
        ("until: robot = target", "untl: robot = target", "'until' is missing; add until: ..."),
        ("until: robot = target", "until: robot = [target]", "unknown value '[target]' of robot"),
        ("until: robot = target", "until: [robot]", "line 8, tasks.Goto.until: it is no plain text"),
        ("-10", "ten", "line 9, tasks.Goto.pseudo_reward: it is no number; write one, such as -10"),
        ("-10", ".inf", "line 9, tasks.Goto.pseudo_reward: it is no number"),
        ("-10", "inf", "line 9, tasks.Goto.pseudo_reward: it is no finite number"),
        (
            "room A",
            "rom A",
            "line 10, tasks.Goto.within: column 10 of 'robot in rom A': unknown set of values",
        ),
        ("uses: [robot]", "uses: robot", "line 11, tasks.Goto.uses: it is no list; write [first, second]"),
        (
            "uses: [robot]",
            "uses: [robt]",
            "tasks.Goto.uses[0]: unknown state variable 'robt'; did you mean 'rob",
        ),
        (
            "East]",
            "Est]",
            "line 12, tasks.Goto.do[3].Est: unknown task or action 'Est'; did you mean 'East'?",
        ),
        ("East]", "{}]", "line 12, tasks.Goto.do[3]: an edge leads to one child, this one to: none"),
        ("  Root:", "  North:", "line 13, tasks.North: task North: the name is taken"),
        ("  Root:", "  when:", "line 13, tasks.when: 'when' is a key of edges and no name of a task"),
        (
            "- Goto: {target: there}",
            "- Gto: {target: there}",
            "line 17, tasks.Root.do[0].Gto: unknown task or",
        ),
        ("target: there", "targt: there", "unknown parameter 'targt' of Goto; did you mean 'target'?"),
        (
            "target: there",
            "target: ther",
            "line 17, tasks.Root.do[0].Goto.target: column 1 of 'ther': unknown",
        ),
        ("{target: there}", "there", "'Goto' is given 'there', which binds no parameters"),
        (
            "when: doors",
            "wen: doors",
            "line 18, tasks.Root.do[0].wen: 'wen' is given 'doors = closed', which",
        ),
        ("when: doors", "wen: doors", "did you mean 'when'?"),
        (
            "doors = closed",
            "dors = closed",
            "column 1 of 'dors = closed': unknown name 'dors'; did you mean 'doo",
        ),
        ("uses: [trigger]", "uses: [triger]", "tasks.Root.do[0].uses[0]: unknown state variable 'triger'"),
        (
            "      - North",
            "      - North:\n        South: {}",
            "an edge leads to one child, this one to: North, South",
        ),
        (
            "  Root:",
            "  Goto:",
            "line 13, tasks.Goto: the key 'Goto' is given again; it stands in line 6 already",
        ),
        ("  Root:", "  [Root]:", "line 13, tasks: a key is no word"),
        ("mine", "&mine mine", "line 1: anchors (&) and aliases (*) are not read here"),
        ("mine", "*mine", "line 1: anchors (&) and aliases (*) are not read here; write it out"),
        (
            "mine",
            "!!python/object:os.system mine",
            "line 1: the tag tag:yaml.org,2002:python/object:os.system is",
        ),
        ("mine", "[" * 30 + "]" * 30, "line 1: it is nested more than 20 deep; write it flatter"),
        (
            "mine",
            "mine\n---\n",
            "column 1, in what begins in line 1: a second document begins here; keep one",
        ),
        ("graph: mine", "graph:", "line 1, graph: it is empty; write something there"),
        ("until: robot = target", "until:", "line 8, tasks.Goto.until: it is empty"),
        (
            "    until: robot",
            "\tuntil: robot",
            "line 8: this is no YAML at column 1: a tab cannot indent; indent",
        ),
        (
            "until: robot = target",
            "until: robot: target",
            "a ': ' cannot stand here; put the value in quotes",
        ),
        (
            "    within:",
            "   within:",
            "line 10: this is no YAML at column 4, in what begins in line 6: it is ind",
        ),
        (
            "uses: [robot]",
            "uses: [robot, robot]",
            "line 11, tasks.Goto.uses[1]: 'robot' is given twice; remove",
        ),
        ("Goto: {target: there}", "Goto: [there]", "binds no parameters; write - Goto: {PARAMETER: VALUE}"),
        ("- North\n", "- Goto(target=there)\n", "'Goto(target=there)'; write - Goto: {PARAMETER: VALUE}"),
        ("graph: mine", 'graph: "\\ud800"', "line 1, graph: an escape stands for half a character"),
        (TEXT, "---\n", "line 1: the text is empty"),
        ("mine", "mine\x07", "line 1: the character U+0007 cannot stand in a text; remove it"),
        ("sets:", "sets: {", "this is no YAML at column"),
        (TEXT, "", "line 1: the text is empty; begin it with 'graph: NAME'"),
        (TEXT, "- graph", "line 1: it is no mapping of keys to values; write keys with values"),
        (TEXT, "#" * LARGEST + "more", f"more than {LARGEST}; split it"),
    ],
)
def test_a_mistake_is_told(old: str, new: str, expected: str) -> None:
    """Source, line and path of what is wrong, and how to mend it."""
    assert old in TEXT
    with pytest.raises(TaskGraphTextError) as caught:
        parse_graph(TEXT.replace(old, new, 1), "mine.yaml")
    assert str(caught.value).startswith("mine.yaml, line ")
    assert expected in str(caught.value)


PREDICATE = "doors = open or robot in corner"


@pytest.mark.parametrize(
    ("text", "column", "expected"),
    [
        ("doors = opn", 9, "unknown value 'opn' of doors; did you mean 'open'?"),
        ("doors == open", 8, "a name or value is missing before '='; write '=' once"),
        ("doors = open && robot = goal", 9, "of doors; write 'and' for '&&'"),
        ("doors = open OR robot = goal", 9, "of doors; write 'or' for 'OR'"),
        ("doors = open and Not robot = goal", 18, "unknown name 'Not robot'; write 'not' for 'Not'"),
        ("doors", 6, "'doors' is compared with nothing; go on with ="),
        ("doors = open and", 17, "a name or value is missing before 'the end'"),
        ("(doors = open", 14, "')' is missing; close the parenthesis"),
        ("doors = open)", 13, "'and', 'or' or the end is missing before ')'"),
        ("open = doors", 1, "unknown name 'open'"),
        ('doors = "open', 9, "'\"' stands alone; close the quotes"),
        ("! doors = open", 1, "'!' stands alone; write 'not' or '!='"),
        (r'doors = "\q"', 9, "has a wrong escape"),
        ("robot in {0,0 0,1}", 11, "unknown value '0,0 0,1' of robot"),
        ("doors in {open,closed}", 11, "separate values by a comma and a blank: open, closed"),
        ("robot in {0,0", 14, "',' or '}' is missing"),
        ("robot in 0,0", 10, "unknown set of values '0,0'; write {0,0}"),
        ("doors in corner", 10, "which is no value of doors; name a set of its values"),
        ("robot < doors", 1, "the values of robot and doors have no common order"),
        ("robot < far", 9, "unknown value 'far' of robot"),
        ("3 < 4", 1, "unknown name '3'"),
        (
            "robot = goal implies doors = open implies doors = closed",
            35,
            "put parentheses around one of the two",
        ),
        ("(" * 9000, 1, "it is nested too deeply; write it flatter"),
    ],
)
def test_a_predicates_mistake_is_told_with_its_column(text: str, column: int, expected: str) -> None:
    """Line and path of the key, and the column in the predicate."""
    quoted = text.replace("'", "''")
    with pytest.raises(TaskGraphTextError) as caught:
        parse_graph(TEXT.replace(f"until: {PREDICATE}", f"until: '{quoted}'"))
    (fault,) = caught.value.faults
    assert (fault.line, fault.path) == (14, "tasks.Root.until")
    assert fault.problem.startswith(f"column {column} of ")
    assert expected in f"{fault.problem}; {fault.mend}"


def test_every_mistake_is_told_at_once() -> None:
    """In the order of their lines."""
    wrong = TEXT.replace("robot = target", "robt = target").replace("East", "Est").replace("closed", "clsed")
    with pytest.raises(TaskGraphTextError) as caught:
        parse_graph(wrong)
    assert [fault.line for fault in caught.value.faults] == [8, 12, 18]


@pytest.mark.parametrize(
    ("written", "printed"),
    [
        ("doors != open", "not (doors = open)"),
        ("robot not in room A", "not (robot in room A)"),
        ("not doors = open and robot = goal", "not (doors = open) and robot = goal"),
        ("doors = open and robot = goal or never", "(doors = open and robot = goal) or never"),
        ("doors = open implies robot in room B", "(doors = open) implies (robot in room B)"),
        ('robot  in\n      {"0,0",  0,1}', "robot in {0,0, 0,1}"),
        ("`robot` = goal", "robot = goal"),
        ("robot = trigger and all (doors = open)", "robot = trigger and (doors = open)"),
    ],
)
def test_other_ways_to_write_a_predicate(written: str, printed: str) -> None:
    """Shorter or longer, the predicate is the one that prints so."""
    graph, _ = parse_graph(TEXT.replace(PREDICATE, f"|\n      {written}"))
    assert str(graph.root.until) == printed


def test_labels_mean_themselves() -> None:
    """No, on, 1e3 and 5:30 are no truth values or numbers, unlike in most of YAML."""
    words = "params: {target: {values: {no: 0, on: 1, 1e3: 2, 5:30: 3}}}"
    graph, _ = parse_graph(
        TEXT.replace('params: {target: {of: robot, values: {here: "1,0", there: "4,0"}}}', words)
        .replace("robot = target", "target = no")
        .replace("target: there", "target: 5:30")
    )
    (param,) = graph.tasks["Goto"].params
    assert (param.domain.labels, param.domain.values) == (("no", "on", "1e3", "5:30"), (0, 1, 2, 3))
    assert str(graph.root.do[0]) == "Goto(target=5:30)"


def test_a_name_comes_before_a_value_of_the_same_spelling() -> None:
    """In quotes it is the value."""
    plain = TEXT.replace("there: ", "trigger: ").replace("target: there", "target: trigger")
    quoted = TEXT.replace("there: ", "trigger: ").replace("target: there", "target: '\"trigger\"'")
    (variable, value) = (
        dict(parse_graph(text).graph.root.do[0].binding)["target"] for text in (plain, quoted)
    )
    assert str(variable) == str(value) == "trigger"
    assert variable != value


def test_a_call_may_come_before_its_task() -> None:
    """A ring of calls is a finding of the check, and no mistake of the text."""
    ring = TEXT.replace("East]", "East, Root]")
    graph, world = parse_graph(ring)
    assert "cycle" in {finding.kind for finding in check(graph, world.model())}


@settings(max_examples=80, deadline=None)
@given(st.text(st.sampled_from("abr ={}()<>!,\"`\n:-[]'"), max_size=30), st.integers(0, len(TEXT)))
def test_any_text_is_read_or_refused(noise: str, place: int) -> None:
    """Nothing that a user types ends in anything but a graph or a message."""
    try:
        graph, _ = parse_graph(TEXT[:place] + noise + TEXT[place:])
    except TaskGraphTextError as error:
        told = [bool(fault.line >= 1 and fault.problem and fault.mend) for fault in error.faults]
    else:
        told = [bool(graph.root.name)]
    assert told
    assert all(told)


def test_a_fault_of_a_parameter_is_told_once() -> None:
    """What depends on it is not told as well."""
    with pytest.raises(TaskGraphTextError) as caught:
        parse_graph(TEXT.replace('there: "4,0"', 'there: "1,0"'))
    (fault,) = caught.value.faults
    assert (fault.line, fault.path) == (7, "tasks.Goto.params.target")


def test_messages_stay_short() -> None:
    """A long predicate is quoted around the mistake, long words in part, and of many mistakes some."""
    long = " and ".join(["doors = open"] * 50)
    with pytest.raises(TaskGraphTextError) as caught:
        parse_graph(TEXT.replace(PREDICATE, f"{long} and dors = open and {long}"))
    told = str(caught.value)
    assert "column 851 of '..." in told
    assert "dors = open" in told
    assert len(told) < 300
    with pytest.raises(TaskGraphTextError) as caught:
        parse_graph(TEXT.replace("doors = closed", "doors = " + "y" * 50_000))
    assert len(str(caught.value)) < 800
    with pytest.raises(TaskGraphTextError) as caught:
        parse_graph(TEXT.replace("[robot, trigger, doors]", str([f"z{i}" for i in range(40)])))
    assert len(caught.value.faults) == 40
    assert str(caught.value).splitlines()[-1] == "and 28 more in task graph"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_editors_ways_to_save_a_file_are_read(tmp_path: Path, encoding: str, ends: str) -> None:
    """With a byte order mark or without, and with anyone's line ends; lines are counted alike."""
    path = tmp_path / "mine.yaml"
    path.write_bytes(TEXT.replace("\n", ends).encode(encoding))
    assert load_graph(path).graph.tasks == parse_graph(TEXT).graph.tasks
    path.write_bytes(TEXT.replace("closed", "clsed").replace("\n", ends).encode(encoding))
    with pytest.raises(TaskGraphTextError, match=r"line 18, tasks\.Root\.do"):
        load_graph(path)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (
            b"graph: a\nworld: \xe4",
            "mine.yaml, line 2: byte 0xe4 cannot be read as UTF-8 text; save it as UTF-8",
        ),
        (TEXT.encode("utf-16"), r"line 1: .*it looks like UTF-16"),
        (b"\x89PNG\r\n", r"line 1: .*it looks like a picture.*; .* or name another file"),
        (b"graph: a\nworld: \x00", r"line 2: the character U\+0000 cannot stand in a text; remove it"),
        (b" " * (4 * LARGEST + 1), "larger than 4000000 bytes; is it the one"),
    ],
)
def test_files_that_are_no_text_are_refused(tmp_path: Path, content: bytes, told: str) -> None:
    """The line is named, and what the file seems to be."""
    path = tmp_path / "mine.yaml"
    path.write_bytes(content)
    with pytest.raises(UserError, match=told):
        load_graph(path)


def test_what_is_no_file_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder, a pipe, a name that no system takes, and a file that may not be read."""
    os.mkfifo(tmp_path / "pipe.yaml")
    cases = [
        (tmp_path, "this is a folder; name a file in it"),
        (tmp_path / "pipe.yaml", "this is no ordinary file"),
        (tmp_path / ("a" * 300), r"it cannot be read \(File name too long\)"),
    ]
    for path, told in cases:
        with pytest.raises(UserError, match=told):
            load_graph(path)

    def refuse(path: Path, mode: str) -> None:
        raise PermissionError(13, "Permission denied", f"{path}, {mode}")

    (tmp_path / "locked.yaml").write_text(TEXT)
    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(
        UserError, match=r"locked.yaml: it cannot be read \(Permission denied\); check the path"
    ):
        load_graph(tmp_path / "locked.yaml")


def test_files_that_are_not_there_are_named(tmp_path: Path) -> None:
    """A name that is almost right gets a suggestion; bytes that are no text are refused."""
    with pytest.raises(
        UserError, match="two_room: no task graph of this name and no such file; did you mean"
    ):
        load_graph("two_room")
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\xff")
    with pytest.raises(UserError, match="byte 0xff cannot be read as UTF-8 text"):
        load_graph(tmp_path / "bytes.yaml")
