"""What a robot lives in: state variables, mazes, exact transition models, environments, the PyBullet twin."""

from worlds.errors import LayoutError, UserError, suggest
from worlds.finite import WorldError, finite_world
from worlds.layout import (
    ACTIONS,
    DELTAS,
    KINDS,
    SIZES,
    Appears,
    Cell,
    Kind,
    Layout,
    Obstacle,
    Size,
)
from worlds.layout_text import layout_names, load_layout, parse_layout
from worlds.maze import Change, Episode, MazeState, Outcome, Push, ahead, roll, step
from worlds.model import StochasticModelError, TransitionModel, maze_model, maze_variables, state_number
from worlds.randomness import Stream
from worlds.variables import StateIndex, Variable

__all__ = [
    "ACTIONS",
    "DELTAS",
    "KINDS",
    "SIZES",
    "Appears",
    "Cell",
    "Change",
    "Episode",
    "Kind",
    "Layout",
    "LayoutError",
    "MazeState",
    "Obstacle",
    "Outcome",
    "Push",
    "Size",
    "StateIndex",
    "StochasticModelError",
    "Stream",
    "TransitionModel",
    "UserError",
    "Variable",
    "WorldError",
    "ahead",
    "finite_world",
    "layout_names",
    "load_layout",
    "maze_model",
    "maze_variables",
    "parse_layout",
    "roll",
    "state_number",
    "step",
    "suggest",
]
