"""Runs of kind "episodes": their settings, each affordance judged, and what a run tells of them."""

from dataclasses import replace
from pathlib import Path

import pytest
from beliefs import MAZE, knowing, number
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import SMALL

from comparisons.dynamic import Tally, judge, random_episode
from comparisons.eyes import Sight
from comparisons.learning import PairLearner
from comparisons.robot import Encounter, Robot
from comparisons.study.declaring.declaration import load_study
from comparisons.study.figures.draw_counterexample import draw
from comparisons.study.kinds import Result
from comparisons.study.running.work import Ran, work
from comparisons.study.runs.episode_settings import complete, files
from comparisons.study.runs.episodes import EPISODES, run
from comparisons.study.runs.judging import Count, Judged, Ledger, Once, counterexample_data, judged, smallest
from comparisons.study.spec import RunSpec
from hierarchy import checked, two_rooms
from perception.truth import Truth
from planners import Affordance, LocalRule, Replanner, Replanning, Strategy
from planners.resweep import Experience, ValueSweep
from worlds import MazeState, Outcome, UserError, load_layout, maze_model, state_number
from worlds.layout_writing import layout_text

EXAMPLES = Path(__file__).parents[3] / "examples" / "studies"
NORTH, SOUTH, WEST, EAST = range(4)
GROUNDED = checked(two_rooms(MAZE), maze_model(MAZE))
ORACLE = Replanner(MAZE, GROUNDED)
TRIGGER, GOAL = GROUNDED.place("GotoTrigger(T4)"), GROUNDED.place("GotoGoal(G4)")


@pytest.fixture(scope="module")
def pairs() -> dict[tuple[str, str], PairLearner]:
    """Return a learner of every pair, learnt with seed 0."""
    found = {
        (trigger, goal): PairLearner(MAZE, GROUNDED, trigger, goal, seed=0)
        for trigger in MAZE.triggers
        for goal in MAZE.goals
    }
    for learner in found.values():
        learner.learn()
    return found


@pytest.fixture(scope="module")
def local(pairs: dict[tuple[str, str], PairLearner]) -> LocalRule:
    """Return the paper's rule, learnt on the pair (T4, G4), whose values for T4 are those of any goal."""
    return LocalRule(MAZE, pairs["T4", "G4"].learner)


def meeting(strategy: Strategy, task: int, cell: str, belief: MazeState) -> Encounter:
    """Return the meeting with an obstacle that a robot has that follows a strategy."""
    at = number(cell)
    here, there = MAZE.cells[belief.robot], MAZE.cells[at]
    distance = abs(here.row - there.row) + abs(here.col - there.col)
    return Encounter(0, "C1", at, task, belief, distance, strategy.affordance(task, at, belief))


@pytest.mark.parametrize(
    ("given_", "message"),
    [
        ({"obstacles": 21}, "obstacles: 21 is not possible; give a whole number from 0 to 20"),
        ({"obstacles": 2.0}, "obstacles: 2.0 is not possible; give a whole number from 0 to 20"),
        ({"obstacles": True}, "obstacles: True is not possible"),
        ({"obstacle": 2}, "obstacle: there is no such setting; did you mean 'obstacles'?"),
        ({"spheres": 1.5}, "spheres: 1.5 is not possible; give a number from 0 to 1"),
        ({"strategy": "localrule"}, "strategy: 'localrule' is not possible; did you mean 'local-rule'?"),
        ({"strategy": 3}, "strategy: 3 is not possible; give one of local-rule, value-sweep, replanning"),
        ({"layout": "two_room"}, "layout: there is no layout 'two_room'; did you mean 'two_rooms'?"),
        ({"perception": "houg"}, "perception: 'houg' is not possible; did you mean 'hough'?"),
        ({"severity": 2}, "severity: 2 of no corruption; name a corruption, or give 0"),
        ({"corruption": "jpeg", "perception": "hough"}, "severity: 0 of jpeg leaves frames as they are"),
        ({"corruption": "jpeg", "severity": 2}, "corruption: 'jpeg' spoils frames, and perception 'truth'"),
    ],
)
def test_settings_that_are_not_possible_are_refused(
    given_: dict[str, bool | int | float | str], message: str
) -> None:
    """The message begins with the setting's name, and says how to mend it."""
    with pytest.raises(UserError) as caught:
        complete(given_)
    assert str(caught.value).startswith(message)


