"""Reading a task graph from its text, with every mistake told by line, path and mend."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Final, NamedTuple

from hierarchy.graph import Call, TaskGraph, TaskGraphError
from hierarchy.predicates import ALWAYS, Predicate
from hierarchy.schema import CallText, TaskText, ValuesText, validated
from hierarchy.terms import Constant, Param, Term, ValueSet, Var
from hierarchy.text_files import file_text
from hierarchy.text_nodes import Document, Fault, TaskGraphTextError, read_yaml
from hierarchy.text_nodes import Path as KeyPath
from hierarchy.text_predicates import parse_predicate, parse_side
from hierarchy.text_words import PredicateError, Scope, literal
from hierarchy.text_worlds import MAZE_SUFFIX, TextWorld, load_world, maze_file
from worlds import UserError, Variable, suggest

_SUFFIX: Final = ".yaml"
RESERVED: Final = ("when", "uses")
"""Keys of an edge, which no task can be called."""


class LoadedGraph(NamedTuple):
    """A task graph that was read from text, and the world that it was read for."""

    graph: TaskGraph
    world: TextWorld


def graph_names() -> tuple[str, ...]:
    """Return the names of the task graphs that come with the package as text.

    Examples
    --------
    >>> "two_rooms" in graph_names()
    True
    """
    found = (entry.name for entry in files("hierarchy").joinpath("graphs").iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in found if name.endswith(_SUFFIX)))


def load_graph(name: str | Path, world: TextWorld | None = None) -> LoadedGraph:
    """Read a task graph that comes with the package, by its name, or any YAML file, by its path.

    Parameters
    ----------
    name
        The graph's name, or a path.
    world
        The world to read it for. Defaults to the one that the text names; a ``.maze`` file is looked for
        beside the text.

    Raises
    ------
    UserError
        If there is no such graph or file, or it cannot be read.
    TaskGraphTextError
        If its text is wrong; the message gives every mistake's line, path and mend.

    Examples
    --------
    >>> graph, world = load_graph("two_rooms")
    >>> graph.root.name, world.name
    ('Root', 'two_rooms')
    """
    if isinstance(name, str) and name in graph_names():
        text = files("hierarchy").joinpath("graphs", name + _SUFFIX).read_text(encoding="utf-8")
        return parse_graph(text, name + _SUFFIX, world)
    missing = (
        f"no task graph of this name and no such file; {suggest(str(name), graph_names(), 'graphs by name:')}"
    )
    path = Path(name)
    return parse_graph(file_text(path, missing), str(path), world, folder=path.parent)


def parse_graph(
    text: str, source: str = "task graph", world: TextWorld | None = None, *, folder: Path = Path()
) -> LoadedGraph:
    r"""Read a task graph from its text.

    Parameters
    ----------
    text
        YAML, in the form that docs/task-graph-text.md describes.
    source
        What errors call the text.
    world
        The world to read it for. Defaults to the one that the text names.
    folder
        Where a ``.maze`` file that the text names is looked for.

    Raises
    ------
    TaskGraphTextError
        If the text is wrong; the message gives every mistake's line, path and mend.

    Examples
    --------
    >>> text = '''
    ... graph: to the trigger
    ... world: two_rooms
    ... tasks:
    ...   Root:
    ...     until: robot = trigger
    ...     within: robot in room A
    ...     uses: [robot, trigger]
    ...     do: [North, South, West, East]
    ... '''
    >>> graph, _ = parse_graph(text)
    >>> print(graph.root.until, "|", graph.root.within)
    robot = trigger | robot in room A
    >>> try:
    ...     parse_graph(text.replace("robot = trigger", "robot = triger"), "mine.yaml")
    ... except TaskGraphTextError as error:
    ...     print(error.faults[0].line, error.faults[0].path, error.faults[0].mend)
    6 tasks.Root.until did you mean 'trigger'?
    """
    document = read_yaml(text, source)
    form = validated(document)
    if isinstance(form, list):
        raise TaskGraphTextError(source, form)
    if world is None:
        try:
            world = _world(form.world, folder)
        except UserError as error:
            problem, _, mend = str(error).rpartition("; ")
            raise TaskGraphTextError(source, [document.fault(("world",), problem, mend)]) from error
    builder = _Builder(document, world)
    graph = builder.graph(form.graph, form.sets, form.tasks)
    if builder.faults:
        raise TaskGraphTextError(source, builder.faults)
    return LoadedGraph(graph, world)


def _world(name: str | None, folder: Path) -> TextWorld:
    if name is None:
        raise UserError("the text names no world, and none is given; add world: NAME")
    if name.endswith(MAZE_SUFFIX):
        return maze_file(folder / name, name)
    return load_world(name)


class _Builder:
    """Builds a task graph from its form, collecting faults."""

    def __init__(self, document: Document, world: TextWorld) -> None:
        self.document = document
        self.world = world
        self.faults: list[Fault] = []
        self.variables: dict[str, Var] = {variable.name: Var(variable) for variable in world.variables}
        self.sets = {values.name: values for values in world.sets}
        self.params: dict[str, tuple[Param, ...]] = {}
        self.unsure: set[str] = set()  # tasks with a faulty parameter: what is said of it is no second fault

    def fail(self, path: KeyPath, problem: str, mend: str) -> None:
        self.faults.append(self.document.fault(path, problem, mend))

    def graph(self, name: str, sets: Mapping[str, ValuesText], tasks: Mapping[str, TaskText]) -> TaskGraph:
        graph = TaskGraph(name, self.world.variables, self.world.actions)
        for key, form in sets.items():
            values = self.values(form, ("sets", key))
            self.sets[key] = ValueSet(key, frozenset(value for _, value in values))
        for key, task in tasks.items():  # a call may come before the task that it calls
            self.params[key] = tuple(self.declared(key, task))
        for key, task in tasks.items():
            self.task(graph, key, task)
        return graph

    def declared(self, task: str, form: TaskText) -> list[Param]:
        """Return the parameters of a task."""
        params = []
        for name, given in form.params.items():
            path = ("tasks", task, "params", name)
            if pairs := self.values(given, path):
                try:
                    domain = Variable(name, tuple(v for _, v in pairs), tuple(label for label, _ in pairs))
                except ValueError as error:
                    problem, _, mend = str(error).partition("; ")
                    self.fail(path, problem, mend)
                else:
                    params.append(Param(domain))
        if len(params) < len(form.params):
            self.unsure.add(task)
        return params

    def values(self, form: ValuesText, path: KeyPath) -> list[tuple[str, Hashable]]:
        """Return labels and values."""
        if form.of is None:
            read = [(label, text, literal(text)) for label, text in form.values or ()]
            return [(str(value) if label == text else label, value) for label, text, value in read]
        if form.of not in self.variables:
            mend = suggest(form.of, self.variables, "state variables:")
            self.fail((*path, "of"), f"unknown state variable {form.of!r}", mend)
            return []
        domain = self.variables[form.of].domain
        if form.values is None:
            return list(zip(domain.labels, domain.values, strict=True))
        found: list[tuple[str, Hashable]] = []
        for label, text in form.values:
            if text in domain.labels:
                found.append((label, domain.values[domain.labels.index(text)]))
            elif text in self.world.marks and self.world.marks[text] in domain:
                found.append((label, self.world.marks[text]))
            else:
                marks = [mark for mark, value in self.world.marks.items() if value in domain]
                mend = suggest(text, (*marks, *domain.labels), "its values:")
                self.fail((*path, "values", label), f"unknown value {text!r} of {form.of}", mend)
        return found

    def task(self, graph: TaskGraph, name: str, form: TaskText) -> None:
        path = ("tasks", name)
        scope = Scope(self.variables | {param.name: param for param in self.params[name]}, self.sets)
        if name in RESERVED:
            self.fail(path, f"{name!r} is a key of edges and no name of a task", "choose another")
        try:
            graph.task(
                name,
                *self.params[name],
                until=self.predicate(form.until, scope, (*path, "until")),
                goal=self.predicate(form.goal, scope, (*path, "goal")),
                pseudo_reward=form.pseudo_reward,
                within=self.predicate(form.within, scope, (*path, "within")),
                start=self.predicate(form.start, scope, (*path, "start")),
                uses=self.known(form.uses, (*path, "uses")),
                do=[self.call(call, scope, (*path, "do", place)) for place, call in enumerate(form.do)],
            )
        except TaskGraphError as error:  # the name is taken
            self.fail(path, *str(error).split("; ", 1))

    def known(self, names: list[str], path: KeyPath) -> list[Var]:
        """Return state variables by name."""
        for place, name in enumerate(names):
            if name not in self.variables:
                mend = suggest(name, self.variables, "state variables:")
                self.fail((*path, place), f"unknown state variable {name!r}", mend)
            elif name in names[:place]:
                self.fail((*path, place), f"{name!r} is given twice", "remove one of the two")
        return [self.variables[name] for name in names if name in self.variables]

    def predicate(self, text: str, scope: Scope, path: KeyPath) -> Predicate:
        try:
            return parse_predicate(text, scope)
        except PredicateError as error:
            if path[1] not in self.unsure:
                self.fail(path, error.problem, error.mend)
            return ALWAYS

    def call(self, form: CallText, scope: Scope, path: KeyPath) -> Call:
        child = form.child
        if child not in self.params and child not in self.world.actions:
            bare = child.split("(")[0].strip()
            mend = suggest(child, (*self.params, *self.world.actions), "tasks and actions:")
            if bare != child and bare in self.params:
                mend = f"write - {bare}: {{PARAMETER: VALUE}}"
            self.fail((*path, child), f"unknown task or action {child!r}", mend)
            return Call(child)
        params = {param.name: param for param in self.params.get(child, ())}
        binding: list[tuple[str, Term | Constant]] = []
        for name, text in form.binding.items():
            here = (*path, child, name)
            if name not in params and child in self.unsure:
                continue
            if name not in params:
                mend = suggest(name, params, f"parameters of {child}:")
                self.fail(here, f"unknown parameter {name!r} of {child}", mend)
                continue
            try:
                binding.append((name, parse_side(text, scope, params[name].domain)))
            except PredicateError as error:
                if path[1] not in self.unsure:
                    self.fail(here, error.problem, error.mend)
        relevant = None
        if form.uses is not None:
            relevant = tuple(var.name for var in self.known(form.uses, (*path, "uses")))
        return Call(child, tuple(binding), self.predicate(form.when, scope, (*path, "when")), relevant)
