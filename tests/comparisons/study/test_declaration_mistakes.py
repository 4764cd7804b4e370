"""Each mistake in a study file is told by line, path and mend."""

from collections.abc import Mapping
from dataclasses import replace

import pytest
from study_texts import FAKE, MEASURES, TEXT, fake_kind, known, told

from comparisons.study.declaring.declaration import StudyError, parse_study
from comparisons.study.declaring.written import LAST_SEED
from comparisons.study.kinds import Kind, Result
from comparisons.study.spec import Value
from hierarchy.text_nodes import LARGEST
from worlds import UserError

FEW_SEEDS = replace(FAKE, name="few", last_seed=1)
fake = pytest.fixture(autouse=True, scope="module")(fake_kind)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        # the form
        ("study: rates\n", "", "line 1: 'study' is missing; add study: ..."),
        ("question: Is a high rate better?", "question:", "line 2, question: it is empty; write something"),
        ("kind: fake", "knd: fake", "line 3, knd: unknown key 'knd'; did you mean 'kind'?"),
        ("rates", "~", "line 1, study: it is empty; write something there"),
        ("against: 1", "against:", "line 12, answer.against: it is empty; write a name as it stands under v"),
        ("fake", "[fake]", "line 3, kind: it is no plain text; write words, not a list or keys"),
        ("seeds: 3", "seeds: 0", "line 4, seeds: 0 is no number of seeds; give a whole number from 1 to"),
        ("seeds: 3", "seeds: 0..9", "line 4, seeds: 0..9 is no number of seeds; give a whole number from 1"),
        ("seeds: 3", "seeds: many", "9223372036854775807, a list, or {first: 100, count: 20}"),
        ("seeds: 3", "seeds: [1, -1]", "line 4, seeds[1]: -1 is no seed; give a whole number from 0 to 92"),
        ("seeds: 3", "seeds: [1, 2.5]", "line 4, seeds[1]: 2.5 is no seed"),
        ("seeds: 3", f"seeds: [{2**63}]", f"line 4, seeds[0]: {2**63} is no seed"),
        ("seeds: 3", f"seeds: {'9' * 5000}", "line 4, seeds: 99"),
        ("seeds: 3", "seeds: [4, 1, 4]", "line 4, seeds[2]: the seed 4 is seeds[0] already; remove one"),
        ("seeds: 3", "seeds: []", "line 4, seeds: it is empty; give at least one"),
        ("seeds: 3", "seeds: {from: 3}", "line 4, seeds.from: unknown key 'from'; keys: first, count"),
        ("seeds: 3", "seeds: {first: 3}", "line 4, seeds: 'count' is missing; add count: ..."),
        ("seeds: 3", f"seeds: {{first: {LAST_SEED}, count: 2}}", "go beyond 9223372036854775807; begin with"),
        ("{steps: 20}", "[steps]", "line 5, settings: it is no mapping of keys to values; write keys"),
        ("steps: 20", "steps: [20]", "line 5, settings.steps: this is no single value; write a number or"),
        ("steps: 20", "steps: null", "line 5, settings.steps: it is empty; give a value, or leave it out"),
        ("steps: 20", "steps: 1e999", "line 5, settings.steps: 1e999 is too large; give a finite number"),
        ("steps: 20", f"steps: {2**63}", f"settings.steps: {2**63} is too large; give a number within"),
        ("[1, 0.9, .5]", "1", "line 7, vary.rate: this is no list of levels; write rate: [FIRST, SECOND]"),
        ("[1, 0.9, .5]", "[]", "line 7, vary.rate: this is no list of levels; write rate: [FIRST, SECOND]"),
        ("0.9, .5]", "{a: 1}]", "line 7, vary.rate[1]: this is no single value; write a number or a word"),
        ("{learner: plain}", "plain", "line 9, vary.learner.plain: the label 'plain' stands for no settings"),
        ("leave_out: [{", "leave_out: [3, {", "line 11, leave_out[0]: it is no mapping of keys to values"),
        ("leave_out: [{", "leave_out: [{}, {", "line 11, leave_out[0]: it is empty; give at least one"),
        ("rate: 0.9", "rate: [0.9]", "line 11, leave_out[0].rate: this is no single label; write one as it"),
        ("statistic: median", "statistic: medain", "line 12, answer.statistic: there is no statistic 'medai"),
        (", against: 1", "", "line 12, answer: 'against' is missing; add against: ..."),
        ("within:", "wihtin:", "line 12, answer.wihtin: unknown key 'wihtin'; did you mean 'within'?"),
        ("[learner]", "learner", "line 12, answer.within: it is no list; write [first, second]"),
        # what it says
        ("fake", "leran", "line 3, kind: 'leran': there is no such kind of run; did you mean 'learn'?"),
        ("[1, 0.9, .5]", "[1, .5, 1]", "line 7, vary.rate[2]: the level 1 is vary.rate[0] already; remove"),
        ("  rate:", "  seed:", "line 7, vary.seed: every combination is run with every seed, so this is no"),
        ("  rate:", "  '':", "line 7, vary.: a factor has no name; write NAME: [FIRST, SECOND]"),
        ("    plain:", "    '':", "line 9, vary.learner.: a label is empty; write LABEL: {SETTING: VALUE}"),
        (
            "{steps: 20}",
            "{steps: 20, rate: 1}",
            "line 7, vary.rate[0]: rate is set by settings.rate in line 5 as well; remove one of the two",
        ),
        (
            "{learner: plain}",
            "{learner: plain, rate: 1}",
            "line 9, vary.learner.plain.rate: rate is set by vary.rate[0] in line 7 as well; remove one",
        ),
        ("{rate: 0.9", "{rtae: 0.9", "line 11, leave_out[0].rtae: there is no factor 'rtae'; did you mean"),
        (
            "{rate: 0.9",
            "{rate: 0.90",
            "line 11, leave_out[0].rate: rate has no level '0.90'; did you mean '0.",
        ),
        (
            "{rate: 0.9, learner: deep}",
            "{learner: deep}, {learner: plain}",
            "leave_out: every combination is",
        ),
        (
            "measure: steps",
            "measure: stepz",
            "line 12, answer.measure: 'stepz': runs of kind fake measure no",
        ),
        (
            "compare: rate",
            "compare: rat",
            "line 12, answer.compare: there is no factor 'rat'; did you mean 'r",
        ),
        ("against: 1", "against: 2", "line 12, answer.against: rate has no level '2'; levels: 1, 0.9, .5"),
        (
            "[1, 0.9, .5]",
            "[1]",
            "answer.against: rate has no other level than 1; give it more, or compare an",
        ),
        ("[{rate: 0.9, learner: deep}]", "[{rate: 1}]", "answer.against: the level 1 is left out everywhere"),
        ("{rate: 0.9, learner: deep}", "{rate: 0.9}, {rate: .5}", "every level but 1 is left out; leave out"),
        (
            "[learner]",
            "[learnr]",
            "line 12, answer.within[0]: there is no factor 'learnr'; did you mean 'lea",
        ),
        ("[learner]", "[rate]", "line 12, answer.within[0]: rate is what is compared; remove it here"),
        ("[learner]", "[learner, learner]", "line 12, answer.within[1]: learner is given twice; remove one"),
        (
            "answer:",
            "figures: [a, b, a]\nanswer:",
            "line 12, figures[2]: a is given twice; remove one of the",
        ),
        (
            "seeds: 3",
            "seeds: 20_001",
            "seeds: this would be 100,005 runs, 5 combinations with 20,001 seeds; gi",
        ),
        ("seeds: 3", f"seeds: {LAST_SEED}", "this would be 46,116,860,184,273,879,035 runs"),
        (
            "measure: steps",
            "measure: optimal.Got",
            "'optimal.Got': optimal has no such part; did you mean 'G",
        ),
        ("measure: steps", "measure: optimal.x", "optimal has no such part; its parts: Goto, Leave"),
        (
            "measure: steps",
            "measure: steps.",
            "line 12, answer.measure: 'steps.': steps has no such part; us",
        ),
        (
            "    plain:",
            '    "a\\nb":',
            "line 6, vary: a control character, such as a line's end, cannot stand",
        ),
        ("study: rates", 'study: "\\e[31m"', "line 1, study: a control character cannot stand here; remove"),
        (
            "    plain:",
            "    null:",
            "line 9, vary.learner.null: a label is empty; write LABEL: {SETTING: VALU",
        ),
        ("  rate:", "  seeds:", "line 7, vary.seeds: every combination is run with every seed, so this is"),
        # what the kind says
        ("kind: fake", "kind: few", "line 4, seeds: kind few has seeds 0 to 1, and none of 2; give seeds am"),
        (
            "kind: fake\nseeds: 3",
            "kind: few\nseeds: [0, 7, 1]",
            "line 4, seeds[1]: kind few has seeds 0 to 1",
        ),
        ("steps: 20", "stpes: 20", "line 5, settings.stpes: there is no such setting; did you mean 'steps'?"),
        ("steps: 20", "steps: 13", "line 5, settings: this cannot go well; think again"),
        ("1, 0.9, .5]", "1, 0.9, 5]", "line 7, vary.rate[2]: 5 is not possible; give a number up to 1"),
        (
            "learner: plain",
            "learner: plane",
            "line 9, vary.learner.plain.learner: there is no plane; use one",
        ),
        (
            "steps: 20",
            "world: mine.maze",
            "line 5, settings.world: the text of the file mine.maze is not given; give it with the study",
        ),
        (
            "steps: 20",
            "world: /mine.maze",
            "the file /mine.maze may lie elsewhere on another machine; name on",
        ),
        (
            "steps: 20",
            "world: a/../../x.maze",
            "the file a/../../x.maze may lie elsewhere on another machine",
        ),
        (
            "steps: 20",
            'world: "a\\\\x.maze"',
            "may lie elsewhere on another machine; name one in the study's",
        ),
        ("steps: 20", "world: ./mine.maze", "./mine.maze is no plain name of a file; write mine.maze"),
        ("steps: 20", "world: .", "settings.world: . is no plain name of a file; write its name"),
        # the text
        (
            "study: rates",
            "study: rates\nstudy: again",
            "line 2, study: the key 'study' is given again; it st",
        ),
        ("rates", "&rates rates", "line 1: anchors (&) and aliases (*) are not read here; write it out"),
        ("[1, 0.9, .5]", "[1, 0.9, .5", "this is no YAML at column"),
        (TEXT, "", "line 1: the text is empty; begin it with study: NAME"),
        (TEXT, "# nothing\n---\n", "line 1: the text is empty; begin it with study: NAME"),
        (TEXT, "- study", "line 1: these are no keys with values; begin with study: NAME"),
        ("study: rates", "tasks: {}", "line 1: this is a task graph; name it in a study, by settings: {gra"),
        (TEXT, "study", "line 1: these are no keys with values; begin with study: NAME"),
        (TEXT, "a" * LARGEST + "bc", f"line 1: the text has {LARGEST + 2} characters, more than {LARGEST}"),
    ],
)
def test_a_mistake_is_told(old: str, new: str, expected: str) -> None:
    """Its line and path, what is wrong, and how to mend it; and little else: what names it elsewhere."""
    assert old in TEXT
    with known(FEW_SEEDS, FAKE):
        faults = told(TEXT.replace(old, new, 1))
    assert any(expected in fault for fault in faults), faults
    assert len(faults) <= 3, faults


