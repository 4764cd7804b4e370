"""What the parts of the report share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from matplotlib.figure import Figure

from comparisons.report import Section


@dataclass(frozen=True, eq=False)
class Part:
    """A section of the report, with the figures that it names."""

    section: Section
    figures: Mapping[str, Figure] = field(default_factory=dict)


def percent(part: float) -> str:
    """Return a share in words.

    >>> percent(0.9612)
    '96.1 %'
    """
    return f"{100 * part:.1f} %"


def share(part: int, whole: int) -> str:
    """Return a part of a whole in percent, a dash if there is no whole.

    >>> share(1, 4)
    '25.0 %'
    """
    return percent(part / whole) if whole else "\N{EN DASH}"
