"""What the README and the examples promise."""

import contextlib
import io
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_readme_prints_what_it_says() -> None:
    """The ten lines of code print the text block below them."""
    code, printed = re.findall(r"```python\n(.*?)```\s*```text\n(.*?)```", README, flags=re.DOTALL)[0]
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, "README.md", "exec"), {})  # noqa: S102 - our own README
    assert out.getvalue() == printed


@pytest.mark.parametrize("name", ["reproduce", "test"])
def test_the_readme_gives_each_command_once(name: str) -> None:
    """Continuous integration finds its commands below these marks."""
    commands = re.findall(rf"<!-- command: {name} -->\n```bash\n(.*?)\n```", README)
    assert len(commands) == 1
    assert "-c constraints.txt" in commands[0]


def test_the_readme_links_to_files_that_are_there() -> None:
    """Every link and picture of the README leads to a file of the repository."""
    links = re.findall(r"\]\(([^)]+)\)", README)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("own_task_graph", "learnt steps equal the oracle's from 7 of 7 starts"),
        ("affordances", "GotoTrigger(T4): North loses 2, South is optimal, West loses 2, East loses 1"),
        ("own_backend", "hough: "),
        ("taxi", "greedy steps are optimal from 100 of 100 sampled starts"),
        ("hdg", "by 3 landmarks it takes 4.32 steps on average, 3.33 at best"),
        ("option_critic_from_pixels", "optimal from 496 of 496 starts"),
        ("four_rooms_key", "the learnt way is a shortest one from 87 of 87 starts"),
    ],
)
def test_examples_print_their_findings(name: str, expected: str) -> None:
    """Every example runs by itself and prints what it found."""
    done = subprocess.run(  # noqa: S603 - our own examples
        [sys.executable, ROOT / "examples" / f"{name}.py"], capture_output=True, text=True, check=True
    )
    assert expected in done.stdout


def test_every_example_is_tested() -> None:
    """No example stands in the folder that the test above leaves out."""
    tested = {
        "own_task_graph",
        "affordances",
        "own_backend",
        "taxi",
        "hdg",
        "four_rooms_key",
        "option_critic_from_pixels",
    }
    assert {path.stem for path in (ROOT / "examples").glob("*.py")} == tested