def test_complete_settings_stay_as_they_are() -> None:
    """Every setting is there, whole numbers that are shares have become shares, and only a file is named."""
    settings_ = complete({"spheres": 1, "on_way": 0})
    assert complete(settings_) == settings_
    assert (repr(settings_["spheres"]), repr(settings_["on_way"])) == ("1.0", "0.0")
    assert files(settings_) == ()
    assert files(complete({"layout": "mine.maze"})) == ("layout",)


@given(st.integers(0, 50), st.integers(0, 50), st.integers(0, 19))
def test_with_more_obstacles_an_episode_gains_some(seed: int, number_: int, count: int) -> None:
    """Pair, start and obstacles stay; those of the paper's experiment are among them."""
    fewer, *pair = random_episode(MAZE, seed, number_, count)
    more, *same = random_episode(MAZE, seed, number_, count + 1)
    assert (pair, fewer.state.robot) == (same, more.state.robot)
    assert list(fewer.obstacles.values()) == list(more.obstacles.values())[:count]
    drawn, *again = random_episode(MAZE, seed, number_)
    assert again == pair
    shared = min(count, len(drawn.obstacles))
    assert list(drawn.obstacles.values())[:shared] == list(fewer.obstacles.values())[:shared]


@given(st.integers(0, 99), st.sampled_from([0.0, 1.0]), st.sampled_from([0.0, 1.0]))
def test_shares_of_spheres_and_of_obstacles_on_the_way_are_kept_to(
    seed: int, spheres: float, on_way: float
) -> None:
    """None or all of either; obstacles of a way that is not full all lie on it."""
    episode, trigger, goal = random_episode(MAZE, seed, 0, 3, spheres=spheres, on_way=on_way)
    kinds = {obstacle.kind for obstacle in episode.obstacles.values()}
    assert kinds == {"sphere" if spheres else "cube"}
    assert not {MAZE.marks[trigger], MAZE.marks[goal]} & {o.cell for o in episode.obstacles.values()}
    if on_way == 0:
        other, *_ = random_episode(MAZE, seed, 0, 3, spheres=1 - spheres, on_way=0.0)
        assert [o.cell for o in other.obstacles.values()] == [o.cell for o in episode.obstacles.values()]


def test_stepping_back_from_a_cube_costs_two_steps(local: LocalRule) -> None:
    """From 3,1 with a cube at 4,1 the rule goes North, first of three that look equal; 5 steps do by West."""
    one = judged(ORACLE, local, meeting(local, TRIGGER, "4,1", knowing("3,1", cubes="4,1")), followed=True)
    assert one is not None
    assert (one.optimal, one.fatal, one.cost) == (False, False, 2)
    data = counterexample_data(MAZE, GROUNDED, one)
    assert {key: data[key] for key in ("task", "action", "optimal", "cost", "known", "target")} == {
        "task": "GotoTrigger(T4)",
        "action": "North",
        "optimal": ["West", "East"],
        "cost": 2,
        "known": 1,
        "target": [6, 1],
    }
    assert (len(data["way"]), len(data["best"])) == (7, 5)


def test_a_strategy_may_be_asked_where_another_is_followed(
    local: LocalRule, pairs: dict[tuple[str, str], PairLearner]
) -> None:
    """Two grids before the cube at 3,0 replanning goes on, and the rule turns aside; both are optimal."""
    replanning = Replanning(ORACLE, pairs["T4", "G4"].learner)
    met = meeting(replanning, TRIGGER, "3,0", knowing("1,0", cubes="3,0"))
    asked = judged(ORACLE, local, met)
    followed = judged(ORACLE, replanning, met, followed=True)
    assert asked is not None
    assert followed is not None
    assert asked.proof is not None
    assert followed.proof is not None
    assert (asked.proof.action, followed.proof.action) == (EAST, SOUTH)
    assert asked.optimal
    assert followed.optimal


