"""Runs of kind "learn": what they measure, what they leave out on purpose, and what they refuse."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from comparisons.learn.line import Line
from comparisons.learn.registry import Request, new_run
from comparisons.learn.tabular import CompiledRun, TabularRun
from comparisons.study.declaring.declaration import load_study
from comparisons.study.kinds import Result, kind
from comparisons.study.running.work import Ran, work
from comparisons.study.runs.learn import LEARN, Goals, first_for_good
from comparisons.study.runs.learn_problem import problem, stored_values
from comparisons.study.runs.learn_settings import LearnSettings, split
from comparisons.study.spec import RunSpec, Value
from hierarchy.abstraction_counts import table_sizes
from planners import flat_optimum
from worlds import UserError

MAZE = "name small\n\ngrid\n. . : D1 G1\nT1 . | . .\n. . : D2 .\n\nstart 0,0\ntrigger T1\ngoal G1\n"
FOLDER = Path(__file__).parents[3] / "examples/studies"
STUDIES = (
    *("abstraction", "doors", "exploration", "gamma", "layout_size"),
    *("learners", "learning_rate", "pseudo_reward", "taxi", "taxi_tuning", "terminations"),
)


def run(seed: int = 0, **settings: Value) -> Result:
    """Carry out a run."""
    return LEARN.run(LEARN.complete(settings), seed)


@pytest.fixture
def small(tmp_path: Path) -> str:
    """Return the path of a small maze."""
    path = tmp_path / "small.maze"
    path.write_text(MAZE)
    return str(path)


def test_it_is_the_kind_of_its_name() -> None:
    """A study finds it without importing it."""
    assert kind("learn") is LEARN


def test_a_run_may_end_as_soon_as_it_has_come_to_the_optimum() -> None:
    """The last point of its curve is the first one at which every start is optimal."""
    result = run(graph="two_rooms", evaluate=20, lasting=0)
    curve, measures = result.curves["learning"], result.measures
    assert curve["share_optimal"][-1] == 1
    assert all(share is not None and share < 1 for share in curve["share_optimal"][:-1])
    assert measures["steps_to_optimal"] == measures["steps"] == curve["steps"][-1]
    assert measures["episodes_to_optimal"] == curve["episodes"][-1]
    assert measures["mean_loss"] == 0
    assert {len(column) for column in curve.values()} == {len(curve["steps"])}
    assert set(measures) == {measure.name for measure in LEARN.measures}


def test_by_default_a_run_ends_when_the_optimum_has_lasted() -> None:
    """Here the first one does not last: a row has been optimal everywhere, and a later one is not."""
    slow: Mapping[str, Any] = {"rate_falls": "geometric", "rate": 0.9, "rate_decay": 0.9, "rate_every": 40}
    settings: Mapping[str, Any] = {
        "graph": "two_rooms",
        "gamma": 0.9,
        "evaluate": 10,
        "spacing": 0.05,
        **slow,
    }
    hasty, sure = run(**settings, lasting=0), run(**settings)
    first, steps = hasty.measures["steps_to_optimal"], sure.measures["steps_to_optimal"]
    curve = sure.curves["learning"]
    optimal = {at: share == 1 for at, share in zip(curve["steps"], curve["share_optimal"], strict=True)}
    assert first is not None
    assert steps is not None
    assert optimal[first]
    assert first < steps
    assert not all(held for at, held in optimal.items() if first < (at or 0) < steps)
    assert all(held for at, held in optimal.items() if (at or 0) >= steps)
    *_, before, last = curve["steps"]
    assert (before or 0) < 2 * steps <= (last or 0)


def test_a_full_run_goes_the_same_way_and_on() -> None:
    """Until its steps are done; what it has reached for good, it reached at the same evaluation."""
    short, whole = (
        run(graph="two_rooms", evaluate=20, steps=60_000, until=until, lasting=0)
        for until in ("optimal", "end")
    )
    points = len(short.curves["learning"]["steps"])
    for name, column in short.curves["learning"].items():
        assert whole.curves["learning"][name][:points] == column
    steps, first = whole.measures["steps"], whole.measures["steps_to_optimal"]
    assert steps is not None
    assert steps >= 60_000
    assert first is not None
    assert first >= (short.measures["steps_to_optimal"] or 0)


def test_what_is_never_reached_is_none() -> None:
    """Too few steps; nan, which no file could hold, is None as well."""
    result = run(graph="two_rooms", steps=100, evaluate=1, spacing=0)
    assert result.measures["steps_to_optimal"] is None
    assert result.measures["episodes_to_optimal"] is None
    assert result.measures["steps_to_level"] is None
    assert None in result.curves["learning"]["mean_loss"]


def test_a_mean_over_starts_is_over_all_of_them() -> None:
    """While episodes from some never end there is none; as soon as all end, there is one."""
    curve = run(graph="two_rooms", evaluate=5, spacing=0, lasting=0).curves["learning"]
    assert any(0 < share < 1 for share in curve["share_ending"] if share is not None)
    for share, gained, lost in zip(
        curve["share_ending"], curve["mean_return"], curve["mean_loss"], strict=True
    ):
        assert (gained is not None) == (lost is not None) == (share == 1)


@given(held=st.lists(st.booleans(), max_size=12))
def test_first_for_good_is_where_nothing_false_follows(held: list[bool]) -> None:
    """And where the one before is false, if there is one."""
    found = first_for_good(held)
    if found is None:
        assert not held or not held[-1]
    else:
        assert all(held[found:])
        assert found < len(held)
        assert found == 0 or not held[found - 1]


@pytest.mark.parametrize("learner", ["maxq-0", "hsmq", "flat-q"])
def test_one_spec_gives_one_result(small: str, learner: str) -> None:
    """Bit for bit; another seed gives another."""
    settings = {"graph": "two_rooms", "world": small, "learner": learner, "evaluate": 10}
    assert run(3, **settings) == run(3, **settings)
    assert run(3, **settings) != run(4, **settings)
    assert run(3, **settings).measures["share_optimal"] == 1


@pytest.mark.slow
@pytest.mark.parametrize("learner", ["option-critic", "flat-ppo"])
def test_networks_learn_in_a_run_too(small: str, learner: str) -> None:
    """The same bits again; their tables are none, and their episodes are not counted."""
    settings = {"graph": "two_rooms", "world": small, "learner": learner, "steps": 500, "until": "end"}
    quick = {"num_envs": 8, "horizon": 8, "hidden": 8, "minibatch": 32, "max_steps": 20, "evaluate": 4}
    result = run(1, **settings, **quick)
    assert result == run(1, **settings, **quick)
    assert (result.measures["steps"] or 0) >= 500
    assert result.measures["stored_values"] is None
    assert "episodes" not in result.curves["learning"]


def test_the_oracle_has_nothing_to_learn() -> None:
    """Its return is the flat optimum's, from the first step on."""
    result = run(graph="taxi", world="taxi-rainy", learner="oracle")
    grounded = problem(LearnSettings("taxi", world="taxi-rainy"))
    best = flat_optimum(grounded.model, grounded.nodes[grounded.root].terminal).value[grounded.model.starts]
    assert result.measures["mean_return"] == pytest.approx(float(best.mean()))
    assert (result.measures["steps_to_optimal"], result.measures["steps_to_level"]) == (0, 0)
    assert result.measures["stored_values"] is None


