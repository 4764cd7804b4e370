"""The critic's values as values of tasks: held to exact dynamic programming over task stacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from hierarchy import GroundGraph, checked, ground, two_rooms
from hierarchy.taxi import taxi_graph
from planners import LocalRule, StackSolution, hierarchical_optimum
from planners.option_critic.options import Options, compile_options
from planners.option_critic.values import OptionValues
from worlds import ACTIONS, Cell, MazeState, load_layout, maze_model
from worlds.taxi import taxi_model

GAMMA = 0.98
MAZE = load_layout("two_rooms")


def paper() -> GroundGraph:
    """Return the paper's graph."""
    return checked(two_rooms(MAZE), maze_model(MAZE))


def taxi() -> GroundGraph:
    """Return Dietterich's."""
    model = taxi_model()
    return ground(taxi_graph(model), model)


def exact(grounded: GroundGraph) -> tuple[Options, StackSolution, OptionValues]:
    """Return options, the discounted optimum over stacks, and values whose critic is that optimum."""
    options, best = compile_options(grounded), hierarchical_optimum(grounded, GAMMA)
    number = {stack: place for place, stack in enumerate(best.problem.stacks)}
    primitives, model = len(grounded.model.actions), grounded.model
    columns = []
    for stack in options.stacks:
        places = (grounded.root, *(edge.child for edge in stack))
        if places[-1] >= primitives:
            columns.append(best.value[number[places]])
            continue
        # After an action its caller goes on, unless it has ended, and so on down to the root.
        after = np.where(grounded.nodes[grounded.root].terminal, 0.0, best.value[0])
        for depth in range(2, len(places)):
            running = ~grounded.nodes[places[depth - 1]].terminal
            for outer in places[1 : depth - 1]:
                running &= ~grounded.nodes[outer].terminal
            after = np.where(running, best.value[number[places[:depth]]], after)
        action = places[-1]
        ahead = after[model.outcomes[:, action]]
        gain = model.outcome_rewards[:, action] + GAMMA * ahead
        columns.append((model.probabilities[:, action] * gain).sum(axis=1))
    table = torch.as_tensor(np.where(np.isfinite(columns), columns, -1e6).T)
    return options, best, OptionValues(options, lambda state: table[state], GAMMA, tie=1e-6)


@pytest.mark.parametrize("graph", [paper, taxi])
def test_the_best_child_is_worth_what_the_task_is(graph: object) -> None:
    """With an exact critic, values obey Bellman's equation at the root and in tasks that call actions."""
    assert callable(graph)
    grounded = graph()
    options, best, values = exact(grounded)
    reachable = grounded.model.reachable() & ~grounded.nodes[grounded.root].terminal
    number = {stack: place for place, stack in enumerate(best.problem.stacks)}
    for state in np.flatnonzero(reachable)[::7].tolist():
        choices = values.choices(grounded.root, state)
        top = max(values.q(grounded.root, state, k) for k in choices)
        assert top == pytest.approx(best.value[0, state], abs=1e-4)
    checks = 0
    for option, stack in enumerate(options.stacks):
        task = stack[-1].child
        if options.task[option] < 0:
            continue
        places = (grounded.root, *(edge.child for edge in stack))
        for state in np.flatnonzero(options.initiation[:, 0, option] & reachable)[::5].tolist():
            top = max(values.q(task, state, k) for k in values.choices(task, state))
            assert top == pytest.approx(best.value[number[places], state], abs=1e-4)
            checks += 1
    assert checks > 50


@pytest.mark.parametrize(
    ("task", "robot", "kind", "obstacle", "action"),
    [
        ("GotoTrigger(T4)", (4, 0), "cubes", (5, 0), "East"),  # C1
        ("GotoGoal(G2)", (4, 4), "cubes", (3, 4), "East"),  # C3
        ("GotoTrigger(T4)", (1, 0), "spheres", (3, 0), "South"),  # S1
        ("GotoGoal(G2)", (5, 4), "spheres", (4, 4), "North"),  # S2
    ],
)
def test_the_papers_table_4_follows_from_exact_values(
    task: str, robot: tuple[int, int], kind: str, obstacle: tuple[int, int], action: str
) -> None:
    """Cubes are passed and spheres pushed, on the way to T4 and on to G2."""
    grounded = paper()
    _, _, values = exact(grounded)
    at, cell = (MAZE.number(Cell(*place)) for place in (robot, obstacle))
    marks = MAZE.number(MAZE.triggers["T4"]), MAZE.number(MAZE.goals["G2"])
    state = MazeState(at, *marks, doors_open=task.startswith("GotoGoal"))
    found = LocalRule(MAZE, values).affordance(
        grounded.place(task), cell, replace(state, **{kind: frozenset({cell})})
    )
    assert found.on_route
    assert found.action == ACTIONS.index(action)


def test_what_no_option_does_is_worth_nothing_good() -> None:
    """A child that cannot be called from a task in a state has the value minus infinity."""
    grounded = paper()
    _, _, values = exact(grounded)
    opened = grounded.model.index.column("doors") == 1
    state = int(np.flatnonzero(opened & grounded.model.reachable())[0])
    trigger = next(
        k
        for k, call in enumerate(grounded.nodes[grounded.root].calls)
        if grounded.nodes[call.child].task == "GotoTrigger"
    )
    assert values.q(grounded.root, state, trigger) == -np.inf
