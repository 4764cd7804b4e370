"""Everything that turns a ground graph and a world into behaviour: MAXQ, the oracle, affordances."""

from planners.affordance import Affordance, LocalRule, Replanning, Strategy
from planners.exploration import Boltzmann, Exploration, Explorer, boltzmann, first_best
from planners.fields import UNREACHED, Field, certify, distance_field, flat_field, task_field
from planners.flat import FlatQ, flattened
from planners.gaps import Gap, GapReport, Shortfall, gap, gap_report
from planners.hsmq import HSMQ
from planners.learner import EpisodeTooLongError, Learner, Settings
from planners.maxq import MaxQ
from planners.maxq_q import MaxQQ
from planners.polled import polled_action, polled_route, polled_steps
from planners.proof import Proof, prove
from planners.recursive import Solution, recursive_optimum
from planners.schedules import HarmonicRate, LearningRate, Rate
from planners.search import Area, Plan, Replanner, verify
from planners.smdp import EndlessRewardError, Optimum, best_policy
from planners.stack import StackProblem, StackSolution, flat_optimum, hierarchical_optimum, stack_problem

__all__ = [
    "HSMQ",
    "UNREACHED",
    "Affordance",
    "Area",
    "Boltzmann",
    "EndlessRewardError",
    "EpisodeTooLongError",
    "Exploration",
    "Explorer",
    "Field",
    "FlatQ",
    "Gap",
    "GapReport",
    "HarmonicRate",
    "Learner",
    "LearningRate",
    "LocalRule",
    "MaxQ",
    "MaxQQ",
    "Optimum",
    "Plan",
    "Proof",
    "Rate",
    "Replanner",
    "Replanning",
    "Settings",
    "Shortfall",
    "Solution",
    "StackProblem",
    "StackSolution",
    "Strategy",
    "best_policy",
    "boltzmann",
    "certify",
    "distance_field",
    "first_best",
    "flat_field",
    "flat_optimum",
    "flattened",
    "gap",
    "gap_report",
    "hierarchical_optimum",
    "polled_action",
    "polled_route",
    "polled_steps",
    "prove",
    "recursive_optimum",
    "stack_problem",
    "task_field",
    "verify",
]
