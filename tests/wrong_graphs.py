"""Task graphs on a corridor that are wrong in one way each, with what validation should say of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hierarchy import Call, Constant, Param, TaskGraph, Var
from hierarchy.terms import Equal, Member, ValueSet
from worlds import StateIndex, TransitionModel, Variable

X = Variable("x", (0, 1, 2, 3, 4))
LAMP = Variable("lamp", ("off", "on"))
ENDS = Param.over("to", {"near": 0, "far": 4})
ELSEWHERE = Param.over("to", {"middle": 2})
GHOST = Var(Variable("xx", (0, 1, 2, 3, 4)))
LONGER = Var(Variable("x", (0, 1, 2, 3, 4, 5)))
EVERYWHERE = (0, 1, 2, 3, 4)


@dataclass(frozen=True)
class Wrong:
    """A graph with one fault, and its finding: kind, task or edge, and words of the problem and the mend.

    `starts` are the cells in which an episode may begin, `wall_at` the last one that can be reached.
    """

    make: Callable[[], TaskGraph]
    kind: str
    where: str
    problem: str
    mend: str
    starts: Sequence[int] = EVERYWHERE
    wall_at: int = 4

    @property
    def name(self) -> str:
        """Return the graph's name, by which tests are called."""
        return self.make.__name__.strip("_")

    @property
    def model(self) -> TransitionModel:
        """Return the world that it is wrong in."""
        return corridor(self.starts, self.wall_at)


def corridor(starts: Sequence[int] = EVERYWHERE, wall_at: int = 4) -> TransitionModel:
    """Return a corridor of five cells and a lamp that never changes; East of `wall_at` nobody comes."""
    index = StateIndex((X, LAMP))
    successors = np.empty((index.size, 2), dtype=np.int64)
    begin = np.zeros(index.size, dtype=np.bool_)
    for number, (x, lamp) in enumerate(index):
        assert isinstance(x, int)
        right = x if x == wall_at else min(x + 1, 4)
        successors[number] = [index.number((max(x - 1, 0), lamp)), index.number((right, lamp))]
        begin[number] = x in starts and lamp == "off"
    return TransitionModel(index, ("left", "right"), successors, np.full(successors.shape, -1.0), begin)


def corridor_graph() -> tuple[TaskGraph, Var, Var]:
    """Return an empty task graph on the corridor, and its variables."""
    graph = TaskGraph("corridor", [X, LAMP], ["left", "right"])
    x, lamp = graph.variables
    return graph, x, lamp


def _no_children() -> TaskGraph:
    graph, x, _ = corridor_graph()
    idle = graph.task("Idle", until=x.eq(4), uses=[x], do="")
    graph.task("Root", until=x.eq(4), uses=[x], do=[idle()])
    return graph


def _unknown_parameter_in_until() -> TaskGraph:
    graph, x, _ = corridor_graph()
    other = Param.over("two", {"near": 0, "far": 4})
    go = graph.task("Go", other, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(two=4)])
    return graph


def _unknown_parameter_in_guard() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().when(~x.eq(ENDS))])
    return graph


def _unknown_parameter_bound_to() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(to=ENDS)])
    return graph


def _unknown_parameter_of_a_child() -> TaskGraph:
    graph, x, _ = corridor_graph()
    graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    call = Call("Go", (("to", ENDS.constant(4)), ("too", ENDS.constant(4))))
    graph.task("Root", until=x.eq(4), uses=[x], do=[call])
    return graph


def _parameter_of_an_action() -> TaskGraph:
    graph, x, _ = corridor_graph()
    graph.task("Root", until=x.eq(4), uses=[x], do=[Call("right", (("steps", Constant(2)),))])
    return graph


def _unbound_parameter() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _unbound_parameter_of_the_root() -> TaskGraph:
    graph, x, _ = corridor_graph()
    graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    return graph


def _parameter_bound_to_another_sort() -> TaskGraph:
    graph, x, lamp = corridor_graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x, lamp], do=[go(to=lamp)])
    return graph


def _parameter_bound_to_a_wider_one() -> TaskGraph:
    graph, x, _ = corridor_graph()
    anywhere = Param(Variable("there", X.values))
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    via = graph.task("Via", anywhere, until=x.eq(anywhere), uses=[x], do=[go(to=anywhere), "left"])
    graph.task("Root", until=x.eq(4), uses=[x], do=[via(there=4)])
    return graph


def _parameter_bound_outside_its_domain() -> TaskGraph:
    graph, x, _ = corridor_graph()
    graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[Call("Go", (("to", Constant(7)),))])
    return graph


def _parameter_with_a_namesake() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", ENDS, until=x.eq(ELSEWHERE), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(to=4)])
    return graph


