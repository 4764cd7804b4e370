"""Kaelbling's landmark maze: what going by landmarks costs, and what a slip does to the graph."""

from hierarchy import check, checked
from hierarchy.hdg import hdg_graph
from planners import Exploration, LearningRate, MaxQ, Settings, flat_field
from worlds.hdg import LandmarkMaze, landmark_model

maze = LandmarkMaze(side=5)
model = landmark_model(maze)
grounded = checked(hdg_graph(maze), model)
root = grounded.root

settings = Settings(rate=LearningRate(every=200), exploration=Exploration(half=200))
learner = MaxQ(grounded, seed=(0,), settings=settings)
starts = [int(state) for state in model.starts.nonzero()[0]]
learner.train(root, starts, episodes=10_000)

shortest = flat_field(model, grounded.node("Root").terminal).distance
learnt = [learner.greedy_steps(root, state) for state in starts]
arrive = [steps for steps in learnt if steps is not None]
print(f"the learnt way arrives from {len(arrive)} of {len(starts)} starts")
means = sum(arrive) / len(arrive), sum(shortest[starts]) / len(starts)
print(f"by {len(maze.landmarks)} landmarks it takes {means[0]:.2f} steps on average, {means[1]:.2f} at best")

slippery = landmark_model(maze, slip=0.2)
for finding in check(hdg_graph(maze), slippery):
    print("with moves that slip:", finding)
print(len(check(hdg_graph(maze, may_leave=True), slippery)), "findings once tasks may leave their region")
