"""The JSON Schema that editors use, and the form that it is made from."""

import json
from importlib.resources import files

import pytest
import yaml
from pydantic import ValidationError

from hierarchy.schema import GraphText, json_schema, shipped_schema

SHIPPED = yaml.safe_load(files("hierarchy").joinpath("graphs", "two_rooms.yaml").read_text(encoding="utf-8"))


def test_the_shipped_schema_is_the_models() -> None:
    """Written by `json_schema`, and not since forgotten."""
    assert shipped_schema() == json_schema()


def test_the_shipped_graph_has_the_form() -> None:
    """Read by an ordinary YAML reader, as editors do, it validates and keeps its tasks in order."""
    form = GraphText.model_validate(SHIPPED)
    assert list(form.tasks) == ["GotoTrigger", "GotoDoor", "GotoGoal", "Root"]
    assert form.tasks["Root"].do[1].binding == {"target": "D1"}
    assert form.tasks["Root"].do[3].uses == []


def test_unknown_keys_have_no_place_in_the_form() -> None:
    """Neither in a graph nor in a task; an edge's other keys are children."""
    for wrong in (
        {**SHIPPED, "wrld": "x"},
        {**SHIPPED, "tasks": {"Root": {**SHIPPED["tasks"]["Root"], "utnil": "x"}}},
    ):
        with pytest.raises(ValidationError, match="Extra inputs are not permitted"):
            GraphText.model_validate(wrong)


def test_the_schema_names_every_key_and_says_what_it_means() -> None:
    """An editor completes keys and shows a description with each."""
    definitions = json.loads(shipped_schema())["$defs"]
    task = definitions["TaskText"]
    assert list(task["properties"]) == [
        "params",
        "until",
        "goal",
        "pseudo_reward",
        "within",
        "start",
        "uses",
        "do",
    ]
    assert task["required"] == ["until", "uses", "do"]
    assert task["additionalProperties"] is False
    assert all(shown["description"] for shown in task["properties"].values())
    assert set(definitions["CallText"]["properties"]) == {"when", "uses"}
