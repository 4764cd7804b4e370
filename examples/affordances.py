"""The same cube affords different things in different subtasks, and each answer is proved."""

from hierarchy import checked, two_rooms
from planners import Replanner, prove
from worlds import ACTIONS, Cell, MazeState, load_layout, maze_model

maze = load_layout("two_rooms")
oracle = Replanner(maze, checked(two_rooms(maze), maze_model(maze)))


def number(row: int, col: int) -> int:
    """Return a cell's number."""
    return maze.number(Cell(row, col))


for task, trigger, doors_open in (
    ("GotoTrigger(T1)", "T1", False),
    ("GotoTrigger(T4)", "T4", False),
    ("GotoDoor(D2)", "T4", True),
):
    # The robot stands at 5,1 and sees a cube east of it, at 5,2.
    marks = number(*maze.triggers[trigger]), number(*maze.goals["G2"])
    belief = MazeState(number(5, 1), *marks, doors_open, cubes=frozenset({number(5, 2)}))
    verdicts = []
    for action, name in enumerate(ACTIONS):
        proof = prove(oracle, oracle.grounded.place(task), belief, action)
        assert proof is not None, "there is a way around one cube"
        verdicts.append(f"{name} {'is optimal' if proof.optimal else f'loses {proof.loss}'}")
    print(f"{task}: {', '.join(verdicts)}")
