"""Random task graphs that are sound by construction, their worlds, and a slow search through both."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from hierarchy import ALWAYS, Call, Constant, GroundGraph, Param, Predicate, Task, TaskGraph, ValueSet, Var
from worlds import StateIndex, TransitionModel, Variable

Place = tuple[int, int]
Mask = NDArray[np.bool_]
MOVES = {"North": (-1, 0), "South": (1, 0), "West": (0, -1), "East": (0, 1)}
ACTIONS = (*MOVES, "Press")
QUITTING = -50.0
"""A pseudo-reward below what any way costs."""


@dataclass(frozen=True)
class Grid:
    """A connected patch of a grid with inner walls, a lamp that Press switches, and a mark that stays.

    Parameters
    ----------
    model
        Its transition model; variables cell, lamp and mark.
    beside
        The cells that a move leads to from each cell, if nothing goes wrong.
    drifts
        Whether a move may lead another way than it is meant.
    """

    model: TransitionModel
    beside: dict[Place, frozenset[Place]]
    drifts: bool

    @property
    def cells(self) -> tuple[Place, ...]:
        """Return the cells, in order."""
        return tuple(self.beside)

    def leading(self, to: Place, past: frozenset[Place]) -> frozenset[Place]:
        """Return the cells but `to` from which moves lead there, and never before that into `past`."""
        found = {to}
        while more := {c for c in set(self.cells) - found - past if self.beside[c] & found}:
            found |= more
        return frozenset(found - {to})


@st.composite
def grids(draw: st.DrawFn) -> Grid:
    """Draw a grid of two to eight cells, maybe with rings, in which moves are sure, or fail, or drift.

    A move that fails stays; one that drifts goes a quarter turn to the right. Press may fail.
    """
    cells: list[Place] = [(0, 0), (0, 1)]
    doors = {frozenset(cells)}
    for _ in range(draw(st.integers(0, 6))):
        row, col = draw(st.sampled_from(cells))
        down, right = draw(st.sampled_from(list(MOVES.values())))
        to = (row + down, col + right)
        if to not in cells or draw(st.booleans()):  # neighbours that no move joined have a wall between them
            doors.add(frozenset([(row, col), to]))
        cells = list(dict.fromkeys([*cells, to]))
    slip = draw(st.sampled_from(["none", "fails", "drifts"]))
    marks = draw(st.lists(st.sampled_from(cells), min_size=1, max_size=2, unique=True))
    index = StateIndex(
        (Variable("cell", tuple(cells)), Variable("lamp", ("off", "on")), Variable("mark", tuple(marks)))
    )

    def ahead(cell: Place, move: int) -> Place:
        down, right = list(MOVES.values())[move]
        to = (cell[0] + down, cell[1] + right)
        return to if frozenset([cell, to]) in doors else cell

    turned = [3, 2, 0, 1]  # right of North is East, and so on
    outcomes = np.empty((index.size, len(ACTIONS), 2), dtype=np.int64)
    starts = np.zeros(index.size, dtype=np.bool_)
    first = draw(st.sets(st.sampled_from(cells), min_size=1))
    for number, (cell, lamp, mark) in enumerate(index):
        assert isinstance(cell, tuple)
        for move in range(len(MOVES)):
            other = cell if slip == "fails" else ahead(cell, turned[move])
            pair = (ahead(cell, move), other)
            outcomes[number, move] = [index.number((to, lamp, mark)) for to in pair]
        switched = index.number((cell, "off" if lamp == "on" else "on", mark))
        outcomes[number, -1] = [switched, number]
        starts[number] = cell in first
    chance = 0.0 if slip == "none" else draw(st.sampled_from([0.1, 0.25]))
    chances = np.tile([1 - chance, chance], (index.size, len(ACTIONS), 1))
    if not draw(st.booleans()):
        chances[:, -1] = [1, 0]
    rewards = np.full(outcomes.shape, -1.0)
    model = TransitionModel(index, ACTIONS, outcomes, rewards, starts, probabilities=chances)
    beside = {cell: frozenset(ahead(cell, move) for move in range(len(MOVES))) - {cell} for cell in cells}
    return Grid(model, beside, slip == "drifts")


@st.composite
def graphs(draw: st.DrawFn, grid: Grid) -> TaskGraph:
    """Draw a graph in which every task reaches its goal from wherever it is called, and none is left out.

    Light; Goto(to); Inside(to), which works in a part of the grid, or ends where it leaves; Choosy, whose
    goals are some of its ends, and which starts only where it can come to them; Via(to) -> Goto(to), Light;
    Roam -> Inside(to), Light, works in the same part; up to two tasks that call any that come before them;
    Root, which calls all.
    """
    builder = _Builder(draw, grid)
    builder.movers()
    builder.choosy()
    builder.inside()
    for number in range(draw(st.integers(0, 2))):
        builder.mid(f"Mid{number}")
    builder.root()
    return builder.graph


class _Builder:
    """Adds tasks that are sound to a graph."""

    def __init__(self, draw: st.DrawFn, grid: Grid) -> None:
        self.draw = draw
        self.grid = grid
        self.graph = TaskGraph("random", grid.model.index.variables, ACTIONS)
        self.index = self.graph.index
        self.cell, self.lamp, self.mark = self.graph.variables
        self.to = Param(Variable("to", grid.cells))
        self.targets = grid.cells
        """What Inside(to) may be bound to."""

    def moves(self) -> list[str]:
        """Draw an order of the moves."""
        return self.draw(st.permutations(list(MOVES)))

    def movers(self) -> None:
        """Add Light, Goto and Via."""
        cell, lamp, to = self.cell, self.lamp, self.to
        light = self.graph.task("Light", until=lamp.eq("on"), uses=[lamp], do="Press")
        goto = self.graph.task("Goto", to, until=cell.eq(to), uses=[cell], do=self.moves())
        both = self.draw(st.permutations([goto(to=to), light()]))
        self.graph.task("Via", to, until=cell.eq(to), uses=[cell, lamp], do=both)

    def choosy(self) -> None:
        """Add a task with a goal among its ends, which starts only where some way leads to it."""
        goal = self.draw(st.sampled_from(self.grid.cells))
        others = self.draw(st.frozensets(st.sampled_from(self.grid.cells), max_size=2)) - {goal}
        near = self.grid.leading(goal, past=others)
        if not near:  # every way to the goal leads past the others
            others, near = frozenset(), self.grid.leading(goal, past=frozenset())
        self.graph.task(
            "Choosy",
            until=self.cell.isin({goal} | others),
            goal=self.cell.eq(goal),
            start=self.cell.isin(near),
            pseudo_reward=QUITTING,
            uses=[self.cell],
            do=self.moves(),
        )

    def inside(self) -> None:
        """Add Inside(to), which works in a connected part of the grid, and Roam in the same part."""
        draw, cell, lamp, mark = self.draw, self.cell, self.lamp, self.mark
        part = self.part()
        there, space = cell.eq(self.to), cell.isin(ValueSet("part", part))
        if self.grid.drifts:  # beside a border no move would surely stay
            self.graph.task(
                "Inside",
                self.to,
                until=there | ~space,
                goal=there,
                pseudo_reward=QUITTING,
                uses=[cell],
                do=self.moves(),
            )
            return
        inside = self.graph.task("Inside", self.to, until=there, within=space, uses=[cell], do=self.moves())
        one = min(part)
        until = draw(st.sampled_from([cell.eq(one), lamp.eq("on") & cell.eq(one), cell.le(one)]))
        live = space.mask(self.index) & ~until.mask(self.index)
        stays = self.grid.model.must_reach(space.mask(self.index))
        calls = [call for call in (*self.calls(inside), Call("Light")) if self.meet(call, live)]
        actions = [Call(action) for k, action in enumerate(ACTIONS) if (live & stays[:, k]).any()]
        do = draw(st.permutations([*calls, *actions]))
        self.graph.task("Roam", until=until, within=space, uses=[cell, lamp, mark], do=do)

    def part(self) -> frozenset[Place]:
        """Draw a connected part of the grid and note what targets there let every move be made in it."""
        draw, beside = self.draw, self.grid.beside
        part = {draw(st.sampled_from(self.grid.cells))}
        while len(part) < 2 or (len(part) < len(self.grid.cells) and draw(st.booleans())):
            part.add(draw(st.sampled_from(sorted({b for c in part for b in beside[c]} - part))))
        inside = self.cell.isin(part).mask(self.index)
        stays = self.grid.model.must_reach(inside)[:, : len(MOVES)] & inside[:, None]
        elsewhere = {to: ~self.cell.eq(to).mask(self.index) for to in part}
        targets = [to for to in sorted(part) if self.grid.drifts or stays[elsewhere[to]].any(axis=0).all()]
        if not targets:
            return frozenset(self.grid.cells)
        self.targets = tuple(targets)
        return frozenset(part)

    def mid(self, name: str) -> None:
        """Add a task that calls some of those before it."""
        cell, lamp, mark = self.cell, self.lamp, self.mark
        until = self.draw(ends(self.graph))
        live = ~until.mask(self.index)
        starts = [ALWAYS, lamp.eq("off"), lamp.eq("off").implies(cell.ge(mark))]
        dark = live & lamp.eq("off").mask(self.index)  # where the root always runs
        start = self.draw(st.sampled_from([p for p in starts if (p.mask(self.index) & dark).any()]))
        children = self.draw(st.lists(st.sampled_from(list(self.graph.tasks.values())), max_size=3))
        do = self.children(children, live)
        self.graph.task(name, until=until, start=start, uses=[cell, lamp, mark], do=do)

    def root(self) -> None:
        """Add the root, which calls all tasks."""
        there = self.draw(st.sampled_from([self.cell.eq(self.mark), self.cell.eq(self.grid.cells[-1])]))
        until = there & self.lamp.eq("on")
        do = self.children(list(self.graph.tasks.values()), ~until.mask(self.index))
        self.graph.task("Root", until=until, uses=self.graph.variables, do=do)

    def children(self, tasks: list[Task], live: Mask) -> list[Call | str]:
        """Draw a call of each of some tasks that can be called, and every primitive action, in any order."""
        options = [[call for call in self.calls(task) if self.meet(call, live)] for task in tasks]
        calls = [self.guarded(self.draw(st.sampled_from(some)), live) for some in options if some]
        return self.draw(st.permutations([*calls, *ACTIONS]))

    def calls(self, task: Task) -> list[Call]:
        """Return the calls of a task that bind its parameter to what it can come to."""
        if not task.params:
            return [task()]
        targets = self.targets if task.name == "Inside" else self.grid.cells
        bound = [task(to=place) for place in targets]
        return [*bound, task(to=self.mark)] if set(self.mark.domain.values) <= set(targets) else bound

    def guarded(self, call: Call, live: Mask) -> Call:
        """Draw a guard for a call, which holds somewhere where both run."""
        cell, lamp, mark = self.cell, self.lamp, self.mark
        both = live & initiation(self.graph, call)
        place, light, at = self.index.state(int(self.draw(st.sampled_from(np.flatnonzero(both).tolist()))))
        other = self.draw(st.sampled_from(self.grid.cells))
        guards = [
            ALWAYS,
            cell.isin({place, other}),
            lamp.eq(light),
            mark.eq(at),
            cell.le(place) | lamp.ne(light),
            mark.eq(at).implies(lamp.eq(light)),
        ]
        options = [call if guard == ALWAYS else call.when(guard) for guard in guards]
        return self.draw(st.sampled_from([option for option in options if self.meet(option, live)]))

    def meet(self, call: Call, live: Mask) -> bool:
        """Return whether a call can be made where its caller runs, for each value of a variable it binds.

        Such a call is grounded once for each value, and each of these must be made somewhere.
        """
        both = live & call.guard.mask(self.index) & initiation(self.graph, call)
        groups = np.zeros(self.index.size, dtype=np.int64)
        for _, bound in call.binding:
            if isinstance(bound, Var):
                groups = self.index.column(bound.name)
        return all(both[groups == group].any() for group in np.unique(groups))


@st.composite
def ends(draw: st.DrawFn, graph: TaskGraph) -> Predicate:
    """Draw a termination that holds somewhere whatever the mark, and fails somewhere with the lamp off."""
    cell, lamp, mark = graph.variables
    cells = cell.domain.values
    some = draw(st.lists(st.sampled_from(cells), min_size=1, max_size=len(cells) - 1, unique=True))
    light = lamp.eq(draw(st.sampled_from(["off", "on"])))
    options: list[Predicate] = [
        cell.isin(some),
        cell.isin(some) & light,
        cell.eq(mark),
        cell.ne(mark) & light,
        cell.gt((0, 0)) | cell.lt((0, 0)),
        cell.lt((0, 1)) & light,
        cell.ge((0, 1)) & light,
        lamp.eq("off").implies(cell.isin(some)),
        cell.eq(mark).implies(lamp.eq("on")),
    ]
    return draw(st.sampled_from(options))


def initiation(graph: TaskGraph, call: Call) -> Mask:
    """Return where a child may be called, whatever its caller and guard, state by state, shape (states,)."""
    task, index = graph.tasks[call.child], graph.index
    found = np.zeros(index.size, dtype=np.bool_)
    for number, state in enumerate(index):
        values: dict[str, Hashable] = dict(zip(index.names, state, strict=True))
        for name, bound in call.binding:
            values[name] = bound.value if isinstance(bound, Constant) else values[bound.name]
        runs = task.within.holds(values) and not task.until.holds(values)
        found[number] = runs and task.start.holds(values)
    return found


def ways_to_end(grounded: GroundGraph, place: int, state: int) -> tuple[set[int], set[int]]:
    """Return the states in which a task may decide, and in which it may end, called in one state.

    The slow way: every stack of running tasks is followed by itself, through whatever may be done next. A
    child that has ended gives way to its caller, which goes on if it runs there; nobody goes on elsewhere.
    """
    nodes, model = grounded.nodes, grounded.model
    decided: set[int] = set()
    ended: set[int] = set()
    first: tuple[tuple[int, ...], int] = ((place,), state)
    waiting, seen = [first], {first}
    while waiting:
        stack, at = waiting.pop()
        node = nodes[stack[-1]]
        after: list[tuple[tuple[int, ...], int]] = []
        if not node.calls:  # a primitive action: back to its caller, whatever its outcome
            for chance, to in zip(
                model.probabilities[at, stack[-1]], model.outcomes[at, stack[-1]], strict=True
            ):
                if chance > 0:
                    after.append((stack[:-1], int(to)))
        elif node.terminal[at]:
            if len(stack) == 1:
                ended.add(at)
            else:
                after.append((stack[:-1], at))
        elif node.live[at]:
            if len(stack) == 1:
                decided.add(at)
            after = [((*stack, call.child), at) for call in node.calls if call.available[at]]
        new = set(after) - seen
        seen |= new
        waiting += new
    return decided, ended


def _outcomes(model: TransitionModel, state: int, action: int) -> list[int]:
    """Return the states that may follow."""
    occurs = model.probabilities[state, action] > 0
    return [int(after) for after in model.outcomes[state, action][occurs]]