def test_the_heat_map_tells_steps_and_gaps() -> None:
    """For the maze's own trigger and goal; a graph with one door task loses two steps somewhere."""
    oracle = run(graph="two_rooms", learner="oracle").details["heat"]
    best = run(graph="two_rooms").details["heat"]
    assert {**best, "way": []} == oracle
    assert (len(best["way"]), best["way"][0], best["way"][-1]) == (16, "1,0", "3,7")
    assert (best["trigger"], best["goal"], best["gaps"]) == ("T4", "G2", [0.0] * 31)
    at = dict(zip(best["cells"], best["steps"], strict=True))
    assert at["1,0"] == 15
    assert "6,1" in at or "T4" not in at  # the trigger's own cell is no start
    early = run(graph="two_rooms", steps=500, evaluate=5).details["heat"]
    gaps = [gap for gap in early["gaps"] if gap is not None]
    steps = [
        None if gap is None else gap + few for gap, few in zip(early["gaps"], best["steps"], strict=True)
    ]
    assert early["steps"] == steps
    assert all(gap >= 0 for gap in gaps)
    assert run(graph="taxi", steps=100).details == {}
    assert run(graph="two_rooms", steps=100, starts="trigger = T1", learner="flat-q").details == {}


def test_a_wall_is_no_cell_of_a_heat_map(tmp_path: Path) -> None:
    """Nor is the trigger, where no episode begins."""
    path = tmp_path / "a file.maze"
    path.write_text(MAZE.replace(": D2 .", ": D2 X"))
    heat = run(graph="two_rooms", world=str(path), learner="oracle").details["heat"]
    assert heat["cells"] == ["0,0", "0,1", "1,1", "2,0", "2,1"]
    assert heat["gaps"] == [0.0] * 5
    assert "a file" not in heat["layout"]