def test_an_action_after_which_no_way_is_left_is_fatal(
    pairs: dict[tuple[str, str], PairLearner],
) -> None:
    """Pushed South, the sphere before the corner G4 lies there for ever: fatal, and no cost in steps."""
    learner = pairs["T1", "G4"].learner
    start = state_number(MAZE, GROUNDED.model.index, replace(knowing("1,0"), trigger=2, goal=60))
    everything = Experience.complete(MAZE, GROUNDED, [start])
    belief = MazeState(number("5,4"), 2, 60, doors_open=True, spheres=frozenset({number("6,4")}))
    for strategy in (LocalRule(MAZE, learner), ValueSweep(MAZE, learner, everything)):
        one = judged(ORACLE, strategy, meeting(strategy, GOAL, "6,4", belief), followed=True)
        assert one is not None
        assert (one.optimal, one.fatal, one.cost) == (False, True, 0)
        assert counterexample_data(MAZE, GROUNDED, one)["cost"] is None
    replanning = Replanning(ORACLE, learner)
    one = judged(ORACLE, replanning, meeting(replanning, GOAL, "6,4", belief), followed=True)
    assert one is not None
    assert one.optimal


class Mute:
    """A strategy that never has an action."""

    def choose(self, belief: MazeState) -> int | None:
        """Choose nothing."""

    def route(self, task: int, belief: MazeState) -> tuple[int, ...] | None:
        """Know no route."""

    def affordance(self, task: int, obstacle: int, belief: MazeState) -> Affordance:
        """Let the obstacle afford nothing."""
        return Affordance("cube", on_route=task == TRIGGER and obstacle in belief.cubes, action=None)


def test_having_no_action_where_there_is_a_way_is_a_mistake_of_its_own() -> None:
    """It is silent: neither optimal nor fatal, without cost, and no counter-example to draw."""
    belief, ledger = knowing("3,1", cubes="4,1"), Ledger()
    ledger.add(judged(ORACLE, Mute(), meeting(Mute(), TRIGGER, "4,1", belief), followed=True), GROUNDED)
    assert ledger.total() == Count(asked=1, silent=1)
    assert ledger.refuted() == {}


def test_an_obstacle_that_leaves_no_way_is_counted_apart(local: LocalRule) -> None:
    """Boxed in by four cubes there is nothing to judge, whatever the strategy says."""
    belief, ledger = knowing("3,1", cubes="2,1 4,1 3,0 3,2"), Ledger()
    ledger.add(judged(ORACLE, local, meeting(local, TRIGGER, "4,1", belief)), GROUNDED)
    assert (ledger.boxed_in, ledger.total()) == (1, Count())


def test_the_smallest_counter_example_has_the_fewest_obstacles_then_the_shortest_way(
    local: LocalRule,
) -> None:
    """Whatever the order in which they come; one with each shape."""
    situations = [
        ("4,1", knowing("3,1", cubes="4,1 0,0")),
        ("4,1", knowing("3,1", cubes="4,1")),
        ("3,1", knowing("2,1", cubes="3,1")),
        ("5,0", knowing("4,0", cubes="6,0", spheres="5,0")),
    ]
    found = [judged(ORACLE, local, meeting(local, TRIGGER, *each), followed=True) for each in situations]
    for order in (found, found[::-1]):
        ledger = Ledger()
        for one in order:
            ledger.add(one, GROUNDED)
        assert ledger.refuted() == {"cube": found[1], "sphere": found[3]}
    first, second = (counterexample_data(MAZE, GROUNDED, one) for one in found[:2] if isinstance(one, Judged))
    assert smallest([first, None, second]) is second
    assert smallest([None]) is None


