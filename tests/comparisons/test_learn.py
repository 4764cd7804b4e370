"""`affordant learn`: what it prints and leaves behind, when it stops, and how it goes on."""

import csv
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from command_line import FILES, affordant, same_files

from comparisons.learn import registry
from comparisons.learn.greedy_tables import greedy_tables
from comparisons.learn.line import Line, Measured
from comparisons.learn.neural import NeuralRun
from comparisons.learn.registry import Request, learner_names, new_run
from comparisons.learn.tabular import TabularRun
from hierarchy import ground
from hierarchy.check import checked
from hierarchy.text import load_graph, load_world
from planners import MaxQ, MaxQQ, flat_optimum, hierarchical_optimum
from planners.option_critic.checkpoint import load_checkpoint
from planners.option_critic.options import compile_options
from worlds import UserError

MAZE = "grid\n. . : D1 G1\nT1 . | . .\n. . : D2 .\nstart 0,0\ntrigger T1\ngoal G1\n"
QUICK = ("--set", "num_envs=16", "horizon=16", "hidden=8", "minibatch=100", "max_steps=20")
OURS = ("option-critic", "flat-ppo", "flat-dqn", "maxq-0", "maxq-q", "hsmq", "flat-q")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder with a small maze."""
    (tmp_path / "small.maze").write_text(MAZE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *tokens: str) -> tuple[int, str, str]:
    """Run the command; return its exit status and what it printed."""
    return affordant(capsys, "learn", *tokens)


def rows(folder: str) -> list[dict[str, str]]:
    """Return a learning curve."""
    with Path(folder, "curve.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("learner", ["maxq-0", "flat-q"])
def test_a_tabular_learner_stops_when_the_oracle_agrees(
    capsys: pytest.CaptureFixture[str], learner: str
) -> None:
    """All 496 starts of the paper's maze; the summary, the curve and the checkpoint say the same."""
    status, out, err = run(capsys, "two_rooms", "--learner", learner, "--out", "run")
    assert status == 0
    assert f"task graph two_rooms on world two_rooms: {learner}, seed 0, " in out
    assert "optimal from 496 of 496 starts; ends from 496" in out
    assert "mean return -11.5, the best possible -11.5" in out
    assert "100.0 % optimal" in err
    assert sorted(path.name for path in Path("run").iterdir()) == sorted(FILES)
    *before, last = rows("run")
    assert (last["share_optimal"], last["share_ending"], last["mean_loss"]) == ("1", "1", "0")
    assert all(float(row["share_optimal"]) < 1 for row in before)
    card = json.loads(Path("run/checkpoint.json").read_text())
    assert (card["learner"], card["world"], card["steps"]) == (learner, "two_rooms", int(last["steps"]))
    again = run(capsys, "two_rooms", "--learner", learner, "--out", "run", "--resume")
    assert again == (0, out, "")  # there is nothing left to learn


@pytest.mark.slow
def test_an_option_critic_learns_a_small_maze(capsys: pytest.CaptureFixture[str]) -> None:
    """Until all starts are optimal; its curve has losses and how options were used."""
    tokens = ("two_rooms", "--world", "small.maze", *QUICK, "entropy=0.05", "anneal=20000")
    status, out, _ = run(capsys, *tokens, "--steps", "60000", "--out", "run")
    assert status == 0, out
    last = rows("run")[-1]
    assert last["share_optimal"] == "1"
    assert {"loss_objective", "loss_critic", "option_duration", "usage_entropy"} < last.keys()


