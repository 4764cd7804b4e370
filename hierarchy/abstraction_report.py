"""The report on an abstraction: the five conditions for every call, and whether its table is safe."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hierarchy.abstraction_verdict import Judgement


@dataclass(frozen=True)
class EdgeReport:
    """What is proved about one call of a ground task.

    Parameters
    ----------
    task, child
        Names of the ground task and of the child.
    uses, relevant
        The relevant variables declared for the task, and those that this call's completion is stored by.
    states
        Number of states in which the call may be made.
    max_node
        Max-node irrelevance: what the child earns, and where it ends as far as `uses` tells, depends on
        `uses` alone; so do the task's termination and guards.
    leaf
        Leaf irrelevance: a primitive child's value is stored by what its expected reward depends on.
    result
        Result distribution irrelevance: where the child ends, as far as it matters afterwards, depends on
        `relevant` alone. It does not apply where `relevant` is the whole of `uses`.
    termination
        The child ends only where its caller has ended too, so that its completion is 0.
    shielding
        No state is met in which the task runs and, on every path from the root, some caller has ended. It
        does not apply where there are no such states.
    table
        Whether the completion table, as projected, holds a function: proved if conditions above add up to
        that; at the policy given, decided by evaluation.
    """

    task: str
    child: str
    uses: tuple[str, ...]
    relevant: tuple[str, ...]
    states: int
    max_node: Judgement
    leaf: Judgement
    result: Judgement
    termination: Judgement
    shielding: Judgement
    table: Judgement

    @property
    def conditions(self) -> dict[str, Judgement]:
        """The five conditions, by name."""
        return {
            "max-node irrelevance": self.max_node,
            "leaf irrelevance": self.leaf,
            "result distribution irrelevance": self.result,
            "termination": self.termination,
            "shielding": self.shielding,
        }

    def __str__(self) -> str:
        head = f"{self.task} -> {self.child}, stored by ({', '.join(self.relevant)}): {self.table}"
        said = (f"  {name}: {judged}" for name, judged in self.conditions.items())
        return "\n".join((head, *said))


@dataclass(frozen=True)
class AbstractionReport:
    """What is proved about every call of a ground graph.

    Parameters
    ----------
    gamma
        The discount factor that it is proved for.
    edges
        One report for each call that can be made, callers in the order of the nodes.
    """

    gamma: float
    edges: tuple[EdgeReport, ...]

    @property
    def safe(self) -> bool:
        """Whether every table is proved to hold a function, for every abstract policy of the tasks below."""
        return all(edge.table.always.proved and not edge.leaf.always.refuted for edge in self.edges)

    @property
    def safe_at_policy(self) -> bool | None:
        """Whether every table holds a function at the policy given; None if none was."""
        verdicts = [edge.table.at_policy for edge in self.edges]
        if any(verdict is None for verdict in verdicts):
            return None
        leaves = all(not edge.leaf.always.refuted for edge in self.edges)
        return leaves and all(verdict is not None and verdict.proved for verdict in verdicts)

    def edge(self, task: str, child: str) -> EdgeReport:
        """Return the report on a call by the names of task and child.

        Raises
        ------
        KeyError
            If there is none; the message lists them.
        """
        for edge in self.edges:
            if (edge.task, edge.child) == (task, child):
                return edge
        known = ", ".join(f"{edge.task} -> {edge.child}" for edge in self.edges)
        raise KeyError(f"no call {task} -> {child} that can be made; there are {known}")

    def unsafe(self) -> Iterator[EdgeReport]:
        """Yield the calls whose tables are not proved to hold a function."""
        return (edge for edge in self.edges if not edge.table.always.proved)

    def __str__(self) -> str:
        proved = sum(edge.table.always.proved for edge in self.edges)
        lines = [f"{proved} of {len(self.edges)} tables proved safe for every policy (gamma {self.gamma:g})"]
        if self.safe_at_policy is not None:
            here = sum(
                edge.table.at_policy is not None and edge.table.at_policy.proved for edge in self.edges
            )
            lines.append(f"{here} of {len(self.edges)} hold a function at the policy given")
        for edge in self.unsafe():
            stored = ", ".join(edge.relevant) or "nothing"
            lines.append(f"{edge.task} -> {edge.child}, stored by {stored}: {edge.table.always}")
        return "\n".join(lines)