@given(
    st.lists(
        st.tuples(st.sampled_from(["A", "B"]), st.sampled_from(["cube", "sphere"]), st.integers(1, 3)),
        max_size=12,
    )
)
def test_counts_add_up_however_they_are_parted(groups: list[tuple[str, str, int]]) -> None:
    """Over subtasks, over shapes or over numbers of known obstacles, the sums are the same."""
    ledger = Ledger()
    for i, group in enumerate(groups):
        ledger.groups[*group, 1] = ledger.groups.get((*group, 1), Count()) + Count(1, i % 2, 0, 0, i)
    total = ledger.total()
    assert (total.asked, total.cost) == (len(groups), sum(range(len(groups))))
    assert ledger.total(subtask="A") + ledger.total(subtask="B") == total
    assert ledger.total(shape="cube") + ledger.total(shape="sphere") == total
    assert sum((ledger.total(known=known) for known in (1, 2, 3)), Count()) == total
    assert sum(row["asked"] for row in ledger.as_data()) == total.asked


@settings(max_examples=60)
@given(st.data())
def test_asking_once_gives_the_oracle_s_plans(data: st.DataObject) -> None:
    """Also where spheres and cubes leave no way, which it sees without a search over the spheres."""
    once = Once(MAZE, GROUNDED)
    cells = [number(str(cell)) for cell in sorted(MAZE.rooms["A"])]
    robot, *rest = data.draw(st.lists(st.sampled_from(cells), unique=True, min_size=1, max_size=12))
    spheres = frozenset(rest[: data.draw(st.integers(0, 3))])
    belief = MazeState(robot, number("6,1"), number("3,7"), False, frozenset(rest) - spheres, spheres)
    for _ in range(2):
        mine, best = once.plan(TRIGGER, belief), ORACLE.plan(TRIGGER, belief)
        assert (mine is None) == (best is None)
        if mine is not None and best is not None:
            assert (mine.actions, mine.first_actions, mine.depths) == (
                best.actions,
                best.first_actions,
                best.depths,
            )


@pytest.mark.parametrize("obstacles", range(1, 7))
def test_a_run_is_the_paper_s_dynamic_part(pairs: dict[tuple[str, str], PairLearner], obstacles: int) -> None:
    """For one to six obstacles its numbers are those of `comparisons.dynamic`, affordance by affordance."""
    tally = Tally()
    for number_ in range(12):
        episode, *pair = random_episode(MAZE, 0, number_, obstacles)
        learner = pairs[pair[0], pair[1]].learner
        done = Robot(MAZE, GROUNDED, Replanning(ORACLE, learner), Sight(MAZE, Truth())).run(episode)
        met = [one for one in done.encounters if one.affordance.on_route]
        tally.add(done, [judge(ORACLE, LocalRule(MAZE, learner), one) for one in met], ORACLE)
    losses = [v.local.loss for v in tally.verdicts if v.local is not None and not v.local.optimal]
    found = run(complete({"obstacles": obstacles, "episodes": 12}), 0)
    measures = found.measures
    asked = len(tally.verdicts)
    assert measures["asked"] == asked
    assert measures["optimal"] == pytest.approx(tally.local_optimal / asked)
    assert measures["fatal"] == pytest.approx(losses.count(None) / asked)
    assert measures["cost_per_episode"] == pytest.approx(sum(loss or 0 for loss in losses) / 12)
    assert measures["boxed_in"] == tally.boxed_in
    assert measures["reached"] == pytest.approx(tally.outcomes[Outcome.REACHED] / 12)
    assert found.details["outcomes"] == {outcome.value: tally.outcomes[outcome] for outcome in Outcome}
    situations = {name: list(counts) for name, counts in tally.local_rule_by().items()}
    mine: dict[str, list[int]] = {}
    for row in found.details["counts"]:
        of = mine.setdefault(f"{row['shape']}, {row['distance']} ahead", [0, 0])
        of[0] += row["asked"]
        of[1] += row["optimal"]
    assert mine == situations


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    """Return a run with each strategy."""
    wanted = {"obstacles": 9, "episodes": 25}
    names = ("local-rule", "value-sweep", "replanning")
    return {name: run(complete({**wanted, "strategy": name}), 0) for name in names}


