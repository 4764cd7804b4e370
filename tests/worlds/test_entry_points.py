"""Entry points are found as `importlib.metadata` finds them, without reading them each time."""

import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import pytest

from worlds.entry_points import entry_points

GROUP = "affordant.tests"


def test_packages_are_read_once_for_each_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package that comes onto the path is found; who asks again gets what was read."""
    asked: list[str] = []
    read: Callable[..., metadata.EntryPoints] = metadata.entry_points

    def counted(*, group: str) -> metadata.EntryPoints:
        asked.append(group)
        return read(group=group)

    monkeypatch.setattr(metadata, "entry_points", counted)
    assert entry_points(group=GROUP) == ()
    info = tmp_path / "mine-0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\nmine = my_package:MINE\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    for _ in range(3):
        assert [(point.name, point.value) for point in entry_points(group=GROUP)] == [
            ("mine", "my_package:MINE")
        ]
    assert asked == [GROUP, GROUP]
