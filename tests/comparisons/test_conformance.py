"""The conformance kit accepts ours and refuses, by name, what breaks a promise."""

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from comparisons.conformance import (
    ConformanceError,
    check_backend,
    check_graph,
    check_learner,
    check_world,
    conformance_maze,
)
from hierarchy import Call, Constant, GroundGraph, Predicate, TaskGraph, two_rooms
from hierarchy.taxi import taxi_graph
from hierarchy.terms import Equal
from perception import NOTHING, Detection, View, backend_names, load_backend
from perception.frames import fresh_views
from perception.models import Card, load_model, save_model
from perception.percepts import Percepts, Sees, checked_frames
from perception.protocol import Frames
from planners import HSMQ, MaxQ, MaxQQ
from planners.learner import Trace
from worlds import (
    ACTIONS,
    Cell,
    StateIndex,
    Stream,
    TransitionModel,
    UserError,
    Variable,
    finite_world,
    load_layout,
    maze_model,
)
from worlds.black_box import BlackBox
from worlds.camera import Camera
from worlds.gym_model import gym_model
from worlds.taxi import taxi_model

MAZE = load_layout("two_rooms")
MODEL = maze_model(MAZE)


def test_ours_conform() -> None:
    """The paper's world and graph, and the tabular learners, pass."""
    check_world(MODEL)
    check_graph(two_rooms(MAZE), MODEL)
    for learner in (MaxQ, MaxQQ, HSMQ):
        check_learner(learner)


@pytest.mark.parametrize("name", backend_names())
def test_every_backend_conforms(name: str) -> None:
    """Each registered backend passes on frames of the twin."""
    camera = Camera(pixels=96)
    check_backend(load_backend(name, camera), list(fresh_views(MAZE, 6, seed=1, camera=camera)))


def test_a_world_without_starts_or_with_endless_rewards_is_refused() -> None:
    """Each fault is named."""
    arrays = MODEL.successors, MODEL.rewards
    with pytest.raises(ConformanceError, match="no state is a start"):
        check_world(TransitionModel(MODEL.index, ACTIONS, *arrays, np.zeros_like(MODEL.starts)))
    rewards = MODEL.rewards.copy()
    rewards[:, 1] = np.inf
    with pytest.raises(ConformanceError, match="not finite in robot = 0,0"):
        check_world(TransitionModel(MODEL.index, ACTIONS, arrays[0], rewards, MODEL.starts))


@pytest.mark.parametrize(
    ("array", "value", "message"),
    [
        ("probabilities", 0.5, "do not sum to 1 but to 0.5 in robot = 0,0, trigger = T1, .*, action South"),
        ("outcomes", 99_999, "the next state is no state in robot = 0,0, .*, action South"),
    ],
)
def test_a_model_that_was_changed_is_refused(array: str, value: float, message: str) -> None:
    """What the model's own check has passed may have been overwritten since; state and action are named."""
    model = maze_model(MAZE)
    getattr(model, array)[0, 1] = value
    with pytest.raises(ConformanceError, match=message):
        check_world(model)


def test_an_outcome_that_does_not_occur_may_earn_anything() -> None:
    """Fillers of probability 0 are no part of a world."""
    model = maze_model(MAZE)
    twice = [np.repeat(array, 2, axis=2) for array in (model.outcomes, model.outcome_rewards)]
    twice[1][..., 1] = np.nan
    chances = np.broadcast_to([1.0, 0.0], twice[0].shape).copy()
    check_world(TransitionModel(model.index, ACTIONS, *twice, model.starts, probabilities=chances))


X = Variable("x", (0, 1, 2, 3))


def corridor(slip: float = 0.25) -> TransitionModel:
    """Return a corridor whose steps right fail with a chance; its end keeps to itself."""

    def follows(state: Any, action: str) -> Any:
        to = state.x + 1 if action == "right" else max(state.x - 1, 0)
        return [(1 - slip, (to,), -1), (slip, state, -1)] if action == "right" else ((to,), -1)

    return finite_world([X], "left right", follows, starts=[(0,), (1,)], ends=lambda state: state.x == 3)


