"""From camera frame to none, cube or sphere, with a confidence: backends behind one protocol."""

from perception.accuracy import Accuracy, confusion, measure
from perception.protocol import LABELS, NOTHING, REACH, Backend, Detection, Frame, Label, View
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
    "Label",
    "Truth",
    "View",
    "backend_names",
    "confusion",
    "load_backend",
    "measure",
]
