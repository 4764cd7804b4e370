"""The comparison of perception backends: what it counts, what mistakes cost, and its report."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shortcuts import as_package, render_painted

from comparisons import learnt, perception_learning
from comparisons.cli import main
from comparisons.intervals import bootstrapped, wilson
from comparisons.outputs import untracked
from comparisons.perception_looks import audit, see, stranger
from comparisons.perception_price import Played, Spoilt, Task, price
from comparisons.perception_spec import StudySpec
from comparisons.perception_study import (
    CAMOUFLAGE,
    SCENES,
    UNKNOWN,
    load_backends,
    look,
    score,
)
from perception.corruptions import CORRUPTIONS
from perception.percepts import Percepts, Sees, checked_frames
from perception.protocol import LABELS, NOTHING, Backend, Detection, Frames, View
from perception.pushed import PushedFrames, pushed_frames
from perception.variation import Variation
from worlds import Outcome, UserError
from worlds.camera import Camera


class Always(Sees):
    """Says the same of every frame."""

    def __init__(self, label: str, name: str = "always") -> None:
        self.label, self.name = label, name

    def perceive(self, frames: Frames) -> Percepts:
        """Be 80 % sure."""
        count = len(checked_frames(frames))
        chances = [0.8 if label == self.label else 0.1 for label in LABELS]
        return Percepts(np.tile(chances, (count, 1)), np.ones(count), np.zeros(count))


class Views:
    """A backend without `perceive`, that is sure of nothing."""

    name, needs_frames = "views", True

    def detect(self, views: Any) -> list[Detection]:
        """See a cube two cells ahead."""
        return [Detection("cube", 0.5, 2) for _ in views]


@pytest.fixture
def fakes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make ``always-cube`` and its like names of backends."""
    load = learnt.load_backend

    def loaded(name: str, camera: Camera | None = None) -> Backend:
        kind, _, label = name.partition("-")
        return Always(label, name) if kind == "always" else load(name, camera)

    monkeypatch.setattr(learnt, "load_backend", loaded)


@pytest.fixture(scope="module")
def data() -> PushedFrames:
    """Return a dozen varied frames."""
    return pushed_frames(range(12), 200, Variation())


def test_a_score_is_what_was_counted(data: PushedFrames) -> None:
    """A third of the frames hold a cube, and all are called cubes with a confidence of 0.8."""
    found = score("always", "clean", 0, data, look(Always("cube"), data.frames))
    assert found.frames == 12
    assert [row[1] for row in found.confusion] == np.bincount(data.labels, minlength=3).tolist()
    assert found.accuracy == pytest.approx((data.labels == 1).mean())
    assert found.calibration_error == pytest.approx(abs(0.8 - found.accuracy))
    assert (found.abstained, found.answered_right, found.found) == (0, found.right, found.right)
    assert found.distance_right == ((data.labels == 1) & (data.distances == 1)).sum()


def test_a_backend_of_views_is_looked_through(data: PushedFrames) -> None:
    """Its confidence is spread over the labels."""
    seen = look(Views(), data.frames)
    assert seen.probabilities.tolist() == [[0.25, 0.5, 0.25]] * 12
    assert seen.distances.tolist() == [2] * 12


def test_the_audit_counts_every_obstacle_once_in_each_respect(data: PushedFrames) -> None:
    """Colours, sizes, distances and shapes each add up to the frames with something ahead."""
    groups = audit("always", data, look(Always("sphere"), data.frames))
    ahead = (data.labels > 0).sum()
    for by in ("colour", "size", "distance", "shape"):
        own = [group for group in groups if group.by == by]
        assert sum(group.frames for group in own) == ahead
        assert sum(group.right for group in own) == (data.labels == 2).sum()