def _parameter_bound_to_a_namesake() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    via = graph.task("Via", ENDS, until=x.eq(ENDS), uses=[x], do=[go(to=ELSEWHERE)])
    graph.task("Root", until=x.eq(4), uses=[x], do=[via(to=4)])
    return graph


def _unknown_variable_in_within() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4), within=~GHOST.eq(1), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _unknown_variable_bound_to() -> TaskGraph:
    graph, x, _ = corridor_graph()
    place = Param(Variable("place", X.values))
    go = graph.task("Go", place, until=x.eq(place), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(place=GHOST)])
    return graph


def _unknown_variable_in_uses() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4), uses=[x, GHOST], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _unknown_variable_of_edge() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().using(GHOST)])
    return graph


def _variable_with_a_namesake() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=LONGER.eq(5), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(), "right"])
    return graph


def _compared_with_a_foreign_value() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=Equal(x, Constant(7)), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _compared_with_foreign_values() -> TaskGraph:
    graph, x, _ = corridor_graph()
    beyond = Member(x, ValueSet("beyond", frozenset({4, 5})))
    go = graph.task("Go", until=x.eq(4), start=~beyond, uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _compared_with_another_sort() -> TaskGraph:
    graph, x, lamp = corridor_graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x, lamp], do=[go().when(x.eq(4).implies(x.eq(lamp)))])
    return graph


def _compared_without_order() -> TaskGraph:
    graph, x, lamp = corridor_graph()
    go = graph.task("Go", until=x.eq(4), goal=x.ge(4) | x.lt(lamp), uses=[x, lamp], do="right")
    graph.task("Root", until=x.eq(4), uses=[x, lamp], do=[go()])
    return graph


def _hidden_variable_in_until() -> TaskGraph:
    graph, x, lamp = corridor_graph()
    go = graph.task("Go", until=x.eq(4) | lamp.eq("on"), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _hidden_variable_of_edge() -> TaskGraph:
    graph, x, lamp = corridor_graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().using(lamp)])
    return graph


def _hidden_variable_bound_to() -> TaskGraph:
    graph, x, lamp = corridor_graph()
    level = Param(Variable("level", LAMP.values))
    go = graph.task("Go", level, until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(level=lamp)])
    return graph


def _unknown_child() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="left rihgt")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _ring() -> TaskGraph:
    graph, x, _ = corridor_graph()
    graph.task("Ping", until=x.eq(4), uses=[x], do=[Call("Ping"), "right"])
    graph.task("Root", until=x.eq(4), uses=[x], do=[Call("Ping")])
    return graph


def _unreachable() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    graph.task("Forgotten", until=x.eq(0), uses=[x], do="left")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _never_runs() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(to=4), go(to=0).when(x.eq(0))])
    return graph


def _root_never_runs() -> TaskGraph:
    graph, x, _ = corridor_graph()
    graph.task("Root", until=x.eq(1), uses=[x], do="left")
    return graph


def _never_starts() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4), start=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(), "right"])
    return graph


def _never_ends() -> TaskGraph:
    graph, x, _ = corridor_graph()
    beyond = graph.task("Beyond", until=x.eq(4), uses=[x], do="left right")
    graph.task("Root", until=x.eq(3), uses=[x], do=[beyond().when(x.eq(0)), "right"])
    return graph


def _no_goal() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4), goal=x.eq(3), pseudo_reward=-9, uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go()])
    return graph


def _stuck() -> TaskGraph:
    graph, x, _ = corridor_graph()
    do = [Call("right").when(x.ne(0)), Call("left").when(x.eq(1))]
    go = graph.task("Go", until=x.eq(4), uses=[x], do=do)
    graph.task("Root", until=x.eq(4), uses=[x], do=[go().when(x.ne(0)), "right"])
    return graph


def _ends_short() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4) | x.eq(0), goal=x.eq(4), uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(), "right"])
    return graph


def _ends_short_behind_its_child() -> TaskGraph:
    """Return a Mid that would end well at 2; but Go, called at 1, runs on to 4, where Mid has ended short."""
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="right")
    mid = graph.task("Mid", until=x.isin([2, 4]), goal=x.eq(2), uses=[x], do=[go().when(x.eq(1)), "right"])
    graph.task("Root", until=x.eq(4), uses=[x], do=[mid().when(x.le(1)), "right"])
    return graph


def _out_of_reach() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(2), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(), "right"])
    return graph


