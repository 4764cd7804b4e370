"""Every goal beside its figure: the benchmarks one after the other, each in a process of its own.

Run with ``python bench/bench_all.py``; it needs the extra `bench`, and takes ten minutes.
"""

import subprocess
import sys
from pathlib import Path

ALL = ("learners", "worlds", "oracle", "scaling", "abstraction", "perception")


def main() -> None:
    """Run them all, each under its title."""
    for name in ALL:
        print(f"\n=== {name} ===", flush=True)
        script = Path(__file__).with_name(f"bench_{name}.py")
        subprocess.run([sys.executable, str(script)], check=True)  # noqa: S603 - our own


if __name__ == "__main__":
    main()
