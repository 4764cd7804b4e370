"""What tests that carry out runs begin with."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from study_kinds import installed


@pytest.fixture
def kind_there(tmp_path: Path) -> Iterator[None]:
    """Let the tests' kind be found, here and by workers."""
    with installed(tmp_path / "site"):
        yield


@pytest.fixture
def marks(tmp_path: Path) -> Path:
    """Return a folder in which runs tell that they are under way."""
    folder = tmp_path / "marks"
    folder.mkdir()
    return folder
