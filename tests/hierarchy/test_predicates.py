from collections.abc import Hashable, Mapping

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy import ALWAYS, Constant, Param, Predicate, Term, ValueSet, Var
from worlds import StateIndex, Variable

X = Var(Variable("x", (0, 1, 2), ("nil", "one", "two")))
Y = Var(Variable("y", (2, 1)))
DOORS = Var(Variable("doors", ("closed", "open")))
INDEX = StateIndex((X.variable, Y.variable, DOORS.variable))
TO = Param.over("to", {"home": 0, "away": 2})
WORD = Param.over("word", {"shut": "closed", "ajar": "open"})
TERMS: tuple[Term, ...] = (X, Y, DOORS, TO, WORD)
VALUES: tuple[Hashable, ...] = (0, 1, 2, "closed", "open")


def _states() -> list[dict[str, Hashable]]:
    return [dict(zip(INDEX.names, state, strict=True)) for state in INDEX]


@st.composite
def _atoms(draw: st.DrawFn, terms: tuple[Term, ...]) -> Predicate:
    left = draw(st.sampled_from(terms))
    match draw(st.sampled_from(["value", "term", "set"])):
        case "value":
            return left.eq(draw(st.sampled_from(left.domain.values)))
        case "term":
            return left.eq(draw(st.sampled_from(terms)))
        case _:
            return left.isin(draw(st.frozensets(st.sampled_from(left.domain.values))))


def _predicates(terms: tuple[Term, ...]) -> st.SearchStrategy[Predicate]:
    return st.recursive(
        st.one_of(st.just(ALWAYS), _atoms(terms)),
        lambda inner: st.one_of(
            st.builds(lambda a, b: a & b, inner, inner),
            st.builds(lambda a, b: a | b, inner, inner),
            st.builds(lambda a: ~a, inner),
        ),
        max_leaves=8,
    )


def _values(binding: Mapping[str, Constant]) -> dict[str, Hashable]:
    return {name: constant.value for name, constant in binding.items()}


BINDINGS = st.fixed_dictionaries(
    {
        "to": st.sampled_from([TO.constant(value) for value in TO.domain.values]),
        "word": st.sampled_from([WORD.constant(value) for value in WORD.domain.values]),
    }
)


@pytest.mark.parametrize(
    ("predicate", "text"),
    [
        (X.eq(1), "x = one"),
        (X.eq(Y), "x = y"),
        (X.eq(TO), "x = to"),
        (X.isin([2, 0]), "x in {nil, two}"),
        (X.isin(ValueSet("ends", frozenset({0, 2}))), "x in ends"),
        (~X.eq(1), "not (x = one)"),
        (X.eq(1) & DOORS.eq("open") & Y.eq(2), "x = one and doors = open and y = 2"),
        (X.eq(1) | DOORS.eq("open"), "x = one or doors = open"),
        ((X.eq(1) | X.eq(2)) & Y.eq(1), "(x = one or x = two) and y = 1"),
        (~(X.eq(1) & Y.eq(1)), "not (x = one and y = 1)"),
        (ALWAYS, "always"),
        (X.isin([]), "x in {}"),
    ],
)
def test_a_predicate_prints_as_it_is_meant(predicate: Predicate, text: str) -> None:
    """Labels stand for values, and brackets only where connectives mix."""
    assert str(predicate) == text


def test_never_prints_as_such() -> None:
    """What a binding has refuted reads 'never'."""
    assert str(TO.eq(0).bind({"to": TO.constant(2)})) == "never"
    assert str(TO.eq(2).bind({"to": TO.constant(2)})) == "always"


def test_predicates_compare_by_form() -> None:
    """The same form built twice is equal and hashes alike; another value, term or order is not."""
    assert X.eq(1) & Y.eq(2) == X.eq(1) & Y.eq(2)
    assert hash(X.eq(1) & Y.eq(2)) == hash(X.eq(1) & Y.eq(2))
    assert X.isin([0, 2]) == X.isin([2, 0])
    different = [
        X.eq(1),
        X.eq(2),
        Y.eq(1),
        X.eq(Y),
        X.isin([1]),
        ~X.eq(1),
        X.eq(1) | Y.eq(1),
        X.eq(1) & Y.eq(1),
    ]
    assert len(set(different)) == len(different)