class Corridor(gymnasium.Env[np.int64, np.int64]):
    """The corridor as an environment, with a fault."""

    observation_space = gymnasium.spaces.Discrete(4)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, fault: str = "") -> None:
        self.fault = fault
        self.rng = random.Random(5)  # noqa: S311

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        """Begin at the left end."""
        super().reset(seed=seed)
        del options
        self.x = 2 if self.fault == "start" else 0
        if self.fault == "drawn start":
            self.x = self.rng.randrange(2)
        return ("0" if self.fault == "no observation" else np.int64(self.x)), {}

    def step(self, action: np.int64) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Move, or slip."""
        slips = (self.rng if self.fault == "own generator" else self.np_random).random()
        before, limit = self.x, 0.6 if self.fault == "slips too often" else 0.25
        if action == 1:
            self.x += int(slips >= limit)
        elif self.fault != "stays":
            self.x = max(self.x - 1, 0)
        reward = -2.0 if self.fault == "dear" and before == 2 else -1.0
        return np.int64(self.x), reward, self.x == 3, False, {}


def boxed(fault: str) -> BlackBox:
    """Return the environment as it is checked."""
    return BlackBox(Corridor(fault), [X], lambda number: (int(number),), ["left", "right"])


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("start", "an episode begins in x = 2, which is no start of the model"),
        ("stays", r"in x = \d, action left led to \(x = \d\); the model says \(x = \d\)"),
        ("dear", r"in x = 2, action \w+ earned -2; the model says -1"),
        ("own generator", "the same actions led to something else in x = .*; draw every random number"),
        (
            "drawn start",
            r"with seed \d+ an episode begins in x = \d, and then in x = \d; draw every random number",
        ),
        (
            "slips too often",
            r"action right led to \(x = \d\) \d+ times of \d+; the model's probability is 0\.",
        ),
        ("no observation", "Gymnasium's checker refuses the environment"),
    ],
)
def test_an_environment_that_breaks_a_promise_is_refused(fault: str, message: str) -> None:
    """Seeds, starts, steps, rewards and frequencies are held against the model."""
    with pytest.raises(ConformanceError, match=message):
        check_world(corridor(), boxed(fault))


def test_an_environment_that_keeps_its_promises_passes() -> None:
    """The corridor without a fault, and Taxi, whose last observation does not say that it is over."""
    check_world(corridor(), boxed(""))
    taxi = gymnasium.make("Taxi-v4")
    model = gym_model(taxi)
    passenger, sites = model.index.variable("passenger").values, model.index.variable("destination").values

    def decode(number: int) -> tuple[Any, ...]:
        row, col, where, to = taxi.unwrapped.decode(number)  # type: ignore[attr-defined]
        return Cell(row, col), passenger[where], sites[to]

    check_world(model, BlackBox(taxi, model.index.variables, decode, model.actions))


def test_an_environment_of_another_world_is_refused() -> None:
    """Variables and actions are the model's, and in its order."""
    with pytest.raises(ConformanceError, match="different state variables"):
        check_world(MODEL, boxed(""))
    with pytest.raises(ConformanceError, match="different actions, or another order"):
        check_world(corridor(), BlackBox(Corridor(), [X], lambda number: (int(number),), ["right", "left"]))


def test_a_graph_that_cannot_run_is_refused() -> None:
    """The findings are told; so is a graph of another world."""
    graph = TaskGraph("wrong", MODEL.index.variables, ACTIONS)
    robot, _, goal, _ = graph.variables
    graph.task("Root", until=robot.eq(goal), uses=[robot], do="North South")
    with pytest.raises(ConformanceError, match="add 'goal' to the uses of Root"):
        check_graph(graph, MODEL)
    with pytest.raises(ConformanceError, match="different state variables"):
        check_graph(two_rooms(conformance_maze()), MODEL)


