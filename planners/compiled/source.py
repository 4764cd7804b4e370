"""Numba source for the shapes of a ground graph: constants folded in, loops over actions unrolled.

Every function is inlined into the two entries, `learn` and `follow`, so that a kernel is one nest of loops
without calls. A task of a few primitive actions, in which nearly all steps are taken, keeps in registers
what it last looked at; any other task goes through the set bits of its words.

In the source, `s` is the state, `t` the state after a child, `c` the count of random draws, `left` the steps
left, `m` a word of the state, `x` the position of a completion value, `y` that of an action's reward. For
`q` of a child see `planners.Learner.q`; `inside` is the best of them to the task itself, `outside` what its
callers see. A negative state is a failure: `TOO_LONG`, `NO_SCHEDULE` or `STUCK`.
"""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import indent
from typing import Final, Literal

from planners.compiled.shapes import FIELDS, Shape, Shapes
from planners.compiled.tables import CALLS, ENDED, SHORT, Tables

Kind = Literal["maxq-0", "maxq-q", "flat-q"]
"""What is learnt."""
TOO_LONG: Final = -1
"""An episode passed its limit of steps."""
NO_SCHEDULE: Final = -2
"""A task had more episodes than the schedules' tables are long."""
STUCK: Final = -3
"""A task had nothing to call; the task and the state stand in `trouble`."""

_HEAD: Final = f'''\
"""Generated: the learner of a ground task graph."""

import math

import numpy as np

from worlds.jit import below, kernel, lowest, moved, ones, pointer, uniform, without_lowest

ENDED = np.uint64(1 << {ENDED})
SHORT = np.uint64(1 << {SHORT})
NONE = np.uint64(0)
WORST = -np.inf


@kernel(cached=False, forceinline=True)
def nth(words, span, n):
    for j in range(span):
        rest = words[j]
        here = ones(rest)
        if n < here:
            for _ in range(n):
                rest = without_lowest(rest)
            return {CALLS} * j + lowest(rest)
        n -= here
    return 0


@kernel(cached=False, forceinline=True)
def boltzmann(q, words, span, draw, temperature):
    most = WORST
    for j in range(span):
        rest = words[j]
        while rest != NONE:
            k = {CALLS} * j + lowest(rest)
            rest = without_lowest(rest)
            most = q[k] if q[k] > most else most
    total = 0.0
    for j in range(span):
        rest = words[j]
        while rest != NONE:
            k = {CALLS} * j + lowest(rest)
            rest = without_lowest(rest)
            q[k] = math.exp((q[k] - most) / temperature)
            total += q[k]
    k = 0
    for j in range(span):
        rest = words[j]
        while rest != NONE:
            k = {CALLS} * j + lowest(rest)
            rest = without_lowest(rest)
            draw -= q[k] / total
            if draw < 0.0:
                return k
    return k
'''
_TABLES: Final = "words, rows, links, values"
_ACTING: Final = f"{_TABLES}, key, scratch, trouble, first, after, reward, up_to"
_LEARNING: Final = f"{_ACTING}, counts, at, schedule, length"


