"""Study files: what they expand to, and how each mistake in one is told."""

import json
import os
import re
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from comparisons.study import kinds
from comparisons.study.declaring import checking
from comparisons.study.declaring.declaration import Answer, Study, StudyError, load_study, parse_study
from comparisons.study.declaring.schema import StudyText, json_schema, read_form, shipped_schema
from comparisons.study.declaring.written import LAST_SEED, value_of
from comparisons.study.kinds import Kind, Measure, Result
from comparisons.study.spec import RunSpec, Value
from hierarchy.text_nodes import LARGEST, read_yaml
from worlds import UserError, suggest

DEFAULTS: Mapping[str, Value] = {
    "learner": "plain",
    "rate": 0.5,
    "endings": "given",
    "world": "",
    "steps": 10,
}
MEASURES = (Measure("steps", "steps taken", "steps", "less"), Measure("optimal", "share that is optimal"))


def complete(given: Mapping[str, Value]) -> Mapping[str, Value]:
    """Return all settings; only the learner "deep" has endings."""
    for name, value in given.items():
        if name not in DEFAULTS:
            raise UserError(f"{name}: there is no such setting; {suggest(name, DEFAULTS)}")
        if name == "rate" and not (isinstance(value, int | float) and value <= 1):
            raise UserError(f"rate: {value!r} is not possible; give a number up to 1")
    settings = {**DEFAULTS, **given}
    if settings["learner"] not in ("plain", "deep"):
        raise UserError(f"learner: there is no {settings['learner']}; use one of plain, deep")
    if settings["learner"] == "plain" and "endings" in given:
        raise UserError("endings: the learner plain has none; leave it out")
    if settings["steps"] == 13:
        raise UserError("this cannot go well; think again")
    rate = settings["rate"]
    assert isinstance(rate, int | float)
    return {**settings, "rate": float(rate)}


def file_settings(settings: Mapping[str, Value]) -> tuple[str, ...]:
    """Return which settings name files: a world whose name has a dot in it."""
    return ("world",) if "." in str(settings["world"]) else ()


FAKE = Kind("fake", 3, MEASURES, complete, file_settings, lambda *_: Result({}))


@pytest.fixture(autouse=True, scope="module")
def fake() -> Iterator[None]:
    """Let there be a kind of run that needs no learner."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checking, "kind", lambda name: FAKE if name == "fake" else kinds.kind(name))
        yield


TEXT = """\
study: rates
question: Is a high rate better?
kind: fake
seeds: 3
settings: {steps: 20}
vary:
  rate: [1, 0.9, .5]
  learner:
    plain: {learner: plain}
    deep: {learner: deep, endings: learnt}
leave_out: [{rate: 0.9, learner: deep}]
answer: {measure: steps, compare: rate, against: 1, within: [learner], statistic: median}
"""


def told(text: str, files: Mapping[str, str] | None = None) -> list[str]:
    """Return the mistakes of a text that has some."""
    with pytest.raises(StudyError) as caught:
        parse_study(text, "mine.yaml", files)
    assert all(fault.problem and fault.mend for fault in caught.value.faults)
    assert str(caught.value).startswith("mine.yaml, line ")
    return [str(fault) for fault in caught.value.faults]


def test_a_study_says_what_its_file_says() -> None:
    """Names, factors, seeds and the answer; without a title its name stands for one."""
    study = parse_study(TEXT)
    assert (study.name, study.title, study.question) == ("rates", "rates", "Is a high rate better?")
    assert (study.kind, study.version, study.seeds, study.runs) == ("fake", 3, (0, 1, 2), 15)
    assert [(factor.name, factor.labels) for factor in study.factors] == [
        ("rate", ("1", "0.9", ".5")),
        ("learner", ("plain", "deep")),
    ]
    assert study.factors[0].numbers == (1.0, 0.9, 0.5)
    assert study.factors[1].numbers is None
    assert study.answer == Answer("steps", "rate", "1", ("learner",), "median")
    assert study.figures is None
    assert study.text == TEXT


def test_a_study_expands_to_runs_in_order() -> None:
    """The last factor's levels come first, each combination with every seed, complete settings in each."""
    planned = parse_study(TEXT.replace("seeds: 3", "seeds: [7, 5]")).expand()
    assert [(*each.levels.values(), each.spec.seed) for each in planned] == [
        *(("1", "plain", 7), ("1", "plain", 5), ("1", "deep", 7), ("1", "deep", 5)),
        *(("0.9", "plain", 7), ("0.9", "plain", 5)),
        *((".5", "plain", 7), (".5", "plain", 5), (".5", "deep", 7), (".5", "deep", 5)),
    ]
    assert planned[2].levels == {"rate": "1", "learner": "deep"}
    settings = {"learner": "deep", "rate": 1.0, "endings": "learnt", "world": "", "steps": 20}
    assert planned[2].spec == RunSpec("fake", 3, settings, 7)