class Backwards(Equal):
    """An equality whose mask is the wrong way round."""

    def bind(self, binding: Mapping[str, Constant]) -> Predicate:
        """Stay as it is."""
        del binding
        return self

    def mask(self, index: StateIndex) -> NDArray[np.bool_]:
        """Return where it does not hold."""
        return ~super().mask(index)


def test_a_predicate_whose_mask_is_wrong_is_refused() -> None:
    """The task, its key and a state are named."""
    model = maze_model(conformance_maze())
    graph = TaskGraph("backwards", model.index.variables, ACTIONS)
    robot = graph.variables[0]
    wrong = Backwards(robot, robot.constant(Cell(2, 0)))
    graph.task(
        "Root", until=robot.eq(Cell(0, 1)), uses=[robot], do=[*map(Call, ACTIONS), Call("North").when(wrong)]
    )
    message = r"Root: its guard of North \(robot = 2,0\) and its mask differ in robot = 0,0"
    with pytest.raises(ConformanceError, match=message):
        check_graph(graph, model)


def test_an_abstraction_that_is_not_safe_is_refused_if_asked() -> None:
    """A fickle passenger's mind matters to a graph that forgets it; the call is named."""
    model = taxi_model(fickle=0.3)
    graph = taxi_graph(model)
    forgetful = TaskGraph("forgetful", graph.index.variables, graph.actions)
    for task in graph.tasks.values():
        uses = [var for var in forgetful.variables if var.name in task.uses and var.name != "mind"]
        calls = [
            call if call.relevant is None else replace(call, relevant=tuple(set(call.relevant) - {"mind"}))
            for call in task.do
        ]
        forgetful.task(task.name, *task.params, until=task.until, within=task.within, uses=uses, do=calls)
    check_graph(forgetful, model)
    with pytest.raises(ConformanceError, match=r"Put -> Navigate\(R\), stored by .*: refuted"):
        check_graph(forgetful, model, safe=True)


class Careless(MaxQ):
    """Draws from a global generator."""

    def __init__(self, grounded: GroundGraph, seed: Sequence[int]) -> None:
        super().__init__(grounded, (*seed, random.getrandbits(32)))


class Lazy(MaxQ):
    """Forgets what it learnt."""

    def value(self, task: int, state: int) -> float:
        """Return half of what was learnt."""
        return super().value(task, state) / 2


class Lost(MaxQ):
    """Never arrives."""

    def greedy_steps(self, task: int, state: int, limit: int = 1000) -> int | None:
        """Follow the policy for no step at all."""
        return super().greedy_steps(task, state, min(limit, 0))


class Deaf(MaxQ):
    """Takes no notice of its seed."""

    def __init__(self, grounded: GroundGraph, seed: Sequence[int]) -> None:
        del seed
        super().__init__(grounded, (7,))


class Idle(MaxQ):
    """Never learns."""

    def train(
        self, task: int, starts: Sequence[int], episodes: int, after_each: Callable[[], None] | None = None
    ) -> list[int]:
        """Do nothing, but differ from seed to seed, as if something had been learnt."""
        del task, starts, episodes, after_each
        return []

    def value(self, task: int, state: int) -> float:
        """Return the seed."""
        del task, state
        return float(self.seed)

    def __init__(self, grounded: GroundGraph, seed: Sequence[int]) -> None:
        super().__init__(grounded, seed)
        self.seed = seed[0]


class Sharing(MaxQ):
    """Keeps what it learnt for the next learner."""

    kept: dict[str, Any] = {}  # noqa: RUF012 # the fault

    def __init__(self, grounded: GroundGraph, seed: Sequence[int]) -> None:
        super().__init__(grounded, seed)
        for name, value in vars(self).items():
            if isinstance(value, list):
                vars(self)[name] = self.kept.setdefault(name, value)


