"""A ground graph as options: what may be chosen where, what ends where, and what each goes by.

An option is a stack of calls from the root down to a task that calls nothing but primitive actions, or down
to a primitive action that a caller of tasks also calls. So graphs of any depth become one set of options, and
the running option is the whole task stack. Initiation is guard and not termination, at every level of the
stack; the termination of each level is its task's (Sutton, Precup and Singh, 1999, section 2; for stacks
Dietterich, 2000, section 3.2).

When a task has ended, so have all that it called, though these would run on by themselves (Dietterich, 2000,
table 1). `planners.stack` lets them; the two are one where no task ends before what it has called.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hierarchy import GroundCall, GroundGraph, GroundTask, checked
from worlds import UserError

Mask = NDArray[np.bool_]
NONE: Final = -1
"""Stands for no option: an episode begins."""
_MOST: Final = 4 << 30  # bytes of masks


@dataclass(frozen=True)
class Edge:
    """A call of a caller, both by place: a step down in a task stack."""

    caller: int
    child: int


@dataclass(frozen=True)
class Part:
    """A part of an option's value, and the variables that it goes by.

    The value of a stack is the value of what runs on top, and for each call below it what is still to come
    when the call has ended (Dietterich, 2000, equation 9).

    Parameters
    ----------
    name
        Such as ``V GotoDoor(D1)`` or ``C Root GotoDoor(D1)``.
    uses
        Names of state variables.
    """

    name: str
    uses: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Options:
    """The options of a ground graph.

    Parameters
    ----------
    grounded
        The ground graph.
    names
        Each option's name: its calls below the root, such as ``Get > Navigate(R)``.
    stacks
        Each option's calls, from the root's to the last.
    initiation
        Where calls may be made, shape (states, levels, options): the calls of an option from a level on down.
        At level 0 this is the initiation set.
    ended
        Where the task that an option calls at a level has ended, shape (states, levels, options). A primitive
        action has always ended after its step; levels that an option lacks never end.
    shares
        Whether two options make the same calls above a level, shape (levels, options, options).
    pseudo_reward
        What the policy of the task on top of an option is taught to expect of ending in a state, shape
        (states, options): 0 where it ends well or not at all, and where the graph gives none.
    tasks
        Places of the tasks on top of stacks, those that have a policy over primitive actions.
    task
        For each option its place in `tasks`, `NONE` where it is a primitive action.
    action
        For each option its primitive action, `NONE` where it is a task.
    actions
        Where the task on top of an option may take an action, shape (states, options, actions).
    parts
        What the options' values are made of.
    made_of
        Which part belongs to which option, shape (options, parts).
    nodes
        For each option and level the place of the task called, `NONE` where there is none, shape
        (options, levels).

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> options = compile_options(ground(two_rooms(maze), maze_model(maze)))
    >>> options.names[3:6], options.initiation.shape
    (('GotoTrigger(T4)', 'GotoDoor(D1)', 'GotoDoor(D2)'), (2048, 1, 10))
    >>> print(*(part.name for i, part in enumerate(options.parts) if options.made_of[4, i]), sep=", ")
    V GotoDoor(D1), C Root GotoDoor(D1)
    """

    grounded: GroundGraph
    names: tuple[str, ...]
    stacks: tuple[tuple[Edge, ...], ...]
    initiation: Mask
    ended: Mask
    shares: Mask
    pseudo_reward: NDArray[np.float32]
    tasks: tuple[int, ...]
    task: NDArray[np.int64]
    action: NDArray[np.int64]
    actions: Mask
    parts: tuple[Part, ...]
    made_of: Mask
    nodes: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.names)

    @property
    def levels(self) -> int:
        """The most calls that a stack holds."""
        return len(self.shares)

    @property
    def task_uses(self) -> tuple[tuple[str, ...], ...]:
        """The variables that the policy of each of `tasks` goes by."""
        return tuple(_own_uses(self.grounded, place) for place in self.tasks)


def compile_options(grounded: GroundGraph) -> Options:
    """Return the options of a ground graph, in the order of its calls, depth first.

    The masks, with the copy that `planners.option_critic.transform.OptionTables` makes, take
    ``states * options * (3 * levels + actions)`` bytes: some 140 kB for the paper's maze.

    Raises
    ------
    hierarchy.TaskGraphError
        If the graph does not pass `hierarchy.check`.
    UserError
        If the masks would take more than 4 GB.
    """
    checked(grounded.graph, grounded.model.whole)
    stacks = tuple(_stacks(grounded, grounded.root, ()))
    nodes, primitives = grounded.nodes, len(grounded.model.actions)
    levels, states = max(map(len, stacks)), grounded.model.index.size
    if (size := states * len(stacks) * (3 * levels + primitives)) > _MOST:
        raise UserError(
            f"{grounded.graph.name}: {len(stacks)} options in {states} states need {size / 2**30:.0f} GB of "
            f"masks, and {_MOST >> 30} are possible; take a smaller world or fewer bindings"
        )
    initiation = np.ones((states, levels, len(stacks)), dtype=np.bool_)
    ended = np.zeros_like(initiation)
    called = np.full((len(stacks), levels), NONE, dtype=np.int64)
    for k, stack in enumerate(stacks):
        may = np.ones(states, dtype=np.bool_)
        for level in reversed(range(len(stack))):
            edge = stack[level]
            may = may & _available(grounded, edge)
            initiation[:, level, k] = may
            ended[:, level, k] = True if edge.child < primitives else nodes[edge.child].terminal
            called[k, level] = edge.child
        initiation[:, len(stack) :, k] = False
    tops = [stack[-1].child for stack in stacks]
    tasks = tuple(sorted({top for top in tops if top >= primitives}))
    own = np.array([tasks.index(top) if top >= primitives else NONE for top in tops], dtype=np.int64)
    action = np.array([top if top < primitives else NONE for top in tops], dtype=np.int64)
    parts, made_of = _parts(grounded, stacks)
    return Options(
        grounded=grounded,
        names=tuple(" > ".join(nodes[edge.child].name for edge in stack) for stack in stacks),
        stacks=stacks,
        initiation=initiation,
        ended=ended,
        shares=np.array([[[a[:n] == b[:n] for b in stacks] for a in stacks] for n in range(levels)]),
        pseudo_reward=np.stack([_pseudo_reward(nodes[top]) for top in tops], axis=1),
        tasks=tasks,
        task=own,
        action=action,
        actions=_actions(grounded, tops),
        parts=parts,
        made_of=made_of,
        nodes=called,
    )


def _stacks(grounded: GroundGraph, place: int, below: tuple[Edge, ...]) -> list[tuple[Edge, ...]]:
    """Return the stacks that a task on top of others can build, itself alone if it calls actions only."""
    primitives = len(grounded.model.actions)
    children = dict.fromkeys(call.child for call in grounded.nodes[place].calls)
    if below and all(child < primitives for child in children):
        return [below]
    found: list[tuple[Edge, ...]] = []
    for child in children:
        stack = (*below, Edge(place, child))
        found += [stack] if child < primitives else _stacks(grounded, child, stack)
    return found


def _calls(grounded: GroundGraph, edge: Edge) -> list[GroundCall]:
    return [call for call in grounded.nodes[edge.caller].calls if call.child == edge.child]


def _available(grounded: GroundGraph, edge: Edge) -> Mask:
    """Return where a caller may call a child, by any of its calls of it, shape (states,)."""
    found: Mask = np.any([call.available for call in _calls(grounded, edge)], axis=0)
    return found


def _pseudo_reward(node: GroundTask) -> NDArray[np.float32]:
    short = node.terminal & ~node.goal
    return np.where(short, node.pseudo_reward or 0.0, 0.0).astype(np.float32)


def _actions(grounded: GroundGraph, tops: list[int]) -> Mask:
    primitives = len(grounded.model.actions)
    found = np.zeros((grounded.model.index.size, len(tops), primitives), dtype=np.bool_)
    for k, top in enumerate(tops):
        if top < primitives:
            found[:, k, top] = True
        for call in grounded.nodes[top].calls:
            found[:, k, call.child] |= call.available
    return found


def _own_uses(grounded: GroundGraph, place: int) -> tuple[str, ...]:
    """Return the variables that the value of a node that calls nothing but actions goes by.

    Of an action these are the variables that its reward hangs on; a task adds what its completions use.
    """
    node, index = grounded.nodes[place], grounded.model.index
    if node.leaf is not None:
        rows = node.leaf.projection.reshape(index.shape)
        axes = enumerate(index.names)
        return tuple(name for axis, name in axes if (rows != rows.take([0], axis=axis)).any())
    wanted = {name for call in node.calls for name in (*call.relevant, *_own_uses(grounded, call.child))}
    return tuple(name for name in index.names if name in wanted)


def _parts(grounded: GroundGraph, stacks: tuple[tuple[Edge, ...], ...]) -> tuple[tuple[Part, ...], Mask]:
    """Return the parts of values, and which option has which."""
    nodes = grounded.nodes
    parts: dict[Part, int] = {}
    members: list[set[int]] = []
    for stack in stacks:
        top = stack[-1].child
        own = [Part(f"V {nodes[top].name}", _own_uses(grounded, top))]
        for edge in stack:
            relevant = {name for call in _calls(grounded, edge) for name in call.relevant}
            uses = tuple(name for name in grounded.model.index.names if name in relevant)
            own.append(Part(f"C {nodes[edge.caller].name} {nodes[edge.child].name}", uses))
        members.append({parts.setdefault(part, len(parts)) for part in own})
    made_of = np.zeros((len(stacks), len(parts)), dtype=np.bool_)
    for k, own_parts in enumerate(members):
        made_of[k, list(own_parts)] = True
    return tuple(parts), made_of
