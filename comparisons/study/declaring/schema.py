"""The form of a study file as pydantic models, and the JSON Schema that is made from them."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Annotated, Any, Final, Literal, NamedTuple, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    Tag,
    ValidationError,
    model_validator,
)
from pydantic.json_schema import WithJsonSchema

from comparisons.study.declaring.written import (
    LAST_SEED,
    Written,
    count,
    has_controls,
    is_nothing,
    label,
    seed,
    written,
)
from hierarchy.form_faults import form_fault
from hierarchy.text_nodes import Document, Fault, Path
from worlds import suggest
from worlds.errors import nearest

SCHEMA: Final = "study.schema.json"
"""The JSON Schema's file, beside this module."""
Statistic = Literal["iqm", "median", "mean"]
"""What sums up the runs of one combination: the interquartile mean, the median or the mean."""
Normalise = Literal["none", "against"]
"""What numbers are divided by, task by task: nothing, or the median of the level compared with."""

_SCALAR: Final = {"type": ["string", "number", "boolean"], "minLength": 1}
_STAND_INS: Final = {"study": "none", "question": "none", "kind": "none", "seeds": "1"}  # for what is wrong


def _line(given: Any) -> Any:
    """Return text in one line: a file may fold it over several."""
    if not isinstance(given, str):
        return given
    line = "" if is_nothing(given) else " ".join(given.split())
    if has_controls(line):
        raise ValueError("a control character cannot stand here; remove it")
    return line


def _empty_or_mapping(given: Any) -> Any:
    return {} if is_nothing(given) else given


def _seeds_form(given: Any) -> str:
    return "list" if isinstance(given, list) else "run" if isinstance(given, dict) else "count"


def _levels_form(given: Any) -> str:
    return "bundles" if isinstance(given, dict) else "values"


def _may_be_null(schema: dict[str, Any]) -> None:
    """Let a model's schema say that what may be left out may also hold nothing."""
    for name, shown in schema["properties"].items():
        if name not in schema["required"] and {"type": "null"} not in shown.get("anyOf", ()):
            form = [key for key in shown if key not in ("default", "description", "title")]
            shown["anyOf"] = [{key: shown.pop(key) for key in form}, {"type": "null"}]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, json_schema_extra=_may_be_null)

    @model_validator(mode="before")
    @classmethod
    def _without_nothing(cls, given: Any) -> Any:
        """Leave out what holds nothing, such as the key of a list whose items are comments just now."""
        if not isinstance(given, dict):
            return given
        optional = {name for name, field in cls.model_fields.items() if not field.is_required()}
        return {key: value for key, value in given.items() if key not in optional or not is_nothing(value)}


Line = Annotated[str, Field(min_length=1), BeforeValidator(_line), WithJsonSchema(_SCALAR)]
WrittenValue = Annotated[Written, PlainValidator(written), WithJsonSchema(_SCALAR)]
Label = Annotated[str, PlainValidator(label), WithJsonSchema(_SCALAR)]
_OF_SEEDS: Final = {"type": "integer", "maximum": LAST_SEED}
Seed = Annotated[int, PlainValidator(seed), WithJsonSchema({**_OF_SEEDS, "minimum": 0})]
Count = Annotated[int, PlainValidator(count), WithJsonSchema({**_OF_SEEDS, "minimum": 1})]
Bundle = Annotated[
    dict[str, WrittenValue],
    BeforeValidator(_empty_or_mapping, json_schema_input_type=dict[str, WrittenValue] | None),
]
Values = Annotated[list[WrittenValue], Field(min_length=1)]
Bundles = Annotated[dict[str, Bundle], Field(min_length=1)]
Levels = Annotated[
    Annotated[Values, Tag("values")] | Annotated[Bundles, Tag("bundles")], Discriminator(_levels_form)
]


class SeedsText(_Model):
    """Seeds that follow each other."""

    first: Annotated[Seed, Field(description="The first seed")] = 0
    count: Annotated[Count, Field(description="How many seeds, one after the other")]


class AnswerText(_Model):
    """How the question is answered: a measure compared between the levels of a factor."""

    measure: Annotated[Line, Field(description="What is measured: one of the kind's measures")]
    compare: Annotated[Label, Field(description="The factor whose levels are compared")]
    against: Annotated[Label, Field(description="The level that the others are compared with, by its label")]
    within: Annotated[
        list[Label], Field(description="Factors at each of whose levels the comparison is made by itself")
    ] = []
    statistic: Annotated[Statistic, Field(description="What sums up the runs that are compared")] = "iqm"
    normalise: Annotated[
        Normalise,
        Field(description="against: count each task's numbers in its median of the level compared with"),
    ] = "none"


