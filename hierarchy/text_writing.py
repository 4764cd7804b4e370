"""Writing a task graph as its text, such that reading it gives the same graph."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence

import yaml

from hierarchy.graph import Call, Task, TaskGraph, TaskGraphError
from hierarchy.predicates import ALWAYS, AllOf, AnyOf, Implies, Not, Predicate
from hierarchy.terms import Member, Param, ValueSet, Var
from hierarchy.text_nodes import TaskGraphTextError
from hierarchy.text_printing import is_listed, predicate_text, side_text
from hierarchy.text_reading import parse_graph
from hierarchy.text_words import Scope, literal
from hierarchy.text_worlds import TextWorld
from worlds import Variable

_TAG = "tag:yaml.org,2002:"


def graph_text(graph: TaskGraph, world: TextWorld) -> str:
    r"""Return a task graph as YAML, in the canonical form.

    The text is read again before it is returned: what it says is the graph, exactly.

    Raises
    ------
    TaskGraphError
        If the graph is not of this world, or holds what has no text, such as two values of one label.

    Examples
    --------
    >>> from hierarchy import two_rooms
    >>> from hierarchy.text_worlds import maze_world
    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> print(*graph_text(two_rooms(maze), maze_world(maze)).splitlines()[-4:], sep="\n")
            uses: [goal]
          - GotoGoal: {target: goal}
            when: robot in room B
            uses: []
    """
    if graph.index.variables != world.variables or graph.actions != world.actions:
        raise TaskGraphError(
            f"task graph {graph.name} has other variables or actions than the world {world.name}; "
            "write it for the world that it was declared on"
        )
    writer = _Writer(graph, world)
    text = yaml.serialize(
        writer.graph_node(), Dumper=_Dumper, width=float("inf"), allow_unicode=True, line_break="\n"
    )
    assert isinstance(text, str), "yaml.serialize returns text where it is given no stream"
    _compare(graph, text, world)
    return text


def _compare(graph: TaskGraph, text: str, world: TextWorld) -> None:
    """Refuse a text that does not say the graph."""
    try:
        read = parse_graph(text, f"the text of {graph.name}", world).graph
    except TaskGraphTextError as error:
        fault = error.faults[0]
        problem = f"{fault.path}: {fault.problem}; {fault.mend}"
        raise TaskGraphError(f"task graph {graph.name} cannot be written as text: {problem}") from error
    if read.name != graph.name:
        raise TaskGraphError(
            f"task graph {graph.name!r} cannot be written as text: its name is none; rename it"
        )
    for written, meant in zip(read.tasks.values(), graph.tasks.values(), strict=True):
        if written != meant:
            raise TaskGraphError(
                f"task graph {graph.name} cannot be written as text: task {meant.name} would be read as "
                "another; give its values distinct labels, and its parameters names of their own"
            )


class _Dumper(yaml.SafeDumper):  # type: ignore[misc] # PyYAML ships no types
    """Indents the items of a list below their key."""

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:
        del indentless
        super().increase_indent(flow, False)


class _Writer:
    """Turns a graph into YAML nodes."""

    def __init__(self, graph: TaskGraph, world: TextWorld) -> None:
        self.graph = graph
        self.world = world

    def graph_node(self) -> yaml.Node:
        sets = {name: self.values(values) for name, values in self.own_sets().items()}
        tasks = {task.name: self.task(task) for task in self.graph.tasks.values()}
        return _mapping(
            {
                "graph": _scalar(self.graph.name),
                "world": _scalar(self.world.name),
                **({"sets": _mapping(sets)} if sets else {}),
                "tasks": _mapping(tasks),
            }
        )

    def own_sets(self) -> dict[str, ValueSet]:
        """Return the named sets that the graph reads and the world does not give."""
        named: dict[str, ValueSet] = {}
        for member in _members(self.graph):
            if is_listed(member.left, member.right):
                continue
            if named.setdefault(member.right.name, member.right) != member.right:
                raise TaskGraphError(
                    f"task graph {self.graph.name} has two sets called {member.right.name!r}; rename one"
                )
        given = {values.name: values for values in self.world.sets}
        return {name: values for name, values in named.items() if given.get(name) != values}

    def values(self, values: ValueSet) -> yaml.Node:
        """Return a set's values, by a state variable's labels if one has them all."""
        for variable in self.world.variables:
            if all(value in variable for value in values.values):
                labels = [variable.label(value) for value in variable.values if value in values.values]
                return _values(variable.name, _sequence(labels))
        return _values(None, _sequence(sorted(map(_literal_text, values.values))))

    def domain(self, domain: Variable) -> yaml.Node:
        """Return a parameter's values, as shortly as they can be said."""
        for variable in self.world.variables:
            if (variable.values, variable.labels) == (domain.values, domain.labels):
                return _scalar(variable.name)
        holders = [v for v in self.world.variables if all(value in v for value in domain.values)]
        for variable in holders:
            if tuple(map(variable.label, domain.values)) == domain.labels:
                return _values(variable.name, _sequence(domain.labels))
        marks = self.world.marks
        if holders and [marks.get(label) for label in domain.labels] == list(domain.values):
            return _values(holders[0].name, _sequence(domain.labels))
        if holders:
            return _values(holders[0].name, _labelled(domain, map(holders[0].label, domain.values)))
        if tuple(map(str, domain.values)) == domain.labels:
            return _values(None, _sequence(map(_literal_text, domain.values)))
        return _values(None, _labelled(domain, map(_literal_text, domain.values)))

    def task(self, task: Task) -> yaml.Node:
        scope = Scope(self.terms(task))
        predicates = {"until": task.until, "goal": task.goal, "within": task.within, "start": task.start}
        texts = {
            key: _scalar(predicate_text(predicate, scope))
            for key, predicate in predicates.items()
            if key == "until" or predicate != ALWAYS
        }
        params = {param.name: self.domain(param.domain) for param in task.params}
        calls = [self.call(call, scope) for call in task.do]
        plain = all(isinstance(call, yaml.ScalarNode) for call in calls)
        order = {
            "params": _mapping(params, flow=True) if params else None,
            "until": texts["until"],
            "goal": texts.get("goal"),
            "pseudo_reward": None if task.pseudo_reward is None else _number(task.pseudo_reward),
            "within": texts.get("within"),
            "start": texts.get("start"),
            "uses": _sequence(task.uses),
            "do": yaml.SequenceNode(f"{_TAG}seq", calls, flow_style=plain),
        }
        return _mapping({key: node for key, node in order.items() if node is not None})

    def terms(self, task: Task) -> Mapping[str, Var | Param]:
        return {var.name: var for var in self.graph.variables} | {param.name: param for param in task.params}

    def call(self, call: Call, scope: Scope) -> yaml.Node:
        if not call.binding and call.guard == ALWAYS and call.relevant is None:
            return _scalar(call.child)
        child = self.graph.tasks.get(call.child)
        domains = {param.name: param.domain for param in child.params} if child else {}
        try:
            bound = {name: _scalar(side_text(side, domains[name], scope)) for name, side in call.binding}
        except KeyError as error:
            raise TaskGraphError(f"edge to {call.child}: it has no parameter {error}; remove it") from None
        nodes = {call.child: _mapping(bound, flow=True)}
        if call.guard != ALWAYS:
            nodes["when"] = _scalar(predicate_text(call.guard, scope))
        if call.relevant is not None:
            nodes["uses"] = _sequence(call.relevant)
        return _mapping(nodes)


