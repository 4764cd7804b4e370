"""Source for tasks that call tasks, or many actions: they go through the set bits of a state's words.

In the source, `k` and `k_` are calls, and `f` is where what there is to know of one begins among `links`.
"""

from __future__ import annotations

from planners.compiled.frame import ACTING, LEARNING, TABLES
from planners.compiled.kernel import BEGIN, COUNT, REWARD, Kernel, look_at_end, stuck
from planners.compiled.shapes import FIELDS, Shape
from planners.compiled.writing import block, each, either, function, lines

_ME = "n, w, l"
"""What the functions of such a task are told of it: its place, where its words begin, and its links."""


def calling_task(kernel: Kernel, shape: Shape) -> list[str]:
    """Return the functions of a shape: what it is worth, its greedy policy, and learning."""
    here = f"here = w + {shape.span} * s"
    start = lines(
        here,
        block("if words[here] >= ENDED:", "break"),
        f"count = {' + '.join(f'ones(words[here + {j}])' for j in range(shape.span))}",
        stuck("count == 0", "s"),
    )
    greedy = _greedy(kernel, shape)
    look = function(
        f"look_{shape.number}({_ME}, s, {TABLES})",
        here,
        look_at_end(shape, "words[here]"),
        _best(kernel, shape),
        "return inside, outside",
    )
    follow = function(
        f"follow_{shape.number}({_ME}, s, c, left, {ACTING})",
        "t = s",
        block("while True:", start, greedy, _place(kernel, "k", "x"), _follow(kernel, shape), "s = t"),
        "return s, c, left",
    )
    run = function(
        f"run_{shape.number}({_ME}, s, c, left, {LEARNING})",
        BEGIN,
        "t = s",
        block(
            "while True:",
            start,
            _explore(shape, greedy),
            _place(kernel, "k", "x"),
            "began = left",
            _run(kernel, shape),
            f"inside, outside = look_{shape.number}({_ME}, t, {TABLES})",
            stuck("inside == WORST", "t"),
            kernel.update("began - left"),
            "s = t",
        ),
        "counts[n] = e + 1",
        "return s, c, left",
    )
    return [look, follow, run]


def _place(kernel: Kernel, k: str, x: str) -> str:
    """Write where a call's link begins, and the position of its completion value."""
    return f"f = (l + {k}) * {kernel.shapes.links.shape[1]}\n{x} = rows[links[f + 1] + s] + links[f + 2]"


def _value(kernel: Kernel, shape: Shape) -> str:
    """Write `q`, which the task compares its call `k_` by, and `o`, which its callers see of it."""
    place = _place(kernel, "k_", "x_")
    if kernel.kind == "flat-q":
        return lines(place, "q = o = values[x_]")
    worth = {
        number: f"look_{number}({_told(told)}, s, {TABLES})[1]" if number else f"values[{_leaf(kernel)}]"
        for number, told in shape.children
    }
    value = either("links[f]", {number: f"v = {found}" for number, found in worth.items()})
    q = f"q = v + values[{kernel.tables.size} + x_]" if kernel.kind == "maxq-q" else "q = o"
    return lines(place, value, "o = v + values[x_]", q)


def _best(kernel: Kernel, shape: Shape) -> str:
    """Write what the best call is worth to the task, `inside`, and to its callers, `outside`."""
    value = _value(kernel, shape)
    best = lines(
        "inside = outside = WORST",
        each(shape.span, lines(value, block("if q > inside:", "inside, outside = q, o"))),
    )
    if kernel.kind != "maxq-q" or not shape.taught:
        return best
    taken = each(shape.span, lines(value, block("if q >= least:", "return inside, o")))
    return lines(best, f"least = inside - {kernel.tie!r}", taken)


def _greedy(kernel: Kernel, shape: Shape) -> str:
    """Write which call `k` is the first of the best; every call's value stands in `scratch`."""
    known = lines(_value(kernel, shape), "scratch[k_] = q", "inside = q if q > inside else inside")
    first = block("if k < 0 and scratch[k_] >= least:", "k = k_")
    return lines(
        "inside = WORST",
        each(shape.span, known),
        f"least = inside - {kernel.tie!r}",
        "k = np.int64(-1)",
        each(shape.span, first),
    )


def _explore(shape: Shape, greedy: str) -> str:
    """Write which call `k` is tried."""
    words = f"moved(words, here), {shape.span}"
    if shape.boltzmann:
        return lines(greedy, "c += 1", f"k = boltzmann(scratch, {words}, uniform(key, c), level)")
    return lines(
        "c += 1",
        "if uniform(key, c) < level:",
        "    c += 1",
        f"    k = np.int64(nth({words}, below(key, c, count)))",
        block("else:", greedy),
    )


def _follow(kernel: Kernel, shape: Shape) -> str:
    """Write how a call is carried out by its greedy policy."""
    return _carried_out(shape, "follow", ACTING, lines(COUNT, kernel.act("links[f + 3]")))


def _run(kernel: Kernel, shape: Shape) -> str:
    """Write how a call is carried out and learnt in."""
    reward = "" if kernel.kind == "flat-q" else lines(f"y = {_leaf(kernel)}", REWARD)
    return _carried_out(shape, "run", LEARNING, lines(kernel.act("links[f + 3]"), reward, COUNT))


def _carried_out(shape: Shape, what: str, given: str, action: str) -> str:
    """Write what is done by the shape of a call's child; a primitive action has none."""
    bodies = {
        number: lines(
            f"t, c, left = {what}_{number}({_told(told)}, s, c, left, {given})",
            block("if t < 0:", "return t, c, left"),
        )
        if number
        else action
        for number, told in shape.children
    }
    return either("links[f]", bodies)


def _leaf(kernel: Kernel) -> str:
    """Return where the value of the primitive action of a link is."""
    return "rows[links[f + 4] + s]" if kernel.tables.many else "links[f + 4]"


def _told(count: int) -> str:
    """Return what a link says of a child, as arguments."""
    return ", ".join(f"links[f + {FIELDS + field}]" for field in range(count))
