"""A perception backend of your own beside ours: the same frames, the same score."""

from collections.abc import Sequence

import cv2

from perception.accuracy import measure
from perception.frames import fresh_views
from perception.protocol import Detection, View
from perception.registry import load_backend
from worlds import load_layout
from worlds.camera import Camera


class Colourful:
    """Calls a frame's middle a sphere, one cell ahead, where it is neither blue, white nor brown."""

    name = "colourful"
    needs_frames = True

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Return one detection a view."""
        return [self._detect(view) for view in views]

    def _detect(self, view: View) -> Detection:
        assert view.frame is not None, "it asked for frames"
        pixels = view.frame.shape[0]
        middle = view.frame[pixels // 3 : 2 * pixels // 3, pixels // 3 : 2 * pixels // 3]
        hue = cv2.cvtColor(middle, cv2.COLOR_RGB2HSV)
        odd = ((hue[..., 1] > 90) & ((hue[..., 0] < 100) | (hue[..., 0] > 125))).mean()
        return Detection("sphere", float(odd), 1) if odd > 0.1 else Detection("none", 1 - float(odd), 0)


maze, camera = load_layout("two_rooms"), Camera()
for backend in (Colourful(), load_backend("hough", camera)):
    result = measure(backend, fresh_views(maze, 90, seed=3, camera=camera))
    print(f"{backend.name}: {100 * result.accuracy:.0f} % of {result.frames} frames")
