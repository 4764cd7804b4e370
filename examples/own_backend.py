"""A perception backend of your own beside ours: checked by the conformance kit, then the same frames."""

import cv2
import numpy as np

from comparisons.conformance import check_backend
from perception.accuracy import measure
from perception.frames import fresh_views
from perception.percepts import Percepts, Sees, checked_frames
from perception.protocol import Frames
from perception.registry import load_backend
from worlds import load_layout
from worlds.camera import Camera


class Colourful(Sees):
    """Takes a frame's middle for a sphere, one cell ahead, where it is neither blue, white nor brown."""

    name = "colourful"

    def perceive(self, frames: Frames) -> Percepts:
        """Return what stands ahead in each frame."""
        odd = np.array([self._odd(frame) for frame in checked_frames(frames)])
        sphere = np.clip(0.4 + odd, 0, 1)  # a tenth of the middle is as likely a sphere as none
        chances = np.column_stack([1 - sphere, np.zeros(len(odd)), sphere])
        return Percepts(chances, np.ones(len(odd), np.int64), np.zeros(len(odd), np.bool_))

    def _odd(self, frame: Frames) -> float:
        third = len(frame) // 3
        hue = cv2.cvtColor(frame[third : 2 * third, third : 2 * third], cv2.COLOR_RGB2HSV)
        return float(((hue[..., 1] > 90) & ((hue[..., 0] < 100) | (hue[..., 0] > 125))).mean())


maze, camera = load_layout("two_rooms"), Camera()
check_backend(Colourful(), list(fresh_views(maze, 9, seed=2, camera=camera)))
for backend in (Colourful(), load_backend("hough", camera)):
    result = measure(backend, fresh_views(maze, 90, seed=3, camera=camera))
    print(f"{backend.name}: {100 * result.accuracy:.0f} % of {result.frames} frames")
