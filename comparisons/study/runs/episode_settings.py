"""Settings of runs of kind "episodes": what is possible, what they are if not given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Final

from comparisons.study.kinds import ReadText
from comparisons.study.runs.settings import NO_CORRUPTION, Setting, check_corruption, completed
from comparisons.study.spec import Value
from hierarchy import checked, two_rooms
from perception.corruptions import CORRUPTIONS, SEVERITIES
from perception.registry import backend_names, load_backend
from worlds import Layout, UserError, layout_names, load_layout, maze_model, parse_layout, suggest
from worlds.appearing import ON_THE_WAY

MOST: Final = 20
"""Obstacles of an episode, at most."""
_FILE: Final = ".maze"

_SETTINGS: Final = {
    "layout": Setting("two_rooms"),
    "obstacles": Setting(3, 0, MOST),
    "spheres": Setting(0.5, 0, 1),
    "on_way": Setting(ON_THE_WAY, 0, 1),
    "strategy": Setting("local-rule", choices=lambda: ("local-rule", "value-sweep", "replanning")),
    "learner": Setting("maxq-0", choices=lambda: ("maxq-0",)),
    "perception": Setting("truth", choices=backend_names),
    "corruption": Setting(NO_CORRUPTION, choices=lambda: (NO_CORRUPTION, *CORRUPTIONS)),
    "severity": Setting(0, 0, max(SEVERITIES)),
    "episodes": Setting(50, 1, 100_000),
    "follow": Setting("replanning", choices=lambda: ("replanning", "strategy")),
}


def complete(given: Mapping[str, Value]) -> Mapping[str, Value]:
    """Return all settings, checked.

    Raises
    ------
    UserError
        If one is not possible; the message begins with its name.

    Examples
    --------
    >>> complete({"obstacles": 12})["strategy"]
    'local-rule'
    >>> complete({"obstacles": 21})
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: obstacles: 21 is not possible; give a whole number from 0 to 20
    """
    settings = completed(_SETTINGS, given)
    check_corruption(settings)
    spoilt = settings["corruption"] != NO_CORRUPTION
    if spoilt and not load_backend(str(settings["perception"])).needs_frames:
        raise UserError(
            f"corruption: {settings['corruption']!r} spoils frames, and perception "
            f"{settings['perception']!r} reads none; name a backend that does, such as 'hough', "
            f"or {NO_CORRUPTION!r}"
        )
    name = str(settings["layout"])
    if name in layout_names():
        check_room(layout_of(name), int(settings["obstacles"]))
    elif not name.endswith(_FILE):  # what a file holds is for `settle`
        mend = suggest(name, layout_names(), f"name a {_FILE} file, or one of")
        raise UserError(f"layout: there is no layout {name!r}; {mend}")
    return settings


def files(settings: Mapping[str, Value]) -> Sequence[str]:
    """Return which settings name files: the layout, unless it comes with the package."""
    return () if settings["layout"] in layout_names() else ("layout",)


def settle(settings: Mapping[str, Value], read: ReadText) -> Mapping[str, Value]:
    """Return complete settings as they are, if a layout of the user's own has all that they ask for.

    Raises
    ------
    UserError
        If it has not; the message begins with a setting's name.
    """
    if files(settings):
        name = str(settings["layout"])
        check_room(_layout_within(read(name), name), int(settings["obstacles"]))
    return settings


@lru_cache(maxsize=64)
def _layout_within(text: str, name: str) -> Layout:
    """Return a layout that a text describes, if the robot's tasks can be learnt in it."""
    try:
        layout = parse_layout(text, name)
        checked(two_rooms(layout), maze_model(layout))
    except UserError as error:
        raise UserError(f"layout: {error}") from error
    return layout


def layout_of(name: str) -> Layout:
    """Return a layout by its name or file; an error begins with the setting's name."""
    try:
        return load_layout(name)
    except UserError as error:
        raise UserError(f"layout: {error}") from error


def check_room(layout: Layout, obstacles: int) -> None:
    """Refuse more obstacles than there are cells: the start, the trigger and the goal stay free."""
    room = len(layout.cells) - len(layout.solid) - 3
    if obstacles > room:
        raise UserError(
            f"obstacles: layout {layout.name} has room for {room} besides the start, the trigger and the "
            f"goal, not for {obstacles}; give fewer, or a larger layout"
        )
