"""The neural target in the paper's experiment: one option-critic, asked for the affordances that MAXQ gives.

Importing this module loads PyTorch and TorchRL.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from comparisons.dynamic import Verdict, judge
from comparisons.eyes import Sight
from comparisons.outputs import Track
from comparisons.robot import Robot, Run
from hierarchy import GroundGraph
from perception.truth import Truth
from planners import LocalRule, Replanner, flat_optimum
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.training import OptionCritic
from planners.option_critic.values import OptionValues
from worlds import Episode, Layout

STEPS: Final = 100_000
"""Environment steps that it learns for."""
_SAME: Final = 1e-6  # steps by which a way may differ from the shortest, for rounding


@dataclass(frozen=True, eq=False)
class Neural:
    """What an option-critic of the paper's graph learnt, and what it affords.

    Parameters
    ----------
    steps
        Environment steps of learning, all pairs together.
    starts, optimal_starts
        Pairs and starting cells, and those from which its greedy policy takes a shortest way.
    example
        The example run of section 6.3 under the local rule by its values, every shape told.
    asked, optimal, same
        Affordances of the random episodes; those in which the local rule by its values picks an action that
        is proved optimal; and those in which it picks what it picks by MAXQ's values.
    """

    steps: int
    starts: int
    optimal_starts: int
    example: Run
    asked: int
    optimal: int
    same: int


def learn_neural(grounded: GroundGraph, seed: int, track: Track, steps: int = STEPS) -> OptionCritic:
    """Return an option-critic that learnt from every state that can be reached.

    Affordances are asked for beside obstacles, and so off the ways that a learner would take from its starts.
    """
    model, terminal = grounded.model, grounded.nodes[grounded.root].terminal
    learner = OptionCritic(
        grounded, seed, OptionCriticConfig(total=steps), starts=model.reachable() & ~terminal
    )
    updates = -(-steps // learner.config.per_update)
    for _ in track(learner.learn(), total=updates, description="learning an option-critic"):
        pass
    return learner


def ask_neural(
    layout: Layout, oracle: Replanner, learner: OptionCritic, verdicts: Sequence[Verdict]
) -> Neural:
    """Hold an option-critic to the oracle, and its affordances to MAXQ's.

    Parameters
    ----------
    layout
        The maze.
    oracle
        Proves or refutes.
    learner
        What has learnt.
    verdicts
        The affordances of the random episodes, with what the local rule picked by MAXQ's values.
    """
    grounded = learner.grounded
    values = OptionValues.of(learner)
    local = LocalRule(layout, values)
    starts = np.flatnonzero(grounded.model.starts)
    best = flat_optimum(grounded.model, grounded.nodes[grounded.root].terminal).value[starts]
    episode = Episode(layout, layout.trigger, layout.goal, layout.start, layout.obstacles)
    asked = [judge(oracle, local, verdict.encounter) for verdict in verdicts]
    found = [(verdict, other) for verdict, other in zip(verdicts, asked, strict=True) if other is not None]
    return Neural(
        steps=learner.steps,
        starts=len(starts),
        optimal_starts=int((np.abs(learner.greedy().returns(starts) - best) < _SAME).sum()),
        example=Robot(layout, grounded, local, Sight(layout, Truth())).run(episode),
        asked=len(found),
        optimal=sum(other.local is not None and other.local.optimal for _, other in found),
        same=sum(_action(verdict) == _action(other) for verdict, other in found),
    )


def _action(verdict: Verdict) -> int | None:
    return None if verdict.local is None else verdict.local.action
