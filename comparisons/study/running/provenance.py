"""Where a run's result is from: code, libraries, machine and time."""

from __future__ import annotations

import os
import platform
import subprocess
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

_LIBRARIES: Final = {
    "numpy": "numpy",
    "scipy": "scipy",
    "numba": "numba",
    "torch": "torch",
    "torchrl": "torchrl",
    "networkx": "networkx",
    "opencv": "opencv-python-headless",
}
"""Names of distributions, whose versions are known without loading them."""
_ROOT: Final = Path(__file__).parents[3]
_GIT_SECONDS: Final = 20.0


def provenance(
    *, seed: int, engine: str, started: datetime, wall_seconds: float, cpu_seconds: float | None
) -> dict[str, Any]:
    """Return what is known of a run besides its result, as plain data.

    Parameters
    ----------
    seed
        The spec's: all that is random comes from it.
    engine
        Name of the engine that ran it.
    started
        When the run began.
    wall_seconds, cpu_seconds
        What it took, loading its libraries included; CPU seconds are None where the worker could not tell.

    Examples
    --------
    >>> told = provenance(seed=3, engine="local", started=utc_now(), wall_seconds=2.0, cpu_seconds=1.5)
    >>> told["seed"], told["engine"], told["libraries"]["numpy"].partition(".")[0]
    (3, 'local', '2')
    """
    return {
        **_of_this_process(),
        "pid": os.getpid(),
        "engine": engine,
        "seed": seed,
        "started": started.isoformat(timespec="milliseconds"),
        "wall_seconds": round(wall_seconds, 6),
        "cpu_seconds": None if cpu_seconds is None else round(cpu_seconds, 6),
    }


def utc_now() -> datetime:
    """Return the time, in UTC."""
    return datetime.now(UTC)


@cache
def _of_this_process() -> dict[str, Any]:
    return {
        "affordant": _version("affordant"),
        "git": git_state(_ROOT),
        "python": platform.python_version(),
        "libraries": {name: _version(distribution) for name, distribution in _LIBRARIES.items()},
        "platform": platform.platform(),
        "host": platform.node(),
    }


def _version(distribution: str) -> str | None:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def git_state(root: Path) -> dict[str, Any] | None:
    """Return the commit of a checkout and whether files of it were changed; None if it is no checkout.

    A folder somewhere inside of a checkout is none: an installed package is not part of the user's project.

    Examples
    --------
    >>> git_state(Path("/")) is None
    True
    """
    if not (root / ".git").exists():
        return None
    commit = _git(root, "rev-parse", "HEAD")
    changed = _git(root, "status", "--porcelain", "--untracked-files=no")
    return None if commit is None else {"commit": commit, "dirty": None if changed is None else bool(changed)}


def _git(root: Path, *arguments: str) -> str | None:
    """Return what git says; None if there is no git, or it does not trust the folder."""
    # A status may write the index anew; many workers that ask at once must not get in the user's way.
    command = ["git", "--no-optional-locks", "-C", str(root), *arguments]
    try:
        done = subprocess.run(  # noqa: S603 - words of ours
            command, capture_output=True, text=True, timeout=_GIT_SECONDS, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
