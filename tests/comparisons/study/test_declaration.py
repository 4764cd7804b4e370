"""Study files: what they say, and what they expand to."""

import json
from collections.abc import Mapping
from itertools import product
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from study_texts import FAKE, MEASURES, TEXT, fake_kind, known

from comparisons.study.declaring.declaration import Answer, Study, StudyError, parse_study
from comparisons.study.declaring.written import LAST_SEED, value_of
from comparisons.study.kinds import Kind
from comparisons.study.spec import RunSpec, Value

fake = pytest.fixture(autouse=True, scope="module")(fake_kind)


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
    settings: Mapping[str, Value] = {
        "learner": "deep",
        "rate": 1.0,
        "endings": "learnt",
        "world": "",
        "steps": 20,
    }
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
    for nothing in ("", " {}", " ~"):
        study = parse_study(TEXT.replace(" {learner: plain}", nothing))
        assert study.combinations == parse_study(TEXT).combinations


NAMES = st.text("abcdefgh", min_size=1, max_size=4)
NUMBERS = st.lists(st.integers(-99, 99), min_size=1, max_size=4, unique=True)
FACTORS = st.dictionaries(NAMES, NUMBERS, max_size=4)
FREE = Kind("free", 1, MEASURES, dict, lambda _: (), FAKE.run)


def free(vary: Any, settings: Mapping[str, Any], seeds: Any = 2, leave_out: Any = ()) -> Study:
    """Return a study of a kind whose settings may be anything; JSON is YAML, too."""
    data = {"study": "s", "question": "q", "kind": "free", "seeds": seeds, "settings": settings}
    data |= {"vary": vary, "leave_out": list(leave_out)}
    with known(FREE):
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