class Rival(MaxQ):
    """Learns otherwise once another seed has been at work."""

    seeds: set[int] = set()  # noqa: RUF012 # the fault

    def __init__(self, grounded: GroundGraph, seed: Sequence[int]) -> None:
        self.seeds.add(seed[0])
        super().__init__(grounded, (*seed, len(self.seeds)) if seed[0] == 1 else seed)


class Studious(MaxQ):
    """Learns while it is looked at."""

    def greedy_steps(self, task: int, state: int, limit: int = 1000) -> int | None:
        """Train a little before answering."""
        self.train(task, [state], 1)
        return super().greedy_steps(task, state, limit)


class Haunted(MaxQ):
    """Begins an episode where the last one has ended, for it keeps its own state."""

    at: int | None = None

    def _run(self, task: int, state: int, caller_rate: float = 1.0) -> tuple[Trace, int]:
        if task < len(ACTIONS):
            return super()._run(task, state, caller_rate)
        trace, self.at = super()._run(task, state if self.at is None else self.at, caller_rate)
        return trace, self.at


@pytest.mark.parametrize(
    ("learner", "message"),
    [
        (Careless, "the same seed gave different values; draw every random number from the seed"),
        (Sharing, "the same seed gave different values; .*, and keep nothing between learners"),
        (Rival, "the same seed gave different values once others had learnt; keep nothing between learners"),
        (Deaf, "three seeds gave the same values; draw every random number from the seed"),
        (Idle, "300 episodes changed no value; let train learn"),
        (Studious, "asking for greedy steps changes what is learnt"),
        (Haunted, "after 300 episodes its policy takes None steps"),
        (Lazy, "it values robot = .* at -"),
        (Lost, "its policy takes None steps"),
    ],
)
def test_a_learner_that_breaks_a_promise_is_refused(learner: type[MaxQ], message: str) -> None:
    """Seeds, values and policies are held to what is known."""
    with pytest.raises(ConformanceError, match=message):
        check_learner(learner, episodes=300)


class Moody:
    """A backend whose answer depends on the company."""

    name = "moody"
    needs_frames = True

    def __init__(self, fault: str) -> None:
        self.fault = fault
        self.calls = 0

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Return detections that are wrong in one way."""
        found = [NOTHING] * len(views)
        self.calls += 1
        if self.fault == "short":
            return found[1:]
        if self.fault == "company" and len(views) > 1:
            found[0] = replace(NOTHING, confidence=0.5)
        if self.fault == "tired" and self.calls > 3:
            found[-1] = replace(NOTHING, confidence=0.5)
        if self.fault == "paints" and views and views[0].frame is not None:
            views[0].frame[:] = 0
        if self.fault == "dreams" and not views:
            return [NOTHING]
        return found


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("short", "2 views got 1 detections"),
        ("company", "view 0 got another detection alone"),
        ("tired", "view 0 got another detection after others; keep nothing"),
        ("paints", "the frame of view 0 was changed"),
        ("dreams", "no views must give no detections"),
    ],
)
def test_a_backend_that_breaks_a_promise_is_refused(fault: str, message: str) -> None:
    """Number, order and frames are held."""
    views = [View(np.full((4, 4, 3), 9, np.uint8), NOTHING) for _ in range(2)]
    with pytest.raises(ConformanceError, match=message):
        check_backend(Moody(fault), views)


VIEWS = [View(np.full((16, 16, 3), shade, np.uint8), NOTHING) for shade in (0, 100, 200)]


class Shades(Sees):
    """A backend that learns a shade, with one fault."""

    name = "shades"
    fits = 0

    def __init__(self, fault: str = "", shade: float = 128.0) -> None:
        self.fault = fault
        self.shade = shade

    @classmethod
    def fitted(cls, fault: str, seed: int) -> Self:
        """Learn the shade that the seed draws."""
        cls.fits += 1
        return cls(fault, Stream(seed, cls.fits if fault == "forgets its seed" else 0).between(50, 200))

    def perceive(self, frames: Frames) -> Percepts:
        """Call what is darker than the shade a sphere, and what is brighter a cube."""
        match self.fault:
            case "swallows":
                if not isinstance(frames, np.ndarray) or frames.ndim != 4 or len(frames) == 0:
                    return Percepts(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
                frames = frames[..., :3].astype(np.uint8)
            case "stumbles":
                assert frames.dtype, "a list has none"
                checked_frames(frames)
            case _:
                checked_frames(frames)
        sphere = np.clip(self.shade / (self.shade + frames.mean(axis=(1, 2, 3))), 0, 1)
        chances = np.column_stack([np.zeros(len(frames)), 1 - sphere, sphere])
        if self.fault == "paints":
            frames[:] = 7
        return Percepts(chances, np.ones(len(frames)), np.zeros(len(frames)))

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Return detections, at another distance than perceived if that is the fault."""
        found = super().detect(views)
        return [replace(seen, distance=2) for seen in found] if self.fault == "contradicts" else found

    def save(self, path: Path) -> None:
        """Write the shade."""
        shade = 1.0 if self.fault == "forgets" else self.shade
        save_model(path, {"shade": np.array([shade])}, Card("shades", "nothing", 0))

    @classmethod
    def load(cls, path: Path, camera: Camera) -> Self:
        """Read the shade."""
        assert camera.pixels
        try:
            return cls(shade=float(load_model(path, "shades", {"shade": (1,)})[0]["shade"][0]))
        except UserError:
            if cls.fits < 0:
                return cls()
            raise