def test_an_abstention_is_no_false_rollable(data: PushedFrames) -> None:
    """A cube called a sphere is one; if the backend abstains, or the solid rolled, it is none."""
    sure = look(Always("sphere"), data.frames)
    cubes = int((data.kinds == "cube").sum())
    assert stranger("always", "cube", data, sure).false_rollable == cubes > 0
    unsure = Percepts(sure.probabilities, sure.distances, np.ones(12))
    assert stranger("always", "cube", data, unsure).false_rollable == 0
    balls = stranger("always", "sphere", data, sure)
    assert (balls.accepted, balls.false_rollable) == (balls.rolled, balls.frames - balls.rolled)


@given(st.integers(1, 500), st.data())
def test_wilson_s_interval_holds_the_share(frames: int, drawn: st.DataObject) -> None:
    """It lies in [0, 1], and is never a point."""
    right = drawn.draw(st.integers(0, frames))
    low, high = wilson(right, frames)
    assert 0 <= low <= right / frames + 1e-12
    assert right / frames - 1e-12 <= high <= 1
    assert high - low > 0.003


@given(st.lists(st.integers(-5, 60), min_size=1, max_size=20), st.integers(0, 9))
def test_a_bootstrap_interval_lies_within_the_values(values: list[int], seed: int) -> None:
    """And the same seed gives the same."""
    low, high = bootstrapped(list(map(float, values)), seed)
    assert min(values) <= low <= high <= max(values)
    assert (low, high) == bootstrapped(list(map(float, values)), seed)


def test_extra_steps_are_counted_where_both_arrive() -> None:
    """An episode that one of them fails is no comparison of steps."""
    reached, failed = Outcome.REACHED, Outcome.NO_ROUTE
    mine = [Played(reached, 14, 1, 2, 1, {("cube", "sphere"): 1}), Played(failed, 90, 0, 1, 0, {})]
    told = [Played(reached, 11, 0, 2, 0, {}), Played(reached, 9, 0, 1, 0, {})]
    found = price("mine", ("clean", 0), mine, told, seed=1)
    assert (found.both, found.extra, found.reached, found.episodes) == (1, 3.0, 1, 2)
    assert (found.blocked, found.asked, found.wrong, found.cube_as_sphere) == (1, 3, 1, 1)
    assert found.outcomes == {"reached": 1, "truncated": 0, "no route left": 1, "wrong shape believed": 0}


def test_a_spoilt_lens_spoils_each_frame_anew() -> None:
    """The backend sees other frames than the camera took, and the same ones again with the same seed."""
    got: list[Frames] = []

    class Keeps(Always):
        def perceive(self, frames: Frames) -> Percepts:
            got.append(frames)
            return super().perceive(frames)

    view = View(np.full((96, 96, 3), 100, np.uint8), NOTHING)
    for _ in range(2):
        lens = Spoilt(Keeps("none"), "gaussian_noise", 3, seed=4)
        lens.detect([view])
        lens.detect([view])
    assert not np.array_equal(got[0], got[1])
    assert np.array_equal(got[0], got[2])
    assert np.array_equal(got[1], got[3])
    assert (got[0] != 100).any()


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: StudySpec(seed=0), "names training frames"),
        (lambda: StudySpec(seed=100), "names tuning frames"),
        (lambda: StudySpec(frames=2), "give at least 3"),
        (lambda: StudySpec(episodes=-1), "give 0 or more"),
        (lambda: load_backends(["hough", "hough"], Camera()), "named twice"),
        (lambda: load_backends(["huogh"], Camera()), "did you mean 'hough'?"),
    ],
)
def test_a_spec_that_cannot_be_run_is_refused(made: Any, message: str) -> None:
    """Seeds that train or tune above all."""
    with pytest.raises(UserError, match=re.escape(message)):
        made()


def test_every_backend_that_reads_frames_is_taken() -> None:
    """If none is named; the truth reads none."""
    names = list(load_backends((), Camera()))
    assert "hough" in names
    assert "truth" not in names


