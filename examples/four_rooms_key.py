"""A world and a task graph of your own: four rooms, a key in one of three, a locked gate to the fourth."""

from hierarchy import Param, TaskGraph, checked
from planners import LearningRate, MaxQ, Settings, flat_field
from worlds import ACTIONS, DELTAS, Cell, Variable, finite_world
from worlds.finite import State

ROOMS = """
...#..K
.......
...#...
#.#####
...#...
...+...
K..#..G
"""
cells = {Cell(row, col): mark for row, line in enumerate(ROOMS.split()) for col, mark in enumerate(line)}
floor = tuple(cell for cell, mark in cells.items() if mark != "#")
GATE, GOAL, BEFORE = Cell(5, 3), Cell(6, 6), Cell(5, 2)
hooks = (Cell(0, 0), *(cell for cell, mark in cells.items() if mark == "K"))

variables = [
    Variable("robot", floor, tuple(map(str, floor))),
    Variable("key", (*hooks, "held"), (*map(str, hooks), "held")),
    Variable("gate", ("locked", "open")),
]


def outcomes(state: State, action: str) -> tuple[dict[str, object], float]:
    """Return what changes and the reward: every action costs 1."""
    if action == "Take":
        return ({"key": "held"} if state.robot == state.key else {}), -1
    if action == "Unlock":
        return ({"gate": "open"} if state.robot == BEFORE and state.key == "held" else {}), -1
    rows, cols = DELTAS[ACTIONS.index(action)]
    to = Cell(state.robot.row + rows, state.robot.col + cols)
    free = to in floor and (to != GATE or state.gate == "open")
    return ({"robot": to} if free else {}), -1


def starts(state: State) -> bool:
    """Return whether an episode may begin here: outside the fourth room, the key on its hook."""
    return state.key != "held" and state.gate == "locked" and (state.robot.row < 3 or state.robot.col < 3)


model = finite_world(variables, (*ACTIONS, "Take", "Unlock"), outcomes, starts)

graph = TaskGraph("four rooms", model.index.variables, model.actions)
robot, key, gate = graph.variables
place = Param.over("place", {**{f"hook {cell}": cell for cell in hooks}, "gate": BEFORE, "goal": GOAL})
goto = graph.task("Goto", place, until=robot.eq(place), uses=[robot, gate], do="North South West East")
to_hooks = [goto(place=cell).when(key.eq(cell)) for cell in hooks]
fetch = graph.task("Fetch", until=key.eq("held"), uses=[robot, key, gate], do=[*to_hooks, "Take"])
enter = graph.task("Open", until=gate.eq("open"), uses=[robot, gate], do=[goto(place=BEFORE), "Unlock"])
graph.task(
    "Root",
    until=robot.eq(GOAL),
    uses=[robot, key, gate],
    do=[
        fetch().when(key.ne("held")),
        enter().when(key.eq("held") & gate.eq("locked")),
        goto(place=GOAL).when(gate.eq("open")),
    ],
)
grounded = checked(graph, model)

learner = MaxQ(grounded, seed=(0,), settings=Settings(rate=LearningRate(every=100)))
first = [int(state) for state in model.starts.nonzero()[0]]
learner.train(grounded.root, first, episodes=2000)
shortest = flat_field(model, grounded.node("Root").terminal).distance
optimal = sum(learner.greedy_steps(grounded.root, state) == shortest[state] for state in first)
print(f"{model.index.size} states; the learnt way is a shortest one from {optimal} of {len(first)} starts")
