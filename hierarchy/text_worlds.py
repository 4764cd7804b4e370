"""The worlds that a task graph's text may name: their variables, actions and named sets of values.

A package adds a world by an entry point of the group ``affordant.worlds``, whose value is a callable
without arguments that returns a `TextWorld`. In its pyproject.toml::

    [project.entry-points."affordant.worlds"]
    mine = "my_package:my_world"
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
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
)
from worlds.taxi import SITES, TAXI_ACTIONS, taxi_model, taxi_variables

GROUP: Final = "affordant.worlds"
"""The entry points' group."""
MAZE_SUFFIX: Final = ".maze"
"""How the name of a maze's file ends."""
# Ours are entry points as well, so that naming a world loads what it needs and no more.
_OURS: Final = (
    EntryPoint("two_rooms", "hierarchy.text_worlds:_two_rooms", GROUP),
    EntryPoint("taxi", "hierarchy.text_worlds:_taxi", GROUP),
)


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
    """

    name: str
    variables: tuple[Variable, ...]
    actions: tuple[str, ...]
    model: Callable[[], TransitionModel]
    sets: tuple[ValueSet, ...] = ()


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
    )


def world_names() -> tuple[str, ...]:
    """Return the names of the worlds there are, ours first; any ``.maze`` file is a world besides.

    Examples
    --------
    >>> "two_rooms" in world_names()
    True
    """
    return tuple(_found())


def load_world(name: str) -> TextWorld:
    """Return the world called `name`, or the maze of a ``.maze`` file.

    Raises
    ------
    UserError
        If there is no such world or file, or it cannot be loaded.

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
        return maze_world(load_layout(name), name)
    found = _found()
    if name not in found:
        near = get_close_matches(name, found, n=1)
        known = f"there are {', '.join(found)}, and any {MAZE_SUFFIX} file by its path"
        raise UserError(f"no world {name!r}; {f'did you mean {near[0]!r}?' if near else known}")
    point = found[name]
    try:
        make: Callable[[], TextWorld] = point.load()
    except (ImportError, AttributeError) as error:
        raise UserError(
            f"world {name!r} ({point.value}) cannot be loaded: {error}; "
            "install what it needs, or mend its entry point"
        ) from error
    return make()


def _found() -> dict[str, EntryPoint]:
    """Return entry points by name; a name of ours cannot be taken by another package."""
    others = {point.name: point for point in sorted(entry_points(group=GROUP), key=lambda p: p.name)}
    ours = {point.name: point for point in _OURS}
    return ours | {name: point for name, point in others.items() if name not in ours}


def _two_rooms() -> TextWorld:
    return maze_world(load_layout("two_rooms"))


def _taxi() -> TextWorld:
    sites = ValueSet("sites", frozenset(SITES.values()))
    return TextWorld("taxi", taxi_variables(), TAXI_ACTIONS, taxi_model, (sites,))
