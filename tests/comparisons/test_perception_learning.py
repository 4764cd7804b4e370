"""Backends trained anew: on few pushes, on wrong labels, without a group; spread over processes, and told."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from matplotlib.collections import PathCollection
from shortcuts import PAINTS, as_package, painted, render_painted, threads

from comparisons import perception_compare, perception_learning
from comparisons.cli import main
from comparisons.figures_pushes import Learnt, Pair, held_out_figure, learning_figure
from comparisons.intervals import mean_interval, paired_difference, wilson
from comparisons.outputs import untracked
from comparisons.perception_learning import Learning, Lesson, Point, learn, learners, teach
from comparisons.perception_learning_section import learning_results, learning_sections
from comparisons.perception_spec import QUICK, LearningSpec, StudySpec
from comparisons.perception_study import load_backends
from comparisons.spread import spread
from perception.audit import HUES, HeldOut, groups, groups_to_hold_out
from perception.pushed import pushed_frames
from perception.variation import Variation
from worlds import UserError
from worlds.camera import Camera

SPEC = StudySpec(frames=120, learning=LearningSpec(seeds=2, pushes=(4, 300), wrong=(0.0, 0.9)))


@pytest.fixture
def colours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install backends with a known short cut, and paint frames instead of rendering them."""
    as_package(tmp_path, monkeypatch)
    monkeypatch.setattr(perception_learning, "render_frames", render_painted)


def point(found: Learning, pushes: int, wrong: float) -> Point:
    """Return the point of so many pushes."""
    (one,) = (one for one in found.points if (one.pushes, one.wrong) == (pushes, wrong))
    return one


@pytest.mark.slow
@pytest.mark.usefixtures("colours")
def test_a_short_cut_shows_whatever_the_number_of_workers() -> None:
    """Who goes by colour fails on the hues kept out, on nothing else, and learns from few pushes little."""
    found = learn(SPEC, ("by-colour",), untracked, workers=2)
    many, few, wrong = point(found, 300, 0.0), point(found, 4, 0.0), point(found, 300, 0.9)
    assert many.right == (120, 120)
    assert max(few.right) < 120
    assert max(wrong.right) < 60
    assert few.interval[0] <= few.accuracy <= few.interval[1] < 1
    told = {one.group: one for one in found.held_out["by-colour"]}
    assert tuple(told) == groups_to_hold_out()
    for group, one in told.items():
        assert one.reference_right == one.frames
        assert one.right == (0 if group.startswith("colour") else one.frames)
    assert learn(SPEC, ("by-colour",), untracked, workers=1) == found


@pytest.mark.slow
@pytest.mark.usefixtures("colours")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("fragile", "training: 4 pushes of seed 0: fragile: ValueError: too few for me"),
        ("mortal", "training: a worker process died (killed, or out of memory) at one of: 4 pushes of seed"),
    ],
)
def test_a_training_that_fails_is_named(name: str, message: str) -> None:
    """The message says which it was, and what happened to it."""
    spec = replace(SPEC, learning=LearningSpec(seeds=1, pushes=(4,), wrong=(0.0,)))
    with pytest.raises(UserError, match=re.escape(message)):
        learn(spec, (name,), untracked, workers=1)


@pytest.mark.slow
def test_an_ensemble_on_the_cnn_beside_it_is_the_one_that_trains_its_own() -> None:
    """Label by label: the CNN is trained once for both."""
    data, frames = {0: pushed_frames(range(60), 0, Variation())}, pushed_frames(range(12), 299, Variation())
    both = teach(Lesson(0, 60), ("ensemble", "cnn"), data, frames.frames, 0.01)
    alone = teach(Lesson(0, 60), ("ensemble",), data, frames.frames, 0.01)
    assert set(both) == {"ensemble", "cnn"}
    assert both["ensemble"].tolist() == alone["ensemble"].tolist()
    assert both["ensemble"].tolist() != both["cnn"].tolist()