@pytest.mark.slow
def test_without_abstraction_learning_takes_longer_and_comes_to_the_same() -> None:
    """Every task and action has values of its own in every state."""
    declared, full = (run(graph="two_rooms", abstraction=how, evaluate=20) for how in ("declared", "full"))
    few, many = declared.measures["steps_to_optimal"], full.measures["steps_to_optimal"]
    assert few is not None
    assert many is not None
    assert many > 2 * few
    assert declared.measures["stored_values"] == 1308  # the paper's 1284, and 24 of the root
    # The states in which each task runs, times its children; and 4 actions in every state.
    grounded = problem(LearnSettings("two_rooms", abstraction="full"))
    reachable = grounded.model.reachable()
    tables = sum(
        int((call.available & node.live & reachable).sum()) for node in grounded.nodes for call in node.calls
    )
    most = tables + 4 * int(reachable.sum())
    assert 1308 < (full.measures["stored_values"] or 0) <= most


def test_an_unsafe_abstraction_never_comes_to_the_optimum() -> None:
    """The root that does not know the goal takes the same door for all of them."""
    result = run(graph="two_rooms", abstraction="drop goal", steps=150_000)
    assert result.measures["steps_to_optimal"] is None
    assert 0 < (result.measures["share_optimal"] or 0) < 1


def test_the_published_counts_of_taxi_are_those_of_the_tables() -> None:
    """632 with abstraction, 3000 flat (Dietterich 2000, section 5.1.6); HSMQ stores by what a task uses."""
    taxi = problem(LearnSettings("taxi"))
    counts = [stored_values(taxi, learner) for learner in ("maxq-0", "flat-q", "hsmq", "option-critic")]
    assert counts[:2] == [632, 3000]
    # Navigate 4 sites x 24 cells x 4, Get 100 x 5, Put 100 x 5, Root 500 x 2, as they are ever read.
    assert counts[2] == 4 * 24 * 4 + 100 * 5 + 100 * 5 + 500 * 2
    assert counts[3] is None
    again = stored_values(taxi, "maxq-q")
    assert again == 632 + sum(table.needed for table in table_sizes(taxi).tables)


@pytest.mark.slow
def test_a_task_that_is_not_taught_quits_early() -> None:
    """With its pseudo-reward MAXQ-Q takes the right door; without, from some starts the wrong one."""
    taught = run(graph=str(FOLDER / "early_doors.yaml"), learner="maxq-q")
    assert taught.measures["share_optimal"] == 1
    untaught = run(
        graph=str(FOLDER / "early_doors.yaml"), learner="maxq-q", pseudo_reward="none", steps=100_000
    )
    assert untaught.measures["share_optimal"] == pytest.approx(0.9375)


def test_a_learner_that_gets_stuck_has_reached_nothing() -> None:
    """An episode that does not end is a result, and says so."""
    result = run(graph="two_rooms", max_steps=300, evaluate=5)
    assert re.fullmatch(r"no end after 300 primitive steps in run 0, episode \d", result.details["stuck"])
    assert result.measures["steps_to_optimal"] is None
    assert result.measures["steps_to_level"] is None
    assert len(result.curves["learning"]["steps"]) >= 1