def _fenced() -> TaskGraph:
    graph, x, _ = corridor_graph()
    low = x.isin([0, 1, 2])
    go = graph.task("Go", until=x.eq(4), within=low, uses=[x], do="left right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(), "right"])
    return graph


def _goal_out_of_reach() -> TaskGraph:
    """Return a Go that from 3 on can only end at 4, short of its goal."""
    graph, x, _ = corridor_graph()
    ends = x.isin([2, 4])
    go = graph.task("Go", until=ends, goal=x.eq(2), pseudo_reward=-9, uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[go(), "right"])
    return graph


def _goal_past_by_the_child() -> TaskGraph:
    """Return a Mid that ends at 2 alone, which Go passes on its way from 0 to 4."""
    graph, x, _ = corridor_graph()
    go = graph.task("Go", ENDS, until=x.eq(ENDS), uses=[x], do="left right")
    mid = graph.task("Mid", until=x.eq(2), uses=[x], do=[go(to=4), go(to=0)])
    graph.task("Root", until=x.eq(4), uses=[x], do=[mid().when(x.eq(1)), "right"])
    return graph


def _strays() -> TaskGraph:
    graph, x, _ = corridor_graph()
    go = graph.task("Go", until=x.eq(4), uses=[x], do="left right")
    low = x.isin([0, 1, 2])
    both = graph.task("Low", until=x.eq(2), within=low, uses=[x], do=[go(), "right"])
    graph.task("Root", until=x.eq(4), uses=[x], do=[both().when(low), "right"])
    return graph


def _root_strays() -> TaskGraph:
    graph, x, _ = corridor_graph()
    graph.task("Root", until=x.eq(2), within=x.le(2), uses=[x], do="right")
    return graph


WRONG = (
    Wrong(_no_children, "no children", "Idle", "nothing to do", "do="),
    Wrong(_unknown_parameter_in_until, "unknown parameter", "Go", "until (x = to)", "did you mean 'two'?"),
    Wrong(
        _unknown_parameter_in_guard,
        "unknown parameter",
        "Root -> Go",
        "when (not (x = to)) reads parameter 'to', which Root does not have",
        "known parameters: none",
    ),
    Wrong(
        _unknown_parameter_bound_to,
        "unknown parameter",
        "Root -> Go",
        "'to' is bound to parameter 'to', which Root does not have",
        "known parameters: none",
    ),
    Wrong(
        _unknown_parameter_of_a_child,
        "unknown parameter",
        "Root -> Go",
        "binds 'too', which is no parameter of Go",
        "did you mean 'to'?",
    ),
    Wrong(
        _parameter_of_an_action,
        "unknown parameter",
        "Root -> right",
        "binds 'steps', which is no parameter of right",
        "known parameters: none",
    ),
    Wrong(_unbound_parameter, "unbound parameter", "Root -> Go", "'to' is not bound", "write Go(to=...)"),
    Wrong(
        _unbound_parameter_of_the_root,
        "unbound parameter",
        "Go",
        "parameter 'to' of the root is not bound",
        "add a root without parameters that calls Go(to=...)",
    ),
    Wrong(
        _parameter_bound_to_another_sort,
        "mistyped parameter",
        "Root -> Go",
        "'lamp' takes values that 'to' does not",
        "give 'to' all of off, on",
    ),
    Wrong(
        _parameter_bound_to_a_wider_one,
        "mistyped parameter",
        "Via -> Go",
        "'there' takes values that 'to' does not",
        "give 'to' all of 0, 1, 2, 3, 4",
    ),
    Wrong(
        _parameter_bound_outside_its_domain,
        "mistyped parameter",
        "Root -> Go",
        "7 is not a value of 'to'",
        "bind it to one of near, far",
    ),
    Wrong(
        _parameter_with_a_namesake,
        "mistyped parameter",
        "Go",
        "until (x = to) reads a parameter 'to' of other values than that of Go",
        "the task's own 'to', with the values near, far",
    ),
    Wrong(
        _parameter_bound_to_a_namesake,
        "mistyped parameter",
        "Via -> Go",
        "'to' is bound to a parameter 'to' of other values than that of Via",
        "the task's own 'to', with the values near, far",
    ),
    Wrong(
        _unknown_variable_in_within, "unknown variable", "Go", "within (not (xx = 1))", "did you mean 'x'?"
    ),
    Wrong(
        _unknown_variable_bound_to,
        "unknown variable",
        "Root -> Go",
        "'place' is bound to 'xx'",
        "did you mean 'x'?",
    ),
    Wrong(_unknown_variable_in_uses, "unknown variable", "Go", "it uses 'xx'", "did you mean 'x'?"),
    Wrong(
        _unknown_variable_of_edge, "unknown variable", "Root -> Go", "the edge uses 'xx'", "did you mean 'x'?"
    ),
    Wrong(
        _variable_with_a_namesake,
        "mistyped variable",
        "Go",
        "until (x = 5) reads a 'x' of other values than the world's",
        "use the graph's own 'x', with the values 0, 1, 2, 3, 4",
    ),
    Wrong(
        _compared_with_a_foreign_value,
        "mistyped comparison",
        "Go",
        "until: x = 7, but 7 is not a value of 'x'",
        "compare 'x' with one of 0, 1, 2, 3, 4",
    ),
    Wrong(
        _compared_with_foreign_values,
        "mistyped comparison",
        "Go",
        "start: x in beyond, but not all of these are values of 'x'",
        "compare 'x' with one of 0, 1, 2, 3, 4",
    ),
    Wrong(
        _compared_with_another_sort,
        "mistyped comparison",
        "Root -> Go",
        "when: x = lamp compares terms that share no value",
        "compare 'x' with one of 0, 1, 2, 3, 4",
    ),
    Wrong(
        _compared_without_order,
        "mistyped comparison",
        "Go",
        "goal: x < lamp compares values that have no order",
        "compare 'x' with its own sort of values",
    ),
    Wrong(
        _hidden_variable_in_until,
        "hidden variable",
        "Go",
        "reads 'lamp', which is not among the relevant variables",
        "add 'lamp' to the uses of Go",
    ),
    Wrong(
        _hidden_variable_of_edge,
        "hidden variable",
        "Root -> Go",
        "the edge uses 'lamp', which Root does not",
        "add 'lamp' to the uses of Root",
    ),
    Wrong(
        _hidden_variable_bound_to,
        "hidden variable",
        "Root -> Go",
        "'level' is bound to 'lamp', which is not among the relevant variables",
        "add 'lamp' to the uses of Root",
    ),
    Wrong(_unknown_child, "unknown child", "Go -> rihgt", "'rihgt' is no task", "did you mean 'right'?"),
    Wrong(_ring, "cycle", "Ping", "in a ring, Ping -> Ping", "remove one of its edges"),
    Wrong(_unreachable, "unreachable", "Forgotten", "no path leads to it from the root Root", "call it, or"),
    Wrong(_never_runs, "never runs", "Root -> Go(near)", "the child can never run", "relax the guard (when)"),
    Wrong(
        _root_never_runs,
        "never runs",
        "Root",
        "it has ended (x = 1) wherever an episode may begin",
        "narrow its until",
        starts=(1,),
    ),
    Wrong(
        _never_starts,
        "never starts",
        "Go",
        "its initiation (x = 4) holds nowhere where it runs",
        "relax its start",
    ),
    Wrong(
        _never_ends,
        "never ends",
        "Beyond",
        "its termination (x = 4) never holds",
        "mend its until",
        starts=(0, 1, 2, 3),
        wall_at=3,
    ),
    Wrong(
        _no_goal,
        "no goal",
        "Go",
        "its goal (x = 3) holds at none of its terminations",
        "mend its goal or its until",
    ),
    Wrong(
        _stuck,
        "stuck",
        "Go",
        "in 1 states it runs but no child can, such as x = 0, lamp = off",
        "widen a child's guard (when)",
    ),
    Wrong(
        _ends_short,
        "ends short",
        "Go",
        "without reaching its goal, such as in x = 0, lamp = off",
        "give it a pseudo_reward below",
    ),
    Wrong(
        _ends_short_behind_its_child,
        "ends short",
        "Mid",
        "without reaching its goal, such as in x = 4, lamp = off",
        "give it a pseudo_reward below",
    ),
    Wrong(
        _out_of_reach,
        "out of reach",
        "Go",
        "called in 1 states it cannot end from, such as x = 3, lamp = off (by Root)",
        "call it elsewhere (when)",
    ),
    Wrong(
        _fenced,
        "out of reach",
        "Go",
        "called in 3 states it cannot end from, such as x = 0, lamp = off (by Root)",
        "widen its working space (within)",
    ),
    Wrong(
        _goal_out_of_reach,
        "out of reach",
        "Go",
        "called in 1 states from which it can end, but not at its goal (x = 2), such as x = 3",
        "or mend its goal",
    ),
    Wrong(
        _goal_past_by_the_child,
        "out of reach",
        "Mid",
        "called in 1 states it cannot end from, such as x = 1, lamp = off (by Root)",
        "mend its until",
    ),
    Wrong(
        _strays,
        "strays",
        "Low -> Go",
        "the child can end outside its caller's working space, such as x = 4, lamp = off",
        "widen the working space (within) of Low",
    ),
    Wrong(
        _root_strays,
        "strays",
        "Root",
        "an episode may begin outside its working space, such as in x = 3, lamp = off",
        "widen the working space (within) of Root",
    ),
)
