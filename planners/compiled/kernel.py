"""What a kernel is generated from, and the source that tasks of every shape share.

In the source, `s` is the state, `t` the state after a child, `c` the count of random draws, `left` the steps
left, `m` a word of the state, `x` the position of a completion value, `y` that of an action's reward, and `n`
the task's place. For `q` of a child see `planners.Learner.q`; `inside` is the best of them to the task
itself, `outside` what its callers see. A negative state is a failure: `TOO_LONG`, `NO_SCHEDULE` or `STUCK`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from planners.compiled.frame import NO_SCHEDULE, STUCK, TOO_LONG
from planners.compiled.shapes import Shape, Shapes
from planners.compiled.tables import Tables
from planners.compiled.writing import block, lines

Kind = Literal["maxq-0", "maxq-q", "flat-q"]
"""What is learnt."""


@dataclass(frozen=True)
class Kernel:
    """What a kernel is generated from.

    Parameters
    ----------
    kind
        What is learnt.
    gamma, tie
        Discount factor, and values that count as equal.
    actions
        Number of primitive actions.
    tables
        How the ground graph is laid out.
    shapes
        The shapes of its tasks.
    """

    kind: Kind
    gamma: float
    tie: float
    actions: int
    tables: Tables
    shapes: Shapes

    def act(self, action: str) -> str:
        """Write how a primitive action leads to the next state `t` and the reward `g`."""
        at = f"i = {self.actions} * s + {action}"
        if self.tables.outcomes.certain:
            return lines(at, "t = np.int64(after[i])", "g = reward[i]")
        return lines(
            at,
            "i, last = first[i], first[i + 1] - 1",
            "if i < last:",
            "    c += 1",
            "    draw = uniform(key, c)",
            "    while i < last and draw >= up_to[i]:",
            "        i += 1",
            "t = np.int64(after[i])",
            "g = reward[i]",
        )

    def update(self, steps: str) -> str:
        """Write what is learnt at `x` of a child that took some steps."""
        if self.gamma == 1:
            discount = ""
        elif steps == "1":
            discount = f"{self.gamma!r} * "
        else:
            discount = f"math.pow({self.gamma!r}, np.float64({steps})) * "
        if self.kind == "flat-q":
            return f"values[x] += rate * ((g + {discount}inside) - values[x])"
        outer = f"values[x] += rate * ({discount}outside - values[x])"
        if self.kind == "maxq-0":
            return outer
        y = f"values[{self.tables.size} + x]"
        return lines(f"{y} += rate * ({discount}inside - {y})", outer)


BEGIN: Final = f"""\
e = counts[n]
if e >= length:
    return {NO_SCHEDULE}, c, left
rate = schedule[at[2 * n] + e]
level = schedule[at[2 * n + 1] + e]"""
"""How a task begins that learns."""
COUNT: Final = f"left -= 1\nif left < 0:\n    return {TOO_LONG}, c, left"
"""How a step is counted."""
REWARD: Final = "values[y] += rate * (g - values[y])"
"""How a primitive action's reward is learnt."""


def ending(shape: Shape, word: str) -> str:
    """Write what a task is worth where it has ended: what it is taught to expect there, 0 to its callers."""
    inside = f"{shape.taught!r} if ({word} & SHORT) != NONE else 0.0" if shape.taught else "0.0"
    return f"inside, outside = {inside}, 0.0"


def look_at_end(shape: Shape, word: str) -> str:
    """Write what `look` returns where a task has ended."""
    return block(f"if {word} >= ENDED:", ending(shape, word), "return inside, outside")


def stuck(condition: str, state: str) -> str:
    """Write how a task fails that has nothing to call."""
    return block(f"if {condition}:", f"trouble[0], trouble[1] = n, {state}", f"return {STUCK}, c, left")