@given(pushes=st.integers(3, 60), wrong=st.floats(0, 0.9), group=st.sampled_from(["", *groups_to_hold_out()]))
def test_a_lesson_is_of_the_first_pushes(pushes: int, wrong: float, group: str) -> None:
    """In their order, without the group, and with that share of labels wrong, not one more."""
    data = painted(range(60), 5)
    found = groups(data[:pushes])
    assume(not group or (group in found and found[group].any() and not found[group].all()))
    got = Lesson(5, pushes, wrong, group).of(data)
    kept = data[:pushes][~found[group]] if group else data[:pushes]
    assert np.array_equal(got.frames, kept.frames)
    assert (got.labels != kept.labels).sum() == round(wrong * len(kept))


def test_only_backends_that_learn_are_taught() -> None:
    """Each once, whatever weights of it are compared."""
    backends = load_backends(["hough", "hog"], Camera())
    assert learners({**backends, "hog=mine.safetensors": backends["hog"]}) == ("hog",)


@given(st.integers(1, 200), st.data())
def test_the_interval_of_a_mean_holds_the_mean_and_wilson_s(frames: int, drawn: st.DataObject) -> None:
    """Runs that differ more than frames explain widen it; it never is a point."""
    rights = drawn.draw(st.lists(st.integers(0, frames), min_size=1, max_size=4))
    low, high = mean_interval(rights, frames, seed=1)
    inner = wilson(round(sum(rights) / len(rights)), frames)
    assert 0 <= low <= inner[0] < inner[1] <= high <= 1
    assert low <= sum(rights) / len(rights) / frames <= high


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=60))
def test_a_paired_difference_is_the_same_from_either_side(pairs: list[tuple[bool, bool]]) -> None:
    """Its interval lies in [-1, 1] and holds it; with the two exchanged everything changes its sign."""
    first, second = (sum(column) for column in zip(*pairs, strict=True))
    both = sum(one and other for one, other in pairs)
    difference, low, high = paired_difference(first, second, both, len(pairs))
    assert difference == pytest.approx((first - second) / len(pairs))
    assert -1 <= low <= difference <= high <= 1
    turned = paired_difference(second, first, both, len(pairs))
    assert turned == pytest.approx((-difference, -high, -low))


def test_the_interval_of_a_paired_difference_holds_what_it_should() -> None:
    """In about 95 of 100 samples of 80 frames, and in at least 93."""
    chances = np.array([0.8, 0.12, 0.04, 0.04])  # both right, the first alone, the second alone, neither
    held = 0
    for both, one, other, _ in np.random.default_rng(0).multinomial(80, chances, size=1000).tolist():
        _, low, high = paired_difference(both + one, both + other, both, 80)
        held += low <= chances[1] - chances[2] <= high
    assert held >= 930


