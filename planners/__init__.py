"""Everything that turns a ground graph and a world into behaviour: MAXQ, the oracle, affordances."""

from planners.affordance import Affordance, LocalRule, Replanning, Strategy
from planners.fields import UNREACHED, Field, certify, distance_field, flat_field, task_field
from planners.maxq import EpisodeTooLongError, MaxQ, Settings
from planners.proof import Proof, prove
from planners.recursive import NEVER, Gap, Solution, gap, recursive_optimum
from planners.schedules import Exploration, LearningRate
from planners.search import Area, Plan, Replanner, verify

__all__ = [
    "NEVER",
    "UNREACHED",
    "Affordance",
    "Area",
    "EpisodeTooLongError",
    "Exploration",
    "Field",
    "Gap",
    "LearningRate",
    "LocalRule",
    "MaxQ",
    "Plan",
    "Proof",
    "Replanner",
    "Replanning",
    "Settings",
    "Solution",
    "Strategy",
    "certify",
    "distance_field",
    "flat_field",
    "gap",
    "prove",
    "recursive_optimum",
    "task_field",
    "verify",
]