@pytest.mark.slow
def test_replanning_makes_no_mistake(results: dict[str, Result]) -> None:
    """All of its affordances are optimal, in every part, and there is nothing to draw."""
    found = results["replanning"]
    assert {found.measures[name] for name in ("optimal", "optimal.GotoGoal", "optimal.cube")} == {1.0}
    assert (found.measures["cost_per_episode"], found.measures["cost_per_mistake"]) == (0.0, None)
    assert found.details["counterexample"] is None
    with pytest.raises(UserError, match="no counter-example"):
        draw(found.details)


@pytest.mark.slow
def test_strategies_are_asked_in_the_same_situations(results: dict[str, Result]) -> None:
    """As the robot follows replanning, all that is not the strategy's own is the same."""
    same = ("asked", "boxed_in", "reached", "steps_over_best", "misread")
    told = [[found.measures[name] for name in same] for found in results.values()]
    assert told[0] == told[1] == told[2]
    shares = [results[name].measures["optimal"] or 0 for name in ("local-rule", "value-sweep", "replanning")]
    assert shares[0] < shares[1] <= shares[2] == 1


@pytest.mark.slow
def test_a_run_tells_only_what_its_kind_measures(results: dict[str, Result]) -> None:
    """Every measure has its description, and the parts by known obstacles add up to the whole."""
    for found in results.values():
        assert {name.partition(".")[0] for name in found.measures} == {m.name for m in EPISODES.measures}
        assert all(EPISODES.measure(name).name == name for name in found.measures)
        curve = found.curves["by_known"]
        assert sum(asked or 0 for asked in curve["asked"]) == found.measures["asked"]
        right = sum(
            (share or 0) * (n or 0) for share, n in zip(curve["optimal"], curve["asked"], strict=True)
        )
        assert right / (found.measures["asked"] or 1) == pytest.approx(found.measures["optimal"])


@pytest.mark.slow
def test_a_counter_example_is_drawn_from_a_run_s_details(results: dict[str, Result]) -> None:
    """Two panels, named after the strategy; the data says what they show."""
    found = results["local-rule"].details
    left, right = draw(found).axes
    assert left.get_title(loc="left").startswith("(a) the paper's local rule")
    assert (
        right.get_title(loc="left")
        == f"(b) an optimal strategy: {len(found['counterexample']['best'])} steps"
    )
    assert found["counterexample"]["action"] not in found["counterexample"]["optimal"]
    assert found["counterexample"] in found["counterexamples"].values()
    left, _ = draw(results["value-sweep"].details).axes
    assert left.get_title(loc="left").startswith("(a) value sweep")


def test_a_blocked_action_is_called_so() -> None:
    """A push against a sphere that the wall behind it holds leaves the robot where it is."""
    found = {
        "strategy": "local-rule",
        "layout": layout_text(MAZE),
        "robot": [1, 1],
        "trigger": [0, 2],
        "goal": [7, 4],
        "doors_open": False,
        "cubes": [],
        "spheres": [[0, 1]],
        "task": "GotoTrigger(T1)",
        "target": [0, 2],
        "cost": 1,
        "action": "North",
        "optimal": ["East"],
        "way": ["North", "East", "North"],
        "best": ["East", "North"],
    }
    assert draw(found).axes[0].get_xlabel() == "GotoTrigger(T1): North is blocked, and costs 1 step more"
    fatal = {**found, "cost": None, "way": ["North"]}
    assert draw(fatal).axes[0].get_xlabel() == "GotoTrigger(T1): North is blocked, and leaves no way"


@pytest.mark.slow
def test_following_the_local_rule_brings_fewer_episodes_to_the_goal() -> None:
    """With its own mistakes to bear; replanning followed is the same run whichever way it is asked for."""
    wanted = {"obstacles": 9, "episodes": 20, "follow": "strategy"}
    local_, best = (
        run(complete({**wanted, "strategy": name}), 0).measures for name in ("local-rule", "replanning")
    )
    assert (local_["reached"] or 0) < (best["reached"] or 0)
    asked = {"obstacles": 9, "episodes": 20, "strategy": "replanning"}
    assert best == run(complete(asked), 0).measures


