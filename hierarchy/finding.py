"""What validation says of a task graph: one fault, where it is, and its mend."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One fault of a task graph.

    `where` is a task, or an edge written ``parent -> child``.

    Examples
    --------
    >>> print(Finding("no children", "Idle", "it has nothing to do", "give it children with do=..."))
    Idle: it has nothing to do; give it children with do=...
    """

    kind: str
    where: str
    problem: str
    mend: str

    def __str__(self) -> str:
        return f"{self.where}: {self.problem}; {self.mend}"
