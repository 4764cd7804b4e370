"""`affordant check`: a task graph in words, what is wrong with it, what it stores, and what is proved."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hierarchy import ALWAYS, Call, GroundGraph, Task, TaskGraph, table_sizes
from hierarchy.abstraction import prove_abstraction
from hierarchy.abstraction_funnel import discounted_funnels
from hierarchy.check import examine
from hierarchy.text import load_graph, load_world
from worlds import UserError


@dataclass(frozen=True)
class Verdict:
    """What `affordant check` prints, and whether the graph may run."""

    text: str
    well: bool


def check_graph(name: str, world: str | None = None, gamma: float = 1.0) -> Verdict:
    r"""Describe a task graph, check it on its world, and count its values.

    Parameters
    ----------
    name
        A graph's name or the path of its text.
    world
        The world's name. Defaults to the one that the text names.
    gamma
        Discount factor that the graph is to be learnt with. Below 1, a call whose table forgets how long
        the child takes is a finding.

    Raises
    ------
    UserError
        If the graph or the world cannot be read, or gamma is not in (0, 1].

    Examples
    --------
    >>> verdict = check_graph("two_rooms")
    >>> print(verdict.text.splitlines()[0])
    task graph two_rooms on world two_rooms: 4 tasks, 4 primitive actions, 2048 states
    >>> verdict.well
    True
    """
    if not 0 < gamma <= 1:
        raise UserError(f"--gamma {gamma:g}: a discount factor lies above 0 and up to 1; give one that does")
    graph, used = load_graph(name, None if world is None else load_world(world))
    model = used.model()
    lines = [
        f"task graph {graph.name} on world {used.name}: {len(graph.tasks)} tasks, "
        f"{len(graph.actions)} primitive actions, {model.index.size} states",
        *describe(graph),
    ]
    findings, examined = examine(graph, model)
    grounded = None if findings else examined
    if grounded is not None:
        findings = discounted_funnels(grounded, gamma)
    found = [f"findings: {len(findings)}", *(f"  {finding}" for finding in findings)]
    lines += ["", *(found if findings else ["findings: none"])]
    if grounded is not None:
        proof = str(prove_abstraction(grounded, gamma=gamma)).splitlines()
        lines += ["", *_counted(grounded), "", "state abstraction:", *(f"  {line}" for line in proof)]
    return Verdict("\n".join(lines), not findings)


def describe(graph: TaskGraph) -> Iterator[str]:
    r"""Yield a task graph line by line, root first: tasks, parameters, terminations, children with guards.

    Examples
    --------
    >>> from hierarchy import two_rooms
    >>> from worlds import load_layout
    >>> print(*list(describe(two_rooms(load_layout("two_rooms"))))[2:6], sep="\n")
      until  doors = open and robot = goal
      uses   robot, trigger, goal, doors
      do     GotoTrigger(target=trigger) when doors = closed, uses trigger, goal
             GotoDoor(target=D1) when doors = open and robot in room A, uses goal
    """
    for task in sorted(graph.tasks.values(), key=lambda task: task.name != graph.root.name):
        yield ""
        yield task.name + (", the root" if task.name == graph.root.name else "")
        for key, lines in _parts(task):
            for place, line in enumerate(lines):
                yield f"  {'' if place else key:6} {line}"


def _parts(task: Task) -> Iterator[tuple[str, list[str]]]:
    if task.params:
        yield "params", [f"{param} in {{{', '.join(param.domain.labels)}}}" for param in task.params]
    yield "until", [str(task.until)]
    optional = {"goal": task.goal, "within": task.within, "start": task.start}
    yield from ((key, [str(predicate)]) for key, predicate in optional.items() if predicate != ALWAYS)
    if task.pseudo_reward is not None:
        yield "else", [f"pseudo-reward {task.pseudo_reward:g}"]
    yield "uses", [", ".join(task.uses) or "nothing"]
    if all(call == Call(call.child) for call in task.do):
        yield "do", [", ".join(call.child for call in task.do)]
    else:
        yield "do", [_edge(call) for call in task.do]


def _edge(call: Call) -> str:
    guard = "" if call.guard == ALWAYS else f" when {call.guard}"
    own = "" if call.relevant is None else f", uses {', '.join(call.relevant) or 'nothing'}"
    return f"{call}{guard}{own}"


def _counted(grounded: GroundGraph) -> Iterator[str]:
    """Yield the values to store, counted as publications do (Taxi's 632), and those that are ever read."""
    sizes = table_sizes(grounded)
    tasks = sorted(grounded.graph.tasks, key=lambda task: task == grounded.graph.root.name)
    rows = [(f"completions of {task}", sizes.of(task), sizes.read_of(task)) for task in tasks]
    leaves = sum(sizes.leaves.values())
    rows.append(("primitive actions", leaves, leaves))
    rows.append(("all of these", sizes.total, sum(read for _, _, read in rows)))
    rows.append(("flat Q", sizes.flat, sizes.flat))
    width = max(len(what) for what, _, _ in rows)
    yield f"{'values:':{width + 2}}  {'stored':>7}  {'ever read':>9}"
    yield from (f"  {what:{width}}  {stored:>7}  {read:>9}" for what, stored, read in rows)
