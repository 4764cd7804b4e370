"""A task graph of your own on a maze of your own: declare, check, learn, and compare with the oracle."""

from hierarchy import Param, TaskGraph, checked, mermaid
from planners import MaxQ, gap, recursive_optimum
from worlds import ACTIONS, maze_model, parse_layout

MAZE = """
name corridor
grid
.  T1 .  |  .  .
.  .  .  :  D1 G1
.  X  .  |  .  .
start 2,0
trigger T1
goal G1
"""

maze = parse_layout(MAZE)
model = maze_model(maze)
graph = TaskGraph("fetch", model.index.variables, ACTIONS)
robot, trigger, goal, doors = graph.variables

# One task, used twice: go to a marked cell. Its parameter ranges over every mark that it is called with.
place = Param.over("place", {**maze.triggers, **maze.goals})
goto = graph.task("Goto", place, until=robot.eq(place), uses=[robot], do="North South West East")
graph.task(
    "Root",
    until=doors.eq("open") & robot.eq(goal),
    uses=[robot, trigger, goal, doors],
    do=[goto(place=trigger).when(doors.eq("closed")), goto(place=goal).when(doors.eq("open"))],
)
grounded = checked(graph, model)  # refuses a graph that cannot work, naming the task, the edge and the mend
print(mermaid(graph))

learner = MaxQ(grounded, seed=(0,))
starts = [int(state) for state in model.starts.nonzero()[0]]
learner.train(grounded.root, starts, episodes=1000)
solution = recursive_optimum(grounded)
right = sum(learner.greedy_steps(grounded.root, s) == solution.steps[grounded.root, s] for s in starts)
print(f"learnt steps equal the oracle's from {right} of {len(starts)} starts")
print(f"the hierarchy loses {gap(grounded, solution).total} steps against the flat optimum")
