"""What `affordant learn` was asked for, and the command that goes on with it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from comparisons.learn.logging_to import refuse_missing
from worlds.errors import UserError


@dataclass(frozen=True)
class Spec:
    """What `affordant learn` was asked for; see `comparisons.commands.learn`.

    Raises
    ------
    UserError
        If a number is out of range, or what belongs together is not there.

    Examples
    --------
    >>> Spec("taxi", Path("run"), seed=3).going_on()
    'affordant learn taxi --learner option-critic --seed 3 --out run --resume'
    >>> Spec("four_rooms", Path("later"), carry=Path("first/checkpoint.safetensors"))
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: --carry: name the state variables that have moved, such as --moved goal
    """

    graph: str
    out: Path
    learner: str = "option-critic"
    world: str | None = None
    seed: int = 0
    config: Path | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    steps: int | None = None
    tolerance: float = 0.0
    starts: str | None = None
    resume: bool = False
    carry: Path | None = None
    moved: tuple[str, ...] = ()
    logger: str | None = None

    def __post_init__(self) -> None:
        refuse_missing(self.logger)
        if not 0 <= self.seed < 1 << 63:
            raise UserError(f"--seed {self.seed}: give a whole number from 0 to 9223372036854775807")
        if not 0 <= self.tolerance < float("inf"):
            raise UserError(f"--tolerance {self.tolerance}: give a number from 0 on")
        if self.steps is not None and self.steps < 1:
            raise UserError(f"--steps {self.steps}: give at least 1")
        if self.carry is not None and not self.moved:
            raise UserError("--carry: name the state variables that have moved, such as --moved goal")
        if self.moved and self.carry is None:
            raise UserError(
                f"--moved {' '.join(self.moved)}: there is nothing to carry; give --carry a checkpoint"
            )

    def going_on(self) -> str:
        """Return the command that goes on; it needs no --carry, for the checkpoint has all the networks."""
        words = ["affordant", "learn", self.graph, "--learner", self.learner]
        words += ["--world", self.world] if self.world is not None else []
        words += ["--seed", str(self.seed)] if self.seed else []
        words += ["--config", str(self.config)] if self.config is not None else []
        for name, text in self.settings.items():
            words += ["--terminations", text] if name == "terminations" else ["--set", f"{name}={text}"]
        words += ["--steps", str(self.steps)] if self.steps is not None else []
        words += ["--tolerance", f"{self.tolerance:g}"] if self.tolerance else []
        words += ["--starts", self.starts] if self.starts is not None else []
        words += ["--logger", self.logger] if self.logger is not None else []
        return shlex.join([*words, "--out", str(self.out), "--resume"])


def named_settings(pairs: tuple[str, ...], terminations: str | None = None) -> dict[str, str]:
    """Return settings by name from what stands on a command line.

    Raises
    ------
    UserError
        If one has no name, or one is given twice.

    Examples
    --------
    >>> named_settings(("rate=1e-3", "gamma=0.9"), "prior")
    {'terminations': 'prior', 'rate': '1e-3', 'gamma': '0.9'}
    """
    found = {} if terminations is None else {"terminations": terminations}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals:
            raise UserError(f"--set {pair}: there is no '='; write NAME=VALUE, such as rate=1e-3")
        if name in found:
            raise UserError(f"--set {pair}: {name} is given already; give it once")
        found[name] = value
    return found
