"""The backend that is told the truth: what planning is worth when perception never errs."""

from __future__ import annotations

from collections.abc import Sequence

from perception.protocol import Detection, View


class Truth:
    """Ground truth as a backend; it reads no frames.

    Examples
    --------
    >>> from perception.protocol import NOTHING
    >>> Truth().detect([View(frame=None, truth=NOTHING)])
    [Detection(label='none', confidence=1.0, distance=0)]
    """

    name = "truth"
    needs_frames = False

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Return each view's truth."""
        return [view.truth for view in views]
