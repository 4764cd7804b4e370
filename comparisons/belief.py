"""What the robot knows: obstacles that it saw, felt, or watched roll."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from perception.protocol import REACH, Chances, Detection
from worlds import Change, Episode, Layout, MazeState, ahead

_NONE: Final[Chances] = (1.0, 0.0, 0.0)
_CUBE: Final[Chances] = (0.0, 1.0, 0.0)
_SPHERE: Final[Chances] = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Filter:
    """How looks are added up: a Bayes filter over none, cube and sphere for each cell.

    Parameters
    ----------
    prior
        Shares of none, cube and sphere among the frames that backends are calibrated on. A look's
        likelihood is its probabilities divided by them, and a cell that was never seen starts from them,
        so that the first look is believed as it is.
    appears
        Chance that a free cell holds an obstacle the next time it is looked at; also that something
        unseen stands behind a sphere.
    goes, turns
        Chance that an obstacle is no longer there, and that it has become one of the other shape. The
        first is rare and the second does not happen; both stand for errors that come again from frame to
        frame, so that no number of looks is ever beyond doubt.

    Examples
    --------
    Two looks outweigh one.

    >>> cell = Filter()
    >>> once = cell.look(cell.prior, (0.125, 0.75, 0.125))
    >>> twice = cell.look(cell.look(once, (0.125, 0.75, 0.125)), (0.125, 0.125, 0.75))
    >>> [round(chance, 2) for chance in twice]
    [0.02, 0.84, 0.14]
    """

    prior: Chances = (1 / 3, 1 / 3, 1 / 3)
    appears: float = 0.1
    goes: float = 0.02
    turns: float = 0.01

    def later(self, chances: Chances) -> Chances:
        """Return what is believed of a cell some time after it was believed to be so."""
        none, cube, sphere = chances
        stays = 1 - self.goes - self.turns
        return (
            none * (1 - self.appears) + (cube + sphere) * self.goes,
            none * self.appears / 2 + cube * stays + sphere * self.turns,
            none * self.appears / 2 + cube * self.turns + sphere * stays,
        )

    def look(self, before: Chances, said: Chances) -> Chances:
        """Return what is believed of a cell after a look, given what was believed of it just before."""
        weights = [b * s / p for b, s, p in zip(before, said, self.prior, strict=True)]
        return _normalised(*weights)


class Belief:
    """The robot's knowledge of one episode, as the maze state that it plans in.

    Walls, doors, its own cell, its trigger and its goal it always knows. An obstacle it knows from looks
    ahead, from a move that failed, or from watching a sphere that it pushed come to rest. Looks are added
    up (`Filter`). Touch outweighs sight: a look does not change what a failed move has shown.

    After a failed move the belief agrees that it fails: something that stops it is touched that was not
    touched before. A touched cell is given up only where the robot or a sphere has entered it, or, if it
    was inferred from a sphere that did not roll, when that turns out to be a cube, which is touched then.

    Parameters
    ----------
    layout
        The maze.
    episode
        The episode at its start.
    cell
        How looks are added up. Defaults to ``Filter()``.

    Attributes
    ----------
    state
        What is believed most likely, as a maze state.
    """

    def __init__(self, layout: Layout, episode: Episode, cell: Filter | None = None) -> None:
        self.layout = layout
        state = episode.state
        self.state = MazeState(state.robot, state.trigger, state.goal, state.doors_open)
        self._filter = Filter() if cell is None else cell
        self._chances: dict[int, Chances] = {}
        self._looks: dict[int, tuple[int, int, Detection]] = {}  # the last one that told of a cell
        self._touched: frozenset[int] = frozenset()
        self._hidden: dict[int, int] = {}  # cells where something unseen must hold a sphere, and its cell
        self._failed: set[tuple[MazeState, int]] = set()

    def chances(self, cell: int) -> Chances:
        """Return how likely a cell is believed to hold nothing, a cube, a sphere."""
        return self._chances.get(cell, self._filter.prior)

    def see(self, action: int, detection: Detection) -> int | None:
        """Take in a look ahead in the direction of `action`; return the cell of the obstacle in view.

        That is the nearest cell believed to hold one. What is seen beyond a wall or a shut door cannot be
        there and is not believed. A touched obstacle stays, is in view whatever was seen, and hides what
        is behind it. Of an obstacle whose shape the backend would rather not tell, it is believed only
        that it is there.
        """
        cells = [ahead(self.layout, self.state, action, distance) for distance in range(1, REACH + 1)]
        view = [cell for cell in cells if cell >= 0]
        if detection.distance <= len(view):
            for place, cell in enumerate(view[: detection.distance or REACH], start=1):
                if cell in self._touched:
                    break
                look = (self.state.robot, action, detection)
                # The same answer from the same place is the same picture again: it is no further evidence.
                if self._looks.get(cell) != look:
                    before = self._filter.later(self._chances[cell]) if cell in self._chances else None
                    said = _told(detection, place, len(view))
                    self._set(cell, self._filter.look(before or self._filter.prior, said))
                    self._looks[cell] = look
        return next((cell for cell in view if self._known(cell)), None)

    def feel(self, change: Change, robot: int, *, doors_open: bool) -> None:
        """Take in what a move did: where the robot now is, what it pushed, or what stopped it."""
        front = ahead(self.layout, self.state, change.action, 1)
        behind = ahead(self.layout, self.state, change.action, 2)
        if change.moved:
            self.state = replace(self.state, robot=robot, doors_open=doors_open)
            self._watch(front, _NONE)
            if change.push is not None:
                cell, distance = behind, 1
                while cell not in (change.push.end, -1):  # nothing is where it rolled through
                    self._watch(cell, _NONE)
                    distance += 1
                    cell = ahead(self.layout, self.state, change.action, distance)
                self._watch(change.push.end, _SPHERE)
            return
        self._failed.add((self.state, change.action))
        if front in self.state.spheres and behind >= 0 and not self._known(behind):
            self._push_failed(front, behind)
        elif front >= 0:
            self._touch(front)

    def fails(self, action: int) -> bool:
        """Return whether an action has failed before in this very belief."""
        return (self.state, action) in self._failed

    def rule_out(self, action: int) -> bool:
        """Take what stands ahead for a cube, for good; return whether that is news.

        Looks may lead back to a belief in which a move seems possible that has failed (`fails`). Then they
        are not to be trusted here.
        """
        front = ahead(self.layout, self.state, action, 1)
        if front < 0 or front in self.state.cubes:
            return False
        self._is_cube(front)
        return True

    def doubt(self) -> bool:
        """Take the most doubtful of the obstacles for none; return whether there was one.

        That is for when no way is left: what is there after all will be felt. What was touched, or told
        with certainty, is in no doubt.
        """
        seen = (self.state.cubes | self.state.spheres) - self._touched
        sure, cell = min(((max(self.chances(cell)), cell) for cell in seen), default=(1.0, -1))
        if sure >= 1:
            return False
        self._set(cell, _NONE)
        return True

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

    def _push_failed(self, front: int, behind: int) -> None:
        """Weigh the two reasons why a sphere should not roll: it is a cube, or something unseen holds it."""
        _, cube, sphere = self.chances(front)
        seen = behind in self._chances
        hidden = 1 - self._filter.later(self._chances[behind])[0] if seen else self._filter.appears
        if cube > sphere * hidden:
            self._is_cube(front)
            return
        self._set(front, _normalised(0.0, cube, sphere * hidden))
        self._touch(behind)
        self._hidden[behind] = front

    def _touch(self, cell: int) -> None:
        """Believe for certain that a cell holds a cube, or what is as good as one."""
        self._set(cell, _CUBE)
        self._touched |= {cell}

    def _is_cube(self, cell: int) -> None:
        """Take for a cube what was thought to be a sphere, and for unknown what was thought to hold it."""
        self._touch(cell)
        for behind in [behind for behind, front in self._hidden.items() if front == cell]:
            self._forget(behind)

    def _watch(self, cell: int, chances: Chances) -> None:
        """Believe of a cell what has just happened there; pictures taken before tell of another time."""
        self._set(cell, chances)
        self._looks.pop(cell, None)

    def _set(self, cell: int, chances: Chances) -> None:
        """Believe so of a cell; a touched cell that changes is touched no more."""
        self._touched -= {cell}
        self._hidden.pop(cell, None)
        self._chances[cell] = chances
        cubes, spheres = self.state.cubes - {cell}, self.state.spheres - {cell}
        none, cube, sphere = chances
        if none < cube + sphere:
            # Of two equally likely shapes the sphere is believed: a push will tell.
            if sphere >= cube:
                spheres |= {cell}
            else:
                cubes |= {cell}
        self.state = replace(self.state, cubes=cubes, spheres=spheres)

    def _forget(self, cell: int) -> None:
        """Know nothing of a cell."""
        self._watch(cell, _NONE)
        del self._chances[cell]


def _told(detection: Detection, place: int, cells: int) -> Chances:
    """Return what a detection says of the cell that is `place` cells ahead, of `cells` in view.

    What the probabilities leave over for an obstacle that was not reported is shared by the cells in view.
    """
    none, cube, sphere = detection.chances
    if detection.label == "none":
        return 1 - (cube + sphere) / cells, cube / cells, sphere / cells
    if place == detection.distance:
        shape = (cube + sphere) / 2
        return (none, shape, shape) if detection.abstains else (none, cube, sphere)
    missed = (1 - max(detection.chances)) / cells
    return 1 - missed, missed / 2, missed / 2


def _normalised(none: float, cube: float, sphere: float) -> Chances:
    total = none + cube + sphere
    return none / total, cube / total, sphere / total
