"""Many mazes as one Gymnasium vector environment. Importing this module loads numba."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from worlds.batch_kernels import STEPS
from worlds.batch_reference import StreamedMazeEnv, checked_count, checked_seed
from worlds.batched import DISABLED, NEXT_STEP, SAME_STEP, Flags, MazeBatch, Stepped
from worlds.errors import UserError, suggest
from worlds.layout import ACTIONS, Layout
from worlds.maze import Outcome

Observations = NDArray[np.int32]
Rewards = NDArray[np.float64]
Info = dict[str, Any]

_LISTED: Final = 12  # a batch has many environments
_MODES: Final = {
    AutoresetMode.DISABLED: DISABLED,
    AutoresetMode.SAME_STEP: SAME_STEP,
    AutoresetMode.NEXT_STEP: NEXT_STEP,
}


class MazeVectorEnv(VectorEnv[Observations, NDArray[np.integer[Any]], NDArray[Any]]):
    """`num_envs` mazes, each as `MazeEnv` describes it, stepped by one kernel.

    Environment i in its episode e draws from ``Stream(seed, i, e)`` alone, so that it is the same among any
    number of others. `reset` begins the next episode of every environment, and with a seed its episode 0.

    What `step` returns is the caller's: it is written once and not again. ``info["steps"]`` counts each
    episode's steps; ``info["outcome"]`` names the ends, in the step that ends them. As everywhere in
    Gymnasium, ``info["_steps"]`` and so on say which environments an entry is about.

    Parameters
    ----------
    num_envs
        How many mazes.
    layout, obstacles, trigger, goal, start, max_steps, most_obstacles
        As for `MazeEnv`.
    autoreset_mode
        When an environment whose episode is over begins the next one: Gymnasium's ``AutoresetMode`` or its
        value. "SameStep": at once; the observation is the new episode's, and ``info["final_obs"]`` and
        ``info["final_info"]`` hold the old one's last. "NextStep": in place of its next step, which earns 0.
        "Disabled": by ``reset(options={"reset_mask": ...})``, without which the next step is refused.
    action_masks
        Whether to give ``info["action_mask"]``, shape (num_envs, 4), int8: 1 for the actions that would move
        the robot.

    Raises
    ------
    UserError
        If an argument names something that is not there.

    Examples
    --------
    >>> envs = MazeVectorEnv(3, trigger="T4", goal="G2", start=(1, 0))
    >>> observations, info = envs.reset(seed=1)
    >>> observations, rewards, terminated, truncated, info = envs.step(np.array([0, 1, 3]))
    >>> observations[:, 0], rewards, info["steps"]
    (array([ 0, 16,  9], dtype=int32), array([-1., -1., -1.]), array([1, 1, 1], dtype=int32))
    """

    def __init__(
        self,
        num_envs: int = 1,
        layout: str | Path | Layout = "two_rooms",
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        action_masks: bool = False,
        **arguments: Any,
    ) -> None:
        self.num_envs = checked_count(num_envs)
        one = StreamedMazeEnv(layout, **arguments)
        if one.render_mode is not None:
            raise UserError(
                f"render_mode {one.render_mode!r} is not possible; draw a single worlds.env.MazeEnv instead"
            )
        self._mode = _mode(autoreset_mode)
        self.metadata = {"render_modes": [], "autoreset_mode": self._mode}
        self.single_observation_space = gymnasium.spaces.MultiDiscrete(
            one.observation_space.nvec,  # type: ignore[attr-defined]
            dtype=np.int32,  # type: ignore[arg-type]  # any integers will do
        )
        self.single_action_space = one.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.batch = MazeBatch(one, num_envs, masks=action_masks)
        self._masked = action_masks
        self._all = np.ones(num_envs, dtype=np.bool_)
        self._over: Flags | None = None  # episodes to be reset by hand
        self._begun = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Info]:
        """Begin an episode in each environment.

        Parameters
        ----------
        seed
            Names the episodes to come, from episode 0. None goes on; at first, it draws a seed.
        options
            "trigger", "goal" and "start" for these episodes alone, as in the constructor; "reset_mask",
            shape (num_envs,), bool, for the environments that are meant, all others staying as they are.

        Raises
        ------
        UserError
            If an option is unknown or wrong, or the seed is no integer of 0 or more.
        """
        given = dict(options or {})
        chosen = self._chosen(given.pop("reset_mask", None))
        wanted = self.batch.one.wanted(given)
        if seed is not None:
            seed = checked_seed(seed)
        super().reset(seed=seed)
        if seed is None and not self._begun:
            drawn = self.np_random_seed  # which draws one
            assert drawn is not None, "Gymnasium gives a seed"
            self.batch.seed(drawn)
        elif seed is not None:
            self.batch.seed(seed, chosen)
        if not (self._begun or chosen.all()):
            raise UserError("reset_mask leaves environments out that have not begun; reset them all first")
        observations, masks = self.batch.reset(chosen, wanted)
        self._begun = True
        if self._over is not None:
            left = self._over & ~chosen
            self._over = left if left.any() else None
        return observations, self._info(chosen, masks)

    def step(self, actions: NDArray[np.integer[Any]]) -> tuple[Observations, Rewards, Flags, Flags, Info]:
        """Carry out an action in each environment.

        Parameters
        ----------
        actions
            Integers of 0 to 3, shape (num_envs,).

        Returns
        -------
        observations, rewards, terminations, truncations, info
            Shapes (num_envs, 8), int32; (num_envs,), float64; (num_envs,), bool, twice.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first `reset`; with autoreset disabled, also while an episode is over.
        UserError
            If the actions are none, or not one for each environment.
        """
        if not self._begun:
            raise gymnasium.error.ResetNeeded("no episode is running; call reset() before step()")
        if self._over is not None:
            over = np.flatnonzero(self._over).tolist()
            more = ", ..." if len(over) > _LISTED else ""
            raise gymnasium.error.ResetNeeded(
                f"the episodes of environments {', '.join(map(str, over[:_LISTED]))}{more} are over;"
                " call reset(options={'reset_mask': ...})"
            )
        stepped = self.batch.step(actions, _MODES[self._mode])
        info = self._info(self._all, stepped.masks)
        if len(stepped.ended):
            self._tell_ends(stepped, info)
        return (
            stepped.observations,
            stepped.rewards,
            stepped.terminated,
            stepped.truncated,
            info,
        )

    def _chosen(self, mask: Any) -> Flags:
        if mask is None:
            return self._all
        good = isinstance(mask, np.ndarray) and mask.dtype == np.bool_ and mask.shape == (self.num_envs,)
        if not good or not mask.any():
            raise UserError(
                f"reset_mask {mask!r} is not possible; give an array of bool of shape ({self.num_envs},),"
                " True where an environment is to be reset"
            )
        return np.ascontiguousarray(mask)

    def _info(self, chosen: Flags, masks: NDArray[np.int8]) -> Info:
        told = chosen.copy()
        info = {"steps": self.batch.state[:, STEPS].copy(), "_steps": told}
        if self._masked:
            info |= {"action_mask": masks, "_action_mask": told}
        if chosen is not self._all:  # as Gymnasium does, zero where nothing was reset
            for name in ("steps", "action_mask")[: 1 + self._masked]:
                info[name][~chosen] = 0
        return info

    def _tell_ends(self, stepped: Stepped, info: Info) -> None:
        """Add to an info how episodes ended and, where the next have begun already, what they last saw."""
        over = stepped.terminated | stepped.truncated
        ended = stepped.ended.tolist()
        outcome = np.empty(self.num_envs, dtype=object)  # of None
        for i, reached in zip(ended, stepped.terminated[stepped.ended].tolist(), strict=True):
            outcome[i] = Outcome.REACHED if reached else Outcome.TRUNCATED
        told = {"outcome": outcome, "_outcome": over}
        if self._mode is AutoresetMode.DISABLED:
            self._over = over.copy()
        if self._mode is not AutoresetMode.SAME_STEP:
            info |= told
            return
        last = stepped.last.copy()
        final = np.empty(self.num_envs, dtype=object)
        for i, row in zip(ended, last[:, :-1], strict=True):
            final[i] = row
        steps = np.zeros(self.num_envs, dtype=np.int32)
        steps[stepped.ended] = last[:, -1]
        told |= {"steps": steps, "_steps": over}
        if self._masked:
            masks = np.zeros((self.num_envs, len(ACTIONS)), dtype=np.int8)
            masks[stepped.ended] = stepped.last_masks
            told |= {"action_mask": masks, "_action_mask": over}
        info |= {"final_obs": final, "_final_obs": over}
        info |= {"final_info": told, "_final_info": over}


def _mode(value: Any) -> AutoresetMode:
    try:
        return AutoresetMode(value)
    except ValueError:
        modes = [mode.value for mode in AutoresetMode]
        raise UserError(f"autoreset_mode {value!r} is not possible; {suggest(str(value), modes)}") from None