class StudyText(_Model):
    """A study of affordant: runs of one kind, in every combination of its factors' levels, with seeds."""

    study: Annotated[Line, Field(description="The study's name")]
    title: Annotated[Line | None, Field(description="What its report is called; the name if left out")] = None
    question: Annotated[Line, Field(description="What it is to answer, in a sentence")]
    kind: Annotated[Line, Field(description="The kind of its runs: learn, episodes, perceive, ...")]
    seeds: Annotated[
        Annotated[Count, Tag("count")]
        | Annotated[list[Seed], Field(min_length=1), Tag("list")]
        | Annotated[SeedsText, Tag("run")],
        Discriminator(_seeds_form),
        Field(description="How many seeds each combination is run with, from 0 on; or which ones"),
    ]
    settings: Annotated[Bundle, Field(description="Settings that every run has")] = {}
    vary: Annotated[
        dict[str, Levels],
        Field(
            description="The factors. Each has levels: a list of values of the setting of its name, or "
            "labels with the settings that each stands for"
        ),
    ] = {}
    leave_out: Annotated[
        list[Annotated[dict[str, Label], Field(min_length=1)]],
        Field(description="Combinations that are not run, by factors and their levels' labels"),
    ] = []
    answer: Annotated[AnswerText | None, Field(description="How the report answers the question")] = None
    figures: Annotated[
        list[Line] | None, Field(description="The report's figures; all that apply if left out")
    ] = None


def json_schema() -> str:
    """Return the JSON Schema of a study file, as the package ships it.

    Examples
    --------
    >>> json.loads(json_schema())["required"]
    ['study', 'question', 'kind', 'seeds']
    """
    schema = StudyText.model_json_schema(mode="validation")
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "affordant study"}
    return json.dumps({**schema, **head}, indent=2) + "\n"


def shipped_schema() -> str:
    """Return the JSON Schema file that comes with the package.

    Examples
    --------
    >>> shipped_schema() == json_schema()
    True
    """
    return files("comparisons.study.declaring").joinpath(SCHEMA).read_text(encoding="utf-8")


class Form(NamedTuple):
    """What can be read of a study file.

    Parameters
    ----------
    text
        The form; what could not be read stands there as nothing.
    unsure
        Keys of the file that cannot be relied on: what else may seem wrong with them is no second fault.
    faults
        What is wrong with the form.
    """

    text: StudyText
    unsure: frozenset[str]
    faults: list[Fault]


def read_form(document: Document) -> Form:
    """Return what can be read of a document, and everything that is wrong with its form."""
    if not isinstance(document.data, dict):
        fault = document.fault((), "these are no keys with values", "begin with study: NAME")
        return Form(StudyText.model_validate(_STAND_INS), frozenset(StudyText.model_fields), [fault])
    if "tasks" in document.data and "study" not in document.data:
        fault = document.fault((), "this is a task graph", "name it in a study, by settings: {graph: FILE}")
        return Form(StudyText.model_validate(_STAND_INS), frozenset(StudyText.model_fields), [fault])
    try:
        return Form(StudyText.model_validate(document.data), frozenset(), [])
    except ValidationError as error:
        errors: list[dict[str, Any]] = [dict(each) for each in error.errors()]
    wrong = {str(each["loc"][0]) for each in errors}
    right = {key: value for key, value in document.data.items() if key not in wrong}
    meant = {nearest(key, StudyText.model_fields) for key in wrong.difference(StudyText.model_fields)}
    form = StudyText.model_validate(_STAND_INS | right)
    return Form(form, frozenset(wrong | {key for key in meant if key}), [_fault(document, e) for e in errors])


def _fault(document: Document, error: dict[str, Any]) -> Fault:
    """Return one of pydantic's errors in our words."""
    path = _path(error["loc"])
    kind, last = error["type"], str(path[-1])
    if kind == "literal_error":
        mend = suggest(str(error["input"]), get_args(Normalise if last == "normalise" else Statistic))
        return document.fault(path, f"there is no {last} {error['input']!r}", mend)
    if kind == "dict_type" and path[0] == "vary" and len(path) == 3:
        mend = f"write {last}: {{SETTING: VALUE}}, or give {path[1]} a list of values"
        return document.fault(path, f"the label {last!r} stands for no settings", mend)
    if kind != "value_error" and path[0] == "vary" and len(path) == 2:
        mend = f"write {last}: [FIRST, SECOND], or labels with settings"
        return document.fault(path, "this is no list of levels", mend)
    return form_fault(document, path, error, _known_keys)


def _known_keys(path: Path) -> list[str]:
    """Return the keys that may stand where an unknown one does."""
    models: dict[str | int, type[BaseModel]] = {"answer": AnswerText, "seeds": SeedsText}
    return list(models.get(path[0], StudyText).model_fields)


def _path(loc: tuple[str | int, ...]) -> Path:
    """Return where an error is; pydantic also names which of several forms it took something for."""
    form = {"seeds": 1, "vary": 2}.get(str(loc[0]), len(loc))
    return (*loc[:form], *loc[form + 1 :])
