"""The replanning oracle: exact breadth-first search over the robot and the spheres that it knows of.

Given what the robot knows at one moment (a snapshot: its belief), the search finds the least number of
steps that ends a task, the SET of optimal first actions, and a certificate that a separate check
accepts without searching. Pushing a sphere moves it, so a search state is the robot's cell, whether
the doors are open, and where the spheres are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from hierarchy import GroundGraph, GroundTask
from worlds import ACTIONS, Cell, Layout, MazeState, state_number, step

SearchState = tuple[int, bool, frozenset[int]]
"""Robot's cell, doors open, spheres' cells."""


@dataclass(frozen=True, eq=False)
class Area:
    """What a task may do and where it ends in one episode: by doors shut (0) and open (1), and by cell.

    Parameters
    ----------
    actions
        The primitive actions that the task may take at ``[doors_open][cell]``, in the order of
        `worlds.ACTIONS`; none where it does not run. A task that calls tasks may take every action: its
        plan is the flat optimum of ending it.
    terminal
        Whether the task has ended at ``[doors_open][cell]``.
    """

    actions: tuple[tuple[tuple[int, ...], ...], ...]
    terminal: tuple[tuple[bool, ...], ...]


@dataclass(frozen=True, eq=False)
class Plan:
    """A shortest way to end a task, with the proof that there is none shorter.

    Parameters
    ----------
    actions
        The first plan in the order of `worlds.ACTIONS`.
    first_actions
        The set of optimal first actions: ties count.
    depths
        Steps from the start of every search state nearer than the end: the certificate.
    """

    actions: tuple[int, ...]
    first_actions: frozenset[int]
    depths: dict[SearchState, int]


class Replanner:
    """Answers, for any belief, how a task is ended in the fewest steps.

    Parameters
    ----------
    layout
        The maze.
    grounded
        Its ground graph, whose tasks are asked for by place.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> replanner = Replanner(maze, ground(two_rooms(maze), maze_model(maze)))
    >>> belief = MazeState(robot=32, trigger=49, goal=31, cubes=frozenset({40}))  # a cube south of 4,0
    >>> plan = replanner.plan(replanner.grounded.place("GotoTrigger(T4)"), belief)
    >>> [ACTIONS[a] for a in plan.actions], sorted(ACTIONS[a] for a in plan.first_actions)
    (['East', 'South', 'South'], ['East'])
    """

    def __init__(self, layout: Layout, grounded: GroundGraph) -> None:
        self.layout = layout
        self.grounded = grounded
        self._areas: dict[tuple[int, int, int], Area] = {}

    def area(self, task: int, belief: MazeState) -> Area:
        """Return where a task runs and ends, for the belief's trigger and goal."""
        key = (task, belief.trigger, belief.goal)
        if key not in self._areas:
            self._areas[key] = _area(self.layout, self.grounded, self.grounded.nodes[task], belief)
        return self._areas[key]

    def plan(self, task: int, belief: MazeState) -> Plan | None:
        """Return a shortest plan of primitive actions that ends `task`, or None if there is no way.

        A task whose children are primitive actions takes only those, where their guards and its working
        space allow; a task that calls tasks takes any (see `Area`).
        """
        area = self.area(task, belief)
        start = _search_state(belief)
        depths: dict[SearchState, int] = {start: 0}
        firsts: dict[SearchState, int] = {start: 0}  # bit sets of optimal first actions
        came: dict[SearchState, tuple[SearchState, int]] = {}
        layer = [start]
        ends: list[SearchState] = [start] if area.terminal[start[1]][start[0]] else []
        while layer and not ends:
            following: list[SearchState] = []
            for state in layer:
                for action, after in _moves(self.layout, area, belief, state):
                    bits = firsts[state] or 1 << action
                    if after not in depths:
                        depths[after] = depths[state] + 1
                        firsts[after] = bits
                        came[after] = (state, action)
                        following.append(after)
                        if area.terminal[after[1]][after[0]]:
                            ends.append(after)
                    elif depths[after] == depths[state] + 1:
                        firsts[after] |= bits
            layer = following
        if not ends:
            return None
        length = depths[ends[0]]
        bits = 0
        for end in ends:
            bits |= firsts[end]
        near = {state: depth for state, depth in depths.items() if depth < length}
        first_actions = frozenset(a for a in range(len(ACTIONS)) if bits >> a & 1)
        return Plan(_backtrack(ends[0], came), first_actions, near)


