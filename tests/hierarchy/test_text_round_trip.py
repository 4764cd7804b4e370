"""Writing a graph or predicate as text and reading it again gives the same; so does the other way round."""

from collections.abc import Hashable
from importlib.resources import files

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hierarchy import (
    ALWAYS,
    Call,
    Constant,
    Param,
    Predicate,
    TaskGraph,
    TaskGraphError,
    Term,
    ValueSet,
    Var,
    two_rooms,
)
from hierarchy.predicates import AllOf, AnyOf, Not
from hierarchy.taxi import taxi_graph
from hierarchy.terms import Ordered
from hierarchy.text import TextWorld, graph_text, load_graph, load_world, maze_world, parse_graph
from hierarchy.text_predicates import parse_predicate
from hierarchy.text_printing import predicate_text
from hierarchy.text_words import Scope
from worlds import StateIndex, TransitionModel, Variable, load_layout
from worlds.taxi import taxi_model

MAZE = load_layout("two_rooms")
SHIPPED = files("hierarchy").joinpath("graphs", "two_rooms.yaml").read_text(encoding="utf-8")
X = Var(Variable("x", (0, 1, 2), ("nil", "one", "two")))
Y = Var(Variable("y", (0, 1, 2, 5)))
AT = Var(Variable("at the (door)", ((0, 1), (2, 3)), ("2,4", "x")))
TO = Param.over("to", {"home, sweet": 0, "not": 2})
ODD = ValueSet("the odd one", frozenset({1}))
TERMS: tuple[Term, ...] = (X, Y, AT, TO)
SCOPE = Scope({term.name: term for term in TERMS}, {ODD.name: ODD})


def _no_model() -> TransitionModel:
    raise AssertionError("text needs no model")


def same(one: TaskGraph, other: TaskGraph) -> bool:
    """Return whether two graphs agree in everything."""
    return (one.name, one.index, one.actions, list(one.tasks.items())) == (
        other.name,
        other.index,
        other.actions,
        list(other.tasks.items()),
    )


@st.composite
def atoms(draw: st.DrawFn, terms: tuple[Term, ...], sets: tuple[ValueSet, ...]) -> Predicate:
    """Draw an equality, an order or a membership."""
    left = draw(st.sampled_from(terms))
    value = draw(st.sampled_from(left.domain.values))
    match draw(st.sampled_from(["value", "term", "set", "named", "order"])):
        case "value":
            return left.eq(value)
        case "term":
            return left.eq(draw(st.sampled_from(terms)))
        case "named":
            fitting = [each for each in sets if all(v in left.domain for v in each.values)]
            return left.isin(draw(st.sampled_from(fitting))) if fitting else left.ne(value)
        case "order" if len({type(each) for each in left.domain.values}) == 1:
            ways = [left.lt(value), left.le(left), left.gt(value), Ordered(">=", left.constant(value), left)]
            beyond = [left.ge(each) for each in (-4, 99, 2.5) if isinstance(value, int)]
            return draw(st.sampled_from(ways + beyond))
        case _:
            return left.isin(draw(st.frozensets(st.sampled_from(left.domain.values))))


def predicates(terms: tuple[Term, ...], sets: tuple[ValueSet, ...] = ()) -> st.SearchStrategy[Predicate]:
    """Draw predicates of any form, those included that only constructors make."""
    return st.recursive(
        st.one_of(st.sampled_from([ALWAYS, AnyOf(())]), atoms(terms, sets)),
        lambda inner: st.one_of(
            st.builds(lambda a, b: a & b, inner, inner),
            st.builds(lambda a, b: a | b, inner, inner),
            st.builds(lambda a, b: a.implies(b), inner, inner),
            st.builds(Not, inner),
            st.builds(lambda parts: AllOf(tuple(parts)), st.lists(inner, max_size=3)),
            st.builds(lambda parts: AnyOf(tuple(parts)), st.lists(inner, max_size=3)),
        ),
        max_leaves=6,
    )


@settings(max_examples=200, deadline=None)
@given(predicates(TERMS, (ODD,)))
def test_a_predicate_is_read_as_it_is_written(predicate: Predicate) -> None:
    """Whatever its form and the words in it; and what is read is written the same."""
    text = predicate_text(predicate, SCOPE)
    assert parse_predicate(text, SCOPE) == predicate
    assert predicate_text(parse_predicate(text, SCOPE), SCOPE) == text


@pytest.mark.parametrize("graph", [two_rooms(MAZE), two_rooms(MAZE, one_door_task=True)])
def test_the_papers_graphs_make_the_round_trip(graph: TaskGraph) -> None:
    """Graph to text to graph, and text to graph to text."""
    text = graph_text(graph, maze_world(MAZE))
    read, world = parse_graph(text)
    assert same(read, graph)
    assert graph_text(read, world) == text


def test_the_shipped_text_is_the_papers_graph() -> None:
    """two_rooms.yaml says what two_rooms declares, and is canonical."""
    read, world = load_graph("two_rooms")
    assert same(read, two_rooms(MAZE))
    assert graph_text(read, world) == SHIPPED


def test_taxi_makes_the_round_trip() -> None:
    """Dietterich's graph is read back from its text, on the world called taxi."""
    graph = taxi_graph(taxi_model())
    assert same(parse_graph(graph_text(graph, load_world("taxi"))).graph, graph)


