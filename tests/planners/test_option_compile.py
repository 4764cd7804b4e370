from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from option_runs import NAMES, allowed, choices, chooses_actions, named, sound_graphs

from hierarchy import Call, GroundGraph, Param, TaskGraph, TaskGraphError, Var, ground
from hierarchy.starts import beginning_where
from planners import stack_problem
from planners.option_critic import options as module
from planners.option_critic.options import NONE, Options, compile_options
from worlds import StateIndex, TransitionModel, UserError, Variable


def _paths(options: Options) -> list[tuple[int, ...]]:
    return [tuple(edge.child for edge in stack) for stack in options.stacks]


def _as_in_the_slow_search(grounded: GroundGraph) -> None:
    """Compare every mask with what call and return would say, state by state."""
    options, nodes = compile_options(grounded), grounded.nodes
    paths = _paths(options)
    assert len(set(paths)) == len(options) == len(options.names)
    for stack, path in zip(options.stacks, paths, strict=True):
        assert [edge.caller for edge in stack] == [grounded.root, *path[:-1]]
    levels = max(map(len, paths))
    assert options.levels == levels
    found: set[tuple[int, ...]] = set()
    for state in range(grounded.model.index.size):
        callers = {grounded.root, *(place for path in paths for place in path[:-1])}
        ways = {caller: choices(grounded, caller, state) for caller in callers}
        found |= ways[grounded.root]
        for k, path in enumerate(paths):
            for level in range(levels):
                called = level < len(path)
                caller = (grounded.root, *path)[level] if called else NONE
                assert options.initiation[state, level, k] == (called and path[level:] in ways[caller])
                ended = called and (not nodes[path[level]].calls or nodes[path[level]].terminal[state])
                assert options.ended[state, level, k] == ended
            assert set(np.flatnonzero(options.actions[state, k]).tolist()) == allowed(grounded, path, state)
    assert found <= set(paths)
    for level in range(levels):
        for i, one in enumerate(paths):
            assert options.shares[level, i].tolist() == [one[:level] == other[:level] for other in paths]


def _tops_and_parts(grounded: GroundGraph) -> None:
    """Check which policy, action and parts belong to which option."""
    options, nodes = compile_options(grounded), grounded.nodes
    for k, path in enumerate(_paths(options)):
        if chooses_actions(grounded, path[-1]):
            assert options.tasks[options.task[k]] == path[-1]
            assert options.action[k] == NONE
        else:
            assert (options.task[k], options.action[k]) == (NONE, path[-1])
        assert options.nodes[k].tolist() == [*path, *[NONE] * (options.levels - len(path))]
        wanted = {f"V {nodes[path[-1]].name}": None}
        for a, b in pairwise((grounded.root, *path)):
            relevant = [set(call.relevant) for call in nodes[a].calls if call.child == b]
            wanted[f"C {nodes[a].name} {nodes[b].name}"] = set().union(*relevant)
        parts = [part for i, part in enumerate(options.parts) if options.made_of[k, i]]
        assert {part.name for part in parts} == set(wanted)
        for part in parts:
            assert wanted[part.name] in (None, set(part.uses))


@settings(max_examples=30, deadline=None)
@given(sound_graphs())
def test_masks_are_those_of_call_and_return(grounded: GroundGraph) -> None:
    """Initiation, ended, shares and actions at every level, in random graphs of up to five levels."""
    _as_in_the_slow_search(grounded)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "two_rooms"])
def test_masks_of_known_graphs(name: str) -> None:
    """The same on graphs of two levels, some with working spaces."""
    _as_in_the_slow_search(named(name))


@settings(max_examples=30, deadline=None)
@given(sound_graphs())
def test_options_know_what_they_are_made_of(grounded: GroundGraph) -> None:
    """Tops, actions, nodes by level, and the names and variables of the parts of values."""
    _tops_and_parts(grounded)


def test_the_parts_of_taxi() -> None:
    """Navigate goes by the taxi alone, Pickup by when it fails, completions by what their edges say."""
    options = compile_options(named("taxi"))
    uses = {part.name: part.uses for part in options.parts}
    assert uses["V Navigate(R)"] == ("taxi",)
    assert uses["V Pickup"] == ("taxi", "passenger")
    assert uses["V Putdown"] == ("taxi", "passenger", "destination")
    assert uses["C Get Navigate(R)"] == ("passenger",)
    assert sorted(options.names)[:3] == ["Get > Navigate(B)", "Get > Navigate(G)", "Get > Navigate(R)"]