@dataclass(frozen=True)
class Writer:
    """Writes the source of a kernel.

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

    def source(self) -> str:
        """Return the source of a module that holds the kernels `learn` and `follow`."""
        parts = [_HEAD]
        for shape in self.shapes.shapes:
            write = self._unrolled if shape.unrolled else self._calling
            parts += write(shape)
        parts += [_entry(_LEARN, self._dispatch("run")), _entry(_FOLLOW, self._dispatch("follow"))]
        return "\n\n".join(parts)

    def _dispatch(self, what: str) -> str:
        """Write the call of the function that belongs to a task's shape."""
        lines: list[str] = []
        for shape in self.shapes.shapes:
            told = ", ".join(f"me[{field + 1}]" for field in range(shape.told))
            more = _LEARNING if what == "run" else _ACTING
            lines.append(f"{'if' if not lines else 'elif'} me[0] == {shape.number}:")
            lines.append(f"    t, c, left = {what}_{shape.number}({told}, s, c, left, {more})")
        return "\n".join(lines)

    # --- tasks of a few primitive actions ---

    def _unrolled(self, shape: Shape) -> list[str]:
        me = ", ".join(["n", "w", *(f"b{g}" for g in range(shape.groups))])
        rows = _lines(*(f"r{g} = rows[b{g} + s]" for g in range(shape.groups)))
        new_rows = _lines(*(f"u{g} = rows[b{g} + t]" for g in range(shape.groups)))
        same = " or ".join(f"u{g} == r{g}" for g in range(shape.groups))
        onward = _lines(*(f"r{g} = u{g}" for g in range(shape.groups)))
        look = _function(
            f"look_{shape.number}({me}, s, {_TABLES})",
            "m = words[w + s]",
            _ended(shape, "m"),
            rows,
            self._values(shape, "s", "r"),
            "return inside, outside",
        )
        nothing = _stuck("m == NONE", "s")
        act = self._act("action", "s")
        action = _pick("action", dict(enumerate(shape.actions)))
        follow = _function(
            f"follow_{shape.number}({me}, s, c, left, {_ACTING})",
            "t = s",
            "while True:",
            indent(
                _lines(
                    "m = words[w + s]",
                    "if m >= ENDED:\n    return s, c, left",
                    nothing,
                    rows,
                    self._values(shape, "s", "r"),
                    self._greedy(shape),
                    "left -= 1",
                    f"if left < 0:\n    return {TOO_LONG}, c, left",
                    action,
                    act,
                    "s = t",
                ),
                "    ",
            ),
        )
        step = _lines(
            nothing,
            self._explore(shape),
            _pick("x", {k: f"r{g} + {at}" for k, (g, at) in enumerate(shape.places)}),
            action,
            act,
            self._reward_of(shape),
            "left -= 1",
            f"if left < 0:\n    return {TOO_LONG}, c, left",
            "m = words[w + t]",
            "if m >= ENDED:",
            indent(_lines(_worth_of_ending(shape, "m"), self._update("1"), "s = t", "break"), "    "),
            new_rows,
            self._values(shape, "t", "u"),
            _stuck("m == NONE", "t"),
            self._update("1"),
            f"if {same}:  # what was looked at has just been learnt",
            indent(self._values(shape, "t", "u"), "    "),
            onward,
            "s = t",
        )
        run = _function(
            f"run_{shape.number}({me}, s, c, left, {_LEARNING})",
            _BEGIN,
            "t = s",
            "m = words[w + s]",
            "if m < ENDED:",
            indent(_lines(rows, self._values(shape, "s", "r"), "while True:", indent(step, "    ")), "    "),
            "counts[n] = e + 1",
            "return s, c, left",
        )
        return [look, follow, run]

    def _values(self, shape: Shape, state: str, row: str) -> str:
        """Write what every action is worth in a state whose word is `m`, and what the best is."""
        lines = []
        for k, (action, (group, at)) in enumerate(zip(shape.actions, shape.places, strict=True)):
            x = f"{row}{group} + {at}"
            if self.kind == "flat-q":
                lines.append(f"q{k} = values[{x}]")
            else:
                column = self.tables.columns[action]
                y = f"rows[{column.rows} + {state}]" if self.tables.many else f"{column.base}"
                inner = f"values[{y}] + values[{self.tables.size} + {x}]"
                outer = f"values[{y}] + values[{x}]"
                lines += (
                    [f"q{k} = {inner}", f"o{k} = {outer}"] if self.kind == "maxq-q" else [f"q{k} = {outer}"]
                )
            lines.append(f"q{k} = q{k} if (m & np.uint64({1 << k})) != NONE else WORST")
        best, names = 0, [f"q{k}" for k in range(len(shape.actions))]
        while len(names) > 1:  # as a tree, which is shorter than a chain
            one, other, *names = names
            best += 1
            lines.append(f"best{best} = {other} if {other} > {one} else {one}")
            names.append(f"best{best}")
        lines.append(f"inside = {names[0]}")
        if self.kind != "maxq-q":
            return _lines(*lines, "outside = inside")
        tie = self.tie if shape.taught else 0.0
        return _lines(*lines, f"least = inside - {tie!r}", _first(len(shape.actions), "outside", "o{}"))

    def _greedy(self, shape: Shape) -> str:
        return _lines(f"least = inside - {self.tie!r}", _first(len(shape.actions), "k", "{}"))

    def _explore(self, shape: Shape) -> str:
        count = len(shape.actions)
        here = "moved(words, w + s)"
        if shape.boltzmann:
            return _lines(
                *(f"scratch[{k}] = q{k}" for k in range(count)),
                "c += 1",
                f"k = boltzmann(scratch, {here}, 1, uniform(key, c), level)",
            )
        return _lines(
            self._greedy(shape),
            "c += 1",
            "explore = uniform(key, c) < level",
            f"if m == np.uint64({(1 << count) - 1}):",  # the usual case has no branch to guess wrongly
            f"    k = below(key, c + 1, {count}) if explore else k",
            "elif explore:",
            f"    k = nth({here}, 1, below(key, c + 1, ones(m)))",
            "c += np.int64(explore)",
        )

    def _reward_of(self, shape: Shape) -> str:
        if self.kind == "flat-q":
            return ""
        columns = [self.tables.columns[action] for action in shape.actions]
        if self.tables.many:
            y = _lines(_pick("y", {k: column.rows for k, column in enumerate(columns)}), "y = rows[y + s]")
        else:
            y = _pick("y", {k: column.base for k, column in enumerate(columns)})
        return _lines(y, "values[y] += rate * (g - values[y])")

    # --- all other tasks ---

    def _calling(self, shape: Shape) -> list[str]:
        me = "n, w, l"
        here = f"here = w + {shape.span} * s"
        value = self._value_of_call(shape)
        keep = "if q > inside:\n    inside, outside = q, o"
        again = ""
        if self.kind == "maxq-q" and shape.taught:
            again = _lines(
                f"least = inside - {self.tie!r}",
                _each(shape.span, _lines(value, "if q >= least:\n    return inside, o")),
            )
        look = _function(
            f"look_{shape.number}({me}, s, {_TABLES})",
            here,
            _ended(shape, "words[here]"),
            "inside = outside = WORST",
            _each(shape.span, _lines(value, keep)),
            again,
            "return inside, outside",
        )
        known = _each(shape.span, _lines(value, "scratch[k_] = q", "inside = q if q > inside else inside"))
        first = _each(shape.span, "if k < 0 and scratch[k_] >= least:\n    k = k_", k="k_")
        greedy = _lines("inside = WORST", known, f"least = inside - {self.tie!r}", "k = np.int64(-1)", first)
        start = _lines(
            here,
            "if words[here] >= ENDED:\n    break",
            f"count = {' + '.join(f'ones(words[here + {j}])' for j in range(shape.span))}",
            _stuck("count == 0", "s"),
        )
        position = f"f = (l + k) * {self.shapes.links.shape[1]}\nx = rows[links[f + 1] + s] + links[f + 2]"
        follow = _function(
            f"follow_{shape.number}({me}, s, c, left, {_ACTING})",
            "t = s",
            "while True:",
            indent(
                _lines(start, greedy, position, self._call(shape, "follow"), "s = t"),
                "    ",
            ),
            "return s, c, left",
        )
        there = _lines(
            f"inside, outside = look_{shape.number}({me}, t, {_TABLES})", _stuck("inside == WORST", "t")
        )
        run = _function(
            f"run_{shape.number}({me}, s, c, left, {_LEARNING})",
            _BEGIN,
            "t = s",
            "while True:",
            indent(
                _lines(
                    start,
                    self._explore_calls(shape, greedy),
                    position,
                    "began = left",
                    self._call(shape, "run"),
                    there,
                    self._update("began - left"),
                    "s = t",
                ),
                "    ",
            ),
            "counts[n] = e + 1",
            "return s, c, left",
        )
        return [look, follow, run]

    def _explore_calls(self, shape: Shape, greedy: str) -> str:
        words = f"moved(words, here), {shape.span}"
        if shape.boltzmann:
            return _lines(greedy, "c += 1", f"k = boltzmann(scratch, {words}, uniform(key, c), level)")
        return _lines(
            "c += 1",
            "if uniform(key, c) < level:",
            "    c += 1",
            f"    k = np.int64(nth({words}, below(key, c, count)))",
            "else:",
            indent(greedy, "    "),
        )

    def _value_of_call(self, shape: Shape) -> str:
        """Write `q`, which the task compares its k-th call by, and `o`, which its callers see of it."""
        fields = self.shapes.links.shape[1]
        position = f"f = (l + k_) * {fields}\nx_ = rows[links[f + 1] + s] + links[f + 2]"
        if self.kind == "flat-q":
            return _lines(position, "q = o = values[x_]")
        by_shape = {}
        for number, told in shape.children:
            if number == 0:
                by_shape[number] = f"v = values[{self._leaf('s')}]"
            else:
                by_shape[number] = f"v = look_{number}({_told(told)}, s, {_TABLES})[1]"
        value = _lines(position, _switch(by_shape), "o = v + values[x_]")
        return _lines(value, f"q = v + values[{self.tables.size} + x_]" if self.kind == "maxq-q" else "q = o")

    def _leaf(self, state: str) -> str:
        """Return where the value of the primitive action of a link is."""
        return f"rows[links[f + 4] + {state}]" if self.tables.many else "links[f + 4]"

    def _call(self, shape: Shape, what: str) -> str:
        by_shape = {}
        for number, told in shape.children:
            if number == 0:
                act = self._act("links[f + 3]", "s")
                learn = f"y = {self._leaf('s')}\nvalues[y] += rate * (g - values[y])"
                count = f"left -= 1\nif left < 0:\n    return {TOO_LONG}, c, left"
                if what == "follow":
                    by_shape[number] = _lines(count, act)
                else:
                    by_shape[number] = _lines(act, "" if self.kind == "flat-q" else learn, count)
            else:
                more = _LEARNING if what == "run" else _ACTING
                by_shape[number] = _lines(
                    f"t, c, left = {what}_{number}({_told(told)}, s, c, left, {more})",
                    "if t < 0:\n    return t, c, left",
                )
        return _switch(by_shape)

    # --- both ---

    def _act(self, action: str, state: str) -> str:
        """Write how a primitive action leads to the next state `t` and the reward `g`."""
        at = f"i = {self.actions} * {state} + {action}"
        if self.tables.outcomes.certain:
            return _lines(at, "t = np.int64(after[i])", "g = reward[i]")
        return _lines(
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

    def _update(self, steps: str) -> str:
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
        return _lines(f"{y} += rate * ({discount}inside - {y})", outer)


_BEGIN: Final = f"""\
e = counts[n]
if e >= length:
    return {NO_SCHEDULE}, c, left
rate = schedule[at[2 * n] + e]
level = schedule[at[2 * n + 1] + e]"""


def _lines(*parts: str) -> str:
    return "\n".join(part for part in parts if part)


def _function(head: str, *body: str) -> str:
    return f"@kernel(cached=False, forceinline=True)\ndef {head}:\n" + indent(_lines(*body), "    ") + "\n"


def _told(count: int) -> str:
    """Return what a link says of a child, as arguments."""
    return ", ".join(f"links[f + {FIELDS + field}]" for field in range(count))


def _worth_of_ending(shape: Shape, word: str) -> str:
    inside = f"{shape.taught!r} if ({word} & SHORT) != NONE else 0.0" if shape.taught else "0.0"
    return f"inside, outside = {inside}, 0.0"


def _ended(shape: Shape, word: str) -> str:
    return _lines(
        f"if {word} >= ENDED:", f"    {_worth_of_ending(shape, word)}", "    return inside, outside"
    )


def _stuck(condition: str, state: str) -> str:
    return _lines(
        f"if {condition}:",
        f"    trouble[0], trouble[1] = n, {state}",
        f"    return {STUCK}, c, left",
    )


def _pick(name: str, by_call: dict[int, object]) -> str:
    """Write `name` as a function of `k`; in one expression if it counts up with it."""
    rows = {str(value).rpartition(" + ") for value in by_call.values()}
    head = {row[0] for row in rows}
    steps = [int(str(value).rpartition(" + ")[2]) for value in by_call.values()]
    if len(head) == 1 and steps == list(range(steps[0], steps[0] + len(steps))):
        return f"{name} = " + " + ".join(
            part for part in (*head, "k", str(steps[0])) if part not in {"", "0"}
        )
    return _lines(
        *(
            f"{'if' if k == 0 else 'elif'} k == {k}:\n    {name} = {value}"
            for k, value in by_call.items()
            if k + 1 < len(by_call)
        ),
        f"else:\n    {name} = {by_call[len(by_call) - 1]}" if len(by_call) > 1 else f"{name} = {by_call[0]}",
    )


def _first(count: int, name: str, value: str) -> str:
    """Write `name` as the value of the first action that is worth `least`."""
    last = value.format(count - 1)
    start = f"{name} = {last}" if value != "{}" else f"{name} = np.int64({last})"
    rest = (
        f"{name} = {value.format(k) if value != '{}' else f'np.int64({k})'} if q{k} >= least else {name}"
        for k in range(count - 2, -1, -1)
    )
    return _lines(start, *rest)


def _each(span: int, body: str, k: str = "k_") -> str:
    """Write a loop over the calls `k_` that are available in the words `here`, in order."""
    return _lines(
        f"for j in range({span}):",
        "    rest = words[here + j]",
        "    while rest != NONE:",
        f"        {k} = {CALLS} * j + lowest(rest)",
        "        rest = without_lowest(rest)",
        indent(body, "        "),
    )


def _switch(by_shape: dict[int, str]) -> str:
    """Write what is done by the shape of a link's child."""
    *some, last = by_shape
    lines: list[str] = []
    for number in some:
        lines += [f"{'elif' if lines else 'if'} links[f] == {number}:", indent(by_shape[number], "    ")]
    if not some:
        return by_shape[last]
    return _lines(*lines, "else:", indent(by_shape[last], "    "))


_WORLD: Final = "uint64[::1], int32[::1], int64[:, ::1], int32[::1], int32[::1], float64[::1], float64[::1]"
_POINTERS: Final = """\
    words, rows, links = pointer(words_), pointer(rows_), pointer(links_)
    first, after = pointer(first_), pointer(after_)
    reward, up_to, trouble, scratch = pointer(reward_), pointer(up_to_), pointer(trouble_), pointer(scratch_)
"""
_LEARN: Final = (
    f"""
@kernel(
    "int64(int64[::1], int64, int64, uint64[::1], int64[::1], float64[:, ::1], int64[:, ::1], int64[::1], "
    "float64[::1], int64, int64[::1], int64, int64, int32[:, ::1], {_WORLD}, int64[::1], float64[::1])"
)
def learn(
    me, low, high, keys, counters, values_, counts_, at_, schedule_, length, starts, episodes, limit, steps,
    words_, rows_, links_, first_, after_, reward_, up_to_, trouble_, scratch_,
):
{_POINTERS}    at, schedule = pointer(at_), pointer(schedule_)
    for run in range(low, high):
        key, c = keys[run], counters[run]
        values = moved(pointer(values_), run * values_.shape[1])
        counts = moved(pointer(counts_), run * counts_.shape[1])
        t = np.int64(0)
        for episode in range(episodes):
            c += 1
            s = starts[below(key, c, starts.size)]
            left = limit
""",
    """\
            if t < 0:
                trouble[2], trouble[3] = run, episode
                return t
            steps[run, episode] = limit - left
        counters[run] = c
    return 0
""",
)
_FOLLOW: Final = (
    f"""
@kernel(
    "int64(int64[::1], int64, int64, uint64[::1], int64[::1], float64[:, ::1], int64[::1], int64, "
    "int64[:, ::1], {_WORLD}, int64[::1], float64[::1])"
)
def follow(
    me, low, high, keys, counters, values_, starts, limit, steps,
    words_, rows_, links_, first_, after_, reward_, up_to_, trouble_, scratch_,
):
{_POINTERS}    for run in range(low, high):
        key, c = keys[run], counters[run]
        values = moved(pointer(values_), run * values_.shape[1])
        t = np.int64(0)
        for start in range(starts.size):
            s = starts[start]
            left = limit
""",
    f"""\
            if t == {STUCK}:
                trouble[2], trouble[3] = run, start
                return t
            steps[run, start] = -1 if t < 0 else limit - left
        counters[run] = c
    return 0
""",
)


def _entry(frame: tuple[str, str], dispatch: str) -> str:
    return frame[0] + indent(dispatch, " " * 12) + "\n" + frame[1]
