"""The command line `affordant`. Heavy libraries load only in the command that needs them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from cyclopts import App, CycloptsError
from rich.console import Console

from worlds.errors import UserError

app = App(
    name="affordant",
    help="Learn, plan and prove affordances of hierarchical tasks.",
    version=lambda: version("affordant"),
    help_format="plaintext",
)


@app.command
def reproduce(
    *,
    out: Path,
    perception: str = "hough",
    seed: int = 0,
    quick: bool = False,
    layout: str = "two_rooms",
) -> int:
    """Run the experiment of Min et al. (2015) and write a report, figures and results.

    Parameters
    ----------
    out
        Directory to make; it must not exist.
    perception
        Backend that tells shapes: hough, truth, or one that an installed package adds.
    seed
        Seed of everything random; the same seed gives the same results.json.
    quick
        Fewer frames, pushes and random episodes, for a first look.
    layout
        Maze: a name (two_rooms) or the path of a .maze file.
    """
    from comparisons.experiment import Spec
    from comparisons.reproduce import reproduce as run
    from comparisons.summary import summarise

    console = Console(stderr=True)
    results = run(Spec(seed, perception, quick, layout), out, console)
    print(summarise(results))
    print(f"report: {out / 'report.html'}")
    return 0


@app.command
def doctor() -> int:
    """Check versions, import names and heavy libraries, and say how to mend each fault."""
    from comparisons.doctor import examine

    checks = examine()
    for check in checks:
        print(check)
    return 0 if all(check.well for check in checks) else 1


def main(tokens: Sequence[str] | None = None) -> None:
    """Run the command line; a user's mistake is one message and exit status 2, never a traceback."""
    try:
        status = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
    except (CycloptsError, UserError) as error:
        print(f"affordant: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("affordant: stopped; nothing was written", file=sys.stderr)
        sys.exit(130)
    sys.exit(status or 0)
