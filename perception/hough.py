"""The paper's recogniser (section 6.1, figure 11): Sobel edges, Hough circles and Hough lines.

Hough transforms propose, edges dispose. A circle proposes the spheres, and a pair of upright lines the
cubes, that would look like it from where the robot stands (`perception.shapes`). A proposal is as good
as the share of its outline that lies on Sobel edges of the right direction; that share is the evidence.
A softmax weighs the evidence (`perception.weighing`): the probability of what is reported grows with the
evidence for it and falls with that of its rivals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.edges import Gradients, OutlineReader, gradients, noise
from perception.hough_drawing import Evidence, draw
from perception.percepts import Percepts, Sees, checked_frames
from perception.proposals import agree, circles, cover, upright_lines, window
from perception.protocol import REACH, Frame, Frames
from perception.shapes import LEFT_SIDE, RIGHT_SIDE, cube_outlines, sphere_outlines
from perception.weighing import Weights, weigh
from worlds.camera import Camera

WEIGHTS: Final[Weights] = (
    ((-13.56, 23.53, 2.93, 0.0, 0.0, -0.23), (-11.89, -4.0, 0.0, 20.43, 5.74, 0.9)),
    ((-12.69, 21.17, 0.64, 0.0, 0.0, 0.16), (-6.97, -4.58, -0.78, 16.69, 0.0, 0.04)),
)
"""Fitted by `perception.tuning` to 1,500 frames of the twin, as they are and corrupted."""


@dataclass(frozen=True)
class HoughSettings:
    """What the recogniser goes by. Gradients are Sobel's: four times a step in 0-255 colour.

    Parameters
    ----------
    smallest, largest, step
        Radii (half the edge for a cube) that are looked for, in metres; for cubes every other step.
    turn
        Cubes are looked for at every multiple of it up to a right angle, in degrees.
    circle_gradient, circle_votes
        Canny's upper threshold, and the votes that a circle needs.
    line_gradient, line_votes, line_gap
        The gradient of an upright edge, the votes that a line needs, and the gap that it may have (pixels).
    side_cover
        Share of each of a cube's two sides that lines must cover for the cube to be proposed.
    edge_gradient, alignment
        The gradient that bears out a point of an outline in full, and the least cosine of its angle with
        the outline's normal.
    noise
        How much of a frame's noise (its median gradient) is added to each of the three gradients above.
    smooth
        Width of the median filter that a frame goes through first, in pixels; odd.
    stretch
        By how much a frame's contrast is stretched at most.
    weights
        The constants of the softmax that weighs the evidence.
    """

    smallest: float = 0.09
    largest: float = 0.43
    step: float = 0.01
    turn: float = 10.0
    circle_gradient: float = 40.0
    circle_votes: float = 12.0
    line_gradient: float = 30.0
    line_votes: int = 6
    line_gap: int = 3
    side_cover: float = 0.4
    edge_gradient: float = 90.0
    alignment: float = 0.95
    noise: float = 1.5
    smooth: int = 3
    stretch: float = 8.0
    weights: Weights = WEIGHTS


@dataclass(frozen=True, eq=False)
class _Sight:
    """What a frame shows of one kind, nearest cell first."""

    best: NDArray[np.float64]  # evidence for any outline there, shape (distances,)
    proposed: NDArray[np.float64]  # and for those that a Hough transform proposed
    outlines: NDArray[np.int64]  # the outline of the latter, or of the former without a proposal


@dataclass(frozen=True, eq=False)
class _Look:
    """All that was found in a frame."""

    cube: _Sight
    sphere: _Sight
    noise: float
    circles: NDArray[np.float64]
    lines: NDArray[np.float64]

    @property
    def features(self) -> NDArray[np.float64]:
        """What is weighed (`perception.weighing.FEATURES`), shape (distances, features)."""
        found = (self.cube.best, self.cube.proposed, self.sphere.best, self.sphere.proposed)
        ones = np.ones(REACH)
        return np.column_stack([ones, *found, ones * self.noise / 100])


class Hough(Sees):
    """Sobel and Hough as a backend.

    Parameters
    ----------
    camera
        The camera that takes the frames; its geometry says where obstacles can be.
    settings
        Thresholds and constants. Defaults to ``HoughSettings()``, tuned for frames of 96 pixels.

    Examples
    --------
    >>> camera = Camera(pixels=128)
    >>> frame = np.full((128, 128, 3), 90, np.uint8)
    >>> Hough(camera).explain(frame).detection.label
    'none'
    >>> col, row = camera.project(1, 0, 0.25)
    >>> _ = cv2.circle(frame, (round(col), round(row)), 24, (200, 30, 30), -1)
    >>> Hough(camera).explain(frame).detection.label
    'sphere'
    """

    name = "hough"

    def __init__(self, camera: Camera, settings: HoughSettings | None = None) -> None:
        self.camera = camera
        self.settings = HoughSettings() if settings is None else settings
        given = self.settings
        distances = np.arange(1, REACH + 1)
        radii = np.arange(given.smallest, given.largest + given.step / 2, given.step)
        self._spheres = sphere_outlines(camera, distances, radii)
        self._cubes = cube_outlines(camera, distances, radii[::2], np.arange(0.0, 90.0, given.turn))
        self._sphere_reader = OutlineReader(self._spheres, camera.pixels)
        self._cube_reader = OutlineReader(self._cubes, camera.pixels)
        self._windows = [window(self._spheres, d, camera.pixels) for d in distances.tolist()]

    def perceive(self, frames: Frames) -> Percepts:
        """Return what stands ahead in each frame, uint8, shape (frames, pixels, pixels, 3).

        Raises
        ------
        UserError
            If these are no frames of the camera's size.
        """
        return self.judge(self.features(frames))

    def features(self, frames: Frames) -> NDArray[np.float64]:
        """Return what is weighed in each frame, shape (frames, distances, features).

        See `perception.weighing.FEATURES`.

        Raises
        ------
        UserError
            If these are no frames of the camera's size.
        """
        checked_frames(frames, self.camera.pixels)
        return np.stack([self._look(frame).features for frame in frames])

    def judge(self, features: NDArray[np.float64]) -> Percepts:
        """Return what to make of what is weighed, shape (frames, distances, features)."""
        probabilities, distances = weigh(features, self.settings.weights)
        return Percepts(probabilities, distances, np.zeros(len(features), dtype=np.bool_))

    def explain(self, frame: Frame) -> Evidence:
        """Return what stands in the way in a frame, shape (pixels, pixels, 3), and why.

        Raises
        ------
        UserError
            If the frame is of another size than the camera's, or not of bytes.
        """
        look = self._look(checked_frames(frame[None], self.camera.pixels)[0])
        seen = self.judge(look.features[None])
        detection, cell = seen.detections()[0], int(seen.distances[0]) - 1
        cube, sphere = look.cube, look.sphere
        # What is reported has an outline, even where edges alone, and no Hough transform, speak for it.
        boxed = cube.proposed[cell] > 0 or detection.label == "cube"
        ringed = sphere.proposed[cell] > 0 or detection.label == "sphere"
        corners = self._cubes.marks[cube.outlines[cell]].tolist() if boxed else []
        circle = self._spheres.marks[sphere.outlines[cell]].tolist() if ringed else None
        return Evidence(
            detection=detection,
            cube=float(cube.best[cell]),
            sphere=float(sphere.best[cell]),
            circles=tuple((x, y, r) for x, y, r in look.circles.tolist()),
            lines=tuple((a, b, c, d) for a, b, c, d in look.lines.tolist()),
            circle=None if circle is None else (*circle,),
            box=tuple((x, y) for x, y in corners),
        )

    def sketch(self, frame: Frame) -> Frame:
        """Return the frame, enlarged, with what was found drawn upon it."""
        return draw(frame, self.explain(frame))

    def _look(self, frame: Frame) -> _Look:
        given = self.settings
        clear = cleared(frame, given.smooth, given.stretch)
        found = gradients(clear)
        level = noise(found)
        noisy = given.noise * level
        round_, spheres = self._propose_spheres(clear, noisy)
        lines, cubes = self._propose_cubes(found, noisy)
        return _Look(
            cube=self._sight(found, self._cube_reader, cubes, noisy),
            sphere=self._sight(found, self._sphere_reader, spheres, noisy),
            noise=level,
            circles=round_,
            lines=lines,
        )

    def _propose_spheres(self, frame: Frame, noisy: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return Hough's circles, shape (n, 3), and which spheres one of them could be."""
        given, marks = self.settings, self._spheres.marks
        # Twice, for the search slows down steeply with the edge pixels that noise makes.
        gradient = given.circle_gradient + 2 * noisy
        found = circles(frame, self._windows, gradient=gradient, votes=given.circle_votes)
        near = agree(found, marks)
        return found[near.any(axis=1)], np.asarray(near.any(axis=0))

    def _propose_cubes(self, found: Gradients, noisy: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return Hough's upright lines, shape (n, 4), and which cubes have both sides covered by them."""
        given, marks = self.settings, self._cubes.marks
        gradient = given.line_gradient + noisy
        lines = upright_lines(found, gradient=gradient, votes=given.line_votes, gap=given.line_gap)
        covered = np.stack([cover(lines, marks[:, side]) for side in (LEFT_SIDE, RIGHT_SIDE)])
        chosen = np.minimum(covered.sum(axis=2), 1.0).min(axis=0) >= given.side_cover
        return lines[(covered > 0).any(axis=(0, 1))], chosen

    def _sight(
        self,
        found: Gradients,
        reader: OutlineReader,
        proposed: NDArray[np.bool_],
        noisy: float,
    ) -> _Sight:
        """Return the best evidence for one kind in each cell."""
        given = self.settings
        evidence = reader.evidence(found, steep=given.edge_gradient + noisy, alignment=given.alignment)
        # Outlines go by distance first, and there are as many at each.
        cells = evidence.reshape(REACH, -1)
        wanted = np.where(proposed.reshape(REACH, -1), cells, 0.0)
        top, most = cells.max(axis=1), wanted.max(axis=1)
        outline = np.where(most > 0, wanted.argmax(axis=1), cells.argmax(axis=1))
        return _Sight(top, most, np.arange(REACH) * cells.shape[1] + outline)


def cleared(frame: Frame, smooth: int, stretch: float) -> Frame:
    """Return a frame without specks, its contrast stretched.

    Parameters
    ----------
    frame
        Shape (rows, columns, 3).
    smooth
        Width of a median filter, in pixels; odd.
    stretch
        By how much at most the colours between the darkest and the lightest hundredth are drawn apart.

    Examples
    --------
    >>> frame = np.full((12, 12, 3), 100, np.uint8)
    >>> frame[:, 6:] = 130
    >>> frame[3, 3] = 255
    >>> cleared(frame, 3, 4.0)[3, [3, 9], 0].tolist()
    [0, 120]
    """
    calm = cv2.medianBlur(frame, smooth)
    darkest, lightest = np.percentile(calm[::3, ::3], (1, 99))
    gain = min(255 / max(lightest - darkest, 1.0), stretch)
    table = ((np.arange(256) - darkest) * gain).clip(0, 255).astype(np.uint8)
    drawn: Frame = cv2.LUT(calm, table).astype(np.uint8, copy=False)
    return drawn