def test_every_mistake_is_told_at_once() -> None:
    """In the order of their lines, and those of the form beside those of what it says."""
    wrong = TEXT.replace("seeds: 3", "seeds: x").replace("steps: 20", "stpes: 20")
    wrong = wrong.replace("[1, 0.9", "[1, 0.9, 3").replace("compare: rate", "compare: rat")
    faults = told(wrong)
    assert [fault.split(": ")[0] for fault in faults] == [
        "line 4, seeds",
        "line 5, settings.stpes",
        "line 12, answer.compare",
    ]  # the rate of 3 is hidden by the setting that does not exist
    assert "line 7, vary.rate[2]" in told(wrong.replace("stpes", "steps"))[1]


def test_a_wrong_part_hides_what_depends_on_it() -> None:
    """A misspelt `vary` does not make every factor that is named elsewhere a mistake, too."""
    assert told(TEXT.replace("vary:", "varry:")) == [
        "line 6, varry: unknown key 'varry'; did you mean 'vary'?"
    ]


def test_many_mistakes_are_told_in_part() -> None:
    """Twelve, and how many more there are."""
    settings = "".join(f", a{i}: []" for i in range(20))
    with pytest.raises(StudyError) as caught:
        parse_study(TEXT.replace("steps: 20", f"steps: 20{settings}"), "mine.yaml")
    assert len(caught.value.faults) == 20
    assert str(caught.value).splitlines()[12:] == ["and 8 more in mine.yaml"]