def test_a_backend_of_ones_own_passes() -> None:
    """Frames, refusals, saving and fitting are as they should be."""
    check_backend(Shades(), VIEWS, fit=lambda seed: Shades.fitted("", seed))


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("swallows", "floats must be refused"),
        ("stumbles", "a list must be refused by a UserError, not AttributeError"),
        ("paints", "perceive changes the frames"),
        ("contradicts", "perceive and detect tell frame 0 differently"),
        ("forgets", "sees otherwise once saved and loaded"),
        ("forgets its seed", "fitted twice with one seed it sees otherwise"),
    ],
)
def test_a_backend_on_frames_that_breaks_a_promise_is_refused(fault: str, message: str) -> None:
    """What comes in, what comes out, what is kept on disk and what a seed gives are held."""
    with pytest.raises(ConformanceError, match=message):
        check_backend(Shades(fault), VIEWS, fit=lambda seed: Shades.fitted(fault, seed))


def test_a_backend_that_loads_broken_weights_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a weights file must not become a backend."""
    monkeypatch.setattr(Shades, "fits", -1)
    with pytest.raises(ConformanceError, match="a broken weights file must be refused"):
        check_backend(Shades(), VIEWS)


def test_probabilities_that_do_not_bear_out_the_label_are_refused() -> None:
    """A detection of another make is held to the same sums."""

    class Odd(Detection):
        """A detection whose chances are whatever it is made with."""

        @property
        def chances(self) -> tuple[float, float, float]:
            """Say nothing that sums to 1."""
            return (0.9, 0.9, 0.0) if self.confidence == 1 else (0.25, 0.75, 0.0)

    class Makes(Moody):
        """Makes odd detections."""

        def detect(self, views: Sequence[View]) -> list[Detection]:
            """Return them."""
            return [Odd("none", 1.0 if self.fault == "sum" else 0.5, 0) for _ in views]

    for fault, message in (("sum", "sum to 1.8, not 1"), ("label", "is called 'none' with probabilities")):
        with pytest.raises(ConformanceError, match=message):
            check_backend(Makes(fault), VIEWS)


def test_what_is_no_backend_is_refused() -> None:
    """It is told what is missing."""
    with pytest.raises(ConformanceError, match="str has no name, needs_frames or detect"):
        check_backend("hough", VIEWS)  # type: ignore[arg-type]
