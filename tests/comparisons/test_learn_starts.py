"""`affordant learn` where episodes begin as a predicate says, and with what was learnt elsewhere."""

import json
import os
import re
import shlex
import signal
from pathlib import Path

import numpy as np
import pytest
from command_line import affordant, same_files

from comparisons.learn.neural import NeuralRun
from planners.option_critic.checkpoint import load_checkpoint
from planners.option_critic.loading import load_option_critic

FIRST, LATER = ("--starts", "goal = 7,9"), ("--starts", "goal = 8,7")
QUICK = ("--set", "num_envs=8", "horizon=8", "hidden=4", "minibatch=64", "max_steps=50")
CARRY = ("--carry", "first/checkpoint.safetensors", "--moved", "goal")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *tokens: str) -> tuple[int, str, str]:
    """Run the command; return its exit status and what it printed."""
    return affordant(capsys, "learn", *tokens)


def card(folder: str) -> dict[str, object]:
    """Return what a checkpoint is of."""
    found = json.loads(Path(folder, "checkpoint.json").read_text())
    assert isinstance(found, dict)
    return found


@pytest.fixture
def first(capsys: pytest.CaptureFixture[str]) -> None:
    """Leave what was learnt of the first goal in the folder ``first``."""
    status, _, err = run(capsys, "four_rooms", *FIRST, *QUICK, "--steps", "128", "--out", "first")
    assert status == 1, err


@pytest.mark.usefixtures("first")
def test_episodes_begin_where_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    """The line is of these starts alone; the card tells, and the checkpoint loads as a learner of them."""
    assert card("first")["starts"] == "goal = 7,9"
    learner = load_option_critic("first/checkpoint.safetensors")
    model = learner.grounded.model
    goal = model.index.variable("goal").values[
        int(model.index.column("goal")[np.flatnonzero(model.starts)[0]])
    ]
    assert (str(goal), int(model.starts.sum()), learner.steps) == ("7,9", 103, 128)
    tokens = ("taxi", "--learner", "flat-q", "--starts", "passenger = R", "--out", "part")
    status, out, _ = run(capsys, *tokens)
    assert (status, "optimal from 100 of 100 starts" in out) == (0, True)


@pytest.mark.parametrize(
    ("starts", "problem"),
    [
        ("gaol = 7,9", "--starts: .*did you mean 'goal'"),
        ("goal = 0,0", "--starts: .*0,0"),
        ("goal =", "--starts: "),
        ("robot = goal", "--starts: no start has 'robot = goal'; choose among the world's 10712 starts"),
    ],
)
def test_refused_predicates(
    capsys: pytest.CaptureFixture[str], here: Path, starts: str, problem: str
) -> None:
    """Exit status 2 and one message; nothing is left behind."""
    status, out, err = run(capsys, "four_rooms", "--starts", starts, "--out", "x")
    assert (status, out) == (2, "")
    assert re.search(problem, err), err
    assert not list(here.iterdir())


@pytest.mark.usefixtures("first")
def test_with_other_starts_it_is_not_gone_on(capsys: pytest.CaptureFixture[str]) -> None:
    """Others, or none: the message says which; with the same it goes on."""
    tokens = ("four_rooms", *QUICK, "--steps", "192", "--out", "first", "--resume")
    for more, now in ((LATER, "goal = 8,7"), ((), "all")):
        status, _, err = run(capsys, *tokens, *more)
        assert (status, f"begun with --starts goal = 7,9, not {now}; give the same" in err) == (2, True), err
    assert run(capsys, *tokens, *FIRST)[0] == 1
    assert card("first")["steps"] == 192


@pytest.mark.usefixtures("first")
def test_what_is_carried_is_told_and_begun_with(capsys: pytest.CaptureFixture[str]) -> None:
    """Sixteen networks that do not see the goal; the curve is another than a fresh one's."""
    tokens = ("four_rooms", *LATER, *QUICK, "--steps", "128", "--out")
    status, _, err = run(capsys, *tokens, "later", *CARRY)
    assert status == 1
    told = re.search(r"carried over from first/checkpoint.safetensors: (.*)\n", err)
    assert told is not None
    names = told[1].split(", ")
    assert len(names) == 16
    assert {"policy of LeaveNW(north)", "V LeaveSE(south)"} < set(names)
    assert re.fullmatch("[0-9a-f]{16} without goal", str(card("later")["carried"]))
    run(capsys, *tokens, "fresh")
    assert card("fresh")["carried"] == ""
    assert not same_files("later", "fresh")