def test_a_mistake_in_every_level_takes_no_longer() -> None:
    """Each of thousands is told by its own place, in a moment."""
    levels = ", ".join(map(str, range(2, 4002)))
    faults = told(TEXT.replace("1, 0.9, .5", levels).replace("rate: 0.9", "rate: 9").replace(": 1,", ": 2,"))
    assert len(faults) == 4000
    assert "line 7, vary.rate[3999]: 4001 is not possible; give a number up to 1" in faults


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "{steps: 20}",
            "{endings: given}",
            "line 5, settings.endings: the learner plain has none (where learner is plain); give it to the "
            "levels under vary that it is for, or leave it out",
        ),
        (
            "[1, 0.9, .5]",
            "[1, 1.0]",
            "line 7, vary.rate[1]: where rate is 1.0 and learner is plain, the runs are the same as where "
            "rate is 1 and learner is plain, and 1 more like that; remove one of the two",
        ),
        (
            "[1, 0.9, .5]",
            "[1, 0.8]",
            "line 7, vary.rate[1]: too low for plain (where learner is plain); name these under leave_out, "
            "or give more",
        ),
        (
            "vary:",
            "vary:\n  more:\n    none: {}\n    some: {steps: 10}",
            "line 9, vary.more.some: where more is some and ",
        ),
    ],
)
def test_it_is_told_which_combinations_are_wrong(old: str, new: str, expected: str) -> None:
    """What they have in common, or two that are the same."""
    text = TEXT.replace("deep, endings: learnt", "deep").replace(
        "leave_out: [{rate: 0.9, learner: deep}]\n", ""
    )
    if new.startswith("vary"):
        text = text.replace("{steps: 20}", "{}")
    (fault,) = told(text.replace(old, new, 1))
    assert expected in fault


