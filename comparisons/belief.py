"""What the robot knows: obstacles that it saw, felt, or watched roll."""

from __future__ import annotations

from dataclasses import replace

from perception.protocol import REACH, Detection
from worlds import Change, Episode, Layout, MazeState, ahead


class Belief:
    """The robot's knowledge of one episode, as the maze state that it plans in.

    Walls, doors, its own cell, its trigger and its goal it always knows. An obstacle it knows from a
    look ahead, from a move that failed, or from watching a sphere that it pushed come to rest. Touch
    outweighs sight: a look does not change what a failed move has shown.
    """

    def __init__(self, layout: Layout, episode: Episode) -> None:
        self.layout = layout
        state = episode.state
        self.state = MazeState(state.robot, state.trigger, state.goal, state.doors_open)
        self._touched: frozenset[int] = frozenset()

    def see(self, action: int, detection: Detection) -> int | None:
        """Take in a look ahead in the direction of `action`; return the cell of the obstacle in view.

        What is seen beyond a wall or a shut door cannot be there and is not believed. A touched obstacle
        stays, is in view whatever was seen, and hides what is behind it.
        """
        view = [ahead(self.layout, self.state, action, distance) for distance in range(1, REACH + 1)]
        at = None
        if detection.label != "none":
            at = view[detection.distance - 1]
            if at < 0:
                return None
            view = view[: detection.distance]
        for cell in view:
            if cell in self._touched:
                return cell
            self._set(cell, detection.label if cell == at else "none")
        return at

    def feel(self, change: Change, robot: int, *, doors_open: bool) -> None:
        """Take in what a move did: where the robot now is, what it pushed, or what stopped it."""
        front = ahead(self.layout, self.state, change.action, 1)
        behind = ahead(self.layout, self.state, change.action, 2)
        if change.moved:
            self.state = replace(self.state, robot=robot, doors_open=doors_open)
            self._set(front, "none")
            if change.push is not None:
                self._set(change.push.end, "sphere")
        elif front in self.state.spheres and behind >= 0 and not self._known(behind):
            self._touch(behind)  # a sphere that should have rolled: something unseen holds it
        elif front >= 0:
            self._touch(front)

    def misjudges(self, truth: MazeState) -> bool:
        """Return whether something was seen, and is still believed, where another thing or nothing is."""
        cubes, spheres = self.state.cubes - self._touched, self.state.spheres - self._touched
        return not (cubes <= truth.cubes and spheres <= truth.spheres)

    def corrected(self, truth: MazeState) -> MazeState:
        """Return the state with every known obstacle as it really is."""
        known = self.state.cubes | self.state.spheres
        return replace(self.state, cubes=known & truth.cubes, spheres=known & truth.spheres)

    def _known(self, cell: int) -> bool:
        return cell in self.state.cubes or cell in self.state.spheres

    def _touch(self, cell: int) -> None:
        self._set(cell, "cube")
        self._touched |= {cell}

    def _set(self, cell: int, label: str) -> None:
        """Believe a cell to hold what `label` says; a touched cell that changes is touched no more."""
        cubes, spheres = self.state.cubes - {cell}, self.state.spheres - {cell}
        if label == "cube":
            cubes |= {cell}
        elif label == "sphere":
            spheres |= {cell}
        self.state = replace(self.state, cubes=cubes, spheres=spheres)
        self._touched -= {cell}
