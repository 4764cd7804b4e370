"""An option-critic that sees the maze through the robot's camera: four looks around, as a CNN sees them.

World, graph and learner are those of `affordant learn two_rooms`; only the encoding is another. Where the
robot stands, and whether the doors are open, it can tell from its frames alone.
"""

import numpy as np
import torch

from hierarchy import checked, two_rooms
from perception.cnn import Cnn
from planners import flat_optimum
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.training import OptionCritic
from worlds import ACTIONS, load_layout, maze_model
from worlds.camera import Camera
from worlds.encoding import Encoding
from worlds.twin import Twin

KEPT = 64  # principal components of the views

torch.set_num_threads(1)
maze, camera = load_layout("two_rooms"), Camera()
model = maze_model(maze)
index = model.index

# From every cell, doors closed and open, the robot looks along each of the four actions.
cells, doors = index.variable("robot").values, index.variable("doors").values
with Twin(maze, camera) as twin:
    frames = []
    for cell in cells:
        for door in doors:
            for action in range(len(ACTIONS)):
                twin.stage(cell, action, (), doors_open=door == "open")
                frames.append(twin.frame())
views = Cnn(camera).features(np.stack(frames)).reshape(len(cells) * len(doors), -1).astype(np.float64)
views -= views.mean(axis=0)
left, sizes, _ = np.linalg.svd(views, full_matrices=False)
seen = left[:, :KEPT] * np.sqrt(len(left))  # each component with deviation 1
share = (sizes[:KEPT] ** 2).sum() / (sizes**2).sum()
print(f"{len(frames)} frames; {KEPT} components hold {share:.0%} of the variance")

# The candidates for trigger and goal are told, as the task is; place and doors are seen.
one_hot = Encoding(index)(torch.arange(index.size)).numpy()
told = np.array([name in ("trigger", "goal") for name in Encoding(index).columns])
where = index.column("robot") * len(doors) + index.column("doors")
table = np.concatenate([seen[where], one_hot[:, told]], axis=1).astype(np.float32)
names = ["robot"] * KEPT + [name for name in Encoding(index).columns if name in ("trigger", "goal")]
encoding = Encoding.of_table(index, table, names)

grounded = checked(two_rooms(maze), model)
learner = OptionCritic(grounded, seed=0, config=OptionCriticConfig(total=120_000), encoding=encoding)
starts = np.flatnonzero(model.starts)
best = flat_optimum(model, grounded.node("Root").terminal).value[starts]
for _ in learner.learn():
    if learner.updates % 4 == 0:
        optimal = np.isclose(learner.greedy().returns(starts), best).sum()
        print(f"{learner.steps} steps: optimal from {optimal} of {len(starts)} starts")
        if optimal == len(starts):
            break
