"""The command line as a user has it: what a command prints, and how it ends."""

from __future__ import annotations

from pathlib import Path

import pytest

from comparisons.cli import main

FILES = ("checkpoint.json", "checkpoint.safetensors", "curve.csv")
"""What `affordant learn` leaves behind."""


def affordant(capsys: pytest.CaptureFixture[str], *tokens: str) -> tuple[int, str, str]:
    """Run a command; return its exit status and what it printed, none of it a traceback."""
    with pytest.raises(SystemExit) as ended:
        main(tokens)
    out, err = capsys.readouterr()
    assert isinstance(ended.value.code, int)
    assert "Traceback" not in err
    return ended.value.code, out, err


def same_files(one: str, other: str) -> bool:
    """Return whether two runs of `affordant learn` left the same bytes."""
    return all(Path(one, name).read_bytes() == Path(other, name).read_bytes() for name in FILES)
