"""Dietterich's Taxi: declare, check, learn with MAXQ-0, and hold what is learnt against the exact optimum."""

from hierarchy import checked, mermaid
from hierarchy.taxi import taxi_graph
from planners import Exploration, LearningRate, MaxQ, Settings, flat_field
from worlds import Stream
from worlds.taxi import taxi_model

model = taxi_model()
graph = taxi_graph(model)
grounded = checked(graph, model)
print(mermaid(graph))

settings = Settings(rate=LearningRate(every=100), exploration=Exploration(half=100))
learner = MaxQ(grounded, seed=(0,), settings=settings)
starts = [int(state) for state in model.starts.nonzero()[0]]
learner.train(grounded.root, starts, episodes=3000)

# The best is never to err: every step but the last costs 1, and the last one brings 20.
steps = flat_field(model, grounded.node("Root").terminal).distance
sample = Stream(1).shuffled(starts)[:100]
optimal = sum(learner.greedy_steps(grounded.root, state) == steps[state] for state in sample)
print(f"greedy steps are optimal from {optimal} of {len(sample)} sampled starts")
error = max(abs(learner.value(grounded.root, state) - (21 - steps[state])) for state in starts)
print(f"over all {len(starts)} starts the learnt value is off by {error:.3f} at most")
