"""Backends by name: our own, and those that other packages add through an entry point.

A package adds a backend by an entry point of the group ``affordant.perception``, whose value is a
factory: a callable that takes the `worlds.camera.Camera` and returns a `Backend`. In its pyproject.toml::

    [project.entry-points."affordant.perception"]
    mine = "my_package:MyBackend"
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint
from typing import Final

from perception.protocol import Backend
from perception.truth import Truth
from worlds import UserError, suggest
from worlds.camera import Camera
from worlds.entry_points import entry_points

GROUP: Final = "affordant.perception"
"""The entry points' group."""

Factory = Callable[[Camera], Backend]

# Ours are entry points as well, so that naming a backend loads its libraries and no other's.
_OURS: Final = (
    EntryPoint("truth", "perception.registry:_truth", GROUP),
    EntryPoint("hough", "perception.hough:Hough", GROUP),
    EntryPoint("cnn", "perception.cnn:Cnn", GROUP),
    EntryPoint("hog", "perception.hog:Hog", GROUP),
    EntryPoint("ensemble", "perception.ensemble:Ensemble", GROUP),
)


def backend_names() -> tuple[str, ...]:
    """Return the names of every backend there is, ours first.

    Examples
    --------
    >>> backend_names()[:5]
    ('truth', 'hough', 'cnn', 'hog', 'ensemble')
    """
    return tuple(_found())


def load_backend(name: str, camera: Camera | None = None) -> Backend:
    """Return the backend called `name`, made for frames of `camera`.

    Parameters
    ----------
    name
        One of `backend_names()`.
    camera
        The camera that takes the frames. Defaults to ``Camera()``.

    Raises
    ------
    UserError
        If there is no such backend, or another package's backend cannot be loaded.

    Examples
    --------
    >>> load_backend("truth").needs_frames
    False
    >>> load_backend("huogh")
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: no perception backend 'huogh'; did you mean 'hough'?
    """
    found = _found()
    if name not in found:
        raise UserError(f"no perception backend {name!r}; {suggest(name, found, 'backends:')}")
    return _load(found[name])(Camera() if camera is None else camera)


def _found() -> dict[str, EntryPoint]:
    """Return entry points by name; a name of ours cannot be taken by another package."""
    others = {point.name: point for point in sorted(entry_points(group=GROUP), key=lambda p: p.name)}
    ours = {point.name: point for point in _OURS}
    return ours | {name: point for name, point in others.items() if name not in ours}


def _load(point: EntryPoint) -> Factory:
    try:
        factory: Factory = point.load()
    except (ImportError, AttributeError) as error:
        raise UserError(
            f"perception backend {point.name!r} ({point.value}) cannot be loaded: {error}; "
            "install what it needs, or mend its entry point"
        ) from error
    return factory


def _truth(_camera: Camera) -> Backend:
    return Truth()
