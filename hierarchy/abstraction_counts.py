"""How many values a ground graph stores, table by table, for the variables declared and what is proved.

For Taxi this gives the counts of Dietterich (2000), section 5.1.6: 632 against 3000 of flat Q.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hierarchy.abstraction_scope import Scope, scopes
from hierarchy.abstraction_structure import stays_on
from hierarchy.graph import Call
from hierarchy.grounding import GroundGraph

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class TableSize:
    """The completion tables of one call, over all bindings of its caller and of its child.

    Parameters
    ----------
    task
        The caller.
    call
        The call.
    relevant
        The variables that they are stored by.
    product
        Values as published counts have them: for every binding, the product over these variables of the
        number of values that each takes where the call may be made, whatever the caller's binding.
    live
        Values that are ever read: the rows that occur where the call may be made.
    zero
        Whether all of them are 0, since the child ends only where its caller has ended (termination): then
        none need be stored.
    """

    task: str
    call: Call
    relevant: tuple[str, ...]
    product: int
    live: int
    zero: bool

    @property
    def needed(self) -> int:
        """Values as published counts have them, and none where all are 0."""
        return 0 if self.zero else self.product

    @property
    def read(self) -> int:
        """Values of these that are ever read."""
        return 0 if self.zero else self.live


@dataclass(frozen=True)
class TableSizes:
    """Every table of a ground graph.

    Parameters
    ----------
    tables
        The completion tables, callers in the order of their declaration.
    leaves
        Values of every primitive action, one for each expected reward.
    flat
        Values of flat Q: reachable states in which the root runs, times actions.
    """

    tables: tuple[TableSize, ...]
    leaves: dict[str, int]
    flat: int

    @property
    def total(self) -> int:
        """All values that need be stored, the leaves' included."""
        return sum(table.needed for table in self.tables) + sum(self.leaves.values())

    def of(self, task: str) -> int:
        """Return the number of completion values that a task needs, over all its bindings and calls."""
        return sum(table.needed for table in self.tables if table.task == task)

    def read_of(self, task: str) -> int:
        """Return how many of these are ever read."""
        return sum(table.read for table in self.tables if table.task == task)

    def __str__(self) -> str:
        lines = [f"{table.task} -> {table.call}: {table.needed}" for table in self.tables]
        lines += [f"{action}: {values}" for action, values in self.leaves.items()]
        return "\n".join((*lines, f"{self.total} of {self.flat} flat"))


def table_sizes(grounded: GroundGraph) -> TableSizes:
    """Count the values of every table.

    Examples
    --------
    >>> from hierarchy import ground
    >>> from hierarchy.taxi import taxi_graph
    >>> from worlds.taxi import taxi_model
    >>> model = taxi_model()
    >>> sizes = table_sizes(ground(taxi_graph(model), model))
    >>> sizes.total, sizes.flat
    (632, 3000)
    >>> {task: sizes.of(task) for task in ("Navigate", "Get", "Put", "Root")}
    {'Navigate': 400, 'Get': 104, 'Put': 104, 'Root': 16}
    """
    model, where = grounded.model, scopes(grounded)
    reachable = model.reachable()
    tasks = (task for task in grounded.graph.tasks.values() if grounded.instances(task.name))
    tables = [_size(grounded, where, task.name, call) for task in tasks for call in task.do]
    leaves = {
        node.name: int(np.unique(node.leaf.projection[reachable]).size)
        for node in grounded.nodes
        if node.leaf is not None
    }
    runs = int((reachable & grounded.nodes[grounded.root].live).sum())
    return TableSizes(tuple(tables), leaves, runs * len(model.actions))


def _size(grounded: GroundGraph, where: tuple[Scope, ...], task: str, call: Call) -> TableSize:
    index = grounded.model.index
    places = [place for place, node in enumerate(grounded.nodes) if node.task == task]
    edges = [k for k, edge in enumerate(grounded.nodes[places[0]].calls) if edge.call is call]
    relevant = grounded.nodes[places[0]].calls[edges[0]].relevant
    rows = index.project(relevant)
    product, live, zero = 0, 0, True
    for k in edges:
        made = {place: where[place].decides & grounded.nodes[place].calls[k].available for place in places}
        made = {place: at for place, at in made.items() if at.any()}
        if made:
            meant = [where[place].decides & _meant(grounded, place, k) for place in made]
            anywhere: Mask = np.logical_or.reduce(meant)
            values = [np.unique(index.column(name)[anywhere]).size for name in relevant]
            product += int(np.prod(values, dtype=np.int64)) * len(made)
        for place, at in made.items():
            live += int(np.unique(rows[at]).size)
            zero = zero and not stays_on(grounded, place, grounded.nodes[place].calls[k], at).any()
    return TableSize(task, call, relevant, product, live, zero)


def _meant(grounded: GroundGraph, place: int, k: int) -> Mask:
    """Return where a call is meant to be made, an action that might leave the working space included."""
    node = grounded.nodes[place]
    edge = node.calls[k]
    if grounded.nodes[edge.child].calls:
        return edge.available
    return edge.call.guard.bind(dict(node.binding)).mask(grounded.model.index)
