"""Settings of a run of learning: what is learnt, what the graph goes without, when it ends, and by whom."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Final, Literal

from comparisons.learn.settings import Settings, learner_settings
from comparisons.study.spec import Value
from hierarchy.text import graph_names
from hierarchy.text_worlds import MAZE_SUFFIX
from planners.config_text import Count, Share, Steps, Weight, check_fields, read_settings
from worlds import UserError, suggest

ORACLE: Final = "oracle"
"""The learner that need not learn: the flat optimum."""
SUFFIX: Final = ".yaml"
"""How the name of a task graph's file ends."""
DROP: Final = "drop "
"""How a state abstraction begins that leaves out variables."""

FLAT: Final = (ORACLE, "flat-q", "flat-ppo", "flat-dqn")
"""The learners that go by no tasks but the root."""
DROPPING: Final = ("maxq-0", "maxq-q")
"""The learners whose abstraction can be made unsafe."""
UNTAUGHT: Final = ("maxq-0", *FLAT)
"""The learners that read no pseudo-rewards."""


@dataclass(frozen=True)
class LearnSettings:
    """What a run of learning is asked, apart from the learner's own settings.

    Parameters
    ----------
    graph
        A task graph by its name, or a YAML file.
    world
        A world by its name, or a .maze file; "" for the one that the graph names.
    starts
        A predicate: where episodes begin; "" for all the world's starts.
    learner
        The learner's name, or "oracle".
    steps
        Environment steps after which learning ends.
    until
        What else ends it: every start being optimal, the mean return being within the tolerance, or nothing.
    lasting
        How long that must have lasted to end it, as a multiple of the steps until then; 0 ends it at once.
    tolerance
        How far the mean return may be from the best to count as near it, as a share of the best's mean size.
    limit
        Steps after which an episode of evaluation is over; 0 for none. Then the mean return and the mean loss
        are over all starts; otherwise over those from which the policy surely ends.
    abstraction
        "declared"; "full" for all state variables in every task; "drop" and names of variables,
        without which completions are then stored, whether that is safe or not.
    pseudo_reward
        "declared", or "none".

    Examples
    --------
    >>> LearnSettings("two_rooms", abstraction="drop goal, doors").dropped
    ('goal', 'doors')
    >>> LearnSettings("two_rooms", abstraction="without goal")
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: abstraction: 'without goal' is not possible; use declared, full, or drop and ...
    """

    graph: str = ""
    world: str = ""
    starts: str = ""
    learner: str = "maxq-0"
    steps: Count = 1_000_000
    until: Literal["optimal", "level", "end"] = "optimal"
    lasting: Weight = 1.0
    tolerance: Share = 0.01
    limit: Steps = 0
    abstraction: str = "declared"
    pseudo_reward: Literal["declared", "none"] = "declared"

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.graph_is_a_file and self.graph not in graph_names():
            mend = suggest(self.graph, graph_names(), f"name a {SUFFIX} file, or one of")
            raise UserError(f"graph: there is no task graph {self.graph!r}; {mend}")
        if self.abstraction not in ("declared", "full") and not self.dropped:
            raise UserError(
                f"abstraction: {self.abstraction!r} is not possible; "
                "use declared, full, or drop and names of state variables, such as drop goal"
            )
        if self.abstraction == "full" and self.learner in FLAT:
            raise UserError(
                f"abstraction: the learner {self.learner} has no tasks to abstract in, and always sees all "
                "state variables; leave it out for this learner"
            )
        if self.pseudo_reward == "none" and self.learner in UNTAUGHT:
            raise UserError(
                f"pseudo_reward: the learner {self.learner} reads none; leave it out for this learner"
            )
        if self.dropped and self.learner not in DROPPING:
            raise UserError(
                f"abstraction: the learner {self.learner} does not store its values call by call; "
                f"{self.abstraction!r} is for {' and '.join(DROPPING)}"
            )

    @property
    def graph_is_a_file(self) -> bool:
        """Whether the task graph is a file of the user's own."""
        return self.graph.endswith(SUFFIX)

    @property
    def world_is_a_file(self) -> bool:
        """Whether the world is a maze's file."""
        return self.world.endswith(MAZE_SUFFIX)

    @property
    def dropped(self) -> tuple[str, ...]:
        """Names of the variables that completions are stored without."""
        if not self.abstraction.startswith(DROP):
            return ()
        return tuple(name.strip() for name in self.abstraction.removeprefix(DROP).split(",") if name.strip())


NAMES: Final = tuple(field.name for field in fields(LearnSettings))
"""The settings that are not the learner's own."""


def settings_of(given: Mapping[str, Value]) -> dict[str, Value]:
    """Return all settings of a run, the learner's own among them, checked.

    Raises
    ------
    UserError
        If one is unknown or not possible; the message begins with its name.

    Examples
    --------
    >>> settings = settings_of({"graph": "two_rooms", "gamma": 0.9})
    >>> settings["learner"], settings["gamma"], settings["exploration_half"]
    ('maxq-0', 0.9, 300)
    >>> settings_of({"graph": "two_rooms", "stepz": 100})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: stepz: the learner maxq-0 has no such setting; did you mean 'steps'?
    """
    mine = split(given)
    own = {name: text(value) for name, value in given.items() if name not in NAMES}
    return {**asdict(mine), **_own(mine.learner, own)}


def split(given: Mapping[str, Value]) -> LearnSettings:
    """Return the settings that are not the learner's own."""
    values = {name: text(value) for name, value in given.items() if name in NAMES}
    try:
        # A graph must be given: this one stands in until it is read.
        return read_settings(LearnSettings("two_rooms"), {"graph": "", **values})
    except UserError as error:
        raise _named(error, values) from error


def text(value: Value) -> str:
    """Return a value as the text that it would be written as.

    >>> [text(value) for value in (True, 1, 0.5, "prior")]
    ['true', '1', '0.5', 'prior']
    """
    return str(value).lower() if isinstance(value, bool) else str(value)


def _own(learner: str, own: Mapping[str, str]) -> Settings:
    """Return all of the learner's settings, but for its steps, which have another name here."""
    if learner == ORACLE:
        known: Settings = {}
    else:
        known = learner_settings(learner, {})
        known.pop("total", None)
    for name in own:
        if name == "total":
            raise UserError("total: here it is called steps; give steps")
        if name not in known and (known or learner == ORACLE):
            mend = suggest(name, (*NAMES, *known))
            raise UserError(f"{name}: the learner {learner} has no such setting; {mend}")
    if learner == ORACLE:
        return {}
    try:
        found = learner_settings(learner, own)
    except UserError as error:
        raise _named(error, own) from error
    found.pop("total", None)
    return found


def _named(error: UserError, given: Mapping[str, str]) -> UserError:
    """Return an error that begins with the name of a setting, and does not quote a command line."""
    said = str(error)
    for name, value in given.items():
        if said.startswith(f"{name}={value}: "):
            return UserError(f"{name}: {said.removeprefix(f'{name}={value}: ')}")
    return error


def files(settings: Mapping[str, Value]) -> tuple[str, ...]:
    """Return which of the complete settings name files.

    >>> files(settings_of({"graph": "two_rooms", "world": "mine.maze"}))
    ('world',)
    """
    mine = split(settings)
    named = {"graph": mine.graph_is_a_file, "world": mine.world_is_a_file}
    return tuple(name for name, is_file in named.items() if is_file)
