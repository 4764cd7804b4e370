"""Gymnasium ids of this package's environments; importing this module registers them.

Gymnasium 1.0 gave up finding environments by entry point. ``gymnasium.make`` imports the module that
stands before a colon instead, so that no other import is needed:
``gymnasium.make("worlds.registration:affordant/TwoRooms-v0")``.
"""

from __future__ import annotations

from typing import Any, Final

import gymnasium

ENVIRONMENTS: Final[dict[str, dict[str, Any]]] = {
    "affordant/TwoRooms-v0": {"layout": "two_rooms", "obstacles": "none"},
    "affordant/TwoRoomsObstacles-v0": {"layout": "two_rooms", "obstacles": "random"},
}
"""Each registered id and the arguments that it gives to `worlds.env.MazeEnv`."""


def register() -> None:
    """Register every id of `ENVIRONMENTS` that Gymnasium does not know yet.

    Examples
    --------
    >>> register()
    >>> env = gymnasium.make("affordant/TwoRooms-v0", trigger="T4", goal="G2", start=(1, 0))
    >>> observation, info = env.reset()
    >>> observation  # robot's cell, trigger, goal, doors, what is North, South, West and East
    array([8, 3, 1, 0, 0, 0, 1, 0])
    """
    for name, arguments in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name,
                entry_point="worlds.quick_env:QuickMazeEnv",
                vector_entry_point="worlds.vector_env:MazeVectorEnv",
                kwargs=arguments,
            )


register()
