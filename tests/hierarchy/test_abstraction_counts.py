import pytest

from hierarchy import derive_uses, ground, prove_abstraction, table_sizes, two_rooms, value_counts
from hierarchy.hdg import hdg_graph
from hierarchy.taxi import taxi_graph
from planners import recursive_optimum
from worlds import Cell, load_layout, maze_model
from worlds.hdg import LandmarkMaze, landmark_model
from worlds.taxi import taxi_model


def test_taxi_s_632_of_3000_values() -> None:
    """Dietterich 2000, section 5.3, part by part: 4 + 4 leaves, 400, 4 + 100, 4 + 100, 16 and 0."""
    model = taxi_model()
    sizes = table_sizes(ground(taxi_graph(model), model))
    assert sizes.leaves == {"North": 1, "South": 1, "East": 1, "West": 1, "Pickup": 2, "Putdown": 2}
    by_edge: dict[tuple[str, str], int] = {}
    for table in sizes.tables:
        key = (table.task, table.call.child)
        by_edge[key] = by_edge.get(key, 0) + table.needed
    moves = {("Navigate", action): 25 * 4 for action in ("North", "South", "East", "West")}
    assert by_edge == moves | {
        ("Get", "Navigate"): 4,
        ("Get", "Pickup"): 25 * 4,
        ("Put", "Navigate"): 4,
        ("Put", "Putdown"): 25 * 4,
        ("Root", "Get"): 16,
        ("Root", "Put"): 0,
    }
    assert (sizes.total, sizes.flat) == (632, 3000)


def test_taxi_s_live_values_leave_out_navigate_s_sites() -> None:
    """Of 25 positions 24 are ever asked about: at its site Navigate has ended."""
    model = taxi_model()
    sizes = table_sizes(ground(taxi_graph(model), model))
    assert sum(table.live for table in sizes.tables if table.task == "Navigate") == 24 * 4 * 4


def test_the_paper_s_1284_values_and_the_root_s() -> None:
    """512 + 256 + 512 + 4 = 1284; the root needs 24 of its 25, since GotoGoal's end is its own."""
    layout = load_layout("two_rooms")
    grounded = ground(two_rooms(layout), maze_model(layout))
    sizes, published = table_sizes(grounded), value_counts(grounded, ignoring=["doors"])
    below = {task: sizes.of(task) for task in ("GotoTrigger", "GotoDoor", "GotoGoal")}
    assert below == published.per_task == {"GotoTrigger": 512, "GotoDoor": 256, "GotoGoal": 512}
    assert sum(below.values()) + sum(sizes.leaves.values()) == 1284
    root = [table for table in sizes.tables if table.task == "Root"]
    assert published.root == 25
    assert [table.needed for table in root] == [16, 4, 4, 0]
    assert [table.zero for table in root] == [False, False, False, True]
    assert sizes.total == 1284 + 24


CORNERS = LandmarkMaze(side=5, landmarks={"L1": Cell(0, 0), "L2": Cell(2, 2), "L3": Cell(4, 4)})


@pytest.mark.parametrize("maze", [LandmarkMaze(side=5), CORNERS], ids=["ours", "corners"])
def test_hdg_s_formulas(maze: LandmarkMaze) -> None:
    """Kaelbling's maze, each node by its formula, for landmarks of our choosing.

    GotoLmk: 4 values for each cell around a landmark but its own. GotoGoal: 4 for each ordered pair of
    cells of a region. GotoGoalLmk: one for each pair of landmarks. Root: one for each goal, and with sure
    moves none after GotoGoal.
    """
    around = [len(area) - 1 for area in maze.around.values()]
    pairs = [len(region) * (len(region) - 1) for region in maze.regions.values()]
    formulas = {
        "GotoLmk": 4 * sum(around),
        "GotoGoal": 4 * sum(pairs),
        "GotoGoalLmk": len(maze.landmarks) ** 2,
    }
    leaving = table_sizes(ground(hdg_graph(maze, may_leave=True), landmark_model(maze)))
    for task, values in formulas.items():
        assert sum(table.live for table in leaving.tables if table.task == task) == values
    staying = table_sizes(ground(hdg_graph(maze), landmark_model(maze)))
    assert staying.of("GotoGoalLmk") == len(maze.landmarks) ** 2
    assert staying.of("Root") == len(maze.cells)
    assert staying.leaves == dict.fromkeys(("North", "South", "West", "East"), 1)


def test_derived_sets_of_taxi_are_dietterich_s() -> None:
    """Found by search, at a random policy and at the optimal one: the sets of section 5, and no larger."""
    model = taxi_model()
    grounded = ground(taxi_graph(model), model)
    for policy in (None, recursive_optimum(grounded).choice):
        found = derive_uses(grounded, policy)
        assert found.uses == {
            "Navigate": ("taxi",),
            "Get": ("taxi", "passenger"),
            "Put": ("taxi", "passenger", "destination"),
            "Root": ("taxi", "passenger", "destination"),
        }
        by_child = {(edge.task, edge.call.child): edge for edge in found.edges}
        assert by_child["Get", "Pickup"].relevant == ("taxi", "passenger")
        assert by_child["Put", "Putdown"].relevant == ("taxi", "destination")
        assert by_child["Root", "Get"].relevant == ("passenger", "destination")
        assert by_child["Get", "Navigate"].relevant == by_child["Put", "Navigate"].relevant == ()
        assert by_child["Root", "Put"].zero
        assert not by_child["Root", "Get"].zero
        assert found.leaves["North"] == ()
        assert found.leaves["Pickup"] == ("taxi", "passenger")


def test_derived_sets_grow_with_discounting() -> None:
    """At gamma = 0.95 what follows Get or Navigate depends on how far the taxi was."""
    model = taxi_model()
    grounded = ground(taxi_graph(model), model)
    by_child = {(e.task, e.call.child): e.relevant for e in derive_uses(grounded, gamma=0.95).edges}
    assert by_child["Root", "Get"] == ("taxi", "passenger", "destination")
    assert by_child["Put", "Navigate"] == ("taxi",)
    assert by_child["Put", "Putdown"] == ("taxi", "destination")


def test_derived_sets_of_the_paper_s_graph() -> None:
    """Each goto needs the robot alone; a call that is bound to the trigger needs no trigger in its rows."""
    layout = load_layout("two_rooms")
    found = derive_uses(ground(two_rooms(layout), maze_model(layout)))
    assert {found.uses[task] for task in ("GotoTrigger", "GotoDoor", "GotoGoal")} == {("robot",)}
    root = [(edge.relevant, edge.zero) for edge in found.edges if edge.task == "Root"]
    assert root == [(("goal",), False), (("goal",), False), (("goal",), False), ((), True)]


@pytest.mark.slow
def test_kaelbling_s_maze_with_slips() -> None:
    """8 by 8 with landmarks three apart: only what GotoGoalLmk stores of its calls is refuted."""
    maze = LandmarkMaze(side=8)
    grounded = ground(hdg_graph(maze, may_leave=True), landmark_model(maze, slip=0.2))
    unsafe = list(prove_abstraction(grounded).unsafe())
    assert len(unsafe) == len(maze.landmarks) ** 2
    assert all(edge.task.startswith("GotoGoalLmk") and edge.result.always.refuted for edge in unsafe)