def test_combinations_with_nothing_of_their_own_in_common_are_told_by_the_first() -> None:
    """And the number of the others."""
    text = TEXT.replace("vary:", "vary:\n  steps: [13, 20]").replace("settings: {steps: 20}\n", "")
    (fault,) = told(text)
    assert fault.startswith("line 1, settings: this cannot go well (where steps is 13); think again")
    with known(FAKE_WITH_AN_ODD_RULE):
        (fault,) = told(TEXT)
    expected = "line 5, settings.steps: odd (where rate is 1 and learner is plain, and in 1 more combination)"
    assert fault.startswith(expected)


def odd(given: Mapping[str, Value]) -> Mapping[str, Value]:
    """Refuse two combinations that share no level."""
    if (given["rate"], given["learner"]) in ((1, "plain"), (0.5, "deep")):
        raise UserError("steps: odd; make them even")
    return given


FAKE_WITH_AN_ODD_RULE = Kind("fake", 3, MEASURES, odd, lambda _: (), lambda *_: Result({}))


def test_too_many_combinations_are_not_even_counted_out() -> None:
    """A short file can declare more than any machine could list."""
    vary = "".join(f"  a{i}: [{', '.join(map(str, range(10)))}]\n" for i in range(40))
    (fault,) = told(TEXT.replace("vary:\n", f"vary:\n{vary}"))
    assert "line 6, vary: with none left out, this would be 180,000,000," in fault


def test_a_number_that_is_none_is_told_where_it_stands() -> None:
    """A kind may read "nan" as a number; a run could not be written down with it."""
    nan = Kind("fake", 3, MEASURES, lambda given: {**given, "rate": float("nan")}, lambda _: (), FAKE.run)
    with known(nan):
        faults = told(TEXT)
    assert faults[0].startswith("line 7, vary.rate[0]: nan is not possible; give a finite number")


def test_bugs_of_a_kind_are_no_mistakes_of_the_file() -> None:
    """They keep their traceback."""
    broken = Kind("fake", 3, MEASURES, lambda given: {"rate": given["none"]}, lambda _: (), FAKE.run)
    with known(broken), pytest.raises(KeyError, match="none"):
        parse_study(TEXT)