@pytest.mark.usefixtures("first")
def test_a_carried_run_goes_on_bit_for_bit(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the command that it prints, with the first checkpoint gone, too; a changed --carry is refused."""
    tokens = ("four_rooms", *LATER, *QUICK, "evaluate=1", "--steps", "320")
    run(capsys, *tokens, *CARRY, "--out", "whole")
    seen: list[int] = []

    def due(run: NeuralRun) -> bool:
        seen.append(run.learner.updates)
        if len(seen) == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return True

    with monkeypatch.context() as patched:
        patched.setattr(NeuralRun, "due", due)
        status, _, err = run(capsys, *tokens, *CARRY, "--out", "broken")
    assert status == 130
    told = re.search(r"stopped after 128 steps; to go on: affordant learn (.*)\n", err)
    assert told is not None
    moved = (*tokens, "--out", "broken", "--resume", "--carry", "first/checkpoint.safetensors", "--moved")
    status, _, err = run(capsys, *moved, "goal", "robot")
    assert (status, bool(re.search("begun with --carry [0-9a-f]{16} without goal, not", err))) == (2, True)
    Path("first").rename("elsewhere")
    status, _, err = run(capsys, *moved, "goal")
    assert (status, "first/checkpoint.safetensors" in err) == (2, True)
    assert run(capsys, *shlex.split(told[1]))[0] == 1
    assert same_files("broken", "whole")
    again = load_checkpoint("whole/checkpoint.safetensors").about
    Path("elsewhere").rename("first")
    assert run(capsys, *tokens, *CARRY, "--out", "whole", "--resume")[0] == 1  # nothing is left to learn
    assert load_checkpoint("whole/checkpoint.safetensors").about == again


@pytest.mark.usefixtures("first")
def test_what_began_fresh_does_not_go_on_carried(capsys: pytest.CaptureFixture[str]) -> None:
    """It did not begin with these networks."""
    tokens = ("four_rooms", *FIRST, *QUICK, "--steps", "192", "--out", "first", "--resume", *CARRY)
    status, _, err = run(capsys, *tokens)
    assert (status, "begun with --carry nothing, not " in err) == (2, True)


@pytest.mark.usefixtures("first")
@pytest.mark.parametrize(
    ("tokens", "problem"),
    [
        (CARRY[:2], "--carry: name the state variables that have moved, such as --moved goal"),
        (CARRY[2:], "--moved goal: there is nothing to carry; give --carry a checkpoint"),
        ((*CARRY[:3], "gaol"), "first/checkpoint.safetensors: there is no state variable 'gaol'; did you"),
        ((*CARRY[:3], "robot", *QUICK), "every network sees robot: nothing can be carried over"),
        (("--carry", "no.safetensors", "--moved", "goal"), "no.safetensors: "),
        ((*CARRY, "--learner", "maxq-0"), "--carry: the learner maxq-0 has no networks to begin with"),
        ((*CARRY, "--learner", "flat-ppo"), "leave it out, or use option-critic"),
        ((*CARRY, *QUICK, "terminations=prior"), "setting terminations was given and is prior now"),
        ((*CARRY, "--set", "hidden=5"), "setting hidden was 4 and is 5 now; give hidden: 4"),
        ((*CARRY, "--world", "four_rooms-sutton", *QUICK), "another task graph or world"),
    ],
)
def test_what_cannot_be_carried_is_one_message(
    capsys: pytest.CaptureFixture[str], here: Path, tokens: tuple[str, ...], problem: str
) -> None:
    """Exit status 2, what is wrong and how to mend it; nothing is left behind."""
    status, out, err = run(capsys, "four_rooms", *LATER, "--out", "x", *tokens)
    assert (status, out) == (2, "")
    assert problem in err, err
    assert [path.name for path in here.iterdir()] == ["first"]


def test_a_tabular_checkpoint_is_not_carried_from(capsys: pytest.CaptureFixture[str]) -> None:
    """It is of another learner; the message says which."""
    run(capsys, "taxi", "--learner", "flat-q", "--steps", "1000", "--out", "first")
    status, _, err = run(capsys, "taxi", "--out", "x", "--carry", CARRY[1], "--moved", "passenger")
    assert (status, "it is of the learner 'flat-q'" in err) == (2, True), err
