"""The paper's recogniser (section 6.1, figure 11): Sobel edges, Hough circles and Hough lines.

Hough transforms propose, edges dispose. A circle proposes the spheres, and a pair of upright lines the
cubes, that would look like it from where the robot stands (`perception.shapes`). A proposal is as good
as the share of its outline that lies on Sobel edges of the right direction; that share is the evidence.
Confidence is a softmax of the evidence for cube, for sphere and, a constant, for neither: it grows with the
evidence of what is reported and falls with that of its rivals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.edges import Gradients, OutlineReader, gradients, noise
from perception.proposals import circles, cover, upright_lines, window
from perception.protocol import REACH, Detection, Frame, Label, View
from perception.shapes import LEFT_SIDE, RIGHT_SIDE, Outlines, cube_outlines, sphere_outlines
from worlds.camera import Camera

Circle = tuple[float, float, float]
"""Column and row of the centre, and radius, in pixels."""
Line = tuple[float, float, float, float]
"""Column and row of one end, then of the other, in pixels."""


@dataclass(frozen=True)
class HoughSettings:
    """What the recogniser goes by. Gradients are Sobel's: four times a step in 0-255 colour.

    Parameters
    ----------
    smallest, largest, step
        Radii (half the edge for a cube) that are looked for, in metres.
    circle_gradient, circle_votes
        Canny's upper threshold, and the votes that a circle needs.
    line_gradient, line_votes, line_gap
        The gradient of an upright edge, the votes that a line needs, and the gap that it may have (pixels).
    side_cover
        Share of each of a cube's two sides that lines must cover for the cube to be proposed.
    edge_gradient, alignment
        The gradient that bears out a point of an outline in full, and the least cosine of its angle with
        the outline's normal.
    unproposed
        What the evidence of a shape that no Hough transform proposed is multiplied by: below `enough`, so
        that such a shape is never reported, but makes "none" less sure.
    noise
        How much of a frame's noise (its median gradient) is added to each of the three gradients above.
    enough
        Evidence at which "none" and an obstacle are equally likely.
    doubt
        How gradually confidence turns from one label to another, in units of evidence.
    """

    smallest: float = 0.09
    largest: float = 0.43
    step: float = 0.01
    circle_gradient: float = 40.0
    circle_votes: float = 12.0
    line_gradient: float = 30.0
    line_votes: int = 6
    line_gap: int = 3
    side_cover: float = 0.25
    edge_gradient: float = 40.0
    alignment: float = 0.9
    unproposed: float = 0.7
    noise: float = 1.5
    enough: float = 0.72
    doubt: float = 0.06


@dataclass(frozen=True)
class Evidence:
    """What the recogniser saw in a frame.

    Parameters
    ----------
    detection
        What it makes of it.
    cube, sphere
        Share of the best cube's and the best sphere's outline that edges bear out, in [0, 1]: at the
        nearest distance at which there is enough of it, or at any if there is not. Discounted if no
        lines or no circle propose the shape (`HoughSettings.unproposed`).
    circles, lines
        What the Hough transforms found and geometry let through: circles that a sphere at 1 or 2 cells
        could look like, and upright lines that could be a side of a cube there.
    circle
        The best sphere's outline, as a circle; None if no sphere was proposed.
    box
        The best cube's corners as (column, row): bottom left, bottom right, top right, back right, back
        left, top left; empty if no cube was proposed.
    """

    detection: Detection
    cube: float
    sphere: float
    circles: tuple[Circle, ...]
    lines: tuple[Line, ...]
    circle: Circle | None
    box: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class _Best:
    """The outline of one kind with the most evidence; its number is None if nothing proposed it."""

    evidence: float
    outline: int | None
    distance: int


class Hough:
    """Sobel and Hough as a backend.

    Parameters
    ----------
    camera
        The camera that takes the frames; its geometry says where obstacles can be.
    settings
        Thresholds. Defaults to ``HoughSettings()``.

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
    needs_frames = True

    def __init__(self, camera: Camera, settings: HoughSettings | None = None) -> None:
        self.camera = camera
        self.settings = HoughSettings() if settings is None else settings
        given = self.settings
        distances = np.arange(1, REACH + 1)
        radii = np.arange(given.smallest, given.largest + given.step / 2, given.step)
        self._spheres = sphere_outlines(camera, distances, radii)
        self._cubes = cube_outlines(camera, distances, radii)
        self._sphere_reader = OutlineReader(self._spheres, camera.pixels)
        self._cube_reader = OutlineReader(self._cubes, camera.pixels)
        self._windows = [window(self._spheres, d, camera.pixels) for d in distances.tolist()]

    def detect(self, views: Sequence[View]) -> list[Detection]:
        """Return one detection a view, in order.

        Raises
        ------
        ValueError
            If a view has no frame, or one of another size than the camera's.
        """
        return [self.explain(_frame(view)).detection for view in views]

    def explain(self, frame: Frame) -> Evidence:
        """Return what stands in the way in a frame, shape (pixels, pixels, 3), and why.

        Raises
        ------
        ValueError
            If the frame is of another size than the camera's, or not of bytes.
        """
        shape = (self.camera.pixels, self.camera.pixels, 3)
        if frame.shape != shape or frame.dtype != np.uint8:
            raise ValueError(f"the frame is {frame.dtype} {frame.shape}; the camera takes uint8 {shape}")
        found = gradients(frame)
        noisy = self.settings.noise * noise(found)
        round_, spheres = self._propose_spheres(frame, noisy)
        lines, cubes = self._propose_cubes(found, noisy)
        sphere_evidence = self._weigh(found, self._sphere_reader, spheres, noisy)
        cube_evidence = self._weigh(found, self._cube_reader, cubes, noisy)
        # Of two obstacles in a row, the nearer one is in the way, however well the other is seen.
        for distance in range(1, REACH + 1):
            sphere = _best(self._spheres, sphere_evidence, spheres, distance)
            cube = _best(self._cubes, cube_evidence, cubes, distance)
            if max(sphere.evidence, cube.evidence) > self.settings.enough:
                break
        else:
            sphere = _best(self._spheres, sphere_evidence, spheres)
            cube = _best(self._cubes, cube_evidence, cubes)
        corners = [] if cube.outline is None else self._cubes.marks[cube.outline].tolist()
        return Evidence(
            detection=self._judge(cube, sphere),
            cube=cube.evidence,
            sphere=sphere.evidence,
            circles=tuple((x, y, r) for x, y, r in round_.tolist()),
            lines=tuple((a, b, c, d) for a, b, c, d in lines.tolist()),
            circle=None if sphere.outline is None else (*self._spheres.marks[sphere.outline].tolist(),),
            box=tuple((x, y) for x, y in corners),
        )

    def sketch(self, frame: Frame) -> Frame:
        """Return the frame, enlarged, with what was found drawn upon it."""
        return draw(frame, self.explain(frame))

    def _propose_spheres(self, frame: Frame, noisy: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return Hough's circles, shape (n, 3), and which spheres one of them could be."""
        given, marks = self.settings, self._spheres.marks
        # Twice, for the search slows down steeply with the edge pixels that noise makes.
        gradient = given.circle_gradient + 2 * noisy
        found = circles(frame, self._windows, gradient=gradient, votes=given.circle_votes)
        near = _agree(found, marks)
        proposed = np.asarray(near.any(axis=0))
        return found[near.any(axis=1)], proposed

    def _propose_cubes(self, found: Gradients, noisy: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return Hough's upright lines, shape (n, 4), and which cubes have both sides covered by them."""
        given, marks = self.settings, self._cubes.marks
        gradient = given.line_gradient + noisy
        lines = upright_lines(found, gradient=gradient, votes=given.line_votes, gap=given.line_gap)
        covered = np.stack([cover(lines, marks[:, side]) for side in (LEFT_SIDE, RIGHT_SIDE)])
        chosen = np.minimum(covered.sum(axis=2), 1.0).min(axis=0) >= given.side_cover
        return lines[(covered > 0).any(axis=(0, 1))], chosen

    def _weigh(
        self, found: Gradients, reader: OutlineReader, proposed: NDArray[np.bool_], noisy: float
    ) -> NDArray[np.float64]:
        """Return the evidence for each outline, shape (outlines,)."""
        given = self.settings
        evidence = reader.evidence(found, steep=given.edge_gradient + noisy, alignment=given.alignment)
        return np.where(proposed, evidence, given.unproposed * evidence)

    def _judge(self, cube: _Best, sphere: _Best) -> Detection:
        """Weigh cube, sphere and nothing against each other (softmax of their evidence)."""
        given = self.settings
        choices: tuple[tuple[Label, float, int], ...] = (
            ("none", given.enough, 0),
            ("cube", cube.evidence, cube.distance),
            ("sphere", sphere.evidence, sphere.distance),
        )
        label, most, distance = max(choices, key=lambda choice: choice[1])
        total = sum(exp((evidence - most) / given.doubt) for _, evidence, _ in choices)
        return Detection(label, 1 / total, distance)


def draw(frame: Frame, evidence: Evidence, zoom: int = 3) -> Frame:
    """Return the frame, enlarged, with the evidence drawn on it, as in the paper's figure 11.

    Thick is the outline of the shape that was recognised: yellow for a sphere, magenta for a cube. Thin
    are the Hough circles that agree with the sphere, or the Hough lines along the cube's sides; where
    nothing is in the way, every circle and line that was looked into and refused.

    Returns
    -------
    Frame
        Shape (zoom * pixels, zoom * pixels, 3).
    """
    size = (frame.shape[1] * zoom, frame.shape[0] * zoom)
    picture = cv2.resize(frame, size, interpolation=cv2.INTER_NEAREST).astype(np.uint8)
    label = evidence.detection.label
    rings, lines = np.array(evidence.circles).reshape(-1, 3), np.array(evidence.lines).reshape(-1, 4)
    if label == "sphere":
        rings, lines = rings[_agree(rings, np.array([evidence.circle]))[:, 0]], lines[:0]
    elif label == "cube":
        sides = np.array(evidence.box)[[LEFT_SIDE, RIGHT_SIDE]]
        rings, lines = rings[:0], lines[(cover(lines, sides) > 0).any(axis=0)]
    for col, row, radius in rings.tolist():
        _draw_circle(picture, (col, row, radius), zoom, (120, 255, 120), 1)
    for x1, y1, x2, y2 in lines.tolist():
        cv2.line(picture, _pixel(x1, y1, zoom), _pixel(x2, y2, zoom), (255, 160, 40), 1, cv2.LINE_AA)
    if label == "sphere" and evidence.circle is not None:
        _draw_circle(picture, evidence.circle, zoom, (255, 230, 0), 2)
    if label == "cube":
        corners = np.array([_pixel(col, row, zoom) for col, row in evidence.box], dtype=np.int32)
        cv2.polylines(picture, [corners, corners[[2, 5]]], True, (255, 0, 255), 2, cv2.LINE_AA)
    return picture


def _frame(view: View) -> Frame:
    if view.frame is None:
        raise ValueError("the view has no frame; render one for backends whose needs_frames is True")
    return view.frame


def _best(
    outlines: Outlines,
    evidence: NDArray[np.float64],
    proposed: NDArray[np.bool_],
    distance: int | None = None,
) -> _Best:
    """Return the outline with the most evidence, at one distance or at any."""
    there = evidence if distance is None else np.where(outlines.distances == distance, evidence, -1.0)
    best = int(there.argmax())
    return _Best(float(there[best]), best if proposed[best] else None, int(outlines.distances[best]))


def _agree(found: NDArray[np.float64], expected: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which circles found could be which expected, shape (found, expected)."""
    off = np.abs(found[:, None] - expected).max(axis=2)
    near: NDArray[np.bool_] = off < 1.5 + 0.1 * expected[:, 2]  # pixels, and the more the larger it is
    return near


def _draw_circle(picture: Frame, circle: Circle, zoom: int, colour: tuple[int, int, int], width: int) -> None:
    col, row, radius = circle
    cv2.circle(picture, _pixel(col, row, zoom), round(radius * zoom), colour, width, cv2.LINE_AA)


def _pixel(col: float, row: float, zoom: int) -> tuple[int, int]:
    return round(col * zoom), round(row * zoom)