def test_a_study_without_factors_is_one_combination() -> None:
    """And needs no answer; a title and figures are kept."""
    study = parse_study(
        "study: one\ntitle: >\n  Only\n  one\nquestion: What?\nkind: fake\nseeds: 1\n"
        "settings:\nvary:\nfigures: [heat, curves]\n"
    )
    assert [(each.levels, each.spec.seed) for each in study.expand()] == [({}, 0)]
    assert (study.title, study.answer, study.figures) == ("Only one", None, ("heat", "curves"))
    assert study.describe() == "one: What?\n1 run of kind fake: 1 combination with seed 0"


def test_a_description_tells_runs_factors_levels_and_seeds() -> None:
    """In a few lines; numbers of seeds that do not follow each other are listed."""
    assert parse_study(TEXT).describe().splitlines() == [
        "rates: Is a high rate better?",
        "15 runs of kind fake: 5 of 6 combinations with 3 seeds, 0 to 2",
        "rate: 1, 0.9, .5",
        "learner: plain, deep",
        "answered by steps (median) of each rate against 1, within learner",
    ]
    commas = parse_study(TEXT.replace("    plain:", '    "plain, that is":')).describe()
    assert "learner: plain, that is; deep" in commas.splitlines()
    listed = parse_study(TEXT.replace("seeds: 3", f"seeds: [9, 3, {LAST_SEED}]")).describe()
    assert f"with 3 seeds, 9, 3, {LAST_SEED}\n" in listed


def test_an_empty_bundle_is_the_settings_as_they_are() -> None:
    """Whether it is written as {} or as nothing."""
    for nothing in ("", " {}"):
        study = parse_study(TEXT.replace(" {learner: plain}", nothing))
        assert study.combinations == parse_study(TEXT).combinations


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        # the form
        ("study: rates\n", "", "line 1: 'study' is missing; add study: ..."),
        ("question: Is a high rate better?", "question:", "line 2, question: it is empty; write something"),
        ("kind: fake", "knd: fake", "line 3, knd: unknown key 'knd'; did you mean 'kind'?"),
        ("fake", "[fake]", "line 3, kind: it is no plain text; write words, not a list or keys"),
        ("seeds: 3", "seeds: 0", "line 4, seeds: 0 is no number of seeds; give a whole number from 1 to"),
        ("seeds: 3", "seeds: many", "line 4, seeds: many is no number of seeds; give a whole number from 1"),
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
        # what the kind says
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


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "{steps: 20}",
            "{endings: given}",
            "line 5, settings.endings: the learner plain has none (where learner is plain); leave it out",
        ),
        (
            "[1, 0.9, .5]",
            "[1, 1.0]",
            "line 7, vary.rate[1]: where rate is 1.0 and learner is plain, the runs are the same as where "
            "rate is 1 and learner is plain, and 1 more like that; remove one of the two",
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
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checking, "kind", lambda _: FAKE_WITH_AN_ODD_RULE)
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
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checking, "kind", lambda _: nan)
        faults = told(TEXT)
    assert faults[0].startswith("line 7, vary.rate[0]: nan is not possible; give a finite number")


