"""Processes watched and killed, for tests of running."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import psutil

PATIENCE = 30.0  # seconds; a busy machine may take its time


def wait_until(true: Callable[[], object], what: str) -> None:
    """Wait until something is true, and fail if it never is."""
    end = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < end, f"this never came: {what}"
        time.sleep(0.02)


def under_way(marks: Path) -> dict[int, list[int]]:
    """Return the ids of processes that have begun runs, by the runs' seeds; each attempt counts."""
    found: dict[int, list[int]] = {}
    for path in marks.glob("[0-9]*-*"):
        seed, pid, _ = path.name.split("-")
        found.setdefault(int(seed), []).append(int(pid))
    return found


def alive(pid: int) -> bool:
    """Return whether a process is there, and not only waits for its parent to notice its end."""
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def parent_of(pid: int) -> int | None:
    """Return the id of a process's parent; None if it has ended."""
    try:
        return psutil.Process(pid).ppid()
    except psutil.NoSuchProcess:
        return None


def kill(pid: int) -> None:
    """End a process at once, as a lack of memory would."""
    os.kill(pid, signal.SIGKILL)