def test_a_text_prints_its_predicates_alike() -> None:
    """What is read prints as what was declared, labels included."""
    read = load_graph("two_rooms").graph
    for task, declared in zip(read.tasks.values(), two_rooms(MAZE).tasks.values(), strict=True):
        assert [str(p) for p in (task.until, task.within)] == [
            str(p) for p in (declared.until, declared.within)
        ]
        assert [f"{c} {c.guard}" for c in task.do] == [f"{c} {c.guard}" for c in declared.do]


WORDS = st.one_of(
    st.sampled_from(
        ["and", "room A", "2,4", "a,", "no", "1", "`b", '"', "x = y", "# c", "k: v", "{", "\n", "~"]
    ),
    st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=5),
)
VALUES: st.SearchStrategy[Hashable] = st.one_of(
    st.integers(-3, 9),
    st.sampled_from(["p", "3", "True", "'"]),
    st.tuples(st.integers(0, 2), st.integers(0, 2)),
)


@st.composite
def domains(draw: st.DrawFn, name: str) -> Variable:
    """Draw a name's values, with labels of their own or not."""
    sorts = st.sampled_from([st.integers(-3, 9), VALUES])
    values = draw(sorts.flatmap(lambda sort: st.lists(sort, min_size=1, max_size=4, unique=True)))
    labels = draw(st.lists(WORDS, min_size=len(values), max_size=len(values), unique=True))
    own = draw(st.booleans()) or len({str(value) for value in values}) < len(values)
    return Variable(name, tuple(values), tuple(labels) if own else ())


@st.composite
def worlds_and_graphs(draw: st.DrawFn) -> tuple[TextWorld, TaskGraph]:
    """Draw a world with any words in it, and a graph of two tasks on it."""
    names = draw(st.lists(WORDS, min_size=9, max_size=9, unique=True))
    variables = [draw(domains(name)) for name in names[:2]]
    if draw(st.booleans()):
        variables[1] = Variable(names[1], variables[0].values, variables[0].labels)
    # Keys of edges can be no child's names.
    actions = tuple(f"{name}!" for name in names[2:4])
    sets = tuple(
        ValueSet(name, frozenset(draw(st.sets(st.sampled_from(variables[0].values), min_size=1))))
        for name in names[4:6]
    )
    world = TextWorld("any", tuple(variables), actions, _no_model, sets[:1])
    graph = TaskGraph(names[6], variables, actions)
    terms = graph.variables
    domain = draw(st.sampled_from([None, *variables]))
    param = Param(Variable(names[7], domain.values, domain.labels) if domain else draw(domains(names[7])))
    some = predicates((*terms, param), sets)
    child = graph.task(
        f"{names[8]}?",
        param,
        until=draw(some),
        goal=draw(some),
        pseudo_reward=draw(st.none() | st.floats(-1e20, 1e20)),
        within=draw(some),
        start=draw(some),
        uses=draw(st.sets(st.sampled_from(terms)).map(list)),
        do=[Call(action) for action in actions],
    )
    bound = draw(st.sampled_from([*terms, *param.domain.values]))
    own = draw(st.sampled_from([None, (), terms[:1]]))
    call = child(**{param.name: bound}).when(draw(predicates(terms, sets)))
    graph.task(
        f"{names[8]}.",
        until=draw(predicates(terms, sets)),
        uses=terms,
        do=[call if own is None else call.using(*own), Call(actions[0]).when(draw(predicates(terms, sets)))],
    )
    return world, graph


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(worlds_and_graphs())
def test_any_graph_makes_the_round_trip(drawn: tuple[TextWorld, TaskGraph]) -> None:
    """Whatever the words are: keywords, quotes, line breaks, numbers."""
    world, graph = drawn
    text = graph_text(graph, world)
    read = parse_graph(text, world=world).graph
    assert same(read, graph)
    assert graph_text(read, world) == text


def _graph(x: Var, until: Predicate) -> TaskGraph:
    graph = TaskGraph("wrong", [x.variable], ["go"])
    graph.task("Root", until=until, uses=[x], do="go")
    return graph


@pytest.mark.parametrize(
    ("x", "until", "problem"),
    [
        (twins := Var(Variable("x", (1, 2), ("a", "a"))), twins.eq(2), "distinct labels"),
        (X, X.eq(Y), "unknown value 'y' of x"),
        (
            X,
            X.isin(ValueSet("a", frozenset({0}))) & X.isin(ValueSet("a", frozenset({1}))),
            "two sets called 'a'",
        ),
        (X, AllOf((Ordered("<", Constant(1), Constant(2)),)), "has no text"),
    ],
)
def test_what_has_no_text_is_refused(x: Var, until: Predicate, problem: str) -> None:
    """A graph that its text would not say is never written."""
    graph = _graph(x, until)
    world = TextWorld("any", graph.index.variables, graph.actions, _no_model)
    with pytest.raises(TaskGraphError, match=problem):
        graph_text(graph, world)


def test_a_graph_of_another_world_is_refused() -> None:
    """A text is written for the world that the graph was declared on."""
    graph = _graph(X, X.eq(1))
    assert graph.index == StateIndex((X.variable,))
    with pytest.raises(TaskGraphError, match="other variables or actions than the world two_rooms"):
        graph_text(graph, maze_world(MAZE))