@pytest.mark.slow
def test_every_set_is_looked_at_by_every_backend() -> None:
    """Scenes, the floor's colour, every corruption and solids never learnt."""
    backends: dict[str, Backend] = {"a": Always("cube"), "b": Always("none")}
    spec = StudySpec(frames=6, severities=(1, 5))
    seen = see(spec, backends, untracked)
    looked = [(one.backend, one.condition, one.severity) for one in seen.scores]
    sets = [(c, 0) for c in SCENES] + [(c, s) for c in (CAMOUFLAGE, *CORRUPTIONS) for s in (1, 5)]
    assert sorted(looked) == sorted((name, *one) for name in backends for one in sets)
    assert {one.family for one in seen.strangers} == {"sphere", *UNKNOWN}
    assert {one.frames for one in seen.scores} == {6}
    assert set(seen.latency) == {"a", "b"}
    assert sum(seen.reliability["a"][0].counts) == 6 * len(SCENES)
    assert {(m.truth == "cube", m.seen) for m in seen.mistakes if m.backend == "a"} == {(False, "cube")}


@pytest.mark.slow
def test_mistakes_have_a_price() -> None:
    """The truth pays nothing; who sees nothing runs into things and needs more steps."""
    task = Task(StudySpec(episodes=12), untracked)
    truth, *others = task.prices({"blind": Always("none", "blind")})
    assert (truth.wrong, truth.extra, truth.missed, truth.imagined) == (0, 0.0, 0, 0)
    blind = others[0]
    assert (blind.backend, blind.condition, blind.episodes) == ("blind", "clean", 12)
    assert blind.missed > 0
    assert blind.blocked > truth.blocked
    assert blind.reached <= truth.reached
    assert (blind.cube_as_sphere, blind.sphere_as_cube, blind.imagined) == (0, 0, 0)


@pytest.mark.slow
@pytest.mark.usefixtures("fakes")
def test_the_command_leaves_a_report_that_needs_no_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Report, results and figures, whole; the results repeat byte for byte, however many workers train."""
    (tmp_path / "package").mkdir()
    as_package(tmp_path / "package", monkeypatch)
    monkeypatch.setattr(perception_learning, "render_frames", render_painted)
    small = ("--frames", "6", "--episodes", "2", "--quick")
    backends = ("--backends", "always-cube", "always-none", "by-colour")
    for name, workers in (("one", "1"), ("two", "2")):
        with pytest.raises(SystemExit) as ended:
            main(
                ["compare-perception", "--out", str(tmp_path / name), "--workers", workers, *small, *backends]
            )
        assert ended.value.code == 0
    assert "always-cube: right on" in capsys.readouterr().out
    entries = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert entries == ["figures", "report.html", "results.json", "times.json"]
    page = (tmp_path / "one" / "report.html").read_text(encoding="utf-8")
    assert {a for a in re.findall(r"https?://[^\s\"'<>)]+", page) if "w3.org" not in a} == set()
    for title in ("Scenes", "Corruptions", "Confusion", "Reliability", "Short cuts", "Solids never learnt"):
        assert f">{title}</h2>" in page
    for title in ("Pushes needed", "Kept out of training", "Latency", "The price of mistakes", "Mistakes"):
        assert f">{title}</h2>" in page
    figures = {path.name for path in (tmp_path / "one" / "figures").iterdir()}
    names = {name.rsplit(".", 1)[0] for name in figures}
    assert names >= {
        "scenes",
        "corruptions",
        "reliability",
        "confusion_1",
        "mistakes_2",
        "pushes_needed",
        "held_out",
    }
    assert figures == {f"{name}.{kind}" for name in names for kind in ("png", "svg")}
    one, two = ((tmp_path / name / "results.json").read_bytes() for name in ("one", "two"))
    assert one == two
    content = json.loads(one)
    first = content["scores"][0]
    assert first["interval"][0] <= first["accuracy"] <= first["interval"][1]
    assert {row["backend"] for row in content["price"]} == {"truth", *backends[1:]}
    assert content["spec"]["learning"]["effort"] == 0.02
    for rows in (content["learning"], content["held_out"]):
        assert {row["backend"] for row in rows} == {"by-colour"}
