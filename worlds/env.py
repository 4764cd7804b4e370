"""The maze as a Gymnasium environment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import index
from pathlib import Path
from typing import Any, Final, TypeVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from worlds.appearing import random_obstacles, shortest_way
from worlds.drawing import Picture, draw_maze
from worlds.errors import UserError, suggest
from worlds.layout import ACTIONS, Cell, Layout, Obstacle
from worlds.layout_text import load_layout
from worlds.maze import Episode, MazeState, Outcome, step
from worlds.randomness import Stream

OBSTACLES: Final = ("none", "layout", "random")
"""What may appear: nothing, the obstacles of the layout, or obstacles drawn at each reset."""
FREE, SHUT, CUBE, SPHERE = range(4)
"""What can be next to the robot: free floor, a wall or shut door, a cube, a sphere."""
_OPTIONS: Final = ("trigger", "goal", "start")
_RENDER_MODES: Final = ("rgb_array",)

T = TypeVar("T")
Observation = NDArray[np.int64]
Info = dict[str, Any]


class MazeEnv(gymnasium.Env[Observation, np.int64]):
    """A robot that has to reach a trigger and then, through the doors that it opens, a goal.

    An action is a number: 0 North, 1 South, 2 West, 3 East. Every step costs 1. An episode terminates
    at the goal, doors open, and is truncated after `max_steps`; a maze whose obstacles leave no route
    runs on until then.

    An observation holds eight numbers: the robot's cell (`Layout.number`), the places of the trigger
    and the goal among the layout's, whether the doors are open, and what is North, South, West and
    East of the robot: 0 free floor, 1 a wall or shut door, 2 a cube, 3 a sphere.

    ``info["action_mask"]``, shape (4,), int8, is 1 for the actions that would move the robot (all may
    be 0); ``info["steps"]`` counts; ``info["outcome"]`` is there at the end, a value of `Outcome`.

    Parameters
    ----------
    layout
        A layout, its name or the path of its file.
    obstacles
        One of `OBSTACLES`.
    trigger, goal
        Names of marks; None draws one at each reset.
    start
        The robot's first cell, as (row, column); None draws one at each reset, from the layout's start
        room less the trigger.
    max_steps
        Length at which an episode is truncated.
    most_obstacles
        With random obstacles, each episode draws 1 to this many.
    render_mode
        None, or "rgb_array": `render` then returns a picture from above.

    Raises
    ------
    UserError
        If an argument names something that is not there.

    Examples
    --------
    >>> env = MazeEnv("two_rooms", trigger="T4", goal="G2", start=(1, 0), obstacles="layout")
    >>> observation, info = env.reset(seed=1)
    >>> info["action_mask"]
    array([1, 1, 0, 1], dtype=int8)
    >>> env.step(1)[0]  # South: the sphere S1 is now ahead
    array([16,  3,  1,  0,  0,  3,  1,  0])
    """

    # Gymnasium declares it as an instance variable, which mypy holds us to.
    metadata: dict[str, Any] = {"render_modes": list(_RENDER_MODES), "render_fps": 8}  # noqa: RUF012

    def __init__(
        self,
        layout: str | Path | Layout = "two_rooms",
        *,
        obstacles: str = "none",
        trigger: str | None = None,
        goal: str | None = None,
        start: Sequence[int] | None = None,
        max_steps: int = 200,
        most_obstacles: int = 6,
        render_mode: str | None = None,
    ) -> None:
        self.layout = layout if isinstance(layout, Layout) else load_layout(layout)
        _hold(obstacles in OBSTACLES, "obstacles", obstacles, suggest(str(obstacles), OBSTACLES))
        _hold(
            render_mode is None or render_mode in _RENDER_MODES,
            "render_mode",
            render_mode,
            f"use None or {_RENDER_MODES[0]!r}",
        )
        _hold(max_steps >= 1, "max_steps", max_steps, "give 1 or more")
        if obstacles == "random":
            room = len(self.layout.cells) - len(self.layout.solid) - 3  # start, trigger and goal stay free
            _hold(1 <= most_obstacles <= room, "most_obstacles", most_obstacles, f"give 1 to {room}")
        self.obstacles = obstacles
        self.max_steps = max_steps
        self.most_obstacles = most_obstacles
        self.render_mode = render_mode
        self._starts = tuple(sorted(self.layout.room(self.layout.start)))
        self._fixed = self._checked({"trigger": trigger, "goal": goal, "start": start})
        self.episode: Episode | None = None
        self._done = True
        marks = (len(self.layout.triggers), len(self.layout.goals))
        self.action_space = gymnasium.spaces.Discrete(len(ACTIONS))
        self.observation_space = gymnasium.spaces.MultiDiscrete(
            [len(self.layout.cells), *marks, 2, *[SPHERE + 1] * len(ACTIONS)]
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Begin an episode.

        Parameters
        ----------
        seed
            Seeds the environment's generator; None lets it run on.
        options
            "trigger", "goal" and "start" for this episode alone, as in the constructor.

        Raises
        ------
        UserError
            If an option is unknown, or names something that is not there.
        """
        super().reset(seed=seed)
        wanted = self._checked({**self._fixed, **(options or {})})
        trigger, goal, start = self._draw(wanted)
        obstacles = self._draw_obstacles(trigger, goal, start)
        self.episode = Episode(self.layout, trigger, goal, start, obstacles)
        self._done = False
        return self._observation(self.episode.state), self._info(self.episode)

    def step(self, action: int | np.int64) -> tuple[Observation, float, bool, bool, Info]:
        """Carry out an action; return observation, reward, terminated, truncated and info.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first `reset`, and after an episode's end.
        gymnasium.error.InvalidAction
            If the action is not 0, 1, 2 or 3.
        """
        episode = self.episode
        if episode is None or self._done:
            raise gymnasium.error.ResetNeeded("no episode is running; call reset() before step()")
        if not self.action_space.contains(action):
            raise gymnasium.error.InvalidAction(f"{action!r} is not an action; give 0 to {len(ACTIONS) - 1}")
        episode.step(int(action))
        terminated = episode.reached
        truncated = not terminated and episode.steps >= self.max_steps
        info = self._info(episode)
        if terminated or truncated:
            info["outcome"] = Outcome.REACHED if terminated else Outcome.TRUNCATED
            self._done = True
        return self._observation(episode.state), -1.0, terminated, truncated, info

    def render(self) -> Picture | None:
        """Return a picture of the maze from above, or None without a render mode.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first `reset`.
        """
        if self.render_mode is None:
            return None
        if self.episode is None:
            raise gymnasium.error.ResetNeeded("there is nothing to draw; call reset() before render()")
        episode = self.episode
        looks = {cell: episode.obstacles[name] for name, cell in episode.placed.items()}
        return draw_maze(self.layout, episode.state, looks)

    def _checked(self, options: Mapping[str, Any]) -> dict[str, Any]:
        """Return options whose names and values are known to be good; the start as a `Cell`."""
        for name in options:
            if name not in _OPTIONS:
                raise UserError(f"unknown option {name!r}; {suggest(str(name), _OPTIONS)}")
        for name, marks in (("trigger", self.layout.triggers), ("goal", self.layout.goals)):
            value = options[name]
            _hold(value is None or value in tuple(marks), name, value, suggest(str(value), marks))
        start = None if options["start"] is None else self._start_cell(options["start"])
        if start is not None:
            trigger = options["trigger"]
            others = set(
                self.layout.triggers.values() if trigger is None else [self.layout.triggers[trigger]]
            )
            _hold(bool(others - {start}), "start", start, "it is the trigger's cell; choose another")
        return {**options, "start": start}

    def _start_cell(self, value: Any) -> Cell:
        try:
            row, col = (index(part) for part in value)
        except (TypeError, ValueError):
            raise UserError(f"start {value!r}: give a cell as (row, column)") from None
        cell = Cell(row, col)
        mend = (
            f"choose a cell that {self.layout.start} connects to with doors shut, such as {self.layout.start}"
        )
        _hold(cell in self._starts, "start", cell, mend)
        return cell

    def _draw(self, wanted: Mapping[str, Any]) -> tuple[str, str, Cell]:
        """Return this episode's trigger, goal and start, drawing those that are not given."""
        layout, start = self.layout, wanted["start"]
        triggers = [name for name, cell in layout.triggers.items() if cell != start]
        trigger = wanted["trigger"] or self._choose(triggers)
        goal = wanted["goal"] or self._choose(list(layout.goals))
        if start is None:
            start = self._choose([cell for cell in self._starts if cell != layout.triggers[trigger]])
        return trigger, goal, start

    def _choose(self, items: Sequence[T]) -> T:
        return items[int(self.np_random.integers(len(items)))]

    def _draw_obstacles(self, trigger: str, goal: str, start: Cell) -> tuple[Obstacle, ...]:
        if self.obstacles == "none":
            return ()
        if self.obstacles == "layout":
            return self.layout.obstacles
        ends = (start, self.layout.triggers[trigger], self.layout.goals[goal])
        stream = Stream(int(self.np_random.integers(1 << 63, dtype=np.uint64)))
        count = 1 + stream.below(self.most_obstacles)
        way = shortest_way(self.layout, *ends)
        return random_obstacles(self.layout, stream, count, way, keep_free=frozenset(ends))

    def _observation(self, state: MazeState) -> Observation:
        cells = self.layout.cells
        trigger = list(self.layout.triggers.values()).index(cells[state.trigger])
        goal = list(self.layout.goals.values()).index(cells[state.goal])
        around = (self._beside(state, action) for action in range(len(ACTIONS)))
        return np.array([state.robot, trigger, goal, state.doors_open, *around], dtype=np.int64)

    def _beside(self, state: MazeState, action: int) -> int:
        to = self.layout.passage(state.robot, action, doors_open=state.doors_open)
        if to < 0:
            return SHUT
        if to in state.cubes:
            return CUBE
        return SPHERE if to in state.spheres else FREE

    def _info(self, episode: Episode) -> Info:
        state = episode.state
        moves = [step(self.layout, state, action)[0].robot != state.robot for action in range(len(ACTIONS))]
        return {"action_mask": np.array(moves, dtype=np.int8), "steps": episode.steps}


def _hold(condition: bool, name: str, value: object, mend: str) -> None:
    """Refuse what a user gave unless a condition holds."""
    if not condition:
        shown = str(value) if isinstance(value, Cell) else repr(value)
        raise UserError(f"{name} {shown} is not possible; {mend}")
