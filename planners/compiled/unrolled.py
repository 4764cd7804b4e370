"""Source for tasks of a few primitive actions, whose loop over the actions is unrolled.

Nearly all steps are taken in such tasks, so they keep in registers what they last looked at. In the source,
`q0`, `q1`, ... are what the actions are worth to the task, `o0`, `o1`, ... what they are to its callers;
`r0`, `r1`, ... are the rows of its tables in state `s`, `u0`, `u1`, ... those in state `t`.
"""

from __future__ import annotations

from planners.compiled.frame import ACTING, LEARNING, TABLES
from planners.compiled.kernel import BEGIN, COUNT, REWARD, Kernel, ending, look_at_end, stuck
from planners.compiled.shapes import Shape
from planners.compiled.writing import block, first, function, lines, pick


def unrolled_task(kernel: Kernel, shape: Shape) -> list[str]:
    """Return the functions of a shape: what it is worth, its greedy policy, and learning."""
    groups = range(shape.groups)
    me = ", ".join(["n", "w", *(f"b{g}" for g in groups)])
    rows = lines(*(f"r{g} = rows[b{g} + s]" for g in groups))
    values = _values(kernel, shape, "s", "r")
    nothing = stuck("m == NONE", "s")
    action = pick("action", dict(enumerate(shape.actions)))
    act = kernel.act("action")
    look = function(
        f"look_{shape.number}({me}, s, {TABLES})",
        "m = words[w + s]",
        look_at_end(shape, "m"),
        rows,
        values,
        "return inside, outside",
    )
    follow = function(
        f"follow_{shape.number}({me}, s, c, left, {ACTING})",
        "t = s",
        block(
            "while True:",
            "m = words[w + s]",
            block("if m >= ENDED:", "return s, c, left"),
            nothing,
            rows,
            values,
            _greedy(kernel, shape),
            COUNT,
            action,
            act,
            "s = t",
        ),
    )
    places = {k: f"r{g} + {at}" for k, (g, at) in enumerate(shape.places)}
    values_after = _values(kernel, shape, "t", "u")
    step = block(
        "while True:",
        nothing,
        _explore(kernel, shape),
        pick("x", places),
        action,
        act,
        _learn_reward(kernel, shape),
        COUNT,
        "m = words[w + t]",
        block("if m >= ENDED:", ending(shape, "m"), kernel.update("1"), "s = t", "break"),
        *(f"u{g} = rows[b{g} + t]" for g in groups),
        values_after,
        stuck("m == NONE", "t"),
        kernel.update("1"),
        block(
            f"if {' or '.join(f'u{g} == r{g}' for g in groups)}:  # what was looked at has just been learnt",
            values_after,
        ),
        *(f"r{g} = u{g}" for g in groups),
        "s = t",
    )
    run = function(
        f"run_{shape.number}({me}, s, c, left, {LEARNING})",
        BEGIN,
        "t = s",
        "m = words[w + s]",
        block("if m < ENDED:", rows, values, step),
        "counts[n] = e + 1",
        "return s, c, left",
    )
    return [look, follow, run]


def _values(kernel: Kernel, shape: Shape, state: str, row: str) -> str:
    """Write what every action is worth in a state whose word is `m`, and what the best is."""
    tables = kernel.tables
    found = []
    for k, (action, (group, at)) in enumerate(zip(shape.actions, shape.places, strict=True)):
        x = f"{row}{group} + {at}"
        if kernel.kind == "flat-q":
            found.append(f"q{k} = values[{x}]")
        else:
            column = tables.columns[action]
            y = f"rows[{column.rows} + {state}]" if tables.many else f"{column.base}"
            outer = f"values[{y}] + values[{x}]"
            if kernel.kind == "maxq-q":
                found += [f"q{k} = values[{y}] + values[{tables.size} + {x}]", f"o{k} = {outer}"]
            else:
                found.append(f"q{k} = {outer}")
        found.append(f"q{k} = q{k} if (m & np.uint64({1 << k})) != NONE else WORST")
    best, names = 0, [f"q{k}" for k in range(len(shape.actions))]
    while len(names) > 1:  # as a tree, which is shorter than a chain
        one, other, *names = names
        best += 1
        found.append(f"best{best} = {other} if {other} > {one} else {one}")
        names.append(f"best{best}")
    found.append(f"inside = {names[0]}")
    if kernel.kind != "maxq-q":
        return lines(*found, "outside = inside")
    tie = kernel.tie if shape.taught else 0.0
    return lines(*found, f"least = inside - {tie!r}", first(len(shape.actions), "outside", "o{}"))


def _greedy(kernel: Kernel, shape: Shape) -> str:
    """Write which action `k` is the first of the best."""
    return lines(f"least = inside - {kernel.tie!r}", first(len(shape.actions), "k", "np.int64({})"))


def _explore(kernel: Kernel, shape: Shape) -> str:
    """Write which action `k` is tried."""
    count = len(shape.actions)
    here = "moved(words, w + s)"
    if shape.boltzmann:
        return lines(
            *(f"scratch[{k}] = q{k}" for k in range(count)),
            "c += 1",
            f"k = boltzmann(scratch, {here}, 1, uniform(key, c), level)",
        )
    return lines(
        _greedy(kernel, shape),
        "c += 1",
        "explore = uniform(key, c) < level",
        f"if m == np.uint64({(1 << count) - 1}):",  # the usual case has no branch to guess wrongly
        f"    k = below(key, c + 1, {count}) if explore else k",
        "elif explore:",
        f"    k = nth({here}, 1, below(key, c + 1, ones(m)))",
        "c += np.int64(explore)",
    )


def _learn_reward(kernel: Kernel, shape: Shape) -> str:
    """Write what is learnt of action `k` itself."""
    if kernel.kind == "flat-q":
        return ""
    columns = dict(enumerate(kernel.tables.columns[action] for action in shape.actions))
    if not kernel.tables.many:
        return lines(pick("y", {k: column.base for k, column in columns.items()}), REWARD)
    return lines(pick("y", {k: column.rows for k, column in columns.items()}), "y = rows[y + s]", REWARD)
