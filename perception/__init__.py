"""From camera frame to none, cube or sphere, with a confidence: backends behind one protocol."""

from perception.accuracy import Accuracy, confusion, measure
from perception.percepts import Percepts, Sees, checked_frames
from perception.protocol import (
    LABELS,
    NOTHING,
    REACH,
    Backend,
    Detection,
    Frame,
    FrameBackend,
    Frames,
    Label,
    View,
)
from perception.registry import backend_names, load_backend
from perception.truth import Truth

__all__ = [
    "LABELS",
    "NOTHING",
    "REACH",
    "Accuracy",
    "Backend",
    "Detection",
    "Frame",
    "FrameBackend",
    "Frames",
    "Label",
    "Percepts",
    "Sees",
    "Truth",
    "View",
    "backend_names",
    "checked_frames",
    "confusion",
    "load_backend",
    "measure",
]
