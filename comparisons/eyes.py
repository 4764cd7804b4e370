"""What a robot sees with: the truth, or a perception backend on the twin's camera."""

from __future__ import annotations

from perception.protocol import NOTHING, REACH, Backend, Detection, Frame, View
from worlds import Change, Episode, Layout, MazeState, ahead
from worlds.twin import Twin


def truth_ahead(layout: Layout, state: MazeState, action: int) -> Detection:
    """Return what really stands ahead: the nearest obstacle within reach, not past a wall or shut door.

    Examples
    --------
    >>> from worlds import load_layout
    >>> maze = load_layout("two_rooms")
    >>> state = MazeState(robot=8, trigger=49, goal=31, spheres=frozenset({24}))
    >>> truth_ahead(maze, state, 1)
    Detection(label='sphere', confidence=1.0, distance=2)
    """
    for distance in range(1, REACH + 1):
        cell = ahead(layout, state, action, distance)
        if cell < 0:
            break
        if cell in state.cubes:
            return Detection("cube", 1.0, distance)
        if cell in state.spheres:
            return Detection("sphere", 1.0, distance)
    return NOTHING


class Sight:
    """A robot's eye: a backend, on the twin's frames where there is a twin.

    Parameters
    ----------
    layout
        The maze.
    backend
        Tells shapes.
    twin
        Carries the episode out in physics and renders it; without one, the backend must need no frames.

    Raises
    ------
    ValueError
        If the backend needs frames and there is no twin.
    """

    def __init__(self, layout: Layout, backend: Backend, twin: Twin | None = None) -> None:
        if backend.needs_frames and twin is None:
            raise ValueError(f"backend {backend.name!r} needs frames; give it a twin")
        self.layout = layout
        self.backend = backend
        self.twin = twin
        self.frame: Frame | None = None
        """The last frame looked at, None if the backend needs none."""

    def begin(self, episode: Episode) -> None:
        """Take up an episode."""
        if self.twin is not None:
            self.twin.begin(episode)

    def look(self, episode: Episode, action: int) -> Detection:
        """Turn towards `action` and tell what stands ahead."""
        if self.twin is not None and self.backend.needs_frames:
            self.twin.face(action)
            self.frame = self.twin.frame()
        view = View(self.frame, truth_ahead(self.layout, episode.state, action))
        return self.backend.detect([view])[0]

    def follow(self, episode: Episode, change: Change) -> None:
        """Let physics carry out a step of the episode."""
        if self.twin is not None:
            self.twin.carry_out(episode, change)