def test_steps_that_are_too_few_are_told_and_can_be_added_to(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit status 1; with more steps the run goes on, and ends like one that had them at once."""
    tokens = ("taxi", "--world", "taxi-rainy", "--learner", "maxq-0", "--seed", "4")
    status, out, _ = run(capsys, *tokens, "--out", "parts", "--steps", "40000")
    assert status == 1
    assert re.search(r"optimal from \d+ of 400 starts", out)
    run(capsys, *tokens, "--out", "parts", "--steps", "60000", "--resume")
    run(capsys, *tokens, "--out", "whole", "--steps", "60000")
    assert int(rows("whole")[-1]["steps"]) >= 60000
    assert same_files("parts", "whole")


def test_a_tolerance_ends_learning_where_there_is_chance(capsys: pytest.CaptureFixture[str]) -> None:
    """Once it ends from everywhere and the mean is near enough, though hardly a start is optimal."""
    tokens = ("taxi", "--world", "taxi-rainy", "--learner", "maxq-0", "--out", "run")
    status, _, _ = run(capsys, *tokens, "--tolerance", "1.5")
    *before, last = rows("run")
    assert status == 0
    assert float(last["share_optimal"]) < 1
    assert float(last["mean_loss"]) <= 1.5
    assert last["share_ending"] == "1"
    assert all(row["share_ending"] != "1" or float(row["mean_loss"]) > 1.5 for row in before)


@pytest.mark.parametrize(("number", "expected"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_told_to_stop_it_saves_and_says_how_to_go_on(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    number: signal.Signals,
    expected: int,
) -> None:
    """Ctrl-C and SIGTERM; the command that it prints ends as if nothing had happened."""
    tokens = ("two_rooms", "--learner", "flat-q", "--seed", "2", "--steps", "100000", "--out")
    run(capsys, *tokens, "whole")
    seen: list[int] = []

    def due(run: TabularRun) -> bool:
        seen.append(run.episodes)
        if len(seen) == 3:
            os.kill(os.getpid(), number)
        return True

    with monkeypatch.context() as patched:
        patched.setattr(TabularRun, "due", due)
        status, out, err = run(capsys, *tokens, "a broken one")
    assert (status, out) == (expected, "")
    assert len(rows("a broken one")) == 3
    told = re.search(r"stopped after \d+ steps; to go on: affordant learn (.*)\n", err)
    assert told is not None
    assert run(capsys, *shlex.split(told[1]))[0] == 1
    assert same_files("a broken one", "whole")


@pytest.mark.parametrize("learner", ["option-critic", "flat-ppo", "flat-dqn"])
def test_a_run_with_networks_goes_on_after_ctrl_c(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, learner: str
) -> None:
    """The command that it prints leaves the same bytes as a run that nothing broke off."""
    tokens = ("two_rooms", "--learner", learner, "--world", "small.maze", *QUICK, "--steps", "2560", "--out")
    ended, *_ = run(capsys, *tokens, "whole")
    usual, seen = NeuralRun.due, list[bool]()

    def due(run: NeuralRun) -> bool:
        seen.append(usual(run))
        if len(seen) == 5:
            os.kill(os.getpid(), signal.SIGINT)
        return seen[-1]

    with monkeypatch.context() as patched:
        patched.setattr(NeuralRun, "due", due)
        assert run(capsys, *tokens, "broken")[:2] == (130, "")
    assert seen == [False, True, False, True, False]
    about = load_checkpoint("broken/checkpoint.safetensors").about
    assert (about.learner, about.steps) == (learner, 5 * 256)
    assert not same_files("broken", "whole")
    going_on = (*tokens, "broken", "--resume")
    assert "begun with setting gamma 0.98, not 0.5" in run(capsys, *going_on, "--set", "gamma=0.5")[2]
    assert run(capsys, *going_on)[0] == ended
    assert same_files("broken", "whole")


def test_a_run_that_was_never_evaluated_is_told_of(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped after its first piece, and gone on with for fewer steps than that."""
    tokens = ("two_rooms", "--learner", "maxq-0", "--out", "run", "--steps")

    def due(_: TabularRun) -> bool:
        os.kill(os.getpid(), signal.SIGINT)
        return False

    with monkeypatch.context() as patched:
        patched.setattr(TabularRun, "due", due)
        assert run(capsys, *tokens, "60000")[0] == 130
    assert rows("run") == []
    status, out, _ = run(capsys, *tokens, "1", "--resume")
    assert (status, "of 496 starts" in out) == (1, True)
    assert run(capsys, *tokens, "60000", "--resume")[0] == 0


def test_a_folder_that_stays_empty_is_taken_away(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever ends learning before there is anything to keep."""

    def fails(_: TabularRun) -> bool:
        raise UserError("no more")

    monkeypatch.setattr(TabularRun, "due", fails)
    status, _, err = run(capsys, "two_rooms", "--learner", "maxq-0", "--out", "deep/run")
    assert (status, "affordant: no more" in err) == (2, True)
    assert not Path("deep/run").exists()


@pytest.mark.parametrize(
    ("tokens", "expected"),
    [
        (("two_room", "--out", "x"), "did you mean 'two_rooms'?"),
        (("two_rooms",), "--out"),
        (("two_rooms", "--out", "."), "it exists already"),
        (
            ("two_rooms", "--out", "small.maze/x", "--learner", "maxq-0"),
            "it cannot be made (Not a directory)",
        ),
        (
            ("two_rooms", "--out", "x", "--learner", "maxq"),
            "--learner maxq: there is none; did you mean 'maxq-q'?",
        ),
        (("two_rooms", "--out", "x", "--world", "tax"), "did you mean 'taxi'?"),
        (("two_rooms", "--out", "x", "--config", "no.yaml"), "no.yaml: there is no such file"),
        (("two_rooms", "--out", "x", "--config", "small.maze"), "small.maze, line "),
        (
            ("two_rooms", "--out", "x", "--set", "rte=1"),
            "rte=1: there is no such setting; did you mean 'rate'?",
        ),
        (("two_rooms", "--out", "x", "--set", "rate"), "write NAME=VALUE"),
        (("two_rooms", "--out", "x", "--set", "a=1", "a=2"), "a is given already"),
        (("two_rooms", "--out", "x", "--terminations", "lernt"), "did you mean 'learnt'?"),
        (("two_rooms", "--out", "x", "--steps", "0"), "--steps 0: give at least 1"),
        (("two_rooms", "--out", "x", "--seed", "-1"), "--seed -1: give a whole number"),
        (("two_rooms", "--out", "x", "--tolerance", "nan"), "--tolerance nan: give a number from 0 on"),
        (("two_rooms", "--out", "x", "--resume"), "leave --resume out to begin"),
        (
            ("two_rooms", "--out", "x", "--learner", "flat-q", "--terminations", "prior"),
            "terminations=prior: there is no such setting; use one of gamma, ",
        ),
        (
            ("two_rooms", "--out", "x", "--learner", "hsmq", "--set", "explores=boltzman"),
            "explores=boltzman: boltzman is not possible; did you mean 'boltzmann'?",
        ),
        (("two_rooms", "--out", "x", "--lerner", "flat-q"), "Did you mean --learner"),
        (
            ("two_rooms", "--out", "x", "--learner", "flat-ppo", "--terminations", "prior"),
            "--terminations: the learner flat-ppo has no use for terminations; leave it out. "
            "Its settings are hidden, num_envs, ",
        ),
        (
            ("two_rooms", "--out", "x", "--learner", "flat-ppo", "--set", "rate=1e-3", "prior=1"),
            "--set prior: the learner flat-ppo has no use for prior",
        ),
        (
            ("two_rooms", "--out", "x", "--learner", "flat-dqn", "--set", "clip=0.1"),
            "--set clip: the learner flat-dqn has no use for clip",
        ),
        (
            ("two_rooms", "--out", "x", "--learner", "flat-ppo", "--set", "rte=1"),
            "rte=1: there is no such setting; did you mean 'rate'?",
        ),
    ],
)
def test_wrong_input_is_one_message(
    capsys: pytest.CaptureFixture[str], here: Path, tokens: tuple[str, ...], expected: str
) -> None:
    """Exit status 2, what is wrong and how to mend it; nothing is left behind."""
    status, out, err = run(capsys, *tokens)
    assert (status, out) == (2, "")
    assert err.startswith("affordant: ")
    assert expected in err
    assert [path.name for path in here.iterdir()] == ["small.maze"]


def test_another_run_is_not_gone_on_with(capsys: pytest.CaptureFixture[str]) -> None:
    """Another seed, learner, setting, world or graph is named; so are a changed maze and a broken file."""
    tokens = ("two_rooms", "--world", "small.maze", "--out", "run", *QUICK, "--steps", "512")
    run(capsys, *tokens)
    kept = Path("run/checkpoint.safetensors").read_bytes()
    other = Path("other.yaml")
    graph = json.loads(Path("run/checkpoint.json").read_text())["graph"]
    other.write_text(graph.replace("uses: [robot]", "uses: [robot, goal]", 1))
    for more, expected in (
        (("--seed", "3"), "begun with --seed 0, not 3; give the same, or another --out"),
        (("--learner", "maxq-0"), "num_envs=16: there is no such setting"),
        (("--terminations", "prior"), "begun with setting terminations given, not prior"),
        (("--world", "two_rooms"), "begun with --world small.maze, not two_rooms"),
    ):
        before = tokens[:1] + tokens[3:] if more[0] == "--world" else tokens
        status, _, err = run(capsys, *before, "--resume", *more)
        assert (status, expected in err) == (2, True), err
    assert "of another task graph" in run(capsys, str(other), *tokens[1:], "--resume")[2]
    Path("small.maze").write_text(MAZE.replace("T1 .", ". T1"))
    assert "no longer what was learnt on" in run(capsys, *tokens, "--resume")[2]
    Path("small.maze").write_text(MAZE)
    Path("run/checkpoint.safetensors").write_bytes(kept[: len(kept) // 2])
    assert "no safetensors file, or a broken one" in run(capsys, *tokens, "--resume")[2]


@pytest.mark.parametrize("learner", ["flat-ppo", "flat-dqn"])
def test_flat_learners_are_wide_unless_said_otherwise(learner: str) -> None:
    """By name, or in a file, in which settings that are not read are let be, and never count."""
    graph, world = load_graph("two_rooms", load_world("small.maze"))
    grounded = checked(graph, world.model())
    file = Path("mine.yaml")

    def width(text: str, **settings: str) -> object:
        file.write_text(text)
        found = new_run(Request(learner, grounded, 0, file, settings, 512)).settings
        assert found["total"] == 512
        assert not found.keys() & {"terminations", "abstracted", "epsilon", "prior", "deliberation"}
        return found["hidden"]

    assert new_run(Request(learner, grounded)).settings["hidden"] == 128
    assert width("# nothing yet\n") == 128
    assert width("prior: 2.0\nterminations: prior\n") == 128
    assert width("hidden: 32\n") == 32
    assert width("hidden: 32\n", hidden="16") == 16
    assert width("rate: 0.1\n", hidden="16") == 16
    assert new_run(Request("option-critic", grounded)).settings["hidden"] == 32


@pytest.mark.slow
def test_learning_that_goes_astray_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """Numbers that are none any more are never kept; the message says what to change."""
    tokens = ("two_rooms", "--world", "small.maze", *QUICK, "rate=1e30", "--steps", "5120", "--logger", "csv")
    status, _, err = run(capsys, *tokens, "--out", "run")
    assert (status, "learning went astray: after " in err) == (2, True)
    assert "lower the setting rate" in err
    assert not Path("run").exists()


@pytest.mark.parametrize("kind", [MaxQ, MaxQQ])
def test_greedy_tables_go_the_learners_way(kind: type[MaxQ]) -> None:
    """What the tables are worth is what following the learner earns, half-learnt as it is."""
    graph, world = load_graph("taxi")
    grounded = checked(graph, world.model())
    learner = kind(grounded, seed=(1,))
    starts = np.flatnonzero(grounded.model.starts)
    learner.train(grounded.root, starts.tolist(), episodes=20)
    returns = greedy_tables(learner, compile_options(grounded)).returns(starts)
    rewards = grounded.model.rewards
    followed = []
    for start in starts.tolist():
        route = learner.greedy_route(grounded.root, start)
        followed.append(-np.inf if route is None else sum(rewards[state, action] for state, action in route))
    np.testing.assert_allclose(returns, followed)
    assert np.isfinite(returns).any()
    assert (
        returns < flat_optimum(grounded.model, grounded.nodes[grounded.root].terminal).value[starts]
    ).any()


def test_the_line_is_the_oracles(here: Path) -> None:
    """Starts from which the end cannot be reached do not count; the best policy reaches the line."""
    graph, world = load_graph("two_rooms", load_world(str(here / "small.maze")))
    grounded = checked(graph, world.model())
    line = Line.of(grounded)
    assert line.starts.tolist() == np.flatnonzero(grounded.model.starts).tolist()
    best = hierarchical_optimum(grounded).value[0, line.starts]
    np.testing.assert_allclose(line.best, best)
    flat = flat_optimum(grounded.model, grounded.nodes[grounded.root].terminal)
    np.testing.assert_array_equal(line.best, flat.value[line.starts])


@pytest.mark.parametrize(
    ("measured", "tolerance", "enough"),
    [
        (Measured(1.0, 1.0, -3.0, 0.0), 0.0, True),
        (Measured(0.9, 1.0, -3.0, 1e-9), 0.0, False),
        (Measured(0.1, 1.0, -3.0, 0.5), 0.5, True),
        (Measured(0.1, 0.9, -3.0, 0.0), 0.5, False),
        (Measured(0.0, 0.0, float("nan"), float("nan")), 9.0, False),
    ],
)
def test_when_learning_may_stop(measured: Measured, tolerance: float, enough: bool) -> None:
    """All optimal; or, with a tolerance, all ending and the mean near."""
    assert measured.enough(tolerance) is enough


def test_a_package_can_add_a_learner(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its entry point is offered; ours cannot be taken, and a broken one says so."""
    points = [
        EntryPoint("mine", "comparisons.learn.tabular:maxq_0", registry.GROUP),
        EntryPoint("maxq-0", "nowhere:none", registry.GROUP),
        EntryPoint("broken", "nowhere:none", registry.GROUP),
    ]
    monkeypatch.setattr(registry, "entry_points", lambda **_: points)
    assert learner_names() == (*OURS, "broken", "mine")
    graph, world = load_graph("taxi")
    grounded = ground(graph, world.model())
    for name in ("mine", "maxq-0"):
        assert isinstance(new_run(Request(name, grounded)), TabularRun)
    with pytest.raises(UserError, match=r"learner 'broken' .* cannot be loaded"):
        new_run(Request("broken", grounded))


@pytest.mark.slow
def test_a_killed_run_that_goes_on_ends_like_an_unbroken_one(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    """SIGKILL at any time costs what was learnt since the last checkpoint, and changes nothing else."""
    tokens = ("two_rooms", "--world", "small.maze", *QUICK, "entropy=1", "--steps", "10240", "--out")
    ended, *_ = run(capsys, *tokens, "whole")
    code = "import comparisons.learn.command as c; c.EVERY = 0.0; from comparisons.cli import main; main()"
    killed = subprocess.Popen(  # noqa: S603 - our own code
        [sys.executable, "-c", code, "learn", *tokens, "broken"],
        cwd=here,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        stderr=subprocess.DEVNULL,
    )
    until = time.monotonic() + 120
    while not Path("broken/curve.csv").exists() and time.monotonic() < until:
        time.sleep(0.002)
    killed.kill()
    assert killed.wait() == -signal.SIGKILL
    assert load_checkpoint("broken/checkpoint.safetensors").about.steps < 10240
    assert run(capsys, *tokens, "broken", "--resume")[0] == ended
    assert same_files("broken", "whole")