def test_numbers_that_are_none_any_more_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The run ends there, and has reached nothing."""

    def astray(self: TabularRun, episodes: int) -> float:
        usual(self, episodes)
        return float("nan") if self.episodes > 400 else 1.0

    usual = CompiledRun._train
    monkeypatch.setattr(CompiledRun, "_train", astray)
    result = run(graph="two_rooms", until="end")
    assert re.fullmatch(
        r"learning went astray: after \d+ steps episode_length is nan", result.details["stuck"]
    )
    assert result.measures["steps_to_optimal"] is None
    assert result.measures["episodes_to_optimal"] is None
    assert result.curves["learning"]["episodes"] == [100, 200, 300, 400]


def test_where_there_is_chance_a_level_is_reached() -> None:
    """Within a share of the best's size; cut off, the mean is over all starts."""
    settings: Mapping[str, Any] = {
        "graph": "taxi",
        "world": "taxi-rainy",
        "until": "level",
        "tolerance": 0.5,
        "lasting": 0,
    }
    exact, cut = run(**settings), run(**settings, limit=300)
    best = run(**{**settings, "learner": "oracle"}).measures["mean_return"]
    assert best is not None
    for result in (exact, cut):
        assert result.measures["steps_to_level"] == result.measures["steps"]
        assert (result.measures["mean_loss"] or np.inf) <= 0.5 * best
        *before, _ = result.curves["learning"]["mean_return"]
        assert all(value is None or value < 0.5 * best for value in before) or result is exact
    assert None not in cut.curves["learning"]["mean_return"]
    assert (cut.measures["steps"] or 0) <= (exact.measures["steps"] or 0)


def test_a_cut_return_comes_to_the_exact_one() -> None:
    """The more steps an episode may take; few steps cost few."""
    grounded = problem(LearnSettings("taxi", world="taxi-rainy"))
    learner = new_run(Request("maxq-0", grounded, 0, steps=100_000))
    for _ in learner.learn():
        pass
    line, policy = Line.of(grounded), learner.greedy()
    exact, cut = policy.returns(line.starts), policy.returns_within(line.starts, 2000)
    ends = np.isfinite(exact)
    assert 0 < ends.sum() < ends.size
    np.testing.assert_allclose(cut[ends], exact[ends], atol=1e-6)
    assert (cut[~ends] < -50).all()
    np.testing.assert_allclose(policy.returns_within(line.starts, 0), 0)
    one = policy.returns_within(line.starts, 1)
    assert set(one.tolist()) <= {-1.0, -10.0}
    assert Goals(line, 0.0, "end", limit=1).measure(policy).mean_return == pytest.approx(one.mean())


def test_episodes_begin_where_they_are_told_to() -> None:
    """Fewer starts need fewer steps, whatever else is the same."""
    every, one = run(graph="two_rooms", evaluate=5), run(graph="two_rooms", starts="robot = 1,0", evaluate=5)
    assert (one.measures["steps_to_optimal"] or np.inf) < (every.measures["steps_to_optimal"] or 0)
    assert one.measures["mean_return"] != every.measures["mean_return"]


def test_complete_settings_are_complete(small: str) -> None:
    """Completed again they stay the same; a number is the same however it is written."""
    for partial in (
        {"graph": "two_rooms"},
        {"graph": "two_rooms", "learner": "option-critic", "terminations": "prior"},
        {"graph": "two_rooms", "learner": "oracle", "world": small},
        {"graph": "two_rooms", "learner": "flat-q", "explores": "boltzmann", "cooling": 0.5},
    ):
        settings = LEARN.complete(partial)
        assert LEARN.complete(settings) == settings
        assert "total" not in settings
    one, other = (LEARN.complete({"graph": "two_rooms", "gamma": gamma}) for gamma in (1, 1.0))
    assert RunSpec("learn", 1, one, 0).hash == RunSpec("learn", 1, other, 0).hash


@pytest.mark.slow
def test_a_flat_network_is_wide_and_has_no_use_for_tasks() -> None:
    """Its settings are those that it reads."""
    settings = LEARN.complete({"graph": "two_rooms", "learner": "flat-ppo"})
    assert settings["hidden"] == 128
    assert "terminations" not in settings
    with pytest.raises(UserError, match=r"^prior: the learner flat-ppo has no such setting"):
        LEARN.complete({"graph": "two_rooms", "learner": "flat-ppo", "prior": 1})


def test_files_are_named_and_travel(small: str) -> None:
    """A run needs no more than the spec: the maze's text lies where the worker puts it."""
    settings = LEARN.complete({"graph": "two_rooms", "world": "small.maze", "steps": 2000})
    assert LEARN.files(settings) == ("world",)
    assert LEARN.files(LEARN.complete({"graph": "mine.yaml", "world": "m.maze"})) == ("graph", "world")
    outcome = work(RunSpec("learn", LEARN.version, settings, 0, {"small.maze": MAZE}), "test").outcome
    assert isinstance(outcome, Ran)
    assert outcome.result == LEARN.run({**settings, "world": small}, 0)