def test_work_that_is_spread_comes_back_in_order_and_on_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers are told to use one thread; this process keeps its own setting."""
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    assert spread(pow, [5, 3, 4], (2,), workers=2) == [25, 9, 16]
    assert spread(threads, [0], workers=1) == ["1"]
    assert os.environ["OMP_NUM_THREADS"] == "7"
    with pytest.raises(UserError, match=re.escape("dividing: 3: ZeroDivisionError")):
        spread(divmod, [3], (0,), workers=1, description="dividing")
    with pytest.raises(UserError, match=re.escape("--workers 0: give at least 1")):
        spread(pow, [3], (2,), workers=0)


def alive(pid: int) -> bool:
    """Return whether a process runs."""
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().rsplit(")", 1)[1].split()[0] != "Z"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are looked up in /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_their_parent(tmp_path: Path, number: signal.Signals) -> None:
    """Told to end, it tidies up and leaves status 143; killed, it at least leaves no workers behind."""
    code = (
        "from pathlib import Path; from shortcuts import sign_and_wait\n"
        "from comparisons.outputs import new_directory; from comparisons.stopping import orderly_exit\n"
        "from comparisons.spread import spread\n"
        f"folder = Path({str(tmp_path)!r})\n"
        "with orderly_exit(), new_directory(folder / 'out'):\n"
        "    spread(sign_and_wait, [folder / 'one', folder / 'two'], workers=2)\n"
    )
    path = os.pathsep.join(sys.path)
    parent = subprocess.Popen([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": path})  # noqa: S603
    signed = [tmp_path / "one", tmp_path / "two"]
    try:
        wait_until(lambda: all(file.exists() and file.read_text() for file in signed))
        workers = [int(file.read_text()) for file in signed]
        assert all(map(alive, workers))
        parent.send_signal(number)
        assert parent.wait(timeout=20) == (143 if number == signal.SIGTERM else -signal.SIGKILL)
        wait_until(lambda: not any(map(alive, workers)))
    finally:
        parent.kill()
        parent.wait()
    if number == signal.SIGTERM:
        assert sorted(path.name for path in tmp_path.iterdir()) == ["one", "two"]


def wait_until(holds: Any) -> None:
    """Wait until something holds, for at most half a minute."""
    until = time.monotonic() + 30
    while not holds():
        assert time.monotonic() < until, "it never came to hold"
        time.sleep(0.05)


@pytest.mark.slow
def test_a_command_told_to_end_leaves_nothing(tmp_path: Path) -> None:
    """Status 143, no traceback, and no hidden folder."""
    code = "from comparisons.cli import main; main()"
    command = [sys.executable, "-c", code, "compare-perception", "--backends", "hog", "--quick"]
    running = subprocess.Popen(  # noqa: S603
        [*command, "--out", str(tmp_path / "out")], stderr=subprocess.PIPE, text=True
    )
    try:
        wait_until(lambda: list(tmp_path.iterdir()))
        time.sleep(1)
        running.terminate()
        _, said = running.communicate(timeout=30)
    finally:
        running.kill()
    assert running.returncode == 143
    assert "Traceback" not in said
    assert list(tmp_path.iterdir()) == []


def told() -> tuple[StudySpec, Learning]:
    """Return made-up findings of two backends."""
    spec = StudySpec(learning=LearningSpec(seeds=2, pushes=(25, 100), wrong=(0.0, 0.2), effort=0.25))
    points = tuple(
        Point(name, pushes, wrong, (pushes - 10, pushes - 5), 100, (0.1, 0.99))
        for name in ("one", "ensemble")
        for pushes in (25, 100)
        for wrong in (0.0, 0.2)
    )
    apart = HeldOut("colour red", 80, ((0, 0, 0), (3, 1, 6), (0, 0, 0)), ((0, 0, 0), (0, 9, 1), (0, 0, 0)), 1)
    return spec, Learning(("one", "ensemble"), points, {"one": (apart,), "ensemble": (apart,)})


def test_what_was_learnt_is_told() -> None:
    """Means with intervals, each seed, and the errors on what was kept out; the effort is named."""
    pushes, kept_out = learning_sections(*told())
    first, seeds = pushes.section.tables
    assert first.header == ("pushes", "wrong labels", "one", "ensemble")
    assert str(first.rows[0][2]).split()[0] == "17.5"
    assert str(seeds.rows[3][2]).replace("\N{NO-BREAK SPACE}", " ") == "90.0, 95.0"
    assert "80 to 80 pushes" in kept_out.section.paragraphs[0]
    for part in (pushes, kept_out):
        assert "25 % of the usual number of steps" in " ".join(part.section.paragraphs)
        assert {name for name, _ in part.section.figures} == set(part.figures)
    row, second = kept_out.section.tables[0].rows
    assert (*row[1:5], row[6]) == (10, "one", "90.0 %", "10.0 %", "3, 0, 6")
    assert str(row[5]).startswith("\N{MINUS SIGN}80.0")
    assert second[:3] == ("", "", "ensemble")
    assert learning_sections(told()[0], Learning((), (), {})) == []


def test_what_was_learnt_is_in_the_results() -> None:
    """Numbers that JSON can hold, with what follows from them."""
    content = json.loads(json.dumps(learning_results(told()[1]), allow_nan=False))
    assert content["learning"][0]["right"] == [15, 20]
    assert content["learning"][0]["accuracy"] == pytest.approx(0.175)
    first = content["held_out"][0]
    assert (first["backend"], first["group"], first["frames"], first["right"]) == ("one", "colour red", 10, 1)
    assert first["errors"] == {"none": 3, "cube": 0, "sphere": 6}
    assert first["difference"][0] == pytest.approx(-0.8)


def test_pushes_stand_on_a_logarithmic_axis_with_every_seed() -> None:
    """A panel a backend on one scale; a line a share of wrong labels, with its seeds as dots about it."""
    line = [Learnt(25, 0.5, 0.4, 0.6, (0.4, 0.6)), Learnt(2000, 0.9, 0.8, 0.95, (0.88, 0.92))]
    lines = {"labels as pushed": line, "10 % wrong": line}
    figure = learning_figure({"one": lines, "other": lines})
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["one", "other"]
    assert len({axes.get_ylim() for axes in figure.axes}) == 1
    axes = figure.axes[0]
    assert axes.get_xscale() == "log"
    assert [label.get_text() for label in axes.get_xticklabels()] == ["25", "2000"]
    assert [list(drawn.get_ydata()) for drawn in axes.lines] == [[50, 90], [50, 90]]
    assert len({drawn.get_color() for drawn in axes.lines}) == len({d.get_marker() for d in axes.lines}) == 2
    dots = [drawn.get_offsets() for drawn in axes.collections if isinstance(drawn, PathCollection)]
    shares = sorted(round(float(y)) for offsets in dots for _, y in np.asarray(offsets))
    assert shares == [40, 40, 60, 60, 88, 88, 92, 92]


def test_groups_kept_out_stand_in_rows() -> None:
    """A group that a backend lacks leaves its row free."""
    pair = Pair((1.0, 0.9, 1.0), (0.25, 0.1, 0.4))
    figure = held_out_figure({"one": {"colour red": pair, "distance 2": pair}, "other": {"distance 2": pair}})
    left, right = figure.axes
    assert [label.get_text() for label in left.get_yticklabels()] == ["colour red", "distance 2"]
    assert {tuple(axes.get_ylim()) for axes in figure.axes} == {(1.5, -0.5)}
    for axes, rows in ((left, 2), (right, 1)):
        marks = [drawn for drawn in axes.lines if drawn.get_marker() in ("o", "s")]
        assert (
            sorted(float(x) for drawn in marks for x in drawn.get_xdata()) == [25.0] * rows + [100.0] * rows
        )
    ((_, row),) = (
        (drawn.get_marker(), drawn.get_ydata()) for drawn in right.lines if drawn.get_marker() == "s"
    )
    assert float(row[0]) == pytest.approx(1, abs=0.3)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ((), LearningSpec()),
        (("--quick",), QUICK),
        (("--no-learning",), replace(LearningSpec(), seeds=0)),
        (("--quick", "--training-seeds", "2", "--effort", "0.5"), replace(QUICK, seeds=2, effort=0.5)),
    ],
)
def test_the_command_says_how_to_train(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, options: tuple[str, ...], expected: LearningSpec
) -> None:
    """Options reach the study; the number of workers is no part of it."""
    asked: list[tuple[StudySpec, int | None]] = []

    def compare(spec: StudySpec, _out: Path, _console: Any, workers: int | None) -> dict[str, Any]:
        asked.append((spec, workers))
        return {"spec": {"backends": []}, "scores": []}

    monkeypatch.setattr(perception_compare, "compare_perception", compare)
    with pytest.raises(SystemExit) as ended:
        main(["compare-perception", "--out", str(tmp_path / "out"), "--workers", "3", *options])
    assert ended.value.code == 0
    ((spec, workers),) = asked
    assert (spec.learning, workers) == (expected, 3)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--effort", "0"), "--effort 0: give a share"),
        (("--training-seeds", "-1"), "--training-seeds -1: give 0 to 100"),
        (("--workers", "0"), "--workers 0: give at least 1"),
    ],
)
def test_a_number_out_of_range_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: tuple[str, str], message: str
) -> None:
    """Before anything is rendered or written."""
    with pytest.raises(SystemExit) as ended:
        main(["compare-perception", "--out", str(tmp_path / "out"), *option])
    assert ended.value.code == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_painted_hues_are_all_there_are() -> None:
    """The short cut's frames hold each hue that the audit keeps out."""
    assert len(PAINTS) == len(HUES)
