"""`affordant doctor`: is this installation sound, and if not, what to do about it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, packages_distributions, requires, version
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from packaging.requirements import Requirement

OUR_NAMES: Final = ("worlds", "hierarchy", "planners", "perception", "comparisons")
"""Our import packages. Other projects use some of these names, so two may meet in one environment."""
HEAVY: Final = ("pybullet", "cv2", "torch", "torchrl")
"""Libraries with compiled parts, which may be installed and still not load."""
OPENCV: Final = (
    "opencv-python",
    "opencv-python-headless",
    "opencv-contrib-python",
    "opencv-contrib-python-headless",
)


@dataclass(frozen=True)
class Check:
    """One thing that was looked at.

    Parameters
    ----------
    what
        What it is.
    found
        What was found.
    mend
        What to do about it; empty if all is well.
    """

    what: str
    found: str
    mend: str = ""

    @property
    def well(self) -> bool:
        """Whether there is nothing to mend."""
        return not self.mend

    def __str__(self) -> str:
        line = f"[{'ok' if self.well else '!!'}] {self.what}: {self.found}"
        return line if self.well else f"{line}\n     {self.mend}"


def examine() -> tuple[Check, ...]:
    """Return every check, in order."""
    return (_python(), *_versions(), *_names(), _opencv(), *(_loads(name) for name in HEAVY))


def _python() -> Check:
    found = ".".join(map(str, sys.version_info[:3]))
    mend = "" if sys.version_info[:2] == (3, 11) else "use Python 3.11: PyBullet's wheels stop there"
    return Check("Python", found, mend)


def _versions() -> Iterator[Check]:
    """Check every dependency that our own metadata names."""
    for text in requires("affordant") or ():
        wanted = Requirement(text)
        if wanted.marker is not None and not wanted.marker.evaluate({"extra": ""}):
            continue
        try:
            found = version(wanted.name)
        except PackageNotFoundError:
            yield Check(
                wanted.name, "not installed", "install affordant with `pip install -c constraints.txt .`"
            )
            continue
        fits = wanted.specifier.contains(found, prereleases=True)
        mend = "" if fits else f"needs {wanted.specifier}: run `pip install -c constraints.txt .`"
        yield Check(wanted.name, found, mend)


def _names() -> Iterator[Check]:
    """Check that each of our import names leads to our own folder, and that nobody else claims it."""
    home = Path(__file__).parent.parent
    distributions = packages_distributions()
    for name in OUR_NAMES:
        spec = find_spec(name)
        origin = None if spec is None or spec.origin is None else Path(spec.origin).parent
        others = sorted(set(distributions.get(name, ())) - {"affordant"})
        if origin != home / name:
            yield Check(
                f"import {name}",
                f"leads to {origin}, not to affordant",
                "another package or folder of this name comes first on the path: remove it, or run elsewhere",
            )
        elif others:
            yield Check(
                f"import {name}",
                f"also installed by {', '.join(others)}",
                f"run `pip uninstall {' '.join(others)}`, then install affordant again",
            )
        else:
            yield Check(f"import {name}", "ours")


def _opencv() -> Check:
    found = [name for name in OPENCV if _installed(name)]
    if found == ["opencv-python-headless"]:
        return Check("OpenCV wheels", "one, headless")
    remove = " ".join(name for name in found if name != "opencv-python-headless")
    return Check(
        "OpenCV wheels",
        ", ".join(found) or "none",
        f"wheels overwrite each other's cv2: run `pip uninstall -y {remove} opencv-python-headless`, then "
        "`pip install -c constraints.txt opencv-python-headless`",
    )


def _installed(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True


def _loads(name: str) -> Check:
    """Import a library in a process of its own, so that one that crashes is a finding, not our end."""
    done = subprocess.run(  # noqa: S603 - the name is one of HEAVY
        [sys.executable, "-c", f"import {name}"], capture_output=True, text=True, check=False
    )
    if done.returncode == 0:
        return Check(f"load {name}", "loads")
    lines = done.stderr.strip().splitlines()
    found = lines[-1] if lines else f"ended with status {done.returncode}"
    return Check(
        f"load {name}", found, "reinstall it with `pip install --force-reinstall -c constraints.txt .`"
    )