def test_conjunctions_and_disjunctions_flatten() -> None:
    """However brackets stand, a chain under one connective is the same predicate."""
    a, b, c = X.eq(0), Y.eq(1), DOORS.eq("open")
    assert (a & b) & c == a & (b & c)
    assert (a | b) | c == a | (b | c)
    assert (a & b) | c != a & (b | c)


def test_a_double_negation_falls_away() -> None:
    """Not of not is the predicate itself."""
    assert ~~X.eq(1) == X.eq(1)
    assert ~~~X.eq(1) == ~X.eq(1)


def test_a_predicate_knows_what_it_reads() -> None:
    """Variables and parameters are told apart, under every connective and on either side."""
    predicate = ~(X.eq(TO) | WORD.eq(DOORS)) & X.isin([1])
    assert predicate.variables() == {"x", "doors"}
    assert predicate.parameters() == {"to", "word"}
    assert ALWAYS.variables() == ALWAYS.parameters() == frozenset()


def test_bind_keeps_the_word_for_a_value() -> None:
    """A bound parameter prints as its label, and a parameter on the left gives way to the variable."""
    binding = {"to": TO.constant(2)}
    assert str(X.eq(TO).bind(binding)) == "x = away"
    assert str(TO.eq(X).bind(binding)) == "x = away"
    assert X.eq(TO).bind({}) == X.eq(TO)


@pytest.mark.parametrize("use", [bool, lambda p: p and p, lambda p: not p])
def test_a_predicate_is_no_truth_value(use: object) -> None:
    """'and', 'or' and 'not' raise in place of dropping half of a predicate."""
    assert callable(use)
    with pytest.raises(TypeError, match=r"combine predicates with &, \| and ~"):
        use(X.eq(1))


@pytest.mark.parametrize("make", [lambda: X.eq(5), lambda: X.isin([0, 5]), lambda: TO.eq(1)])
def test_a_value_outside_the_domain_is_refused(make: object) -> None:
    """The error names the term and its values."""
    assert callable(make)
    with pytest.raises(ValueError, match=r"is not a value of '(x|to)'; its values are (nil|home)"):
        make()


@settings(max_examples=150, deadline=None)
@given(_predicates((X, Y, DOORS)))
def test_the_mask_is_what_holds_in_each_state(predicate: Predicate) -> None:
    """All states at once, or one at a time by name: the same answer."""
    assert predicate.mask(INDEX).tolist() == [predicate.holds(state) for state in _states()]


@settings(max_examples=150, deadline=None)
@given(_predicates(TERMS), BINDINGS)
def test_binding_then_masking_is_holding_with_the_binding(
    predicate: Predicate, binding: dict[str, Constant]
) -> None:
    """A bound predicate reads no parameter, and means what the predicate means under the binding."""
    bound = predicate.bind(binding)
    assert bound.parameters() == frozenset()
    assert bound.variables() <= predicate.variables()
    expected = [predicate.holds({**state, **_values(binding)}) for state in _states()]
    assert bound.mask(INDEX).tolist() == expected


@settings(max_examples=80, deadline=None)
@given(_predicates(TERMS), _predicates(TERMS), BINDINGS)
def test_connectives_are_those_of_sets(a: Predicate, b: Predicate, binding: dict[str, Constant]) -> None:
    """And, or and not of predicates are the meet, join and complement of their masks."""
    here, there = a.bind(binding).mask(INDEX), b.bind(binding).mask(INDEX)
    for joined, expected in ((a & b, here & there), (a | b, here | there), (~a, ~here)):
        assert np.array_equal(joined.bind(binding).mask(INDEX), expected)


@settings(max_examples=50, deadline=None)
@given(_predicates(TERMS), BINDINGS)
def test_parameters_may_be_bound_one_at_a_time(predicate: Predicate, binding: dict[str, Constant]) -> None:
    """Binding in two steps gives the same mask as in one."""
    steps = predicate.bind({"word": binding["word"]}).bind({"to": binding["to"]})
    assert np.array_equal(steps.mask(INDEX), predicate.bind(binding).mask(INDEX))
