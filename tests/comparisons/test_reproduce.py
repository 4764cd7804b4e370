"""The main job, run as a user runs it: its numbers, its files, and that the same seed repeats them."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

FIGURE_13 = {
    "GotoTrigger(T4)": ["7678", "6567", "5456", "4345", "3234", "2123", "1012", "2123"],
    "GotoDoor(D1)": ["6543", "5432", "4321", "5432", "6543", "7654", "8765", "9876"],
    "GotoDoor(D2)": ["9876", "8765", "7654", "6543", "5432", "4321", "5432", "6543"],
    "GotoGoal(G2)": ["6543", "5432", "4321", "3210", "4321", "5432", "6543", "7654"],
}


def run(out: Path, *options: str) -> str:
    """Run the command in a process of its own and return what it prints."""
    command = [sys.executable, "-c", "from comparisons.cli import main; main()"]
    done = subprocess.run(  # noqa: S603 - our own command
        [*command, "reproduce", "--quick", "--out", str(out), *options],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the output of a quick run with the camera, and what it printed."""
    out = tmp_path_factory.mktemp("reproduce") / "out"
    return out, run(out)


@pytest.fixture(scope="module")
def results(made: tuple[Path, str]) -> dict[str, Any]:
    """Return results.json of that run."""
    content: dict[str, Any] = json.loads((made[0] / "results.json").read_text())
    return content


def test_the_learnt_tables_are_figure_13(results: dict[str, Any]) -> None:
    """Cell by cell."""
    tables = {name: [list(map(int, row)) for row in rows] for name, rows in FIGURE_13.items()}
    assert results["step_counts"] == tables


def test_every_pair_equals_the_oracle(results: dict[str, Any]) -> None:
    """All 16 pairs of trigger and goal, from every start."""
    pairs = {(pair["trigger"], pair["goal"]): pair["optimal"] for pair in results["pairs"]}
    assert pairs == {(f"T{i}", f"G{j}"): True for i in range(1, 5) for j in range(1, 5)}


def test_the_affordances_are_table_4(results: dict[str, Any]) -> None:
    """Four rows as printed, None for the obstacles off the route; replanning agrees."""
    rows = {row["obstacle"]: (row["subtask"], row["action"], row["shape"]) for row in results["affordances"]}
    assert rows == {
        "C1": ("GotoTrigger", "East", "cube"),
        "C2": (None, None, "cube"),
        "C3": ("GotoGoal", "East", "cube"),
        "S1": ("GotoTrigger", "South", "sphere"),
        "S2": ("GotoGoal", "North", "sphere"),
        "S3": (None, None, "sphere"),
    }
    assert len(results["affordances"]) == 6
    assert results["affordances_replanned"] == results["affordances"]


def test_the_value_counts_are_the_paper_s(results: dict[str, Any]) -> None:
    """Both readings of the count without abstraction are there."""
    counts = results["value_counts"]
    assert (counts["flat_q"], counts["maxq_abstracted"], counts["primitive_actions"]) == (4096, 1284, 4)
    assert (counts["GotoTrigger"], counts["GotoDoor"], counts["GotoGoal"]) == (512, 256, 512)
    assert (counts["unabstracted_as_printed"], counts["unabstracted_four_subtasks"]) == (12288, 16384)


def test_every_affordance_under_replanning_is_optimal(results: dict[str, Any]) -> None:
    """The local rule is not always; the ends add up to the episodes."""
    dynamic = results["dynamic"]
    assert dynamic["optimal_replanning"] == dynamic["affordances"] > 30
    assert 0 < dynamic["optimal_local_rule"] < dynamic["affordances"]
    assert sum(dynamic["outcomes"].values()) == dynamic["episodes"]
    assert set(dynamic["outcomes"]) == {"reached", "truncated", "no route left", "wrong shape believed"}


def test_snapshots_are_held_to_the_exact_planner(results: dict[str, Any]) -> None:
    """The same affordances by each reading of the spheres; as blocks they hide ways, and never trap."""
    snapshots = results["snapshots"]
    assert list(snapshots) == ["as they stand", "as floor", "as blocks"]
    ends = ("optimal", "longer than needed", "leaves no way", "sees no way")
    for tally in snapshots.values():
        assert sum(tally[end] for end in ends) == tally["affordances"]
        assert (tally["smallest"] is None) == (tally["optimal"] == tally["affordances"])
    assert 0 < snapshots["as floor"]["affordances"] <= results["dynamic"]["affordances"]
    blocks, standing = snapshots["as blocks"], snapshots["as they stand"]
    assert (blocks["leaves no way"], standing["sees no way"]) == (0, 0)
    assert blocks["optimal"] < standing["optimal"]


def test_perception_is_measured_on_the_camera(results: dict[str, Any]) -> None:
    """The Hough backend is right on most fresh frames; its confusion matrix adds up."""
    seen = results["perception"]
    assert seen["backend"] == "hough"
    assert seen["accuracy"] >= 0.9  # of 150 frames; the thousand of the whole run are for 0.95
    assert sum(n for row in seen["confusion"].values() for n in row.values()) == seen["frames"]


def test_one_goto_door_loses_what_two_do_not(results: dict[str, Any]) -> None:
    """The gap report shows the difference."""
    doors = results["doors"]
    assert (doors["as_parameter"]["short"], doors["one_task"]["short"]) == (0, 31)


def test_the_report_is_one_file_that_needs_no_network(made: tuple[Path, str]) -> None:
    """It holds its figures and frames, and names no address but XML's namespaces."""
    page = (made[0] / "report.html").read_text(encoding="utf-8")
    addresses = {address for address in re.findall(r"https?://[^\s\"'<>)]+", page) if "w3.org" not in address}
    assert addresses == set()
    assert page.count("data:image/png;base64,") > 15
    assert "counter-example" in page


def test_every_figure_comes_as_png_and_svg(made: tuple[Path, str]) -> None:
    """Each is there twice, and nothing else is in the directory but the report and the numbers."""
    figures = sorted(path.name for path in (made[0] / "figures").iterdir())
    names = {name.rsplit(".")[0] for name in figures}
    assert names >= {"maze", "task_graph", "convergence", "step_counts", "trajectories", "confusion"}
    assert figures == sorted(f"{name}.{kind}" for name in names for kind in ("png", "svg"))
    entries = sorted(path.name for path in made[0].iterdir())
    assert entries == ["figures", "report.html", "results.json", "task_graph.mmd", "times.json"]
    assert [path.name for path in made[0].parent.iterdir()] == ["out"]


def test_the_command_prints_a_summary(made: tuple[Path, str]) -> None:
    """A few lines, and where the report is."""
    assert "pairs learnt to optimality: 16 of 16" in made[1]
    assert made[1].splitlines()[-1] == f"report: {made[0] / 'report.html'}"


def test_the_same_seed_gives_the_same_bytes(made: tuple[Path, str], tmp_path: Path) -> None:
    """Results, report and figures repeat in another process; another seed gives other results."""
    again = tmp_path / "again"
    run(again)
    for path in made[0].rglob("*"):
        if path.is_file() and path.name != "times.json":
            assert (again / path.relative_to(made[0])).read_bytes() == path.read_bytes(), path.name
    other = tmp_path / "other"
    run(other, "--seed", "1", "--perception", "truth")
    mine, theirs = (json.loads((p / "results.json").read_text()) for p in (made[0], other))
    assert mine["step_counts"] == theirs["step_counts"]
    assert mine["dynamic"]["steps"] != theirs["dynamic"]["steps"]
    assert theirs["perception"]["accuracy"] == 1.0