def verify(layout: Layout, area: Area, belief: MazeState, plan: Plan) -> tuple[str, ...]:
    """Check a plan against its certificate without searching; return each fault in words.

    The plan is carried out by `worlds.step` and must end the task at its last action. The depths must be
    0 at the start, rise by at most 1 along every move, and hold no state in which the task has ended:
    then no sequence of moves ends it sooner.
    """
    faults = [*_plan_faults(layout, area, belief, plan)]
    length = len(plan.actions)
    if length and plan.depths.get(_search_state(belief)) != 0:
        faults.append("the start's depth is not 0")
    for near, depth in plan.depths.items():
        if area.terminal[near[1]][near[0]]:
            faults.append(f"the task has ended at depth {depth}, before {length}")
        if depth < length - 1 and any(
            plan.depths.get(after, length) > depth + 1 for _, after in _moves(layout, area, belief, near)
        ):
            faults.append(f"a move from depth {depth} leads further than depth {depth + 1}")
    return tuple(faults)


def _plan_faults(layout: Layout, area: Area, belief: MazeState, plan: Plan) -> Iterator[str]:
    """Carry out a plan by the world's own dynamics and yield what is wrong with it."""
    state = belief
    for action in plan.actions:
        if area.terminal[state.doors_open][state.robot]:
            yield "the plan ends the task before its last action"
        elif action not in area.actions[state.doors_open][state.robot]:
            yield f"the task may not take {ACTIONS[action]} from {layout.cells[state.robot]}"
        state, _ = step(layout, state, action)
    if not area.terminal[state.doors_open][state.robot]:
        yield "the plan does not end the task"


def _backtrack(end: SearchState, came: dict[SearchState, tuple[SearchState, int]]) -> tuple[int, ...]:
    actions = []
    state = end
    while state in came:
        state, action = came[state]
        actions.append(action)
    return tuple(reversed(actions))


def _search_state(belief: MazeState) -> SearchState:
    return belief.robot, belief.doors_open, belief.spheres


def _moves(
    layout: Layout, area: Area, belief: MazeState, state: SearchState
) -> list[tuple[int, SearchState]]:
    """Return the moves out of a search state that the task may make, in order."""
    robot, doors_open, spheres = state
    here = replace(belief, robot=robot, doors_open=doors_open, spheres=spheres)
    moves = []
    for action in area.actions[doors_open][robot]:
        after, _ = step(layout, here, action)
        if after is not here:
            moves.append((action, _search_state(after)))
    return moves


def _area(layout: Layout, grounded: GroundGraph, task: GroundTask, belief: MazeState) -> Area:
    actions: list[list[tuple[int, ...]]] = []
    terminal: list[list[bool]] = []
    for doors_open in (False, True):
        states = [_state_at(layout, grounded, belief, cell, doors_open) for cell in layout.cells]
        actions.append([() if at is None else _actions(grounded, task, at) for at in states])
        terminal.append([at is not None and bool(task.terminal[at]) for at in states])
    return Area(tuple(map(tuple, actions)), tuple(map(tuple, terminal)))


def _state_at(
    layout: Layout, grounded: GroundGraph, belief: MazeState, cell: Cell, doors_open: bool
) -> int | None:
    """Return the number of the state with the robot in a cell, or None if the cell is solid."""
    if cell in layout.solid:
        return None
    here = replace(belief, robot=layout.number(cell), doors_open=doors_open)
    return state_number(layout, grounded.model.index, here)


def _actions(grounded: GroundGraph, task: GroundTask, state: int) -> tuple[int, ...]:
    """Return the primitive actions that a task may take in a state."""
    everything = len(grounded.model.actions)
    if not task.live[state]:
        return ()
    if any(call.child >= everything for call in task.calls):
        return tuple(range(everything))
    return tuple(sorted({call.child for call in task.calls if call.available[state]}))