@settings(max_examples=30, deadline=None)
@given(sound_graphs())
def test_stacks_are_those_of_the_exact_planner(grounded: GroundGraph) -> None:
    """The stacks of `stack_problem` are the options' and their beginnings; what may be chosen is the same."""
    options, problem = compile_options(grounded), stack_problem(grounded)
    size, number = grounded.model.index.size, {stack: i for i, stack in enumerate(problem.stacks)}
    begun = {(grounded.root,)}
    for k, path in enumerate(_paths(options)):
        whole = (grounded.root, *path)
        begun |= {whole[:n] for n in range(1, len(whole) + 1) if grounded.nodes[whole[n - 1]].calls}
        may = np.ones(size, dtype=np.bool_)
        for level in reversed(range(len(path))):
            caller = whole[: level + 1]
            rows = slice(number[caller] * size, (number[caller] + 1) * size)
            calls = enumerate(grounded.nodes[caller[-1]].calls)
            may &= np.any([problem.choices[i][0][rows] for i, c in calls if c.child == path[level]], axis=0)
            assert (options.initiation[:, level, k] == may).all()
    assert begun == set(problem.stacks)


def _corridor(**changes: object) -> tuple[TaskGraph, TransitionModel]:
    """Return a flat graph of two actions in a corridor of four cells."""
    index = StateIndex((Variable("x", (0, 1, 2, 3)),))
    after = np.array([[max(x - 1, 0), min(x + 1, 3)] for x in range(4)])
    model = TransitionModel(index, ("left", "right"), after, np.full(after.shape, -1.0), np.arange(4) < 2)
    graph = TaskGraph("corridor", index.variables, model.actions)
    (x,) = graph.variables
    graph.task("Root", **{"until": x.eq(3), "uses": [x], "do": "left right", **changes})  # type: ignore[arg-type]
    return graph, model


def test_a_flat_graph_has_an_option_an_action() -> None:
    """A root that calls actions alone: each is an option that ends after its step."""
    options = compile_options(ground(*_corridor()))
    assert options.names == ("left", "right")
    assert options.tasks == ()
    assert options.task_uses == ()
    assert options.ended.all()
    assert options.initiation[:, 0].tolist() == [[True, True]] * 3 + [[False, False]]
    assert options.actions.tolist() == [[[True, False], [False, True]]] * 4


def test_what_check_refuses_is_refused() -> None:
    """The findings of `hierarchy.check` are the user's to mend."""
    (x,) = (Var(Variable("x", (0, 1, 2, 3))),)
    grounded = ground(*_corridor(until=x.eq(0) & x.eq(3)))
    with pytest.raises(TaskGraphError, match="Root: ") as refused:
        compile_options(grounded)
    assert isinstance(refused.value, UserError)


def test_masks_too_large_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message says how large they would be and what to do; what just fits is compiled."""
    grounded = ground(*_corridor())
    needed = 4 * 2 * (3 * 1 + 2)
    monkeypatch.setattr(module, "_MOST", needed)
    compile_options(grounded)
    monkeypatch.setattr(module, "_MOST", needed - 1)
    with pytest.raises(UserError, match=r"corridor: 2 options in 4 states need .* take a smaller world"):
        compile_options(grounded)


def test_values_go_by_completions_and_rewards() -> None:
    """Of a task by what any of its completions use and its actions cost, in the order of the variables."""
    x, wind, mark = Variable("x", (0, 1, 2, 3)), Variable("wind", (0, 1)), Variable("mark", (0, 3))
    index = StateIndex((x, wind, mark))
    moves = [[(max(at - 1, 0), w, m), (min(at + 1, 3), w, m)] for at, w, m in index]
    after = np.array([[index.number(to) for to in row] for row in moves])
    rewards = np.array([[-1.0, -1.0 - w] for _, w, _ in index])
    starts = np.array([at == 0 for at, _, _ in index])
    model = TransitionModel(index, ("left", "right"), after, rewards, starts)
    graph, to = TaskGraph("windy", index.variables, model.actions), Param(Variable("to", (0, 3)))
    at, blows, there = graph.variables
    do = [Call("left").using(at), Call("right").using()]
    go = graph.task("Go", to, until=at.eq(to), uses=[at], do=do)
    calls = [go(to=there), "left", "right"]
    graph.task("Root", until=at.eq(3), uses=[at, blows, there], do=calls)
    options = compile_options(ground(graph, model))
    assert options.names == ("Go(0)", "Go(3)", "left", "right")
    uses = {part.name: part.uses for part in options.parts}
    assert (uses["V Go(3)"], uses["V left"], uses["V right"]) == (("x", "wind"), (), ("wind",))


def test_fewer_starts_leave_the_options_as_they_are() -> None:
    """With one trigger and one goal the other tasks can never run, which is no fault of the graph's."""
    whole = named("two_rooms")
    part = beginning_where(whole, "trigger = T1 and goal = G2")
    assert part.model.starts.sum() == 31
    assert compile_options(part).names == compile_options(whole).names
