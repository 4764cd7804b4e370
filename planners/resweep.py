"""Replanning as a learner could do it alone: values swept anew in the model that it has experienced.

The oracle's search knows how the maze moves. A learner knows what it has tried: it keeps each transition that
it meets while it learns (`Remembering`), and as an obstacle is seen, sweeps the values of its current subtask
anew in that model (`ValueSweep`). What it has never tried it does not know of, and so does not plan with.

Of obstacles it knows where they are and table 3's two words. A cube is unrollable: the move into its cell
leaves it where it is. A sphere is rollable: its cell is as good as free, in every direction in which it could
roll just now. It could not if the learner has found a wall behind it, or knows of another obstacle there. The
sweep leaves out that a sphere which has rolled lies somewhere else afterwards: it is a snapshot.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hierarchy import GroundGraph
from planners.affordance import Replanning
from planners.learner import Settings
from planners.maxq import MaxQ
from planners.search import Area, Plan, Replanner
from worlds import ACTIONS, Cell, Layout, MazeState, Stream

Place = tuple[bool, int]
"""Doors open, robot's cell."""


class Remembering(MaxQ):
    """A MAXQ-0 learner that keeps every transition that it tries while it learns.

    It learns what `MaxQ` does, to the last bit.

    Attributes
    ----------
    tried
        The next state by state and primitive action.
    """

    def __init__(self, grounded: GroundGraph, seed: Sequence[int], settings: Settings | None = None) -> None:
        super().__init__(grounded, seed, settings)
        self.tried: dict[tuple[int, int], int] = {}

    def _act(self, action: int, state: int, chance: Stream) -> tuple[int, float]:
        after, reward = super()._act(action, state, chance)
        if chance is self.random:  # greedy ways are measurements, and have a stream of their own
            self.tried[state, action] = after
        return after, reward


@dataclass(frozen=True, eq=False)
class Experience:
    """Where primitive actions led that a learner has tried, obstacles left out.

    Parameters
    ----------
    after
        The next cell by doors open, cell and action, where the action has been tried.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> learner = Remembering(ground(two_rooms(maze), maze_model(maze)), seed=(0,))
    >>> start = learner.grounded.model.index.number((maze.start, Cell(6, 1), Cell(3, 7), "closed"))
    >>> _ = learner.train(learner.grounded.place("GotoTrigger(T4)"), [start], episodes=100)
    >>> found = Experience.of(maze, learner.grounded, learner.tried)
    >>> len(found.after), found.after[False, maze.number(maze.start), ACTIONS.index("South")]
    (124, 16)
    """

    after: dict[tuple[bool, int, int], int]

    @classmethod
    def of(cls, layout: Layout, grounded: GroundGraph, tried: dict[tuple[int, int], int]) -> Experience:
        """Return the experience of transitions between states, of which only cells and doors count.

        What was tried with several triggers and goals is experience of one and the same maze.
        """
        states = dict.fromkeys((*(state for state, _ in tried), *tried.values()))
        places = {state: _place(layout, grounded, state) for state in states}
        return cls({(*places[state], action): places[to][1] for (state, action), to in tried.items()})

    @classmethod
    def complete(cls, layout: Layout, grounded: GroundGraph, starts: Iterable[int]) -> Experience:
        """Return the experience of a learner that has tried everything in all that `starts` lead to."""
        table = grounded.model.successors
        tried: dict[tuple[int, int], int] = {}
        states = list(dict.fromkeys(starts))
        seen = set(states)
        for state in states:  # which grows as new ones are found
            for action in range(len(ACTIONS)):
                to = int(table[state, action])
                tried[state, action] = to
                if to not in seen:
                    seen.add(to)
                    states.append(to)
        return cls.of(layout, grounded, tried)


class ValueSweep(Replanning):
    """Values swept anew in the experienced model, with the obstacles that the robot knows of.

    Beyond its planner it is `Replanning`: the root chooses by the swept values and the learnt completion.

    Parameters
    ----------
    layout
        The maze.
    learner
        Gives the root's completion values.
    experience
        What has been tried.

    Examples
    --------
    A cube straight ahead on the way to T4. Stepping back is worth as much as stepping aside by static values;
    swept anew, they differ.

    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> learner = MaxQ(ground(two_rooms(maze), maze_model(maze)), seed=(0,))
    >>> start = learner.grounded.model.index.number((maze.start, Cell(6, 1), Cell(3, 7), "closed"))
    >>> everything = Experience.complete(maze, learner.grounded, [start])
    >>> sweep = ValueSweep(maze, learner, everything)
    >>> belief = MazeState(robot=25, trigger=49, goal=31, cubes=frozenset({33}))
    >>> task = learner.grounded.place("GotoTrigger(T4)")
    >>> ACTIONS[sweep.affordance(task, 33, belief).action]
    'West'
    """

    def __init__(self, layout: Layout, learner: MaxQ, experience: Experience) -> None:
        super().__init__(Sweeper(layout, learner.grounded, experience), learner)


