import numpy as np
import pytest

from hierarchy import TaskGraph, checked
from planners import flat_optimum
from planners.option_critic.config import Ends, OptionCriticConfig
from planners.option_critic.training import OptionCritic
from worlds import StateIndex, TransitionModel, Variable


@pytest.mark.parametrize("terminations", ["given", "prior", "learnt"])
def test_options_that_are_actions_learn(terminations: Ends) -> None:
    """A graph without subtasks is learnt by the critic alone, whatever ends a task; all starts optimal."""
    index = StateIndex((Variable("x", tuple(range(8))),))
    after = np.array([[max(x - 1, 0), min(x + 1, 7)] for x in range(8)])
    model = TransitionModel(index, ("left", "right"), after, np.full(after.shape, -1.0), np.arange(8) < 7)
    graph = TaskGraph("corridor", index.variables, model.actions)
    (x,) = graph.variables
    graph.task("Root", until=x.eq(7), uses=[x], do="left right")
    grounded = checked(graph, model)
    config = OptionCriticConfig(
        terminations=terminations,
        num_envs=16,
        horizon=16,
        minibatch=64,
        hidden=8,
        anneal=10_000,
        total=10_000,
    )
    learner, starts = OptionCritic(grounded, 0, config), np.arange(7)
    best = flat_optimum(model, grounded.nodes[grounded.root].terminal).value[:7]
    assert any(np.allclose(learner.greedy().returns(starts), best) for _ in learner.learn())