def test_bugs_of_a_kind_are_no_mistakes_of_the_file() -> None:
    """They keep their traceback."""
    broken = Kind("fake", 3, MEASURES, lambda given: {"rate": given["none"]}, lambda _: (), FAKE.run)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checking, "kind", lambda _: broken)
        with pytest.raises(KeyError, match="none"):
            parse_study(TEXT)


# Files


def test_texts_of_files_travel_with_the_study(tmp_path: Path) -> None:
    """They are read beside the study's file, once, and what was read gives the same study elsewhere."""
    (tmp_path / "worlds").mkdir()
    (tmp_path / "worlds" / "mine.maze").write_bytes("#é\r\n".encode())
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT.replace("steps: 20", "world: worlds/mine.maze"), encoding="utf-8-sig")
    study = load_study(path)
    assert study.files == {"worlds/mine.maze": "#é\r\n"}
    assert all(each.spec.files == study.files for each in study.expand())
    assert parse_study(study.text, str(path), study.files) == study
    other = parse_study(study.text, files={"worlds/mine.maze": "other", "unused": "x"})
    assert list(other.files) == ["worlds/mine.maze"]
    assert {each.spec.hash for each in other.expand()}.isdisjoint(each.spec.hash for each in study.expand())


def test_a_file_that_is_not_there_is_told_at_its_setting(tmp_path: Path) -> None:
    """With the path that was looked for."""
    path = tmp_path / "mine.yaml"
    path.write_text(TEXT.replace("{learner: plain}", "{learner: plain, world: mine.maze}"), encoding="utf-8")
    with pytest.raises(StudyError) as caught:
        load_study(path)
    expected = f"{path}, line 9, vary.learner.plain.world: {tmp_path}{os.sep}mine.maze: there is no such file"
    assert str(caught.value).startswith(expected)


def test_a_study_that_is_not_there_is_told(tmp_path: Path) -> None:
    """A missing file, a folder, and one that is no text."""
    with pytest.raises(UserError, match="there is no such file; check the path"):
        load_study(tmp_path / "none.yaml")
    with pytest.raises(UserError, match="this is a folder"):
        load_study(tmp_path)
    (tmp_path / "bin.yaml").write_bytes(b"study: \xff")
    with pytest.raises(UserError, match="cannot be read as UTF-8 text"):
        load_study(tmp_path / "bin.yaml")


# Properties

NAMES = st.text("abcdefgh", min_size=1, max_size=4)
NUMBERS = st.lists(st.integers(-99, 99), min_size=1, max_size=4, unique=True)
FACTORS = st.dictionaries(NAMES, NUMBERS, max_size=4)
FREE = Kind("free", 1, MEASURES, dict, lambda _: (), FAKE.run)


def free(vary: Any, settings: Mapping[str, Any], seeds: Any = 2, leave_out: Any = ()) -> Study:
    """Return a study of a kind whose settings may be anything; JSON is YAML, too."""
    data = {"study": "s", "question": "q", "kind": "free", "seeds": seeds, "settings": settings}
    data |= {"vary": vary, "leave_out": list(leave_out)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checking, "kind", lambda _: FREE)
        return parse_study(json.dumps(data))


def test_limits_are_within_reach() -> None:
    """As many runs as are allowed, and the largest seed; one more is refused."""
    assert free({}, {}, 100_000).runs == 100_000
    with pytest.raises(StudyError, match="this would be 100,001 runs, 1 combination with 100,001 seeds"):
        free({}, {}, 100_001)
    assert free({}, {}, {"first": LAST_SEED - 1, "count": 2}).seeds == (LAST_SEED - 1, LAST_SEED)


@pytest.mark.parametrize(("number", "shown"), [(12, "22"), (13, "22, ...")])
def test_a_dozen_seeds_are_listed(number: int, shown: str) -> None:
    """Of more, the first twelve."""
    seeds = [*range(0, 2 * number, 2)]
    assert free({}, {}, seeds).describe().endswith(f" 18, 20, {shown}")