class Sweeper(Replanner):
    """Plans by sweeping values: what `Replanning` asks for, without the oracle's knowledge or its proof.

    Parameters
    ----------
    layout, grounded
        The maze and its ground graph.
    experience
        What has been tried.
    """

    def __init__(self, layout: Layout, grounded: GroundGraph, experience: Experience) -> None:
        super().__init__(layout, grounded)
        self.experience = experience

    def plan(self, task: int, belief: MazeState) -> Plan | None:
        """Return the plan that is greedy by the swept values, or None if they see no way.

        Its depths are empty: it is what the learner holds to be shortest, and certifies nothing.
        """
        area = self.area(task, belief)
        moves = self._moves(area, belief)
        values = sweep(moves, area)
        here = belief.doors_open, belief.robot
        if values[here] == float("-inf"):
            return None
        actions: list[int] = []
        firsts: frozenset[int] = frozenset()
        while not area.terminal[here[0]][here[1]]:
            best = [action for action, to in moves[here] if values[to] - 1 == values[here]]
            firsts = firsts or frozenset(best)
            actions.append(best[0])
            here = next(to for action, to in moves[here] if action == best[0])
        return Plan(tuple(actions), firsts, {})

    def _moves(self, area: Area, belief: MazeState) -> dict[Place, list[tuple[int, Place]]]:
        """Return where the task's actions lead from each place, as far as it was tried and is not blocked."""
        moves: dict[Place, list[tuple[int, Place]]] = {}
        for doors_open in (False, True):
            for cell, actions in enumerate(area.actions[doors_open]):
                moves[doors_open, cell] = [
                    (action, (doors_open or to == belief.trigger, to))
                    for action in actions
                    if (to := self.experience.after.get((doors_open, cell, action), cell)) != cell
                    and not self._blocked(belief, doors_open, to, action)
                ]
        return moves

    def _blocked(self, belief: MazeState, doors_open: bool, cell: int, action: int) -> bool:
        """Return whether an obstacle in a cell stops the robot from entering it along an action.

        A direction that was never tried from a sphere's cell is taken to be free: the push will tell.
        """
        if cell in belief.cubes:
            return True
        if cell not in belief.spheres:
            return False
        behind = self.experience.after.get((doors_open, cell, action), -1)
        return behind == cell or behind in belief.cubes or behind in belief.spheres


def sweep(moves: dict[Place, list[tuple[int, Place]]], area: Area) -> dict[Place, float]:
    """Return the values of a task, by value iteration in place until none changes; -inf where none ends it.

    V(p) = max over actions of V(p') - 1, and 0 where the task has ended: each step costs 1, as in the paper.

    Examples
    --------
    Three cells in a row, the task ends in the first, and nothing is known of the way out of the third.

    >>> row = Area(actions=(((), (2,), (2,)), ((), (), ())), terminal=((True, False, False), (False,) * 3))
    >>> found = sweep({(False, 1): [(2, (False, 0))], (False, 2): []}, row)
    >>> [found[False, cell] for cell in range(3)]
    [0.0, -1.0, -inf]
    """
    values = {
        (bool(doors), cell): 0.0 if ended else float("-inf")
        for doors, row in enumerate(area.terminal)
        for cell, ended in enumerate(row)
    }
    changed = True
    while changed:
        changed = False
        for place, steps in moves.items():
            if steps and not area.terminal[place[0]][place[1]]:
                best = max(values[to] for _, to in steps) - 1
                changed |= best != values[place]
                values[place] = best
    return values


def _place(layout: Layout, grounded: GroundGraph, state: int) -> Place:
    """Return the place that a state of the maze's model says."""
    robot, _, _, doors = grounded.model.index.state(state)
    assert isinstance(robot, Cell), "a maze's first variable is the robot's cell"
    return doors == "open", layout.number(robot)
