"""The worlds that a task graph's text may name: their variables, actions and named sets of values.

A package adds a world by an entry point of the group ``affordant.worlds``, whose value is a callable
without arguments that returns a `TextWorld`. In its pyproject.toml::

    [project.entry-points."affordant.worlds"]
    mine = "my_package:my_world"
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Final

from hierarchy.terms import ValueSet
from worlds import (
    ACTIONS,
    Layout,
    TransitionModel,
    UserError,
    Variable,
    load_layout,
    maze_model,
    maze_variables,
    suggest,
)
from worlds.entry_points import entry_points
from worlds.four_rooms import AREAS, HALLWAYS, ROOMS, Rules, four_rooms_model, four_rooms_variables
from worlds.hdg import LandmarkMaze, landmark_model, landmark_variables
from worlds.taxi import SITES, TAXI_ACTIONS, taxi_model, taxi_variables

GROUP: Final = "affordant.worlds"
"""The entry points' group."""
MAZE_SUFFIX: Final = ".maze"
"""How the name of a maze's file ends."""
GYM_PREFIX: Final = "gym:"
"""How the name of a Gymnasium environment begins."""
_TAXIS: Final = {  # rain and fickle: Dietterich (2000), section 7.1
    "taxi": (0.0, 0.0),
    "taxi-rainy": (0.2, 0.0),
    "taxi-fickle": (0.0, 0.3),
    "taxi-rainy-fickle": (0.2, 0.3),
}
_HDGS: Final = {"hdg": 0.0, "hdg-slippery": 0.2}
_FOUR_ROOMS: Final[Mapping[str, tuple[Rules, float]]] = {  # rules and slip
    "four_rooms": ("bacon", 1 / 3),
    "four_rooms-sutton": ("sutton", 1 / 3),
    "four_rooms-sure": ("bacon", 0.0),
}


@dataclass(frozen=True)
class TextWorld:
    """What the text of a task graph needs of a world.

    Parameters
    ----------
    name
        What the text calls the world.
    variables
        Its state variables, in order.
    actions
        Its primitive actions, in the order that breaks ties.
    model
        Makes its transition model, which only `affordant check` needs.
    sets
        Sets of values that a predicate may name, such as the rooms of a maze.
    marks
        Values by names of their own besides their labels, such as the grids behind a maze's doors.
    """

    name: str
    variables: tuple[Variable, ...]
    actions: tuple[str, ...]
    model: Callable[[], TransitionModel]
    sets: tuple[ValueSet, ...] = ()
    marks: Mapping[str, Hashable] = field(default_factory=dict)


def maze_world(layout: Layout, name: str | None = None) -> TextWorld:
    """Return the world of a maze: its rooms, and the grids behind its doors, are named sets.

    Parameters
    ----------
    layout
        The maze.
    name
        What texts call it. Defaults to the layout's own name.

    Examples
    --------
    >>> from worlds import load_layout
    >>> world = maze_world(load_layout("two_rooms"))
    >>> world.name, [str(values) for values in world.sets]
    ('two_rooms', ['room A', 'room B', "doors' grids"])
    """
    rooms = tuple(ValueSet(f"room {letter}", cells) for letter, cells in layout.rooms.items())
    doors = ValueSet("doors' grids", frozenset(layout.thresholds.values()))
    return TextWorld(
        name=layout.name if name is None else name,
        variables=maze_variables(layout),
        actions=ACTIONS,
        model=lambda: maze_model(layout),
        sets=(*rooms, doors) if doors.values else rooms,
        marks=layout.thresholds,
    )


def world_names() -> tuple[str, ...]:
    """Return the names of the worlds there are, ours first.

    Any ``.maze`` file is a world besides, and so is any Gymnasium environment that exposes its model.

    Examples
    --------
    >>> world_names()[:3]
    ('two_rooms', 'taxi', 'taxi-rainy')
    """
    return (*_ours(), *_others())


