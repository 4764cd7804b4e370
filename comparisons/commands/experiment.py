"""Commands on the project as a whole: the paper's experiment, and whether all is there for it."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console


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


def doctor() -> int:
    """Check versions, import names and heavy libraries, and say how to mend each fault."""
    from comparisons.doctor import examine

    checks = examine()
    for check in checks:
        print(check)
    return 0 if all(check.well for check in checks) else 1