def _members(graph: TaskGraph) -> Iterator[Member]:
    for task in graph.tasks.values():
        for predicate in (task.until, task.goal, task.within, task.start, *(call.guard for call in task.do)):
            yield from _members_of(predicate)


def _members_of(predicate: Predicate) -> Iterator[Member]:
    match predicate:
        case Member():
            yield predicate
        case Not():
            yield from _members_of(predicate.inner)
        case Implies():
            yield from _members_of(predicate.premise)
            yield from _members_of(predicate.conclusion)
        case AllOf() | AnyOf():
            for part in predicate.parts:
                yield from _members_of(part)


def _literal_text(value: Hashable) -> str:
    """Return the text that `literal` reads as a value."""
    return value if isinstance(value, str) and literal(value) == value else repr(value)


def _scalar(text: str) -> yaml.ScalarNode:
    # In other quotes, YAML would fold line breaks into blanks.
    return yaml.ScalarNode(f"{_TAG}str", text, style=None if text.isprintable() else '"')


def _number(number: float) -> yaml.ScalarNode:
    if number.is_integer() and abs(number) < 1e15:
        return yaml.ScalarNode(f"{_TAG}int", str(int(number)))
    text = repr(float(number))
    # YAML 1.1, which many tools read, takes 1e-07 for a word.
    return yaml.ScalarNode(f"{_TAG}float", text if "." in text else text.replace("e", ".0e"))


def _sequence(texts: Iterable[str]) -> yaml.SequenceNode:
    return yaml.SequenceNode(f"{_TAG}seq", [_scalar(text) for text in texts], flow_style=True)


def _mapping(nodes: Mapping[str, yaml.Node], *, flow: bool = False) -> yaml.MappingNode:
    pairs = [(_scalar(key), node) for key, node in nodes.items()]
    return yaml.MappingNode(f"{_TAG}map", pairs, flow_style=flow)


def _values(of: str | None, values: yaml.Node) -> yaml.MappingNode:
    nodes = {"values": values} if of is None else {"of": _scalar(of), "values": values}
    return _mapping(nodes, flow=True)


def _labelled(domain: Variable, texts: Iterable[str]) -> yaml.MappingNode:
    words: Sequence[tuple[str, str]] = list(zip(domain.labels, texts, strict=True))
    return _mapping({label: _scalar(text) for label, text in words}, flow=True)