@given(FACTORS, st.integers(1, 4), st.integers(0, LAST_SEED - 4))
def test_an_expansion_is_a_product(vary: dict[str, list[int]], count: int, first: int) -> None:
    """Of the factors' levels in the file's order and the seeds; no two runs are the same."""
    planned = free(vary, {"zz": 1}, {"first": first, "count": count}).expand()
    expected = [
        ({"zz": 1, **dict(zip(vary, values, strict=True))}, first + i)
        for values in product(*vary.values())
        for i in range(count)
    ]
    assert [(each.spec.settings, each.spec.seed) for each in planned] == expected
    assert all({**each.levels} == {k: str(each.spec.settings[k]) for k in vary} for each in planned)
    assert len({each.spec.hash for each in planned}) == len(planned)


@given(st.data(), FACTORS)
def test_the_order_of_keys_changes_no_run(data: st.DataObject, vary: dict[str, list[int]]) -> None:
    """The same runs come in another order, with the same hashes."""
    settings = {"zx": 1, "zy": "b", "zz": True}
    names = data.draw(st.permutations(list(vary)))
    shuffled = {name: data.draw(st.permutations(vary[name])) for name in names}
    one = free(vary, settings)
    other = free(shuffled, dict(data.draw(st.permutations(list(settings.items())))))
    assert {each.spec.hash for each in one.expand()} == {each.spec.hash for each in other.expand()}
    assert [each.spec.hash for each in one.expand()] == [
        each.spec.hash for each in free(vary, settings).expand()
    ]


@given(st.data(), FACTORS.filter(bool))
def test_what_is_left_out_is_what_has_all_the_labels(data: st.DataObject, vary: dict[str, list[int]]) -> None:
    """And all the rest stays, in its order."""
    some = st.fixed_dictionaries({}, optional={name: st.sampled_from(vary[name]) for name in vary})
    barred = data.draw(st.lists(some.filter(bool), max_size=3))
    every = [dict(zip(vary, values, strict=True)) for values in product(*vary.values())]
    kept = [each for each in every if not any(each.items() >= labels.items() for labels in barred)]
    if kept:
        found = free(vary, {}, leave_out=barred).combinations
        assert [dict(each.settings) for each in found] == kept
    else:
        with pytest.raises(StudyError, match="every combination is left out"):
            free(vary, {}, leave_out=barred)


@given(st.booleans() | st.integers(-LAST_SEED, LAST_SEED) | st.floats(allow_nan=False, allow_infinity=False))
def test_a_value_is_read_as_it_is_written(value: Value) -> None:
    """Truth values and numbers keep their type and every bit."""
    assert repr(value_of(json.dumps(value))) == repr(value)


@given(st.text(max_size=30))
def test_no_text_is_more_than_a_mistake(text: str) -> None:
    """Whatever stands in a file, reading it ends with a study or with mistakes told."""
    for whole in (text, TEXT.replace("0.9, .5", text), TEXT.replace("steps: 20", text)):
        try:
            parse_study(whole)
        except StudyError as error:
            assert error.faults  # noqa: PT017 - most texts are wrong, and a few are not


# The schema


def fits(data: Any, schema: Mapping[str, Any], root: Mapping[str, Any]) -> bool:
    """Return whether data has the form that a JSON Schema gives, as far as ours uses its words."""
    if "$ref" in schema:
        schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
    if "anyOf" in schema or "oneOf" in schema:
        return any(fits(data, each, root) for each in (*schema.get("anyOf", ()), *schema.get("oneOf", ())))
    types = {"string": str, "boolean": bool, "null": type(None), "array": list, "object": dict}
    named = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    number = isinstance(data, int | float) and not isinstance(data, bool)
    found = [number if name in ("number", "integer") else isinstance(data, types[name]) for name in named]
    if not any(found) or (named == ["integer"] and not isinstance(data, int)):
        return False
    if isinstance(data, str):
        return len(data) >= schema.get("minLength", 0) and data in schema.get("enum", [data])
    if isinstance(data, list):
        return len(data) >= schema.get("minItems", 0) and all(
            fits(each, schema["items"], root) for each in data
        )
    if isinstance(data, dict):
        return _mapping_fits(data, schema, root)
    return not number or schema.get("minimum", data) <= data <= schema.get("maximum", data)