def load_world(name: str) -> TextWorld:
    """Return the world called `name`, the maze of a ``.maze`` file, or an environment: ``gym:Taxi-v4``.

    Raises
    ------
    UserError
        If there is no such world, file or environment, or it cannot be loaded.

    Examples
    --------
    >>> [variable.name for variable in load_world("two_rooms").variables]
    ['robot', 'trigger', 'goal', 'doors']
    >>> load_world("two_room")
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: no world 'two_room'; did you mean 'two_rooms'?
    """
    if name.endswith(MAZE_SUFFIX):
        return maze_file(Path(name), name)
    if name.startswith(GYM_PREFIX):
        # Reached by its entry point, so that no other world loads Gymnasium.
        return _called(EntryPoint(name, "hierarchy.text_gym:gym_world", GROUP), name)
    ours, others = _ours(), _others()
    if name in ours:
        return ours[name]()
    if name not in others:
        known = f"name a {MAZE_SUFFIX} file, {GYM_PREFIX}ID, or one of"
        raise UserError(f"no world {name!r}; {suggest(name, (*ours, *others), known)}")
    return _called(others[name])


def maze_file(path: Path, name: str) -> TextWorld:
    """Return the world of a maze's file, called `name`.

    Raises
    ------
    UserError
        If there is no such file, or it is wrong.
    """
    try:
        return maze_world(load_layout(path), name)
    except OSError as error:
        raise UserError(f"{name}: it cannot be read ({error.strerror}); check the path") from error


def site_sets(variables: tuple[Variable, ...]) -> tuple[ValueSet, ...]:
    """Return Taxi's named set, if these are Taxi's variables: the sites.

    >>> [str(values) for values in site_sets(taxi_variables())], site_sets((Variable("x", (0,)),))
    (['sites'], ())
    """
    sites = ValueSet("sites", frozenset(SITES.values()))
    taxi = any(variable == taxi_variables()[1] for variable in variables)
    return (sites,) if taxi else ()


def _called(point: EntryPoint, *arguments: str) -> TextWorld:
    """Return what an entry point's function gives."""
    try:
        make: Callable[..., TextWorld] = point.load()
    except (ImportError, AttributeError) as error:
        raise UserError(
            f"world {point.name!r} ({point.value}) cannot be loaded: {error}; "
            "install what it needs, or mend its entry point"
        ) from error
    return make(*arguments)


def _ours() -> dict[str, Callable[[], TextWorld]]:
    return {
        "two_rooms": lambda: maze_world(load_layout("two_rooms")),
        **{name: partial(_taxi, name) for name in _TAXIS},
        **{name: partial(_hdg, name) for name in _HDGS},
        **{name: partial(_four_rooms, name) for name in _FOUR_ROOMS},
    }


def _others() -> dict[str, EntryPoint]:
    """Return other packages' entry points by name; a name of ours cannot be taken."""
    points = sorted(entry_points(group=GROUP), key=lambda point: point.name)
    return {point.name: point for point in points if point.name not in _ours()}


def _taxi(name: str) -> TextWorld:
    rain, fickle = _TAXIS[name]
    variables = taxi_variables(fickle=fickle > 0)
    model = partial(taxi_model, rain=rain, fickle=fickle)
    return TextWorld(name, variables, TAXI_ACTIONS, model, site_sets(variables))


def _hdg(name: str) -> TextWorld:
    maze = LandmarkMaze()
    named = {"region": maze.regions, "around": maze.around}
    sets = tuple(ValueSet(f"{word} {lmk}", cells) for word, by in named.items() for lmk, cells in by.items())
    return TextWorld(
        name, landmark_variables(maze), ACTIONS, partial(landmark_model, maze, slip=_HDGS[name]), sets
    )


def _four_rooms(name: str) -> TextWorld:
    rules, slip = _FOUR_ROOMS[name]
    named = {"room": ROOMS, "area": AREAS}
    sets = tuple(
        ValueSet(f"{word} {room}", cells) for word, by in named.items() for room, cells in by.items()
    )
    model = partial(four_rooms_model, rules=rules, slip=slip)
    return TextWorld(name, four_rooms_variables(), ACTIONS, model, sets, HALLWAYS)
