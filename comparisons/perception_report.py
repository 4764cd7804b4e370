"""The comparison of perception backends told: its report, its figures and its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from comparisons.perception_learning import Learning
from comparisons.perception_learning_section import learning_results, learning_sections
from comparisons.perception_price import Price
from comparisons.perception_sections import (
    audit_section,
    confusions_section,
    corruptions_section,
    latency_section,
    mistakes_section,
    prices_section,
    reliability_section,
    scenes_section,
    score_of,
    strangers_section,
)
from comparisons.perception_spec import StudySpec
from comparisons.perception_study import VARIED, Seen
from comparisons.perception_words import interval
from comparisons.report import Report
from comparisons.story_parts import percent
from perception.calibration import Reliability
from perception.corruptions import HELD_OUT
from perception.models import installed

_PACKAGES: Final = ("affordant", "numpy", "opencv-python-headless", "pybullet", "scikit-learn", "torch")


def tell_perception(
    spec: StudySpec, seen: Seen, prices: Sequence[Price], learning: Learning
) -> tuple[Report, dict[str, Figure]]:
    """Return the report of a comparison, and the figures that it names."""
    parts = [
        scenes_section(seen),
        corruptions_section(seen),
        confusions_section(seen),
        reliability_section(seen),
        audit_section(seen),
        *learning_sections(spec, learning),
        strangers_section(seen),
        latency_section(seen),
        *([prices_section(prices)] if prices else []),
        *mistakes_section(seen),
    ]
    figures = {name: figure for part in parts for name, figure in part.figures.items()}
    summary = []
    for name in seen.backends:
        clean, varied = (score_of(seen, name, condition, 0) for condition in ("clean", VARIED))
        note = f"95 % interval {interval(*varied.interval)}; clean frames {percent(clean.accuracy)}"
        summary.append((f"{name}: right, everything varied", percent(varied.accuracy), note))
    lead = (
        f"{len(seen.backends)} backends on the same {spec.frames} frames of every set, all of seed "
        f"{spec.seed}, which is kept for tests: the ready-made weights know none of them. The truth of a "
        "frame is what its scene holds. Backends learn from what the robot finds out by pushing instead; on "
        f"{percent(seen.agreement)} of the varied frames the two are the same."
    )
    sections = tuple(part.section for part in parts)
    return Report("Perception backends compared", tuple(summary), sections, lead=lead), figures


def perception_results(
    spec: StudySpec, seen: Seen, prices: Sequence[Price], learning: Learning
) -> dict[str, Any]:
    """Return the content of results.json: all but times, so that the same seed gives the same bytes."""
    return {
        "spec": asdict(spec) | {"backends": list(seen.backends)},
        "versions": installed(*_PACKAGES),
        "agreement": seen.agreement,
        "scores": [
            asdict(one)
            | {"frames": one.frames, "accuracy": one.accuracy, "interval": list(one.interval)}
            | {"held_out": one.condition in HELD_OUT}
            for one in seen.scores
        ],
        "audit": [asdict(one) for one in seen.groups],
        **learning_results(learning),
        "solids_never_learnt": [asdict(one) for one in seen.strangers],
        "reliability": {
            name: {"scenes": _bins(scenes), "corrupted": _bins(corrupted)}
            for name, (scenes, corrupted) in seen.reliability.items()
        },
        "price": [asdict(one) | {"success_interval": list(one.success)} for one in prices],
    }


def _bins(found: Reliability) -> dict[str, Any]:
    columns = {"confidence": found.confidence, "accuracy": found.accuracy}
    return {
        "error": found.error,
        "frames": found.counts.tolist(),
        **{name: [None if np.isnan(v) else float(v) for v in values] for name, values in columns.items()},
    }
