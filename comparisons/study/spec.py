"""A run, named by what it is: two runs with the same spec give the same result, and have the same hash."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from worlds import UserError

Value = bool | int | float | str
"""What a setting may be."""


@dataclass(frozen=True)
class RunSpec:
    """What one run is to do.

    Parameters
    ----------
    kind
        Kind of run, such as "learn" (`comparisons.study.kinds`).
    version
        The kind's version: raised whenever the same settings give another result.
    settings
        Every setting of the kind by name, defaults included, so that a default that changes is seen.
    seed
        Of all that is random.
    files
        Texts of the files that settings name, by the name that they are given: what is run is what they
        said when the study was declared, on whatever machine.

    Raises
    ------
    UserError
        If a number is not finite, for it could not be written down.

    Examples
    --------
    >>> one = RunSpec("learn", 1, {"learner": "maxq-0", "gamma": 1.0}, seed=3)
    >>> other = RunSpec("learn", 1, {"gamma": 1.0, "learner": "maxq-0"}, seed=3)
    >>> one.hash == other.hash, len(one.hash), one
    (True, 32, RunSpec(kind='learn', ...))
    """

    kind: str
    version: int
    settings: Mapping[str, Value]
    seed: int
    files: Mapping[str, str] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        for name, value in self.settings.items():
            if isinstance(value, float) and not abs(value) < float("inf"):
                raise UserError(f"{name}: {value} is not possible; give a finite number")

    @property
    def hash(self) -> str:
        """The first 32 hexadecimal digits of the SHA-256 of all this, whatever the order of settings."""
        return digest(self.as_data())[:32]

    def as_data(self) -> dict[str, Any]:
        """Return it as plain data, for JSON."""
        return {
            "kind": self.kind,
            "version": self.version,
            "settings": dict(sorted(self.settings.items())),
            "seed": self.seed,
            "files": dict(sorted(self.files.items())),
        }

    @classmethod
    def of_data(cls, data: Mapping[str, Any]) -> RunSpec:
        """Return the spec that `as_data` made data of."""
        return cls(data["kind"], data["version"], data["settings"], data["seed"], data["files"])


def canonical(data: Any) -> str:
    """Return plain data as JSON in one way only: keys in order, no blanks, no number that is none.

    >>> canonical({"b": 1.0, "a": [True, None, "ä"]})
    '{"a":[true,null,"ä"],"b":1.0}'
    """
    return json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def digest(data: Any) -> str:
    """Return the SHA-256 of plain data's canonical JSON."""
    return hashlib.sha256(canonical(data).encode()).hexdigest()