def _mapping_fits(data: Mapping[str, Any], schema: Mapping[str, Any], root: Mapping[str, Any]) -> bool:
    more = schema.get("additionalProperties", True)
    own = schema.get("properties", {})
    return (
        len(data) >= schema.get("minProperties", 0)
        and set(schema.get("required", ())) <= set(data)
        and all(fits(data[name], own[name], root) for name in data if name in own)
        and (more is True or all(more and fits(data[name], more, root) for name in data if name not in own))
    )


SCHEMA = json.loads(json_schema())


def test_the_shipped_schema_is_the_models() -> None:
    """Written by `json_schema`, and not since forgotten."""
    assert shipped_schema() == json_schema()


def test_the_schema_describes_every_key() -> None:
    """An editor completes keys and shows a description with each."""
    assert list(SCHEMA["properties"]) == list(StudyText.model_fields)
    properties = [*SCHEMA["properties"].values()]
    for model in SCHEMA["$defs"].values():
        properties.extend(model["properties"].values())
    assert all(shown["description"] for shown in properties)


FORMS = [
    ("seeds: 3", "seeds: [3, 4]"),
    ("seeds: 3", "seeds: {first: 3, count: 4}"),
    ("settings: {steps: 20}\n", ""),
    (" {learner: plain}", ""),
    ("answer:", "figures: [a]\nanswer:"),
    ("seeds: 3", "seeds: [-3]"),
    ("seeds: 3", "seeds: 0"),
    ("seeds: 3", "seeds: []"),
    ("seeds: 3", "seeds: {first: 3}"),
    ("study: rates\n", ""),
    ("[1, 0.9, .5]", "[[1]]"),
    ("[1, 0.9, .5]", "[]"),
    ("[1, 0.9, .5]", "3"),
    ("{learner: plain}", "plain"),
    ("leave_out: [{", "leave_out: [{}, {"),
    ("statistic: median", "statistic: mode"),
    ("against: 1", "aganst: 1"),
    ("kind:", "knd:"),
]


@pytest.mark.parametrize(("old", "new"), FORMS)
def test_the_schema_and_the_reader_agree(old: str, new: str) -> None:
    """A form is right for an editor, which reads ordinary YAML, exactly where it is right for a study."""
    text = TEXT.replace(old, new, 1)
    assert text != TEXT
    right = not read_form(read_yaml(text, "mine.yaml")).faults
    assert fits(yaml.safe_load(text), SCHEMA, SCHEMA) is right
    assert right is (FORMS.index((old, new)) < 5)


STUDIES = [
    path
    for path in sorted(Path(__file__).parents[3].glob("examples/studies/*.yaml"))
    if "study" in yaml.safe_load(path.read_text(encoding="utf-8"))
]


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_ready_studies_are_right(path: Path) -> None:
    """For an editor and for their kind; each says how its question is answered, with five seeds or more."""
    assert fits(yaml.safe_load(path.read_text(encoding="utf-8")), SCHEMA, SCHEMA)
    study = load_study(path)
    assert study.answer is not None
    assert len(study.seeds) >= 5


def test_the_guides_example_is_a_study() -> None:
    """Of the runs that it says, and of the schema's form."""
    guide = (Path(__file__).parents[3] / "docs" / "studies.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```yaml\n(.*?)```", guide.partition("\n## ")[2].partition("\n## ")[0], re.DOTALL)
    study = parse_study(blocks[0], "docs/studies.md")
    assert study.runs == 100
    assert fits(yaml.safe_load(blocks[0]), SCHEMA, SCHEMA)
