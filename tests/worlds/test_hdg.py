import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy import check, checked
from hierarchy.hdg import hdg_graph
from planners import Exploration, LearningRate, MaxQ, Settings, flat_field
from worlds import ACTIONS, Cell, UserError
from worlds.hdg import LandmarkMaze, landmark_model


@st.composite
def _mazes(draw: st.DrawFn) -> LandmarkMaze:
    """Draw a grid with landmarks anywhere."""
    side = draw(st.integers(2, 6))
    at = st.builds(Cell, st.integers(0, side - 1), st.integers(0, side - 1))
    cells = draw(st.lists(at, min_size=1, max_size=5, unique=True))
    return LandmarkMaze(side, {f"L{i}": cell for i, cell in enumerate(cells)})


def _steps(one: Cell, other: Cell) -> int:
    return abs(one.row - other.row) + abs(one.col - other.col)


def test_the_published_size_has_ten_thousand_states() -> None:
    """100 cells for the robot, 100 for the goal; our nine landmarks."""
    maze = LandmarkMaze()
    model = landmark_model(maze)
    assert model.successors.shape == (10_000, 4)
    assert model.starts.sum() == 9900
    assert len(maze.landmarks) == 9


@settings(max_examples=60, deadline=None)
@given(_mazes())
def test_regions_divide_the_grid_by_the_nearest_landmark(maze: LandmarkMaze) -> None:
    """Every cell is in one region, no other landmark is nearer, and each step nearer stays in it."""
    assert sorted(cell for region in maze.regions.values() for cell in region) == sorted(maze.cells)
    for name, region in maze.regions.items():
        home = maze.landmarks[name]
        for cell in region:
            assert _steps(cell, home) == min(_steps(cell, other) for other in maze.landmarks.values())
            nearer = {c for c in maze.cells if _steps(c, cell) == 1 and _steps(c, home) < _steps(cell, home)}
            assert nearer <= region


@settings(max_examples=60, deadline=None)
@given(_mazes())
def test_regions_beside_each_other_know_it(maze: LandmarkMaze) -> None:
    """Beside is mutual, and all regions hang together; around is a region with those beside it."""
    for name, others in maze.beside.items():
        assert all(name in maze.beside[other] for other in others)
        assert maze.around[name] == maze.regions[name].union(*(maze.regions[other] for other in others))
    seen, queue = set(), [next(iter(maze.landmarks))]
    while queue:
        if (name := queue.pop()) not in seen:
            seen.add(name)
            queue.extend(maze.beside[name])
    assert seen == set(maze.landmarks)


@settings(max_examples=20, deadline=None)
@given(_mazes())
def test_the_shortest_way_is_the_manhattan_distance(maze: LandmarkMaze) -> None:
    """Without slips, nothing stands in the way."""
    model = landmark_model(maze)
    robot_at_goal = model.index.column("robot") == model.index.column("goal")
    distance = flat_field(model, robot_at_goal).distance
    assert distance.tolist() == [_steps(robot, goal) for robot, goal in model.index]


def test_a_slip_goes_to_either_side() -> None:
    """Nine in ten ahead, one in twenty to each side; at the border the robot stays, the goal as well."""
    maze = LandmarkMaze(side=5)
    model = landmark_model(maze, slip=0.1)
    state = model.index.number((Cell(4, 0), Cell(3, 3)))
    west = ACTIONS.index("West")
    found = [model.index.state(int(to)) for to in model.outcomes[state, west]]
    assert found == [(Cell(4, 0), Cell(3, 3)), (Cell(3, 0), Cell(3, 3)), (Cell(4, 0), Cell(3, 3))]
    assert model.probabilities[state, west].tolist() == pytest.approx([0.9, 0.05, 0.05])


@pytest.mark.parametrize(
    ("landmarks", "message"),
    [
        ({"A": Cell(0, 0), "B": Cell(0, 0)}, "give it landmarks, each in a cell of its own"),
        ({"A": Cell(3, 0)}, "landmark A at 3,0 is outside the grid; give rows and columns 0 to 2"),
    ],
)
def test_wrong_landmarks_are_refused(landmarks: dict[str, Cell], message: str) -> None:
    """The error names the landmark."""
    with pytest.raises(UserError, match=message):
        LandmarkMaze(3, landmarks)


def test_a_maze_of_one_cell_needs_its_landmark_given() -> None:
    """Ours begin one cell in from the corner."""
    with pytest.raises(UserError, match="maze of side 1: give it landmarks"):
        LandmarkMaze(1)


def test_a_slip_is_a_probability() -> None:
    """Anything else is refused."""
    with pytest.raises(UserError, match="slip is a probability, not 2; give 0 to 1"):
        landmark_model(LandmarkMaze(3), slip=2)


@pytest.mark.parametrize("side", [5, 7])
@pytest.mark.parametrize("may_leave", [False, True])
def test_the_task_graph_runs_without_slips(side: int, may_leave: bool) -> None:
    """Both forms of the graph have no findings."""
    maze = LandmarkMaze(side)
    assert check(hdg_graph(maze, may_leave=may_leave), landmark_model(maze)) == ()


def test_moves_that_slip_need_tasks_that_may_leave() -> None:
    """Beside a border no move surely stays in the working space; ending where the task leaves mends it."""
    maze = LandmarkMaze(5)
    model = landmark_model(maze, slip=0.2)
    assert {finding.kind for finding in check(hdg_graph(maze), model)} == {"stuck", "out of reach"}
    assert check(hdg_graph(maze, may_leave=True), model) == ()


def test_going_by_landmarks_is_learnt() -> None:
    """From outside the goal's region the way leads over its landmark, and not one step further."""
    maze = LandmarkMaze(4, {"A": Cell(0, 1), "B": Cell(3, 2)})
    model = landmark_model(maze)
    grounded = checked(hdg_graph(maze), model)
    slow = Settings(rate=LearningRate(every=200), exploration=Exploration(half=200))
    learner = MaxQ(grounded, seed=(1,), settings=slow)
    starts = np.flatnonzero(model.starts).tolist()
    learner.train(grounded.root, starts, episodes=4000)
    for state in starts:
        robot, goal = model.index.state(state)
        by_landmark = maze.landmarks[maze.nearest(goal)]
        expected = _steps(robot, by_landmark) + _steps(by_landmark, goal)
        if maze.nearest(robot) == maze.nearest(goal):
            expected = min(expected, _steps(robot, goal))
        assert learner.greedy_steps(grounded.root, state) == expected
