"""The form of a task graph's text as pydantic models, and the JSON Schema that is made from them."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Annotated, Any, Final

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    FiniteFloat,
    ValidationError,
    model_validator,
)
from pydantic.json_schema import WithJsonSchema

from hierarchy.form_faults import form_fault
from hierarchy.text_nodes import Document, Fault, Path
from worlds import suggest

_SCALAR: Final = {"type": ["string", "number", "boolean"]}

Label = Annotated[str, WithJsonSchema(_SCALAR)]
"""A value by its label. Text that looks like a number or a truth value is a label all the same."""
PredicateText = Annotated[
    str, Field(description="A predicate, such as: doors = open and robot in room A", min_length=1)
]
Pairs = tuple[tuple[str, str], ...]


def _pairs(given: Any) -> Any:
    """Return labels with what they stand for: a list stands for itself."""
    if isinstance(given, list) and all(isinstance(each, str) for each in given):
        return tuple((each, each) for each in given)
    if isinstance(given, dict) and all(isinstance(each, str) for each in given.values()):
        return tuple(given.items())
    raise ValueError("these are no values; write a list of them, or new labels with a value each")


def _variable(given: Any) -> Any:
    """Let a state variable's name stand for all its values."""
    return {"of": given} if isinstance(given, str) and given else given


def _empty_or_mapping(given: Any) -> Any:
    return {} if given == "" else given


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ValuesText(_Model):
    """Values: those of a state variable, some of them by their labels, or, without `of`, literals."""

    of: Annotated[str | None, Field(description="The state variable whose values these are")] = None
    values: Annotated[
        Pairs | None,
        BeforeValidator(_pairs, json_schema_input_type=list[Label] | dict[str, Label]),
        Field(description="Labels of values, or new labels for them; all of the variable's if left out"),
    ] = None

    @model_validator(mode="after")
    def _some(self) -> ValuesText:
        if self.of is None and self.values is None:
            raise ValueError("nothing says which values; give 'of', a state variable, or 'values'")
        return self


class CallText(BaseModel):
    """A child: a task or primitive action with its binding, its guard and its own relevant variables."""

    model_config = ConfigDict(
        extra="allow", frozen=True, json_schema_extra={"minProperties": 1, "maxProperties": 3}
    )
    __pydantic_extra__: dict[
        str,
        Annotated[
            dict[str, Label],
            BeforeValidator(_empty_or_mapping, json_schema_input_type=dict[str, Label] | None),
        ],
    ]

    when: Annotated[PredicateText, Field(description="The guard: where the child may be called")] = "always"
    uses: Annotated[
        list[str] | None,
        Field(description="What the child's completion depends on; the caller's if left out"),
    ] = None

    @model_validator(mode="after")
    def _one_child(self) -> CallText:
        if len(self.__pydantic_extra__) != 1:
            named = ", ".join(self.__pydantic_extra__) or "none"
            raise ValueError(f"an edge leads to one child, this one to: {named}; begin each with '- '")
        return self

    @property
    def child(self) -> str:
        """The child's name."""
        return next(iter(self.__pydantic_extra__))

    @property
    def binding(self) -> dict[str, str]:
        """What each of the child's parameters is bound to."""
        return self.__pydantic_extra__[self.child]


def _call(given: Any) -> Any:
    return {given: {}} if isinstance(given, str) and given else given


class TaskText(_Model):
    """A task."""

    params: Annotated[
        dict[
            str,
            Annotated[ValuesText, BeforeValidator(_variable, json_schema_input_type=str | ValuesText)],
        ],
        Field(description="Parameters: a state variable whose values each takes, or values"),
    ] = {}
    until: Annotated[PredicateText, Field(description="The termination: it ends where this holds")]
    goal: Annotated[PredicateText, Field(description="Which terminations are good ones")] = "always"
    pseudo_reward: Annotated[
        FiniteFloat | None,
        Field(description="What a learner is taught to expect of other terminations"),
    ] = None
    within: Annotated[PredicateText, Field(description="The working space")] = "always"
    start: Annotated[PredicateText, Field(description="The initiation: it is called only here")] = "always"
    uses: Annotated[list[str], Field(description="The relevant state variables")]
    do: Annotated[
        list[Annotated[CallText, BeforeValidator(_call, json_schema_input_type=str | CallText)]],
        Field(description="The children, in the order that breaks ties"),
    ]


class GraphText(_Model):
    """A task graph of affordant. The task that stands last is the root."""

    graph: Annotated[str, Field(description="The graph's name", min_length=1)]
    world: Annotated[str | None, Field(description="The world's name, or the path of a .maze file")] = None
    sets: Annotated[
        dict[str, ValuesText], Field(description="Sets of values that predicates name, besides the world's")
    ] = {}
    tasks: Annotated[dict[str, TaskText], Field(description="The tasks; the last is the root", min_length=1)]


def json_schema() -> str:
    """Return the JSON Schema of a task graph's text, as the package ships it.

    Examples
    --------
    >>> json.loads(json_schema())["required"]
    ['graph', 'tasks']
    """
    schema = GraphText.model_json_schema(mode="validation")
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "affordant task graph"}
    return json.dumps({**schema, **head}, indent=2) + "\n"


def shipped_schema() -> str:
    """Return the JSON Schema file that comes with the package."""
    return files("hierarchy").joinpath("schemas", "task_graph.schema.json").read_text(encoding="utf-8")


def validated(document: Document) -> GraphText | list[Fault]:
    """Return a document as a model, or everything that is wrong with its form."""
    try:
        return GraphText.model_validate(document.data)
    except ValidationError as error:
        return [_fault(document, dict(each)) for each in error.errors()]


def _fault(document: Document, error: dict[str, Any]) -> Fault:
    """Return one of pydantic's errors in our words."""
    path: Path = tuple(part for part in error["loc"] if part != "[key]")
    if error["type"] == "dict_type" and len(path) == 5 and path[2] == "do":  # a binding, or a key gone wrong
        last = str(path[-1])
        mend = suggest(last, ("when", "uses"), "keys besides the child:")
        if last in document.data["tasks"]:
            mend = f"write - {last}: {{PARAMETER: VALUE}}"
        return document.fault(path, f"{last!r} is given {error['input']!r}, which binds no parameters", mend)
    return form_fault(document, path, error, _known_keys)


def _known_keys(path: Path) -> list[str]:
    """Return the keys that may stand where an unknown one does."""
    model: type[BaseModel] = GraphText
    if path[0] == "sets" or "params" in path[2:3]:
        model = ValuesText
    elif path[0] == "tasks" and len(path) > 1:
        model = TaskText
    return list(model.model_fields)
