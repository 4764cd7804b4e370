"""The JSON Schema of study files: shipped, complete, and of one mind with the reader."""

import copy
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from study_texts import TEXT

from comparisons.study.declaring.declaration import load_study, parse_study
from comparisons.study.declaring.schema import StudyText, json_schema, read_form, shipped_schema
from hierarchy.text_nodes import read_yaml


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
    ("leave_out:", "title:\nfigures:\nleave_out: # "),
    ("{measure: steps, compare: rate, against: 1, within: [learner], statistic: median}", "~"),
    ("within: [learner], statistic: median", "within: null, statistic: "),
    ("study: rates", "study: 12"),
    ("study: rates", "study: null"),
    ("against: 1", "against: null"),
    ("steps: 20", "steps: "),
    ("steps: 20", 'steps: ""'),
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
    assert right is (FORMS.index((old, new)) < 9)


DATA = yaml.safe_load(TEXT)
PARTS = [
    None,
    True,
    -1,
    0,
    1,
    2.5,
    "a word",
    [],
    [1],
    [None],
    [[1]],
    {},
    {"a": 1},
    {"a": None},
    {"a": {"b": 1}},
]


def places(data: Any) -> list[list[Any]]:
    """Return the path of every part of some data."""
    inside = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [[], *([key, *path] for key, part in inside for path in places(part))]


@given(st.data())
def test_no_slip_tells_the_schema_from_the_reader(data: st.DataObject) -> None:
    """Parts of a study are replaced, removed or added, up to three of them: both take it, or neither.

    An empty text in quotes and a number in quotes are left aside: the reader does not see the quotes.
    """
    study = copy.deepcopy(DATA)
    for _ in range(data.draw(st.integers(1, 3))):
        *path, last = data.draw(st.sampled_from([path for path in places(study) if path]))
        holder = study
        for key in path:
            holder = holder[key]
        match data.draw(st.sampled_from(["replace", "remove", "add"])):
            case "replace":
                holder[last] = copy.deepcopy(data.draw(st.sampled_from(PARTS)))
            case "remove":
                del holder[last]
            case _ if isinstance(holder, dict):
                key = data.draw(st.sampled_from([*StudyText.model_fields, "first", "count", "other"]))
                holder[key] = copy.deepcopy(data.draw(st.sampled_from(PARTS)))
        if not study:
            break
    form = read_form(read_yaml(json.dumps(study), "mine.yaml"))
    assert fits(study, SCHEMA, SCHEMA) is not bool(form.faults), form.faults


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
