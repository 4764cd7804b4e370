"""What is said about an abstraction: verdicts, and the two states and numbers that refute one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from hierarchy.abstraction_compare import Difference
from worlds import StateIndex

Status = Literal["proved", "refuted", "undecided", "does not apply"]


@dataclass(frozen=True)
class Witness:
    """Two states that an abstraction takes for one, and what tells them apart.

    Parameters
    ----------
    states
        Their numbers.
    words
        Both in words.
    what
        What differs between them.
    numbers
        Its value in the one and in the other.
    """

    states: tuple[int, int]
    words: tuple[str, str]
    what: str
    numbers: tuple[float, float]

    def __str__(self) -> str:
        (one, other), (a, b) = self.words, self.numbers
        return f"{self.what}: {a:.6g} in ({one}), {b:.6g} in ({other})"


@dataclass(frozen=True)
class Verdict:
    """Whether a condition holds.

    Parameters
    ----------
    status
        "undecided": no proof was found, and no policy that refutes it.
    reason
        Why, in a few words.
    witness
        Two states and their numbers if it is refuted; where it is undecided, what the proof stumbled on.
    """

    status: Status
    reason: str = ""
    witness: Witness | None = None

    @property
    def proved(self) -> bool:
        """Whether the condition is proved."""
        return self.status == "proved"

    @property
    def refuted(self) -> bool:
        """Whether the condition is refuted."""
        return self.status == "refuted"

    def __str__(self) -> str:
        said = ", ".join(str(part) for part in (self.reason, self.witness) if part)
        return f"{self.status} ({said})" if said else self.status


NOT_APPLICABLE: Final = Verdict("does not apply")


@dataclass(frozen=True)
class Judgement:
    """A condition's verdict for every abstract policy of the tasks below, and at the policy given, if any."""

    always: Verdict
    at_policy: Verdict | None = None

    def __str__(self) -> str:
        at = "" if self.at_policy is None else f"; at the policy: {self.at_policy}"
        return f"for every policy: {self.always}{at}"


def witness(index: StateIndex, what: str, difference: Difference) -> Witness:
    """Return a difference as a witness, its states in words."""
    first, second = difference.first, difference.second
    words = (describe(index, first), describe(index, second))
    return Witness((first, second), words, what, difference.numbers)


def describe(index: StateIndex, state: int, names: Sequence[str] | None = None) -> str:
    """Return a state in words, or what some of its variables say.

    Examples
    --------
    >>> from worlds import Variable
    >>> index = StateIndex((Variable("x", (0, 1)), Variable("door", ("shut", "open"))))
    >>> describe(index, 3), describe(index, 3, ["door"])
    ('x = 1, door = open', 'door = open')
    """
    return index.words(state, names) or "any state"


def as_numbers(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return a mask as numbers, 1 where it holds."""
    return mask.astype(np.float64)