def test_a_layout_of_the_user_s_gives_the_same_as_the_package_s(tmp_path: Path) -> None:
    """The spec's text is run, wherever it is laid; the seed names everything."""
    text = layout_text(load_layout("two_rooms"))
    wanted = complete({"layout": "mine.maze", "episodes": 6})
    spec = RunSpec("episodes", 1, wanted, 4, {"mine.maze": text})
    done = work(spec, "local", tmp_path).outcome
    assert isinstance(done, Ran)
    own = run(complete({"episodes": 6}), 4)
    assert done.result.measures == own.measures
    assert done.result.details["counterexample"] == own.details["counterexample"]
    assert own.measures != run(complete({"episodes": 6}), 5).measures


def test_more_obstacles_than_a_layout_has_room_for_are_refused(tmp_path: Path) -> None:
    """The message says how many there is room for."""
    path = tmp_path / "small.maze"
    path.write_text(SMALL)
    with pytest.raises(UserError, match="obstacles: layout small has room for 5 besides the start"):
        run(complete({"layout": str(path), "obstacles": 6}), 0)
    assert (
        run(complete({"layout": str(path), "obstacles": 5, "episodes": 3}), 0).measures["asked"] is not None
    )


def test_no_obstacles_are_no_affordances() -> None:
    """There is nothing to be optimal, and every episode takes the shortest way."""
    measures = run(complete({"obstacles": 0, "episodes": 5}), 1).measures
    assert (measures["asked"], measures["optimal"], measures["cost_per_episode"]) == (0, None, 0.0)
    assert (measures["reached"], measures["steps_over_best"]) == (1.0, 0.0)


@pytest.mark.slow
def test_a_large_layout_has_time_and_tells_what_was_not_learnt(tmp_path: Path) -> None:
    """Ways of more than a hundred steps are not cut off; 1,200 episodes a subtask leave grids unlearnt."""
    path = tmp_path / "long.maze"
    corridor = [" ".join([*"." * 59, ":" if row == 1 else "|", *"." * 59]) for row in range(3)]
    rows = [row.split() for row in corridor]
    rows[0][0], rows[1][60], rows[2][-1] = "T1", "D1", "G1"
    text = "\n".join(" ".join(row) for row in rows)
    path.write_text(f"name long\n\ngrid\n{text}\n\nstart 2,0\ntrigger T1\ngoal G1\n")
    long = run(complete({"layout": str(path), "obstacles": 1, "episodes": 6}), 0)
    assert long.measures["reached"] == 1
    assert (long.measures["unlearnt"] or 0) > 0
    assert run(complete({"obstacles": 1, "episodes": 2}), 0).measures["unlearnt"] == 0


@pytest.mark.parametrize(
    ("name", "runs", "followed"),
    [("local_rule", 720, "replanning"), ("replanning", 360, "strategy"), ("density", 240, "replanning")],
)
def test_the_ready_studies_can_begin(name: str, runs: int, followed: str) -> None:
    """Each compares all strategies, or the two that fall short, and each run is complete."""
    study = load_study(EXAMPLES / f"{name}.yaml")
    assert (study.kind, study.runs) == ("episodes", runs)
    planned = study.expand()
    assert {str(one.spec.settings["follow"]) for one in planned} == {followed}
    assert {one.levels["strategy"] for one in planned} >= {"local-rule", "value-sweep"}
    assert all(complete(one.spec.settings) == one.spec.settings for one in planned[::40])


@pytest.mark.slow
def test_a_spoilt_lens_misreads() -> None:
    """Frames are rendered, and corrupted if asked for; the truth misreads nothing."""
    wanted = {"perception": "hough", "obstacles": 3, "episodes": 4}
    clear = run(complete(wanted), 1).measures
    spoilt = run(complete({**wanted, "corruption": "gaussian_noise", "severity": 5}), 1).measures
    assert run(complete({"obstacles": 3, "episodes": 4}), 1).measures["misread"] == 0
    assert (clear["misread"] or 0) < (spoilt["misread"] or 0)