@pytest.mark.parametrize(
    ("given", "problem_told"),
    [
        ({}, "graph: there is no task graph ''; name a .yaml file, or one of "),
        ({"graph": "two_room"}, "graph: there is no task graph 'two_room'; did you mean 'two_rooms'?"),
        ({"graph": "two_rooms", "world": "tax"}, "world: no world 'tax'; did you mean 'taxi'?"),
        ({"graph": "two_rooms", "world": "taxi"}, "graph: "),
        ({"graph": "two_rooms", "learner": "maxq"}, "learner: maxq is not possible; did you mean "),
        (
            {"graph": "two_rooms", "gama": 1},
            "gama: the learner maxq-0 has no such setting; did you mean 'gamma'?",
        ),
        (
            {"graph": "two_rooms", "stpes": 1},
            "stpes: the learner maxq-0 has no such setting; did you mean 'steps'?",
        ),
        ({"graph": "two_rooms", "gamma": 2}, "gamma: 2 is not possible; give a number from 0 to 1"),
        ({"graph": "two_rooms", "cooling": 0.5}, "cooling: it is not read with explores=share"),
        ({"graph": "two_rooms", "total": 5}, "total: here it is called steps; give steps"),
        ({"graph": "two_rooms", "steps": 0}, "steps: 0 is not possible; give a whole number from 1"),
        ({"graph": "two_rooms", "steps": True}, "steps: true is not possible; give a whole number from 1"),
        ({"graph": "two_rooms", "until": "ende"}, "until: ende is not possible; did you mean 'end'?"),
        ({"graph": "two_rooms", "starts": "gaol = G1"}, "starts: "),
        ({"graph": "two_rooms", "starts": "robot = goal and doors = open"}, "starts: no start has "),
        (
            {"graph": "two_rooms", "abstraction": "none"},
            "abstraction: 'none' is not possible; use declared, ",
        ),
        (
            {"graph": "two_rooms", "abstraction": "drop gaol"},
            "abstraction: there is no state variable 'gaol'",
        ),
        (
            {"graph": "two_rooms", "abstraction": "drop doors"},
            "abstraction: no completion is stored by doors",
        ),
        (
            {"graph": "two_rooms", "abstraction": "drop goal", "learner": "hsmq"},
            "abstraction: the learner hsmq does not store its values call by call",
        ),
        (
            {"graph": "two_rooms", "abstraction": "full", "learner": "flat-q"},
            "abstraction: the learner flat-q has no tasks to abstract in",
        ),
        (
            {"graph": "two_rooms", "pseudo_reward": "none"},
            "pseudo_reward: the learner maxq-0 reads none; leave it out for this learner",
        ),
        (
            {"graph": "two_rooms", "pseudo_reward": "none", "learner": "maxq-q"},
            "pseudo_reward: task graph two_rooms has none; there is nothing to leave out",
        ),
        (
            {"graph": "two_rooms", "learner": "oracle", "gamma": 1},
            "gamma: the learner oracle has no such setting",
        ),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, Value], problem_told: str) -> None:
    """Before anything is run; the message begins with the setting, so that it is found in the study."""
    with pytest.raises(UserError, match="^" + re.escape(problem_told)):
        LEARN.complete(given)


@pytest.mark.parametrize("name", STUDIES)
def test_the_ready_studies_could_begin(name: str) -> None:
    """An answer, seeds enough to rank, and what each combination learns on can be had."""
    study = load_study(FOLDER / f"{name}.yaml")
    assert study.name == name
    assert study.answer is not None
    assert len(study.seeds) >= 5
    problems = set()
    for each in study.combinations:
        files = {setting: str(FOLDER / str(each.settings[setting])) for setting in LEARN.files(each.settings)}
        settings = {**each.settings, **files}
        problems.add(split({name: settings[name] for name in ("graph", "world", "learner", "abstraction")}))
    assert all(problem(settings).model.starts.any() for settings in problems)


def test_no_ready_study_is_forgotten() -> None:
    """Those listed here are those that are there."""
    ours = {
        path.stem for path in FOLDER.glob("*.yaml") if "\nkind: learn\n" in path.read_text(encoding="utf-8")
    }
    assert ours == set(STUDIES)
